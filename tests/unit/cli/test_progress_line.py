"""One line of progress on a terminal of any width."""

import os
import re
import subprocess
import sys
import textwrap

import pytest

from sand.cli.progress_line import ProgressLine
from tests.systems import needs_terminals

NUMBERS = ("1.2 us/s", "27 clusters", "S = 5.8", "drift 4e-04")
SCRIPT = """
    import math, sys, time
    from sand.cli import report
    for layout, total in (({layout!r}, 1.0), ("{{desc}} [{{elapsed}}{{postfix}}]", None)):
        with report.progress_bar(total, False, bar_format=layout) as bar:
            for k in range({updates}):
                time.sleep(0.25 if k < 2 else 0.02)
                bar.set_description_str(f"{{k}} of 40 collisions of two bodies", refresh=False)
                bar.set_postfix_str({numbers!r}, refresh=False)
                bar.update(0.02)
                bar.refresh()
                if k == {updates} // 2:
                    report.note("compiling the time steps (last time 20 s) …")
                if k == 3 and {width}:
                    import fcntl, struct, termios
                    fcntl.ioctl(sys.stderr.fileno(), termios.TIOCSWINSZ, struct.pack("HHHH", 24, {width}, 0, 0))
"""


def on_terminal(width, script):
    """What a script writes to a terminal of so many columns."""
    import fcntl
    import pty
    import struct
    import termios

    leader, follower = pty.openpty()
    fcntl.ioctl(follower, termios.TIOCSWINSZ, struct.pack("HHHH", 24, width, 0, 0))
    # the size of the terminal counts, not these variables
    environment = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "LINES")}
    words = [sys.executable, "-c", textwrap.dedent(script)]
    with subprocess.Popen(words, stdin=follower, stdout=follower, stderr=follower, env=environment) as process:
        os.close(follower)
        found = b""
        try:
            while piece := os.read(leader, 65536):
                found += piece
        except OSError:  # the terminal is closed
            pass
        os.close(leader)
    assert process.returncode == 0, found.decode()
    return found.decode()


def drawn(text):
    """The texts between two returns of the cursor, without control sequences."""
    return [re.sub(r"\x1b\[[0-9;]*[A-Za-z]", "", part) for part in re.split(r"[\r\n]+", text)]


@needs_terminals
@pytest.mark.slow
@pytest.mark.parametrize("width", [20, 40, 60, 80, 0])
def test_no_line_of_progress_reaches_the_last_column(width):
    """A terminal begins a new line when its last column is passed: every text of the line is shorter than the width.

    A terminal that does not tell its size, 0, counts as one of 80 columns.
    """
    from sand.cli.report import LAYOUT

    text = on_terminal(width, SCRIPT.format(layout=LAYOUT, numbers=", ".join(NUMBERS), updates=8, width=0))
    lines = [line for line in drawn(text) if line and "compiling" not in line]
    assert len(lines) >= 16 and max(map(len, lines)) < (width or 80), lines
    # the notes have lines of their own
    assert [line for line in drawn(text) if "compiling" in line] == 2 * [
        "sand: compiling the time steps (last time 20 s) …"
    ]
    assert text.count("\n") == 2, "progress itself begins no new line"


@needs_terminals
@pytest.mark.slow
def test_the_line_follows_the_width_of_the_window():
    """After the window has become narrower, from 80 to 40 columns, the next text fits into it."""
    from sand.cli.report import LAYOUT

    text = on_terminal(80, SCRIPT.format(layout=LAYOUT, numbers=", ".join(NUMBERS), updates=12, width=40))
    lines = [line for line in drawn(text) if line and "compiling" not in line]
    lengths = [len(line) for line in lines]
    changed = lengths.index(next(length for length in lengths if length < 40))
    # the second bar begins at the new width
    assert lengths[0] == 79 and changed > 0 and max(lengths[changed:]) < 40
    assert lines[-2].startswith("11 of 40") and not lines[-1].strip(), "the line is removed at its end"


@pytest.mark.parametrize("width", range(8, 120))
def test_the_numbers_that_fit_are_shown(width):
    """At any width: the first numbers and no part of one, if there is room; the text is shorter than the width."""
    layout = "{percentage:3.0f}%|{bar}| {desc} [{elapsed}<{remaining}{postfix}]"
    text = ProgressLine.format_meter(
        0.4, 1.0, 8.0, ncols=width, bar_format=layout, prefix="2 us", postfix=", ".join(NUMBERS)
    )
    assert len(text) < width
    shown = [number in text for number in NUMBERS]
    assert shown == sorted(shown, reverse=True), "the last ones are left out first"
    if width > 40:
        assert text.endswith("]") and text.startswith(" 40%|")
    assert all(shown) == (width > 5 + 3 + 2 + len("2 us [00:08<00:12") + sum(2 + len(n) for n in NUMBERS) + 1)
