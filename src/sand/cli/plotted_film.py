"""Pictures of the frames of a film by the renderer of `sand plot`, without a browser."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qsl

import numpy as np

from ..basics.errors import BadInput, did_you_mean
from ..plotting.render.scene import camera_rotation, make_scene, view_window
from ..plotting.render.still import still_picture

if TYPE_CHECKING:
    from PIL import Image

    from ..viewer.dataset import RunDataset

SAMPLED = 9
"""Frames from which the window of all pictures is found."""
TEXTS = {
    "colour": None,
    "bonds": ("off", "plain", "load", "mode"),
    "arrows": ("0", "1"),
    "whole": ("0", "1"),
    "theme": ("light", "dark"),
}
"""Settings of the page that figures have, too, with their values; None: any quantity."""


@contextmanager
def plotted_pictures(
    dataset: RunDataset, size: tuple[int, int], settings: str = ""
) -> Iterator[Callable[[int], Image.Image]]:
    """The block gets a function that draws the k-th selected frame as `sand plot` does, without a browser.

    Parameters
    ----------
    dataset : RunDataset
        Data of the run.
    size : tuple of int
        Width and height [pixels].
    settings : str, optional
        Settings of the page that figures have, too, see TEXTS.

    Raises
    ------
    BadInput
        For other settings, or if a frame is damaged.
    """
    options = _still_options(settings)
    window = _window_of_all(dataset, size, options["whole"])

    def picture(k: int) -> Image.Image:
        frame = dataset.read(k)[0]
        still = still_picture(frame, size=size, field=dataset.flux_density(frame.time), window=window, **options)
        return still.image().convert("RGB")

    yield picture


def _still_options(settings: str) -> dict[str, Any]:
    """Options of `still_picture`.  Raises BadInput for settings that it does not have."""
    given = dict(parse_qsl(settings, keep_blank_values=True))
    problems = []
    for name, value in given.items():
        allowed = TEXTS.get(name, ())
        if name not in TEXTS:
            problems.append(
                f"--settings {name}: without the page there is no such setting; {did_you_mean(name, tuple(TEXTS))}"
            )
        elif allowed is not None and value not in allowed:
            problems.append(f"--settings {name}={value}: {did_you_mean(value, allowed)}")
    if problems:
        raise BadInput(problems)
    bonds = given.get("bonds", "plain")
    return {
        "colour": given.get("colour", "cluster"),
        "bonds": bonds if bonds in ("load", "mode") else None,
        "arrows": given.get("arrows", "1") == "1",
        "whole": given.get("whole", "1") == "1",
        "dark": given.get("theme", "light") == "dark",
    }


def _window_of_all(dataset: RunDataset, size: tuple[int, int], whole: bool) -> tuple[float, float, float, float]:
    """Left, right, bottom and top [m] around grains and box of frames sampled from all."""
    windows = []
    for k in np.unique(np.linspace(0, len(dataset) - 1, SAMPLED).round().astype(int)).tolist():
        frame = dataset.read(k)[0]
        scene = make_scene(frame, frame.pair, frame.box, whole)
        windows.append(view_window(scene, size[0] / size[1], 0.0, camera_rotation()))
    left, right, bottom, top = np.array(windows).T
    return float(left.min()), float(right.max()), float(bottom.min()), float(top.max())
