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


def lightness(shades):
    """L* of CIELAB of sRGB colours from 0 to 1 (IEC 61966-2-1, CIE 15)."""
    linear = np.where(shades <= 0.04045, shades / 12.92, ((shades + 0.055) / 1.055) ** 2.4)
    y = linear @ [0.2126729, 0.7151522, 0.0721750]
    return np.where(y > 216 / 24389, 116.0 * np.cbrt(y) - 16.0, 24389 / 27 * y)


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
