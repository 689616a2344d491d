"""The entry point of the `sand` command: deals with Ctrl-C from the first moment on, then loads the rest."""

from __future__ import annotations

import signal
import sys

TYPE_CHECKING = False  # typing takes as long to load as all the rest here
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any

INTERRUPTED = 130
"""Exit code after Ctrl-C; it stands here, too, because nothing else of ours may be loaded yet."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code.

    Parameters
    ----------
    argv : Sequence[str] or None, optional
        words after `sand`; those of the command line by default.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a terminal that cannot show µ or … gets something else instead
            stream.reconfigure(errors="replace")
    with _Interrupts(to_the_end=argv is None) as interrupts:
        try:
            from .program import run_command

            return run_command(words, lambda: interrupts.asked)
        except KeyboardInterrupt:
            pass
        except Exception:  # an import that is cut short fails in any way
            if not interrupts.asked:
                raise
        sys.stderr.write("sand: interrupted\n")
        return INTERRUPTED


class _Interrupts:
    """Ctrl-C raises KeyboardInterrupt in the block, and is remembered: what is being imported may swallow it.

    Parameters
    ----------
    to_the_end : bool
        the program ends with the block; Ctrl-C then ends it at once, without a word.
    """

    def __init__(self, to_the_end: bool):
        self.asked = False
        self._to_the_end = to_the_end
        self._before: Any = None
        self._hook = sys.unraisablehook

    def __enter__(self) -> _Interrupts:
        before = signal.getsignal(signal.SIGINT)
        if before not in (signal.SIG_IGN, None):  # a shell's `sand run … &` is not for Ctrl-C
            try:
                signal.signal(signal.SIGINT, self._raise)
            except ValueError:  # not in the main thread
                return self
            self._before = before
            sys.unraisablehook = self._lost
        return self

    def _raise(self, _number: int, _frame: Any) -> None:
        self.asked = True
        raise KeyboardInterrupt

    def _lost(self, unraisable: Any) -> None:
        if not isinstance(unraisable.exc_value, KeyboardInterrupt):
            self._hook(unraisable)

    def __exit__(self, *_: object) -> None:
        if self._before is None:
            return
        signal.signal(signal.SIGINT, signal.SIG_DFL if self._to_the_end else self._before)
        sys.unraisablehook = self._hook


if __name__ == "__main__":
    sys.exit(main())
