"""HTML of the viewer page: as served by `sand view`, and as a single file with all data."""

from __future__ import annotations

import base64
import gzip
import hashlib
import html
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..analysis.fractal import FEWEST
from ..basics.errors import BadInput
from ..basics.paths import user_path
from ..io.page_bundle import read_bundle
from ..io.run_folder import replacing
from .dataset import RunDataset
from .dimensions import Dimensions
from .packets import compact_json

BASE_POLICY = "default-src 'none'; base-uri 'none'; form-action 'none'; img-src data: blob:; media-src blob:; "
"""Content security policy of both pages: nothing is loaded from or sent to other sites."""
SERVED_POLICY = BASE_POLICY + "script-src 'self'; style-src 'self'; connect-src 'self'; frame-ancestors 'none'"
GZIP_LEVEL = 6
"""Higher levels take longer and hardly reduce the size of packets."""
DIMENSION_COST = 5e7
"""Limit of Σ N^(3/2) over the frames whose fractal dimensions are stored in a single file (about 20 s)."""

NO_SCRIPT = "The viewer needs JavaScript; please allow this page to run its script."
LOADING = "Reading the frames … If this message stays, the file is incomplete; write it again."
"""Shown until the script at the end of the file runs."""


def served_page(name: str) -> str:
    """HTML of the page of a run with this name, as served by `server.Server`."""
    styles = '<link rel="stylesheet" href="grainview.css">\n'
    return _head(name, styles) + '<script type="module" src="grainview.js"></script>\n' + _FOOT


def _head(name: str, styles: str, content: str = "") -> str:
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        '<meta name="referrer" content="no-referrer">\n'
        f'<link rel="icon" href="data:,">\n<title>{html.escape(name)} – SAND</title>\n{styles}</head>\n<body>\n'
        f'<div id="grainview">{content}</div>\n<noscript>{NO_SCRIPT}</noscript>\n'
    )


_FOOT = "</body>\n</html>\n"


def write_page(dataset: RunDataset, path: str | Path, *, progress: Callable[[], None] | None = None) -> int:
    """Write a single-file page with all selected frames of a dataset, in half precision.

    Frames are read, packed and written one by one.

    Parameters
    ----------
    dataset : RunDataset
        Data of the run; its `compact` is set.
    path : str or Path
        Path of the HTML file; an existing file is replaced.
    progress : callable, optional
        Called after each frame.

    Returns
    -------
    int
        Size of the file [bytes].

    Raises
    ------
    BadInput
        If the viewer page is not installed, or a frame is damaged.
    FilesFailed
        If the file cannot be written.
    """
    script, styles = read_bundle()
    script = _escape_script(f"\n{script}\n")
    script_hash = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    policy = f"{BASE_POLICY}script-src 'sha256-{script_hash}'; style-src 'unsafe-inline'"
    styles = re.sub("</(?=style)", r"<\\/", styles, flags=re.IGNORECASE)
    head = f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n<style>\n{styles}\n</style>\n'
    dataset.compact = True
    count, dimensions, stride = len(dataset), [], _dimension_stride(dataset)
    largest_clusters = Dimensions()
    with replacing(user_path(path)) as file:
        file.write(_head(dataset.name, head, f"<p>{LOADING}</p>").encode())
        file.write(_packet_element("sand-grains", dataset.grains()))
        for k in range(count):
            frame, names = dataset.read(k)
            file.write(_packet_element(f"sand-frame-{k}", dataset.packet(k, frame, names)))
            dimensions.append(largest_clusters.of(frame, names) if k % stride == 0 else {})
            if progress:
                progress()
        manifest = dataset.manifest() | {"running": False, "dimensions": dimensions}
        if stride > 1 and any(dimensions):
            note = f"fractal dimensions of one frame of {stride}"
            manifest["note"] = "; ".join(filter(None, (manifest["note"], note)))
        file.write(_json_element("sand-manifest", manifest).encode())
        file.write(_json_element("sand-series", dataset.series()).encode())
        file.write(f'<script type="module">{script}</script>\n{_FOOT}'.encode())
        return file.tell()


def _dimension_stride(dataset: RunDataset) -> int:
    """Every how many frames fractal dimensions are computed."""
    if dataset.grains_count < FEWEST:
        return len(dataset) + 1
    return max(math.ceil(dataset.grains_count**1.5 * len(dataset) / DIMENSION_COST), 1)


def _packet_element(key: str, packet: bytes) -> bytes:
    """Script element with a compressed packet; without a time stamp, so that equal packets give equal bytes."""
    text = base64.b64encode(gzip.compress(packet, GZIP_LEVEL, mtime=0))
    return b'<script type="application/octet-stream" id="%s">%s</script>\n' % (key.encode(), text)


def _json_element(key: str, content: dict[str, Any]) -> str:
    """Script element with JSON, in which `<` is escaped so that no text can end the element."""
    text = compact_json(content).replace("<", "\\u003c")
    return f'<script type="application/json" id="{key}">{text}</script>\n'


def _escape_script(script: str) -> str:
    """Script with `</script` and `<!--` in string literals escaped, so that they cannot end its element."""
    lines = script.replace("\r\n", "\n").replace("\r", "\n")  # as browsers do before they hash the script
    return re.sub("<(?=/script|!--)", r"\\x3c", lines, flags=re.IGNORECASE)


def frame_stride(dataset: RunDataset, most: float) -> int:
    """Smallest stride with which the selected frames take at most `most` bytes."""
    return max(-(-dataset.size // int(most)), 1)


def frame_slice(frames: slice, every: int) -> slice:
    """Every `every`-th frame of a slice.

    Raises
    ------
    BadInput
        If the step of the slice is less than 1.
    """
    if frames.step is not None and frames.step < 1:
        raise BadInput(f"frames with step {frames.step}: the viewer plays frames forwards; give a step of at least 1")
    return slice(frames.start, frames.stop, (frames.step or 1) * every)
