"""`sand view DIR`: shows the grains of a run in the browser."""

from __future__ import annotations

import os
import shlex
import threading
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput
from ..config.folders import without_run
from ..io.run_folder import CASE, SUMMARY, TRAJECTORY, holds_sweep
from . import movie, options, parsing, report

WAIT = 60.0
"""Longest wall time [s] to wait for the first frame of a run, which may have to compile first."""
YOUNG = 5.0
"""Age [s] of a trajectory up to which its first frame may still be missing."""


@parsing.command(
    "view", short_help="Show the grains of a run in the browser, or write a page or a film.", check=movie.check
)
@click.argument("folder", metavar="DIR", type=options.RUN)
@click.option(
    "--html", "html", metavar="FILE", type=options.FILE, help="Write one self-contained page instead, to keep or send."
)
@movie.movie_options
@click.option("--every", metavar="K", type=options.WholeNumber(min=1), default=1, help="Only every K-th frame.")
@options.frames
@click.option(
    "--port", metavar="N", type=options.WholeNumber(0, 65535), default=0, help="Port (default: any free one)."
)
@click.option("--no-browser", is_flag=True, help="Print the address and open no browser.")
@click.option("--overwrite", is_flag=True, help="Replace FILE if it exists.")
@options.reading
@options.output
def command(
    folder: str,
    *,
    html: str | None,
    every: int,
    frames: slice,
    port: int,
    no_browser: bool,
    overwrite: bool,
    **how: Any,
) -> None:
    """Show the grains of the run in DIR in the browser.

    DIR may also be a trajectory, or a file of grains: XYZ, columns, LAMMPS data and dump, GSD.

    New frames of a running simulation appear as they are written; if there is none yet, the first one is waited for.
    The page can be opened on this machine only; Ctrl-C ends the server.

    A film shows all frames, or those of --frames and --every, in the view that contains all grains. For another one,
    set up the page, copy its address (key j) and give it to --settings.
    """
    from ..viewer.html import frame_slice, write_page

    of_film = {name: how.pop(name) for name in ("movie", *movie.OF_FILMS)}
    is_film = of_film["movie"] is not None
    target = Path(of_film["movie"]) if is_film else None if html is None else Path(html)
    if target is not None:
        _refuse_target(target, overwrite, of_film if is_film else None)
    selection = frame_slice(frames, every)
    silent, given = how["quiet"] or how["as_json"], {name: how.pop(name) for name in options.READING}
    dataset = _open_dataset(Path(folder), given, verbose=not silent)
    if selection != slice(None, None, 1):
        ends = ("" if k is None else str(k) for k in (frames.start, frames.stop, frames.step))
        chosen = ":".join(ends).removesuffix(":")
        parts = [f"frames {chosen} of the run"] * (chosen != ":") + [f"one frame of {every}"] * (every > 1)
        dataset.select(selection, ", ".join(parts))
    if target is None:
        _serve(dataset, folder, port, not no_browser, as_json=how["as_json"], silent=silent)
        return
    if is_film:
        written = movie.write_movie(dataset, target, of_film, silent)
        rows = [
            ("file", str(target)),
            ("frames", f"{written['frames']}, {written['fps']} per second"),
            ("size", f"{written['bytes'] / 1e6:.3g} MB"),
        ]
        rows += [("picture", "{} x {} pixels".format(*written["size"])), ("drawn by", written["renderer"])]
        report.answer(written, f"view {folder}", rows, **how)
        return
    with report.progress_bar(len(dataset), silent, desc=report.clean(target.name), unit="frame") as bar:
        size = write_page(dataset, target, progress=bar.update)
    megabytes = f"{size / 1e6:.3g} MB"
    rows = [("file", str(target)), ("frames", str(len(dataset))), ("size", megabytes)]
    report.answer({"file": str(target), "bytes": size}, f"view {folder}", rows, **how)
    if size > report.LARGE:
        fewer = max(int(every * size / report.LARGE) + 1, 2)
        report.note(f"note: a page of {megabytes} opens slowly; --every {fewer} would reduce it to about 100 MB")


