"""Stills as outlines, and percolating packings: what is drawn where, and in which order."""

import io
import re

import numpy as np
import pytest

import sand
from sand.plotting.render.scene import make_scene
from sand.plotting.render.still import still_picture
from sand.plotting.render.vector import Outlines
from sand.plotting.run_figure import figure_bytes

from ..synthetic_frames import frame_of

L = 1e-6


@pytest.mark.parametrize("eye", [None, 4.0])
def test_the_order_of_spheres(eye):
    """Of two disjoint spheres that a line of sight meets, that which it meets first has the larger key: brute force.

    Lines from the eye, or along z, through random points; where a line meets both, the entry points are compared.
    """
    random = np.random.default_rng(7)
    outlines, compared = Outlines(np.zeros(2), eye), 0
    for _ in range(9000):
        centre, radius = random.uniform(-1.0, 1.0, (2, 3)), random.uniform(0.05, 0.9, 2)
        if np.linalg.norm(centre[0] - centre[1]) < radius.sum():
            continue
        aim = centre[0] + random.normal(0.0, 0.4, 3)
        start = np.array([aim[0], aim[1], 9.0]) if eye is None else np.array([0.0, 0.0, eye])
        along = np.array([0.0, 0.0, -1.0]) if eye is None else (aim - start) / np.linalg.norm(aim - start)
        to = centre - start
        inside = (to @ along) ** 2 - (to**2).sum(axis=1) + radius**2
        if (inside <= 0.0).any():
            continue
        entry = to @ along - np.sqrt(inside)
        key = outlines.order_of(centre, radius)
        assert (key[0] > key[1]) == (entry[0] < entry[1])
        compared += 1
    assert compared > 100


@pytest.mark.slow
def test_outlines_fill_what_the_image_fills():
    """The same grains, box and window: dark or coloured pixels of both pictures agree but for 1 % of all, the edges."""
    frame = frame_of([[0, 0, 0], [1.9e-8, 0, 0], [1e-8, 3e-8, 1e-8]], [(0, 1)], moment=np.eye(3) * 1e-18)
    how = {"size": (400, 300), "colour": "radius"}
    for perspective in (False, True):
        pictures = [still_picture(frame, **how, vector=vector, perspective=perspective) for vector in (False, True)]
        assert pictures[0].window == pictures[1].window
        filled = [np.asarray(one.image().convert("L"), float)[40:280, 10:330] < 250 for one in pictures]
        assert (filled[0] != filled[1]).mean() < 0.01
        assert filled[0].mean() > 0.1


def test_a_vector_file_has_no_image():
    """PDF and SVG of outlines hold no pixels; each grain has six discs in the SVG; equal pictures give equal bytes."""
    frame = frame_of([[0, 0, 0], [3e-8, 0, 0]])
    pictures = [still_picture(frame, vector=True, arrows=False, size=(300, 200)) for _ in range(2)]
    svg, again = (figure_bytes(one, "svg") for one in pictures)
    assert svg == again and b"<image" not in svg
    group = re.search(rb'<g id="grains">(.*?)</g>', svg, re.S)[1]
    assert group.count(b"<path") + group.count(b"<use") >= 12
    assert b"/Subtype /Image" not in figure_bytes(pictures[0], "pdf")
    assert b"<image" in figure_bytes(still_picture(frame, size=(300, 200)), "svg")


@pytest.mark.compiled("fields")
def test_the_command_writes_outlines(run_in_field, tmp_path):
    """`sand plot --format pdf` has stills without pixels."""
    from sand.cli.main import main

    assert (
        main(["plot", str(run_in_field), "--what", "still", "--format", "pdf", "--out", str(tmp_path / "there")]) == 0
    )
    assert b"/Subtype /Image" not in (tmp_path / "there" / "still.pdf").read_bytes()


def test_a_percolating_cluster_is_drawn_inside_the_box():
    """A chain that touches its own image stays in the box; another cluster across a face is made whole.

    Chain of ten grains along x at distances L/10; a pair across the face y = L/2.
    """
    x = (np.arange(10) + 0.5) / 10 * L - L / 2
    pair = [[0.0, 0.49 * L, 0.3 * L], [0.0, -0.45 * L, 0.3 * L]]
    position = np.array([[one, 0.48 * L, 0.0] for one in x] + pair)
    pairs = np.array([(k, (k + 1) % 10) for k in range(10)] + [(10, 11)])
    box = sand.Box.periodic("1 um")
    frame = frame_of(position, pairs, radius=[0.05 * L] * 10 + [0.03 * L] * 2, box=box)
    drawn = make_scene(frame, frame.pair, box).position
    np.testing.assert_allclose(drawn[:10], position[:10], atol=1e-12 * L)
    assert abs(drawn[10, 1] - drawn[11, 1]) == pytest.approx(0.06 * L, rel=1e-9, abs=0.0)
    assert io.BytesIO(figure_bytes(still_picture(frame, vector=True, size=(300, 200)))).getbuffer().nbytes > 1000
