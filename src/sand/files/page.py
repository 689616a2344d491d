"""The bundle of the page, and pages written as files."""

from __future__ import annotations

import contextlib
import os
from pathlib import Path
from types import TracebackType
from typing import Any

from ..core.errors import BadInput, FilesFailed

BUNDLE = Path(__file__).parents[1] / "view" / "page"
"""Where grainview's build puts grainview.js and grainview.css."""


def read_bundle() -> tuple[str, str]:
    """Script and sheet of styles of the page.

    Raises:
        BadInput: the package was built without them.
    """
    try:
        script, styles = ((BUNDLE / f"grainview.{end}").read_text(encoding="utf-8") for end in ("js", "css"))
    except OSError:
        raise BadInput(
            "this installation lacks the page (grainview.js): build it with 'npm ci && npm run build' in grainview/, "
            "or install a wheel"
        ) from None
    return script, styles


class Written:
    """A large text file written bit by bit: beside, and renamed when it is whole.

    Args:
        path: of the file; what is there is replaced, but only when the new one is whole.

    Raises:
        FilesFailed: it cannot be written; also later.
    """

    def __init__(self, path: str | Path):
        self.path, self.size = Path(path), 0
        self._beside = self.path.with_name(f".{self.path.name}.new")
        try:
            self._file: Any = open(self._beside, "wb")  # noqa: SIM115
        except OSError as error:
            raise self._failed(error) from error

    def _failed(self, error: OSError) -> FilesFailed:
        return FilesFailed(f"cannot write {self.path}: {error.strerror}; what was there is untouched")

    def write(self, text: str | bytes) -> None:
        """Raises FilesFailed."""
        part = text.encode() if isinstance(text, str) else text
        try:
            self._file.write(part)
        except OSError as error:
            raise self._failed(error) from error
        self.size += len(part)

    def __enter__(self) -> Written:
        return self

    def __exit__(self, kind: type[BaseException] | None, _: object, __: TracebackType | None) -> None:
        try:
            if kind is None:
                self._file.flush()
                os.fsync(self._file.fileno())
                self._file.close()
                os.replace(self._beside, self.path)
        except OSError as error:
            raise self._failed(error) from error
        finally:
            with contextlib.suppress(OSError):
                self._file.close()
            with contextlib.suppress(OSError):
                self._beside.unlink(missing_ok=True)
