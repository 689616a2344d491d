"""`view()` of a simulation, and of a run that was opened: a widget in a notebook, a page elsewhere."""

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
from .html import fitting, write_page
from .notebook import has_widgets, widget

LARGEST = 150e6
"""Bytes of frames in a page that nobody asked to be larger."""


def show_dataset(story: RunDataset, path: str | Path | None, folder: Path | None, instead: Callable[[], Any]) -> Any:
    """The widget in a notebook with anywidget, unless a `path` is given; else the page, written and opened.

    Parameters
    ----------
    path : str or Path or None
        of the page; view.html in the `folder` of the run by default, or in a new temporary folder.
    instead : Callable[[], Any]
        shows the figure, where this installation lacks the page.

    Returns
    -------
    result
        The widget, or the path of the page, or the figure.

    Raises
    ------
    BadInput, FilesFailed
        the page cannot be written.
    """
    try:
        read_bundle()
    except BadInput as error:
        warnings.warn(f"{error}; here is the figure instead", stacklevel=4)
        return instead()
    if path is None and in_notebook() and has_widgets():
        return widget(story)
    if path is None:
        path = (folder or Path(tempfile.mkdtemp(prefix="sand-"))) / VIEW
    page = Path(path)
    if not page.parent.is_dir():
        raise BadInput(f"there is no folder {page.parent}; make it first")
    story.compact = True
    if (every := fitting(story, LARGEST)) > 1:
        story.choose(slice(None, None, every), f"one frame of {every}, because all of them would take too much room")
    write_page(story, page)
    if not open_page(page.resolve().as_uri()):
        warnings.warn(f"wrote {page}: open it in a browser; none could be opened from here", stacklevel=4)
    return page
