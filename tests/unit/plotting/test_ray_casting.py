"""The first sphere or cone that each ray meets, against their equations."""

import dataclasses
import tracemalloc

import numpy as np
import pytest

from sand.plotting.render import ray_casting as trace
from sand.plotting.render.ray_casting import DepthBuffer, Solids
from sand.plotting.render.spheres import Rods, Spheres, render_spheres


@pytest.mark.parametrize("w", [0.0, 1 / 300.0])
def test_two_overlapping_spheres(w):
    """Every sample of two overlapping spheres shows the one that its ray meets first.

    Rays are the lines (X(1 − wz), Y(1 − wz), z).  Both quadratic equations are solved in double precision; samples with
    depths that differ by less than 0.01 (the depth has 24 bits of 300) are left out.
    """
    centre, radius = np.array([[-12.0, 3.0, 5.0], [14.0, -2.0, -9.0]]), np.array([40.0, 33.0])
    rods = np.zeros((0, 3)), np.zeros((0, 3)), np.zeros((0, 2))
    canvas = DepthBuffer((120, 160), Solids(centre, radius, *rods, np.eye(3)[:2], np.ones(2)), w)
    rows, columns = np.mgrid[:120, :160]
    x, y = columns + 0.5 - 80, rows + 0.5 - 60
    depth = np.full((2, 120, 160), -np.inf)
    for k in range(2):
        p, d = np.stack([x, y, 0.0 * x]) - centre[k][:, None, None], np.stack([-w * x, -w * y, 1.0 + 0.0 * x])
        a, b, c = (d * d).sum(axis=0), (p * d).sum(axis=0), (p * p).sum(axis=0) - radius[k] ** 2
        hits = b * b > a * c
        depth[k][hits] = (-b[hits] + np.sqrt(b[hits] ** 2 - a[hits] * c[hits])) / a[hits]
    hits = np.isfinite(depth).any(axis=0)
    with np.errstate(invalid="ignore"):
        clear = hits & ~(np.abs(depth[0] - depth[1]) < 0.01)
    r, c = np.nonzero(clear)
    assert clear.sum() > 5000 and ((canvas.nearest > 0) == hits).mean() > 0.9995
    r, c = np.nonzero(clear & (canvas.nearest > 0))
    which, point, normal = canvas.surface(r, c)
    np.testing.assert_array_equal(which, depth.argmax(axis=0)[r, c])
    np.testing.assert_allclose(point[:, 2], depth.max(axis=0)[r, c], atol=0.01)
    np.testing.assert_allclose(normal, (point - centre[which]) / radius[which, None], atol=1e-3)


@pytest.mark.parametrize("w", [0.0, 1 / 400.0])
def test_cones_and_cylinders(w):
    """Points on a cone and a cylinder fulfil their equations: the radius changes linearly between the ends.

    Tolerance 0.01 samples: the depth has 24 bits of about a hundred samples.
    """
    start, end = (
        np.array([[-60.0, -30.0, -20.0], [10.0, -20.0, 30.0]]),
        np.array([[40.0, 35.0, 25.0], [60.0, 40.0, -30]]),
    )
    end_radii = np.array([[14.0, 0.0], [6.0, 6.0]])
    spheres = np.zeros((0, 3)), np.zeros(0)
    canvas = DepthBuffer((140, 180), Solids(*spheres, start, end, end_radii, np.eye(3)[:2], np.ones(2)), w)
    which, point, normal = canvas.surface(*np.nonzero(canvas.nearest))
    for k in range(2):
        q, axis = point[which == k] - start[k], end[k] - start[k]
        along = q @ axis / (axis @ axis)
        away = np.linalg.norm(q - along[:, None] * axis, axis=1)
        caps = (np.abs(along) < 1e-3) | (np.abs(along - 1.0) < 1e-3)
        expected = end_radii[k, 0] + (end_radii[k, 1] - end_radii[k, 0]) * along
        assert len(q) > 300 and (along > -1e-3).all() and (along < 1.0 + 1e-3).all()
        np.testing.assert_allclose(away[~caps], expected[~caps], atol=0.01)
    facing = (normal * np.column_stack([-w * point[:, 0], -w * point[:, 1], np.ones(len(point))])).sum(axis=1)
    assert (facing > -0.1).all()  # no back faces are visible


@pytest.mark.validate
def test_chunks_bound_the_memory(monkeypatch):
    """Ten thousand grains in chunks of two sizes and in one: the same picture; only the last needs more memory.

    With chunks of MAX_SAMPLES the peak is that of the picture itself, as with chunks a twentieth of it; with one chunk
    it is twice as much.  The picture is densest in the middle.
    """
    rng = np.random.default_rng(5)
    grains = Spheres(
        rng.normal(size=(10_000, 3)), np.full(10_000, 0.03), np.full((10_000, 3), 0.5), np.zeros((10_000, 3))
    )
    peaks, pictures = [], []
    for most in (trace.MAX_SAMPLES, trace.MAX_SAMPLES // 20, 10**9):
        monkeypatch.setattr(trace, "MAX_SAMPLES", most)
        tracemalloc.start()
        pictures.append(render_spheres(grains, (-3.2, 3.2, -2.0, 2.0), 800, 500))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[0] < 1.1 * peaks[1] and peaks[2] > 1.5 * peaks[0]
    assert all((picture == pictures[0]).all() for picture in pictures)
    assert pictures[0][200:300, 350:450, 3].mean() > 0.95


@pytest.mark.slow
def test_a_sphere_larger_than_the_picture_is_drawn_in_tiles():
    """The sphere is drawn in tiles within the sample limit of one chunk."""
    one = Spheres(np.zeros((1, 3)), np.ones(1), np.full((1, 3), 0.5), np.zeros((1, 3)))
    assert (render_spheres(one, (-0.4, 0.4, -0.3, 0.3), 400, 300)[..., 3] == 1.0).all()


def test_rods_join():
    """Joined rods are all of them, in order."""
    one = Rods(np.zeros((1, 3)), np.ones((1, 3)), np.ones((1, 2)), np.ones((1, 3)), np.ones(1))
    both = Rods.joined(one, dataclasses.replace(one, shading=np.zeros(1)))
    np.testing.assert_array_equal(both.shading, [1.0, 0.0])
