"""Colour maps have uniform lightness steps, and the page uses those of the pictures."""

import numpy as np
import pytest

from sand.analysis.quantities import MODES
from sand.plotting.palettes import (
    DIVERGING,
    MATERIAL_COLOURS,
    MODE_COLOURS,
    SEQUENTIAL,
    WITHIN_LIMITS_COLOUR,
    colours,
    palettes,
)
from sand.plotting.panels import LOSS_CHANNELS, LOSS_COLOURS
from sand.plotting.style import ON_DARK, rgb


def lightness(shades):
    """L* of CIELAB of sRGB colours from 0 to 1 (IEC 61966-2-1, CIE 15)."""
    linear = np.where(shades <= 0.04045, shades / 12.92, ((shades + 0.055) / 1.055) ** 2.4)
    y = linear @ [0.2126729, 0.7151522, 0.0721750]
    return np.where(y > 216 / 24389, 116.0 * np.cbrt(y) - 16.0, 24389 / 27 * y)


def lab(linear):
    """L*, a*, b* of CIELAB of linear RGB (3,) of sRGB, for the white of the screen."""
    xyz = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
    x, y, z = np.cbrt(np.maximum(np.dot(xyz, linear) / np.sum(xyz, axis=1), 216 / 24389))
    return np.array([116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)])


SIGHTS = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
}
"""Linear RGB that an eye sees (Machado, Oliveira & Fernandes 2009, severity 1, from memory)."""


@pytest.mark.parametrize("sight", SIGHTS)
@pytest.mark.parametrize("dark", [False, True])
def test_the_loss_by_stiffness_has_a_colour_of_its_own(sight, dark):
    """The stiffness differs from damping, and from all other losses, by ΔE = |ΔL*a*b*| above 15.

    A difference of 2.3 is just seen on surfaces side by side; lines are thin and apart.
    """
    shown = {name: ON_DARK[c] if dark else c for name, c in zip(LOSS_CHANNELS, LOSS_COLOURS, strict=True)}
    seen = {}
    for name, colour in shown.items():
        shade = np.array(rgb(colour))
        linear = np.where(shade <= 0.04045, shade / 12.92, ((shade + 0.055) / 1.055) ** 2.4)
        seen[name] = lab(np.clip(np.dot(SIGHTS[sight], linear), 0.0, 1.0))
    for name in shown.keys() - {"stiffness"}:
        assert np.linalg.norm(seen[name] - seen["stiffness"]) > 15.0


def test_lightness_rises_evenly():
    """Linear in the map from dark to bright, to 0.5 of 57; the eye resolves about 1."""
    light = lightness(SEQUENTIAL(np.linspace(0.0, 1.0, 256))[:, :3])
    assert (np.diff(light) > 0.0).all()
    assert light == pytest.approx(np.linspace(light[0], light[-1], 256), rel=0.0, abs=0.5)
    assert light[-1] - light[0] > 50.0


def test_diverging_map_is_symmetric_in_lightness():
    """Equal lightness at equal distance from the middle, which is the lightest, to 3 of 57."""
    light = lightness(DIVERGING(np.linspace(0.0, 1.0, 257))[:, :3])
    assert light == pytest.approx(light[::-1], rel=0.0, abs=3.0)
    assert (np.diff(light[:128]) > 0.0).all() and light[128] - light[0] > 50.0


def test_the_page_has_the_pictures_colours():
    """The first map is "deep", 64 steps from end to end; colours of modes, materials, contacts within limits."""
    colour_maps = palettes()
    assert list(colour_maps) == ["deep", "cividis", "viridis", "diverging"]
    assert all(np.shape(steps) == (64, 3) for steps in colour_maps.values())
    for name, way in (("deep", SEQUENTIAL), ("diverging", DIVERGING)):
        ends = np.rint(255 * way(np.array([0.0, 1.0]))[:, :3])
        assert [colour_maps[name][0], colour_maps[name][-1]] == ends.tolist()
    named = colours()
    assert list(named) == ["big", "small", "single", "modes", "within", "materials", "rest"]
    assert named["modes"] == list(MODE_COLOURS) and len(MODE_COLOURS) == len(MODES) - 1
    assert (named["within"], named["materials"]) == (WITHIN_LIMITS_COLOUR, list(MATERIAL_COLOURS))
