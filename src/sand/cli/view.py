"""`sand view DIR`: a page on which the grains of a run move."""

from __future__ import annotations

import os
import shlex
import threading
import time
from pathlib import Path
from typing import Any

import click

from ..errors import BadInput
from ..io.run_folder import CASE, SUMMARY, TRAJECTORY
from . import options, report
from .exits import DONE
from .export import chosen

LARGE = 100e6
"""Bytes above which a page takes long to open."""
WAIT = 60.0
"""Seconds that the first frame of a run is waited for, which may have to be compiled first."""
TOLD_EVERY = 15.0
YOUNG = 5.0
"""Seconds within which a trajectory gets its first frame."""


@click.command("view", short_help="Look at the grains of a run in the browser.")
@click.argument("folder", metavar="DIR", type=options.PLACE)
@click.option(
    "--html",
    "html",
    metavar="FILE",
    type=options.PLACE,
    help="Write one page with everything in it instead, to keep or send.",
)
@click.option("--every", metavar="K", type=click.IntRange(min=1), default=1, help="Every K-th frame only.")
@click.option("--frames", metavar="SLICE", default=":", help="Which frames, as in Python: '-1', '10:', '::5'.")
@click.option("--port", metavar="N", type=click.IntRange(0, 65535), default=0, help="Listen there (default: any free).")
@click.option("--no-browser", is_flag=True, help="Print the address and open nothing.")
@click.option("--overwrite", is_flag=True, help="Replace FILE if it is there.")
@options.as_json
@options.quiet
@options.debug
def command(
    folder: str,
    html: str | None,
    every: int,
    frames: str,
    port: int,
    no_browser: bool,
    overwrite: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Look at the grains of the run in DIR, or of a trajectory of SAND, in the browser.

    A run that is still going is followed; one that is still being compiled is waited for. The page is for this machine
    alone; Ctrl-C ends it.
    """
    from ..viewer.html import frame_slice, write_page

    target = None if html is None else Path(html)
    if target is not None:
        _refuse(target, overwrite)
    picked = frame_slice(chosen(frames), every)
    story = _story(Path(folder), talk=not (quiet or as_json))
    if picked != slice(None, None, 1):
        told = [f"frames {frames} of the run"] * (frames != ":") + [f"one frame of {every}"] * (every > 1)
        story.select(picked, ", ".join(told))
    if target is None:
        return _serve(story, folder, port, not no_browser, as_json, quiet)
    size = write_page(story, target, progress=None if quiet or as_json else _Bar(target))
    if as_json:
        report.emit({"file": str(target), "bytes": size})
    elif not quiet:
        report.show(f"view {folder}", [("file", str(target)), ("frames", str(len(story))), ("size", _spoken(size))])
    if size > LARGE:
        fewer = max(int(every * size / LARGE) + 1, 2)
        report.note(f"note: {_spoken(size)} take long to open; --every {fewer} would make it about 100 MB")
    return DONE


def _story(place: Path, talk: bool) -> Any:
    """Of the run in a folder, as soon as it has a frame.  Raises BadInput: there is none, or not within WAIT."""
    from ..viewer.dataset import run_dataset
    from ..viewer.run_files import find_run_folder
    from ..viewer.simulation_view import read_field

    begun = time.monotonic()
    told = -TOLD_EVERY
    while True:
        waited = time.monotonic() - begun
        try:
            home = find_run_folder(place)
            return run_dataset(place, None if home is None else read_field(home))
        except BadInput as error:
            if not _is_beginning(place, watched=waited > 0.1):
                raise
            if waited > WAIT:
                raise BadInput(
                    f"{place} has no frame after {WAIT:.0f} s; see whether its run is still going, or has failed"
                ) from error
        if talk and waited - told >= TOLD_EVERY:
            so_far = f" ({waited:.0f} s so far)" if told >= 0.0 else ""
            report.note(f"no frame yet; waiting up to {WAIT:.0f} s for the run to write one{so_far}")
            told = waited
        time.sleep(0.2)


def _is_beginning(place: Path, watched: bool) -> bool:
    """Whether a run may be about to write its first frame: its folder is empty, or holds a case and no frames.

    Parameters
    ----------
    watched : bool
        it was so a moment ago; its trajectory then may be there, but without a frame.
    """
    if not place.is_dir() or (place / SUMMARY).exists():
        return False
    try:
        age = time.time() - (place / TRAJECTORY).stat().st_mtime
    except OSError:
        return (place / CASE).exists() or not any(place.iterdir())
    return watched and age < YOUNG


def _refuse(target: Path, overwrite: bool) -> None:
    """Raises BadInput for a file that is there, or a folder that is not."""
    if target.is_dir():
        raise BadInput(f"{target} is a folder; give --html the name of a file, such as {target / 'view.html'}")
    if target.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"--html {target}: the name of a page must end in .html or .htm, such as {target.stem}.html")
    if target.exists() and not overwrite:
        raise BadInput(f"{target} exists; give another --html, or --overwrite")
    if not target.parent.is_dir():
        raise BadInput(f"there is no folder {target.parent}; make it first")


def _spoken(size: int) -> str:
    return f"{size / 1e6:.3g} MB"


class _Bar:
    """How far the file is, on stderr, where somebody sees it."""

    def __init__(self, target: Path):
        self.target = target
        self._bar: Any = None

    def __call__(self, done: int, count: int) -> None:
        from tqdm import tqdm

        if self._bar is None:
            self._bar = tqdm(total=count, desc=report.clean(self.target.name), unit="frame", disable=None, leave=False)
        self._bar.update(done - self._bar.n)
        if done == count:
            self._bar.close()


def _serve(story: Any, folder: str, port: int, browser: bool, as_json: bool, quiet: bool) -> int:
    """Until Ctrl-C."""
    from ..viewer.browser import open_page, remove_redirects
    from ..viewer.server import Server

    server = Server(story, port)
    server.start()
    try:
        opened = browser and open_page(server.url)
        if as_json:
            report.emit({"url": server.url})
        else:
            report.show(f"view {shlex.quote(folder)}", [("address", server.url), ("frames", str(len(story)))])
        if not quiet and not as_json:
            if os.environ.get("SSH_CONNECTION"):
                tunnel = f"ssh -L {server.port}:127.0.0.1:{server.port} …"
                report.note(f"note: from another machine, first type there: {tunnel}")
            report.note(f"{'' if opened else 'open the address in a browser; '}Ctrl-C ends it")
        _wait()
    except KeyboardInterrupt:
        pass
    finally:
        server.stop()
        remove_redirects()
    if not quiet and not as_json:
        report.note("ended")
    return DONE


def _wait() -> None:
    """Until Ctrl-C."""
    while not threading.Event().wait(0.5):  # a longer wait cannot be interrupted everywhere
        pass
