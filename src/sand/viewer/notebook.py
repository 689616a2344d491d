"""The page of a run in a notebook: an anywidget that asks the kernel for frames."""

from __future__ import annotations

import importlib.util
from typing import Any

from ..errors import BadInput
from ..io.page_bundle import read_bundle
from ..io.run_folder import plain
from .dataset import RunDataset


def has_widgets() -> bool:
    """Whether anywidget is installed."""
    return importlib.util.find_spec("anywidget") is not None


def widget(story: RunDataset) -> Any:
    """A widget that shows a story.

    Raises
    ------
    BadInput
        anywidget is not installed, or the page is missing.
    """
    if not has_widgets():
        raise BadInput("a page in a notebook needs anywidget: pip install anywidget")
    return _kind(*read_bundle())(story)


def _kind(script: str, styles: str) -> Any:
    """The class, made when it is first wanted: anywidget is imported nowhere else."""
    import anywidget

    class GrainWidget(anywidget.AnyWidget):
        """Grains of a run that move.

        Parameters
        ----------
        story : Story
            of the run.

        The page sends what it asks for, such as {"kind": "frame", "k": 3}, and gets the same back with the answer, or
        with `error`, a sentence; packets come as the first buffer.
        """

        _esm, _css = script, styles

        def __init__(self, story: RunDataset):
            super().__init__()
            self._story = story
            self.on_msg(self._asked)

        def _asked(self, _: Any, content: Any, buffers: Any) -> None:
            """Answer a message."""
            self.send(*answered(self._story, content))

    return GrainWidget


def answered(story: RunDataset, content: Any) -> tuple[dict[str, Any], list[bytes]]:
    """The answer to a message, and its buffers; see grainview/README.md."""
    asked = content if isinstance(content, dict) else {}
    kind = asked.get("kind")
    echo = {key: asked[key] for key in ("kind", "k", "grain", "since", "id") if key in asked}
    try:
        if kind == "grains":
            return echo, [story.grains()]
        if kind == "series":
            return echo | {"series": plain(story.series())}, []
        if kind == "manifest":
            story.refresh()
            return echo | {"manifest": plain(story.manifest(_number(asked, "since")))}, []
        if kind == "frame":
            return echo, [story.frame(_number(asked, "k"))]
        if kind == "dimension":
            return echo | plain(story.dimension(_number(asked, "k"), _number(asked, "grain"))), []
        raise BadInput(f"kind = {kind!r}; allowed: manifest, series, grains, frame, dimension")
    except BadInput as error:
        return echo | {"error": str(error)}, []
    except Exception as error:  # the page waits for an answer, whatever it is
        return echo | {"error": f"internal error ({type(error).__name__}: {error})"}, []


def _number(asked: dict[str, Any], key: str) -> int:
    """A count from the page.  Raises BadInput."""
    value = asked.get(key, 0 if key == "since" else None)
    if isinstance(value, bool) or not isinstance(value, int) or value < 0:
        raise BadInput(f"{key} = {value!r} must be a whole number of at least 0")
    return value
