"""Arrows on the screen point where the moments of the file point.

An arrow is a shaft with a head, round about its axis, four radii of its grain long, its middle at the grain's.  Seen
along −from its outline mirrors at the projected axis, which is therefore the long principal axis of its pixels.
"""

import numpy as np
import pytest

from .looking import SOURCES, View
from .test_seen_grains import BACKGROUND

LENGTH = 4.0
"""Of an arrow, in radii of its grain."""
ALONE = {"shade": 0, "bonds": "off", "box": 0, "size": 0.1, "isolate": 1, "ortho": 1}
"""One arrow only: a grain of a tenth of its size lies within the shaft."""


def axis_of(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middle (2,) of pixels (P, 2), and the direction (2,) of their long axis towards their thicker end, the head."""
    middle = points.mean(0)
    _, ways = np.linalg.eigh(np.cov((points - middle).T))
    way = ways[:, 1]
    along = (points - middle) @ way
    # the head is short and wide, so that the middle of all pixels is on its side of the middle between both ends
    return middle, way if along.max() + along.min() < 0.0 else -way


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("grain", [92, 93, 96])
def test_an_arrow_points_along_the_moment(page, shows, grain, source):
    """Direction and both ends, in three frames, seen from across.

    A pixel at the outline is off by half of one at most, so that the axis of an arrow L pixels long is off by less than
    the angle 1/(L/2) of a pixel at its end; tip and tail by a pixel and a half (one for the tip's last pixel, which is
    thinner than a pixel).
    """
    shown = shows("hundred")
    view = View(page, shown, source, grain=grain, look=(0, 0, 0, 0, -1, 0, 0, 0, 1, 10), **ALONE)
    for k in (0, 3, 5):
        frame = view.go(k)
        moment = np.asarray(frame.moment[grain], float)
        way = moment / np.linalg.norm(moment)
        across = np.cross(way, [0.3, -0.8, 0.5])
        place, length = view.positions[grain], LENGTH * view.radii[grain]
        eye = view.look(*place, *(across + 0.4 * way * np.linalg.norm(across)), *(0.2, 0.1, 0.97), 1.5 * length)
        rows, columns = np.nonzero(np.abs(view.image() - BACKGROUND).max(-1) > 30)
        points = np.stack([columns, rows], axis=1) + 0.5
        (tail, tip), _ = eye.pixels([place - 0.5 * length * way, place + 0.5 * length * way])
        seen = np.linalg.norm(tip - tail)
        _, found = axis_of(points)
        expected = (tip - tail) / seen
        assert found @ expected > 0.0, f"frame {k}: the arrow of grain {grain} points backwards"
        assert abs(np.cross([*found, 0.0], [*expected, 0.0])[2]) < 2.0 / seen, (k, found, expected)
        along = (points - tail) @ expected
        assert abs(along.max() - seen) < 2.0, (k, along.max(), seen)
        shaft = points[along < 0.5 * seen]
        off = (shaft - tail) @ [-expected[1], expected[0]]
        assert abs(off.max() + off.min()) < 2.0, (k, off.min(), off.max())


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("ortho", [0, 1])
def test_all_arrows_have_their_heads_in_front(page, shows, ortho, source):
    """Grains tiny, every arrow that no other crosses: dark beside the axis in the head, empty there in the shaft.

    The head is 0.087 of the length thick (half) a quarter in front of the middle, the shaft 0.042: at 0.065 beside the
    axis there is ink in front and none behind.  What has no moment (silica) has no arrow.
    """
    view = View(page, shows("hundred"), source, look=(0, 0, 0, 0.52, -0.74, 0.43, 0, 0, 1, 30), ortho=ortho, size=0.1,
                shade=0, bonds="off", box=0)  # fmt: skip
    for k in (0, 3, 5):
        frame, tried, none = view.go(k), 0, 0
        eye, dark = view.eye(), view.image().max(-1) < 160
        moment = np.asarray(frame.moment, float)
        size = np.linalg.norm(moment, axis=1)
        way = moment / np.where(size > 0.0, size, 1.0)[:, None]
        half = 0.5 * LENGTH * view.radii[:, None] * way
        tip, tail, middle = (eye.pixels(view.positions + s * half)[0] for s in (1.0, -1.0, 0.0))
        long, depth = np.linalg.norm(tip - tail, axis=1), eye.pixels(view.positions)[1]
        full = LENGTH * view.radii * eye.scale * (1.0 if ortho else 2.0 * eye.height / depth)
        for i in np.flatnonzero((middle > 60).all(1) & (middle < [eye.wide - 60, eye.high - 60]).all(1)):
            along = (tip[i] - tail[i]) / long[i] if size[i] > 0.0 else np.array([1.0, 0.0])
            beside = 0.065 * full[i] * np.array([-along[1], along[0]])
            for part, wanted in ((0.25, True), (-0.25, False)):
                spot = middle[i] + part * (tip[i] - tail[i]) + beside
                far = apart_from(spot, tail, tip) > 0.14 * full * (size > 0.0) + 0.12 * view.radii * eye.scale + 3.0
                if not np.delete(far, i).all() or 0.0 < long[i] < 0.6 * full[i]:
                    continue
                x, y = spot.astype(int)
                if size[i] == 0.0:
                    none += part > 0
                    assert not dark[y - 1 : y + 2, x - 1 : x + 2].any(), (k, i)
                else:
                    tried += part > 0
                    assert dark[y, x] == wanted, (k, i, part)
        assert tried >= 10 and none >= 5, (tried, none)


def apart_from(spot: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Distance (N,) of a pixel from lines from one place to another."""
    way = end - begin
    share = np.clip(((spot - begin) * way).sum(1) / np.maximum((way**2).sum(1), 1e-9), 0.0, 1.0)
    return np.linalg.norm(spot - begin - share[:, None] * way, axis=1)
