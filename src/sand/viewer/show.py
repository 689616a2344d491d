"""Display of run data by `view()`: a widget in a notebook, otherwise a page that is written and opened."""

from __future__ import annotations

import tempfile
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ..errors import BadInput
from ..io.page_bundle import read_bundle
from ..io.run_folder import VIEW
from ..plotting.run_figure import in_notebook
from .browser import open_page
from .dataset import RunDataset
from .html import frame_stride, write_page
from .notebook import has_widgets, widget

MAX_BYTES = 150e6
"""Size of frames in a page [bytes] above which `view()` leaves out frames."""


def show_dataset(dataset: RunDataset, path: str | Path | None, folder: Path | None, fallback: Callable[[], Any]) -> Any:
    """Show a dataset in a notebook or browser.

    Parameters
    ----------
    dataset : RunDataset
        Data of a run.
    path : str or Path or None
        Path of the page. None shows a widget in notebooks that have anywidget; elsewhere it means view.html in
        `folder`.
    folder : Path or None
        Run folder; None means a new temporary folder.
    fallback : callable
        Shows the figure of the run, if the viewer page is not installed.

    Returns
    -------
    GrainWidget or Path or Figure
        The widget, the path of the page, or the result of `fallback`.

    Raises
    ------
    BadInput, FilesFailed
        If the page cannot be written.
    """
    try:
        read_bundle()
    except BadInput as error:
        warnings.warn(f"{error}; showing the figure instead", stacklevel=4)
        return fallback()
    if path is None and in_notebook() and has_widgets():
        return widget(dataset)
    if path is None:
        path = (folder or Path(tempfile.mkdtemp(prefix="sand-"))) / VIEW
    page = Path(path)
    if not page.parent.is_dir():
        raise BadInput(f"there is no folder {page.parent}; create it first")
    dataset.compact = True
    if (stride := frame_stride(dataset, MAX_BYTES)) > 1:
        dataset.select(slice(None, None, stride), f"one frame of {stride}, to limit the size of the page")
    write_page(dataset, page)
    if not open_page(page.resolve().as_uri()):
        warnings.warn(f"wrote {page}, but no browser could be opened; open the file in a browser", stacklevel=4)
    return page
