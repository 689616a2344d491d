"""Entry point of the `sand` command: handles Ctrl-C from the beginning, then imports the rest."""

from __future__ import annotations

import signal
import sys

from .exits import BAD_INPUT, DONE, INTERRUPTED
from .interrupts import Interrupts
from .streams import keep_working_without_streams, lost

TYPE_CHECKING = False  # typing takes as long to load as all the rest here
if TYPE_CHECKING:
    from collections.abc import Sequence


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command.

    Parameters
    ----------
    argv : Sequence[str] or None, optional
        Arguments after `sand`; those of the command line by default.

    Returns
    -------
    int
        The exit code.
    """
    words = list(sys.argv[1:] if argv is None else argv)
    outputs = keep_working_without_streams() if argv is None else []
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # replace characters that the terminal cannot show, such as µ and …
            stream.reconfigure(errors="replace")
    # at the end of the program further Ctrl-C end it silently
    with Interrupts((signal.SIGINT,), after=signal.SIG_DFL if argv is None else None) as interrupts:
        try:
            from .program import run_command

            code = run_command(words, lambda: interrupts.received)
            if problem := lost(outputs):
                sys.stderr.write(f"sand: cannot write to standard output: {problem}\n")
                return code if code != DONE else BAD_INPUT
            return code
        except KeyboardInterrupt:
            pass
        except Exception:  # an interrupted import can raise anything
            if not interrupts.received:
                raise
        sys.stderr.write("sand: interrupted\n")
        return INTERRUPTED


if __name__ == "__main__":
    sys.exit(main())
