"""The page of a run: as the server hands it out, and as one file that needs nothing else."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..analysis.fractal import FEWEST
from ..errors import BadInput
from ..io.page_bundle import Written, read_bundle
from ..io.run_folder import plain
from .dataset import RunDataset
from .dimensions import Dimensions

CLOSED = "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data: blob:; media-src blob:; "
"""What neither page may do: load anything from elsewhere, or send anything anywhere."""
SERVED = CLOSED + "script-src 'self'; style-src 'self'; connect-src 'self'; frame-ancestors 'none'"
"""The policy of the page that the server hands out."""
LEVEL = 6
"""Of gzip; a higher one takes longer, and packets of moving grains hardly get smaller."""
MEASURED = 5e7
"""Grains to the power 3/2, all frames together, whose clusters' dimensions are worked out for a file: some 20 s."""

NO_SCRIPT = "This page draws moving grains; please allow it to run its script."

NOT_WHOLE = "Reading the frames … If this stays, the file is not whole: ask for it again."
"""What a file says until its script, which is at its end, has run."""


def served(title: str) -> str:
    """The page of the server."""
    return _page(
        title,
        '<link rel="stylesheet" href="grainview.css">\n',
        '<script type="module" src="grainview.js"></script>\n',
    )


def _page(title: str, head: str, body: str) -> str:
    return _top(title, head) + body + _BOTTOM


def _top(title: str, head: str, within: str = "") -> str:
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="referrer" content="no-referrer">\n'
        f'<link rel="icon" href="data:,">\n<title>{html.escape(title)}</title>\n{head}</head>\n<body>\n'
        f'<div id="grainview">{within}</div>\n<noscript>{NO_SCRIPT}</noscript>\n'
    )


_BOTTOM = "</body>\n</html>\n"


def write_page(
    story: RunDataset, path: str | Path, *, progress: Callable[[int, int], None] | None = None, bundle: Any = None
) -> int:
    """One file with all frames of a story, which becomes a `compact` one; returns its bytes.

    Frames are read, packed and written one by one.

    Parameters
    ----------
    path : str or Path
        of the file, .html; replaced if it is there.
    progress : Callable[[int, int], None] or None, optional
        told how many frames of how many are written.
    bundle : optional
        script and sheet of styles, of the package by default.

    Raises
    ------
    BadInput
        the bundle is missing; a frame is not whole.
    FilesFailed
        the file cannot be written.
    """
    script, styles = bundle or read_bundle()
    script = _harmless(f"\n{script}\n")
    allowed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = f"{CLOSED}script-src 'sha256-{allowed}'; style-src 'unsafe-inline'"
    styles = re.sub("</(?=style)", r"<\\/", styles, flags=re.IGNORECASE)
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<style>\n{styles}\n</style>\n'
    story.compact = True
    count, dimensions, measured = len(story), [], _measured(story)
    measure = Dimensions()
    with Written(path) as file:
        file.write(_top(_title(story), head, f"<p>{NOT_WHOLE}</p>"))
        file.write(_block("sand-grains", story.grains()))
        for k in range(count):
            frame, names = story.read(k)
            file.write(_block(f"sand-frame-{k}", story.packed(k, frame, names)))
            dimensions.append(measure.of(frame, names) if k % measured == 0 else {})
            if progress:
                progress(k + 1, count)
        manifest = story.manifest() | {"running": False, "dimensions": dimensions}
        if measured > 1 and any(dimensions):
            said = f"fractal dimensions of one frame of {measured}"
            manifest["note"] = "; ".join(filter(None, (manifest["note"], said)))
        file.write(_json("sand-manifest", manifest))
        file.write(_json("sand-series", story.series()))
        file.write(f'<script type="module">{script}</script>\n{_BOTTOM}')
    return file.size


def _title(story: RunDataset) -> str:
    return f"{story.name} – SAND"


def _measured(story: RunDataset) -> int:
    """Dimensions are worked out for every such frame."""
    if story.grains_count < FEWEST:
        return len(story) + 1
    return max(math.ceil(story.grains_count**1.5 * len(story) / MEASURED), 1)


def _block(key: str, packet: bytes) -> bytes:
    """A packet, zipped; the same bytes whenever it is written."""
    text = base64.b64encode(gzip.compress(packet, LEVEL, mtime=0))
    return b'<script type="application/octet-stream" id="%s">%s</script>\n' % (key.encode(), text)


def _json(key: str, content: dict[str, Any]) -> str:
    """JSON that cannot end its element."""
    text = json.dumps(plain(content), allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return f'<script type="application/json" id="{key}">{text}</script>\n'


def _harmless(script: str) -> str:
    """A script that cannot end its element: what would is inside text there, and is written in another way."""
    lines = script.replace("\r\n", "\n").replace("\r", "\n")  # as a browser reads it, before it takes the hash
    return re.sub("<(?=/script|!--)", r"\\x3c", lines, flags=re.IGNORECASE)


def fitting(story: RunDataset, most: float) -> int:
    """Every which frame is to be told so that all of them take at most so many bytes."""
    return max(-(-story.size // int(most)), 1)


def frame_slice(frames: slice, every: int) -> slice:
    """Every so many of a slice.  Raises BadInput for less than 1, and for a slice that goes backwards."""
    if every < 1:
        raise BadInput(f"every = {every} must be a whole number of at least 1")
    if frames.step is not None and frames.step < 1:
        raise BadInput(f"frames in steps of {frames.step}: the page tells them in order; give a step of at least 1")
    return slice(frames.start, frames.stop, (frames.step or 1) * every)
