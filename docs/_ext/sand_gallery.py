"""The gallery: sphinx-gallery runs the scripts of examples/gallery in the process of the build, which loads SAND once.

The scripts run in a copy of their folder, so that the files that they write are not in the checkout.
"""

from __future__ import annotations

import logging
import os
import shutil
import tempfile
import warnings
from pathlib import Path
from typing import Any

import matplotlib

SECTIONS = ("growth", "collisions", "aggregates", "mechanics")
"""Folders of examples/gallery, in the order of the page."""


def scraped(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the pictures of SAND that a block has made, by any name, and those of pyplot; returns their markup.

    Parameters
    ----------
    block, block_vars, gallery_conf
        As sphinx-gallery gives them.
    """
    from sphinx_gallery.scrapers import figure_rst, matplotlib_scraper

    from sand.plotting.run_figure import RunFigure

    names = block_vars["example_globals"]
    saved = names.setdefault("_saved_pictures", [])
    paths = []
    for picture in [value for value in names.values() if isinstance(value, RunFigure)]:
        if not any(picture is other for other in saved):
            saved.append(picture)
            paths.append(next(block_vars["image_path_iterator"]))
            picture.savefig(paths[-1])
    drawn = matplotlib_scraper(block, block_vars, gallery_conf, bbox_inches="tight", dpi=110)
    return str(drawn) + str(figure_rst(paths, gallery_conf["src_dir"]))


def quiet(gallery_conf: dict[str, Any], name: str) -> None:
    """Before each script: no window, no log of files, no warnings of limits, which are explained in words."""
    matplotlib.use("agg")
    logging.getLogger("gsd").setLevel(logging.WARNING)  # Sphinx shows what is logged
    for start in ("contacts of", "grains in contact vibrate", "grains overlap too deeply"):
        warnings.filterwarnings("ignore", message=start)


def configuration(docs: Path, examples: Path) -> dict[str, Any]:
    """The settings `sphinx_gallery_conf` of the folder of conf.py, for a folder of scripts."""
    place = Path(tempfile.mkdtemp(prefix="sand-gallery-")) / "gallery"
    shutil.copytree(examples, place)
    return {
        "examples_dirs": str(place),
        "gallery_dirs": "gallery",
        "filename_pattern": r"\.py",
        "subsection_order": [os.path.relpath(place / name, docs) for name in SECTIONS],
        "within_subsection_order": "FileNameSortKey",
        "image_scrapers": ("sand_gallery.scraped",),
        "reset_modules": ("matplotlib", "sand_gallery.quiet"),
        "run_stale_examples": True,  # as all pages, they show what this version does
        "capture_repr": (),
        "nested_sections": False,
        "min_reported_time": 0,
        "download_all_examples": False,
        "show_signature": False,
        "remove_config_comments": True,
        "write_computation_times": False,
    }
