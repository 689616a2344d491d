"""Options of `sand view --movie FILE`, and the writing of the film."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput
from . import options, report

RATE, SIZE = 20, (1280, 720)
"""Frames per second and pixels without options."""
LEAST, MOST = 200, 4096
"""Pixels that a film may be wide or high."""
OF_FILMS = ("fps", "size", "settings", "renderer")
"""Options that only films have."""


def _size(_context: click.Context, _option: click.Parameter, text: str | None) -> tuple[int, int] | None:
    """Read '1280x720', or '1280' for a film 16:9.  Raises BadInput."""
    if text is None:
        return None
    parts = text.lower().replace("×", "x").split("x")
    try:
        numbers = [int(part) for part in parts]
        width, height = numbers if len(numbers) == 2 else (numbers[0], 2 * round(numbers[0] * 9 / 32))
        if len(numbers) > 2 or not all(LEAST <= length <= MOST for length in (width, height)):
            raise ValueError
    except ValueError:
        raise BadInput(
            f"--size {text!r} must be width x height in pixels, such as 1280x720, or a width; "
            f"each from {LEAST} to {MOST}"
        ) from None
    return width, height


def movie_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """The options --movie, --fps, --size, --settings and --renderer."""
    added = (
        click.option(
            "--movie",
            metavar="FILE",
            type=options.FILE,
            help="Write a film instead: FILE.mp4, FILE.webm (both need ffmpeg) or FILE.gif.",
        ),
        click.option(
            "--fps", metavar="N", type=options.WholeNumber(1, 60), help=f"Frames per second of a film (default {RATE})."
        ),
        click.option(
            "--size", metavar="WxH", callback=_size, help="Size of a film in pixels, or its width (default 1280x720)."
        ),
        click.option(
            "--settings",
            metavar="TEXT",
            help="Settings of the page for a film, as after # in its address: 'colour=speed&theme=dark'.",
        ),
        click.option(
            "--renderer",
            type=click.Choice(["page", "plot"]),
            help="What draws a film: the page in a browser without a window (default, if there is one), or sand plot.",
        ),
    )
    for option in reversed(added):
        command = option(command)
    return command


def check(values: Mapping[str, Any]) -> Iterator[str]:
    """Errors of the values of options together."""
    if values["movie"] is None:
        yield from (f"--{name} is for a film: add --movie FILE" for name in OF_FILMS if values[name] is not None)
    elif values["html"] is not None:
        yield "--html and --movie are two results: give one of them"


def write_movie(dataset: Any, target: Path, given: Mapping[str, Any], silent: bool) -> dict[str, Any]:
    """Write the film; returns what the command answers.

    Raises
    ------
    BadInput
        If it cannot be written; before a frame is drawn where that is possible.
    """
    from ..viewer.film import write_film
    from ..viewer.headless import page_pictures, why_no_page
    from .plotted_film import plotted_pictures

    size, rate = given["size"] or SIZE, given["fps"] or RATE
    renderer, settings = given["renderer"], given["settings"] or ""
    settings = settings.rpartition("#")[2]  # of a whole address, what follows #
    reason = None if renderer == "plot" else why_no_page()
    if renderer == "page" and reason:
        raise BadInput(f"--renderer page: {reason}; --renderer plot needs no browser")
    if reason:
        report.note(f"note: sand plot draws the frames, because {reason}")
    by_page = renderer == "page" or (renderer is None and not reason)
    count = len(dataset)  # a run that goes on may write more
    with (
        (page_pictures if by_page else plotted_pictures)(dataset, size, settings) as picture,
        report.progress_bar(count, silent, desc=report.clean(target.name), unit="frame") as bar,
    ):

        def drawn() -> Iterator[Any]:
            for k in range(count):
                yield picture(k)
                bar.update()

        length = write_film(target, drawn(), size, rate)
    return {
        "file": str(target),
        "bytes": length,
        "frames": count,
        "size": list(size),
        "fps": rate,
        "renderer": "page" if by_page else "plot",
    }