def _open_dataset(path: Path, given: Mapping[str, Any], verbose: bool) -> Any:
    """Open a run as soon as it has a frame, or a file.  Raises BadInput if there is none within WAIT."""
    from ..io.file_frames import FileFrames
    from ..setup.from_file import is_own_trajectory
    from ..viewer.dataset import frames_dataset, run_dataset
    from ..viewer.external_field import read_field
    from ..viewer.run_files import find_run_folder

    if path.is_file() and find_run_folder(path) is None and not is_own_trajectory(path):
        return frames_dataset(path, FileFrames(path, **given))
    options.refuse_reading(path, given)
    begun, noted = time.monotonic(), not verbose
    while True:
        waited = time.monotonic() - begun
        if not (path / TRAJECTORY).exists() and (holds_sweep(path) or any(path.glob("seed-*"))):
            raise BadInput(without_run(path))
        try:
            folder = find_run_folder(path)
            return run_dataset(path, None if folder is None else read_field(folder))
        except BadInput as error:
            if not _is_beginning(path, seen_before=waited > 0.1):
                raise
            if waited > WAIT:
                raise BadInput(
                    f"{path} has no frame after {WAIT:.0f} s; check whether its run is still running or has failed"
                ) from error
        if not noted:
            report.note(f"no frame yet; waiting up to {WAIT:.0f} s for the run to write one")
            noted = True
        time.sleep(0.2)


def _is_beginning(path: Path, seen_before: bool) -> bool:
    """Whether a run may be about to write its first frame: its folder is empty, or has a case and no frame.

    Parameters
    ----------
    seen_before : bool
        Whether this was the case a moment ago; then a new trajectory without a frame is accepted, too.
    """
    if not path.is_dir() or (path / SUMMARY).exists():
        return False
    try:
        age = time.time() - (path / TRAJECTORY).stat().st_mtime
    except OSError:
        return (path / CASE).exists() or not any(path.iterdir())
    return seen_before and age < YOUNG


def _refuse_target(target: Path, overwrite: bool, of_film: Mapping[str, Any] | None) -> None:
    """Raise BadInput if the file exists, its folder does not, or a film of this kind cannot be written."""
    option, example = ("--html", "view.html") if of_film is None else ("--movie", "film.mp4")
    if target.is_dir():
        raise BadInput(f"{target} is a folder; give {option} the name of a file, such as {target / example}")
    if of_film is not None:
        from ..viewer.film import check_film

        check_film(target, of_film["size"] or movie.SIZE)
    elif target.suffix.lower() not in (".html", ".htm"):
        raise BadInput(f"--html {target}: the name of a page must end in .html or .htm, such as {target.stem}.html")
    if target.exists() and not overwrite:
        raise BadInput(f"{target} exists; give another {option}, or --overwrite")
    if not target.parent.is_dir():
        raise BadInput(f"there is no folder {target.parent}; make it first")


def _serve(dataset: Any, folder: str, port: int, browser: bool, *, as_json: bool, silent: bool) -> None:
    """Serve the page until Ctrl-C."""
    from ..viewer.browser import open_page, remove_redirects
    from ..viewer.server import Server

    server = Server(dataset, port)
    server.start()
    try:
        opened = browser and open_page(server.url)
        rows = [("address", server.url), ("frames", str(len(dataset)))]
        report.answer({"url": server.url}, f"view {shlex.quote(folder)}", rows, as_json=as_json)
        if not silent:
            if os.environ.get("SSH_CONNECTION"):
                tunnel = f"ssh -L {server.port}:127.0.0.1:{server.port} …"
                report.note(f"note: to open it on another machine, first run there: {tunnel}")
            report.note(f"{'' if opened else 'open the address in a browser; '}Ctrl-C ends the server")
        _wait()
    except KeyboardInterrupt:
        pass
    finally:
        server.stop()
        remove_redirects()
    if not silent:
        report.note("ended")


def _wait() -> None:
    """Wait for Ctrl-C."""
    while not threading.Event().wait(0.5):  # an unlimited wait cannot be interrupted on all systems
        pass
