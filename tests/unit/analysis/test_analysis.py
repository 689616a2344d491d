"""Shapes, contact networks, fractal dimensions and fits against exact shapes and brute force."""

import itertools
import math
from types import SimpleNamespace

import numpy as np
import pytest

from sand import BadInput
from sand.analysis.clusters import aggregate_moments, cluster_labels, percolating_clusters, unwrapped
from sand.analysis.fits import power_law, separation
from sand.analysis.fractal import box_dimension, correlation_dimension, ensemble_dimension, grains_within
from sand.analysis.frame_statistics import COLUMNS, aggregate_statistics, size_distribution
from sand.analysis.network import network
from sand.analysis.shape import (
    coordination,
    directions_of_view,
    elongation,
    filling_factor,
    gyration_radius,
    inertia_tensor,
    principal_lengths,
    projected_area,
)
from sand.basics.box import Box

ROD = np.column_stack([2.0 * np.arange(9) - 8.0, np.zeros(9), np.zeros(9)])
RNG = np.random.default_rng(5)


def test_gyration_of_exact_shapes():
    """Rod of n spheres 2a apart: r_g² = a²(n² − 1)/3, plus ⅗a² with extent; arbitrary masses by brute force.

    r_g² = Σ m_i m_j |x_i − x_j|²/2M²; both to rounding.
    """
    assert gyration_radius(ROD) == pytest.approx(math.sqrt((81 - 1) / 3), rel=1e-14, abs=0)
    assert gyration_radius(ROD, radius=1.0) ** 2 == pytest.approx(80 / 3 + 0.6, rel=1e-14, abs=0)
    points, mass = RNG.normal(size=(20, 3)), RNG.uniform(1, 3, 20)
    brute = sum(mass[i] * mass[j] * ((points[i] - points[j]) ** 2).sum() for i in range(20) for j in range(20))
    assert gyration_radius(points, mass) == pytest.approx(math.sqrt(brute / 2) / mass.sum(), rel=1e-13, abs=0)


def test_inertia_against_the_definition():
    """I = Σ m (x² 1 − x xᵀ) about the centre of mass + ⅖mr² each, also for one sphere."""
    points, mass, radius = RNG.normal(size=(7, 3)), RNG.uniform(1, 3, 7), RNG.uniform(0.1, 0.4, 7)
    x = points - np.average(points, axis=0, weights=mass)
    one = np.eye(3)
    each = zip(x, mass, radius, strict=True)
    brute = sum(m * (p @ p * one - np.outer(p, p)) + 0.4 * m * r * r * one for p, m, r in each)
    # with extent the tensor uses the mass average of r², which is the same sum
    assert inertia_tensor(points, mass, radius) == pytest.approx(brute, rel=1e-12, abs=1e-12)
    assert inertia_tensor(points[:1], mass[:1], radius[:1]) == pytest.approx(
        0.4 * mass[0] * radius[0] ** 2 * np.eye(3), rel=1e-6, abs=0.0
    )


def test_lengths_and_elongation():
    """A rotated rod: ratio of the axes √((80/3 + 1/5)/(1/5)); a sphere has 1; a disc has two equal lengths."""
    turn = np.linalg.qr(RNG.normal(size=(3, 3)))[0]
    assert principal_lengths(ROD @ turn) == pytest.approx([math.sqrt(80 / 3), 0, 0], abs=1e-7)
    assert elongation(ROD @ turn, None, 1.0) == pytest.approx(math.sqrt((80 / 3 + 0.2) / 0.2), rel=1e-12, abs=0)
    assert elongation(np.zeros((1, 3)), None, 1.0) == 1.0
    angle = 2 * np.pi * np.arange(12) / 12
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(12)])
    assert principal_lengths(ring) == pytest.approx([math.sqrt(0.5), math.sqrt(0.5), 0], abs=1e-12)


def test_filling_factor():
    """1 for a sphere; N a³/(5/3 r_g²)^(3/2) for a rod."""
    assert filling_factor(np.zeros((1, 3)), 2.0) == pytest.approx(1.0, rel=1e-14, abs=0)
    assert filling_factor(ROD, 1.0) == pytest.approx(9 / (5 / 3 * (80 / 3 + 0.6)) ** 1.5, rel=1e-13, abs=0)


@pytest.mark.compiled("small")
def test_projected_area_of_exact_shapes():
    """πa² of a sphere; two discs at distance d cover 2πa² − lens; distant ones add; a hidden one adds nothing."""
    assert projected_area(np.zeros((1, 3)), 1.0)[0] == pytest.approx(math.pi, rel=1e-14, abs=0)
    axis = np.array([[0.0, 0.0, 1.0]])
    for d in (0.3, 1.0, 1.9, 2.0, 5.0):
        lens = 2 * math.acos(d / 2) - 0.5 * d * math.sqrt(4 - d * d) if d < 2 else 0.0
        pair = np.array([[0.0, 0, 0], [d, 0, 7.0]])
        assert projected_area(pair, 1.0, axis)[0] == pytest.approx(2 * math.pi - lens, rel=1e-13, abs=0)
    nested = np.array([[0.0, 0, 0], [0.1, 0, 3.0], [0.0, 0.0, 5.0], [0, 0, 9.0]])
    assert projected_area(nested, np.array([1.0, 0.5, 1.0, 1.0]), axis)[0] == pytest.approx(math.pi, rel=1e-13, abs=0)


@pytest.mark.compiled("small")
def test_projected_area_against_monte_carlo():
    """300 discs of several sizes: 4e5 random points agree within four standard deviations, √(p(1−p)/n)."""
    points, radius = RNG.uniform(-5, 5, (300, 3)), RNG.uniform(0.1, 0.8, 300)
    area, _ = projected_area(points, radius, np.array([[0.0, 0.0, 1.0]]))
    random_points = RNG.uniform(-6, 6, (400_000, 2))
    hit = np.zeros(len(random_points), bool)
    for (x, y, _), r in zip(points, radius, strict=True):
        hit |= (random_points[:, 0] - x) ** 2 + (random_points[:, 1] - y) ** 2 < r * r
    share = hit.mean()
    assert abs(area / 144 - share) < 4 * math.sqrt(share * (1 - share) / len(random_points))


@pytest.mark.validate
def test_projected_area_of_a_long_rod():
    """Mean projection of a convex body is a quarter of its surface (Cauchy); spheres 0.02 apart are nearly a capsule.

    Capsule of length L, radius 1: (2πL + 4π)/4.  The gap between spheres is at most 0.02²/8 deep: 5e-5 of the area.
    1024 regular directions have an error of 3e-4 (1.8e-3 with 64, 1.5e-5 with 4096).
    """
    rod = np.column_stack([np.arange(0, 4.001, 0.02), np.zeros(201), np.zeros(201)])
    area, error = projected_area(rod, 1.0, 1024)
    assert area == pytest.approx((2 * math.pi * 4 + 4 * math.pi) / 4, rel=4e-4, abs=0)
    assert 0.0 < error < 0.1
    assert np.abs(directions_of_view(500).mean(axis=0)[:2]).max() < 0.01


def test_networks():
    """A chain, a ring, a cross and a ladder, by hand."""
    chain = network(6, np.array([[k, k + 1] for k in range(5)]))
    assert (chain.ends, chain.junctions, chain.rings, chain.longest) == (2, 0, 0, 6)
    assert chain.chains.tolist() == [6]
    assert chain.coordination == pytest.approx(10 / 6, rel=1e-6, abs=0.0)
    ring = network(6, np.array([[k, (k + 1) % 6] for k in range(6)]))
    assert (ring.ends, ring.junctions, ring.rings, ring.longest) == (0, 0, 1, 4)
    cross = network(7, np.array([[0, 1], [1, 2], [0, 3], [3, 4], [0, 5], [5, 6]]))
    assert (cross.ends, cross.junctions, cross.rings, cross.longest) == (3, 1, 0, 5)
    assert cross.chains.tolist() == [2, 2, 2]
    ladder = network(6, np.array([[0, 1], [1, 2], [3, 4], [4, 5], [0, 3], [1, 4], [2, 5]]))
    assert (ladder.rings, ladder.longest) == (2, 4)
    alone = network(1, np.zeros((0, 2), int))
    assert (alone.ends, alone.rings, alone.longest, alone.coordination) == (0, 0, 1, 0.0)


@pytest.mark.parametrize("seed", range(3))
def test_longest_shortest_path_of_trees(seed):
    """Against all shortest paths (Floyd and Warshall) in random trees of 30 grains."""
    rng = np.random.default_rng(seed)
    pairs = np.array([[rng.integers(k), k] for k in range(1, 30)])
    way = np.full((30, 30), 99)
    np.fill_diagonal(way, 0)
    way[pairs[:, 0], pairs[:, 1]] = way[pairs[:, 1], pairs[:, 0]] = 1
    for k in range(30):
        way = np.minimum(way, way[:, k, None] + way[k])
    assert network(30, pairs).longest == way.max() + 1
    assert coordination(30, pairs).sum() == 58


def sierpinski(depth):
    """Corners of a tetrahedral gasket: D = ln 4/ln 2 = 2."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]], float)
    points = np.zeros((1, 3))
    for level in range(depth):
        points = np.concatenate([points + 2.0**level * corner for corner in corners])
    return points


def dust(depth):
    """A Cantor dust of eight corners, thirds: D = ln 8/ln 3 = 1.893."""
    points = np.zeros((1, 3))
    for level in range(depth):
        points = np.concatenate([points + 2.0 * 3.0**level * np.array(c) for c in itertools.product((0, 1), repeat=3)])
    return points


EXACT = {
    "rod": (np.column_stack([np.arange(2000.0), np.zeros(2000), np.zeros(2000)]), 1.0),
    "disc": (np.array([[x, y, 0.0] for x in range(-30, 31) for y in range(-30, 31) if x * x + y * y < 900]), 2.0),
    "ball": (
        np.array(
            [
                [x, y, z]
                for x in range(-12, 13)
                for y in range(-12, 13)
                for z in range(-12, 13)
                if x * x + y * y + z * z < 144
            ],
            float,
        ),
        3.0,
    ),
    "gasket": (sierpinski(6), 2.0),
    "dust": (dust(4), math.log(8) / math.log(3)),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", list(EXACT))
def test_dimensions_of_exact_shapes(name):
    """Correlation integral within 0.06 (0.3 for a ball 24 grains across), box counting −0.5 … +0.05.

    Boxes at the surface are partly empty: a factor (1 + 1/n)^D for n boxes per side.  Within r of a grain the surface
    matters, too, for r up to 0.7 r_g in bodies this small.
    """
    points, exact = EXACT[name]
    by_pairs, by_boxes = correlation_dimension(points), box_dimension(points)
    assert by_pairs.value == pytest.approx(exact, abs=0.3 if name == "ball" else 0.06)
    assert exact - 0.5 < by_boxes.value < exact + 0.05
    assert 0.0 <= by_pairs.error < 0.5 and 0.0 < by_boxes.error < 0.5


@pytest.mark.validate
def test_dimensions_converge_with_size():
    """A gasket of 16384 corners against one of 1024, both methods."""
    for method in (correlation_dimension, box_dimension):
        near, far = (abs(method(sierpinski(depth)).value - 2.0) for depth in (7, 5))
        assert near < far + 0.02, method.__name__


def test_pair_counts_against_brute_force():
    """The tree counts the same pairs as brute force."""
    points, radii = RNG.normal(size=(300, 3)), np.array([0.3, 1.0])
    apart = np.linalg.norm(points[:50, None] - points[None], axis=2)
    brute = [(apart <= r).sum() / 50 for r in radii]
    assert grains_within(points[:50], points, radii) == pytest.approx(brute, rel=1e-12, abs=0.0)


def test_ensemble_dimension():
    """Exact N = k (r_g/a)^D is recovered to rounding, small clusters are excluded; errors cover noise."""
    sizes = np.array([2, 5, 10, 20, 50, 100.0])
    exact = ensemble_dimension(sizes, 3.0 * (sizes / 1.4) ** (1 / 1.8), 3.0)
    assert (exact.value, exact.prefactor) == (
        pytest.approx(1.8, rel=1e-12, abs=0.0),
        pytest.approx(1.4, rel=1e-12, abs=0.0),
    )
    assert exact.window == (5.0, 100.0)
    many = np.repeat(sizes, 50)
    noisy = ensemble_dimension(many, (many / 1.4) ** (1 / 1.8) * np.exp(0.1 * RNG.normal(size=many.size)), 1.0)
    assert abs(noisy.value - 1.8) < 4 * noisy.error < 0.1


def test_power_laws():
    """Exact data are recovered to rounding; for noisy data the error is that of least squares, σ/√Σ(u−ū)².

    The latter within 20 %.
    """
    x = np.geomspace(1, 100, 400)
    exact = power_law(x, 3.0 * x**0.63)
    assert (exact.exponent, exact.prefactor) == (
        pytest.approx(0.63, rel=1e-12, abs=0.0),
        pytest.approx(3.0, rel=1e-12, abs=0.0),
    )
    assert exact.error < 1e-12
    fit = power_law(x, x**0.63 * np.exp(0.3 * RNG.normal(size=400)))
    expected = 0.3 / math.sqrt(((np.log(x) - np.log(x).mean()) ** 2).sum())
    assert fit.error == pytest.approx(expected, rel=0.2, abs=0.0)
    assert fit.low < fit.exponent < fit.high
    assert abs(fit.exponent - 0.63) < 4 * expected


def test_errors_depend_on_boxes_not_on_points():
    """Eight boxes sampled a hundred times more often have the same error to a tenth.

    It is that of the mean of eight slopes, s/√8, with Student's interval.
    """
    slopes = 0.6 + 0.1 * RNG.normal(size=8)
    errors = []
    for points in (4, 400):
        x = np.tile(np.geomspace(1, 50, points), 8)
        group = np.repeat(np.arange(8), points)
        errors.append(power_law(x, x ** slopes[group], group).error)
    assert errors[0] == pytest.approx(errors[1], rel=0.1, abs=0.0)
    assert errors[0] == pytest.approx(slopes.std(ddof=1) / math.sqrt(8), rel=0.02, abs=0.0)
    fit = power_law(x, x ** slopes[group], group)
    assert fit.high - fit.exponent == pytest.approx(2.3646 * fit.error, rel=1e-3, abs=0.0)
    assert np.isnan(power_law(np.array([1.0, 2]), np.array([1.0, 2]), np.zeros(2)).error)


def test_separation():
    """Welch by hand: means 3 and 1, variances 1 and 0.25 of 4 boxes each."""
    first, second = np.array([2.0, 4, 3, 3]), np.array([1.0, 1, 0.5, 1.5])
    expected = 2.0 / math.sqrt(first.var(ddof=1) / 4 + second.var(ddof=1) / 4)
    assert separation(first, second) == pytest.approx(expected, rel=1e-14, abs=0.0)
    assert separation(np.ones(3), np.ones(3)) == 0.0
    with pytest.raises(BadInput, match="two boxes"):
        separation(np.ones(1), first)


def test_moments():
    """Vector sums and alignment by hand; without moments the alignment is 0."""
    moment = np.array([[1.0, 0, 0], [0, 1, 0], [0, 0, 2], [0, 0, -2]])
    sums, aligned = aggregate_moments(moment, np.array([0, 0, 1, 1]))
    assert sums.tolist() == [[1, 1, 0], [0, 0, 0]]
    assert aligned == pytest.approx([math.sqrt(0.5), 0], rel=1e-6, abs=0.0)
    assert aggregate_moments(0 * moment, np.zeros(4, int))[1].tolist() == [0.0]


def test_cluster_table_across_periodic_faces():
    """A straight chain of four across a face, a pair and a single grain: unwrapped, the largest first."""
    frame = SimpleNamespace(
        position=np.array(
            [[4.0, 0, 0], [-4.0, 0, 0], [-2.0, 0, 0], [2.0, 0, 0], [0, 3, 3], [0, 3, 5 - 1e-9], [0, -4, 0]]
        ),
        radius=np.ones(7),
        mass=np.full(7, 2.0),
        moment=np.tile([1.0, 0, 0], (7, 1)),
        pair=np.array([[3, 0], [0, 1], [1, 2], [5, 4]]),
        box=Box.periodic(10.0),
    )
    rows = aggregate_statistics(frame)
    assert list(rows) == list(COLUMNS)
    assert rows["grains"].tolist() == [4, 2]
    assert rows["mass"].tolist() == [8, 4]
    assert rows["gyration_radius"] == pytest.approx([math.sqrt(15 / 3), 1.0], rel=1e-6, abs=0.0)
    assert rows["moment"].tolist() == [4, 2]
    # as `COLUMNS` says: N a³/((5/3)^(3/2) r_g³), r_g² = 15/3 + 3/5 and 1 + 3/5 with the extent of the grains
    assert "(5/3)^(1/2) r_g, r_g with the extent of grains" in COLUMNS["filling_factor"][1]
    filled = [n / (5 / 3 * (square + 3 / 5)) ** 1.5 for n, square in ((4, 5.0), (2, 1.0))]
    assert rows["filling_factor"] == pytest.approx(filled, rel=1e-6, abs=0.0)
    assert rows["longest"].tolist() == [4, 2]
    assert rows["rings"].tolist() == [0, 0]
    assert size_distribution(np.array([0, 0, 0, 0, 1, 1, 2]))[0].tolist() == [1, 2, 4]
    assert aggregate_statistics(frame, least=5)["grains"].size == 0


def percolates_in_a_supercell(position, pairs, lengths, copies=9):
    """Whether each grain is connected with another copy of itself in an open supercell of copies in x and y."""
    count, tiles = len(position), list(itertools.product(range(copies), repeat=2))
    number = {tile: k for k, tile in enumerate(tiles)}
    shift = np.rint((position[pairs[:, 1]] - position[pairs[:, 0]]) / lengths).astype(int)
    ends = []
    for (i, j), (x, y) in zip(pairs, shift, strict=True):  # j is nearest to i in the tile that lies by −shift
        for a, b in tiles:
            if (a - x, b - y) in number:
                ends.append((number[a, b] * count + i, number[a - x, b - y] * count + j))
    labels = cluster_labels(count * len(tiles), np.array(ends).reshape(-1, 2)).reshape(len(tiles), count)
    middle = labels[number[copies // 2, copies // 2]]
    return (labels == middle).sum(axis=0) > 1


def test_percolating_clusters_are_those_of_a_supercell():
    """A cluster percolates if, in many copies of the box side by side, a grain is connected with a copy of itself."""
    rng, seen = np.random.default_rng(7), []
    lengths = np.array([10.0, 7.0])
    box = Box.periodic(10.0, 7.0, None)
    for _ in range(60):
        position = np.column_stack([rng.uniform(-0.5, 0.5, (12, 2)) * lengths, np.zeros(12)])
        pairs = box.close_pairs(position, rng.uniform(1.5, 3.4))
        found = percolating_clusters(position, pairs, box)[cluster_labels(12, pairs)]
        assert found.tolist() == percolates_in_a_supercell(position[:, :2], pairs, lengths).tolist()
        seen.append(found.any())
    assert 10 < sum(seen) < 50


def test_size_of_percolating_clusters_is_refused():
    """A rod through the box is marked and has no radius of gyration; one grain less, or an open box, and it has."""
    rod = np.column_stack([np.arange(-4.0, 5.0, 2.0), np.zeros(5), np.zeros(5)])
    closed = np.array([[0, 1], [1, 2], [2, 3], [3, 4], [4, 0]])

    def rows(pairs, box):
        more = {"radius": np.ones(5), "mass": np.ones(5), "moment": np.zeros((5, 3))}
        return aggregate_statistics(SimpleNamespace(position=rod, pair=pairs, box=box, **more))

    found = rows(closed, Box.periodic(10.0))
    assert found["percolating"].tolist() == [1]
    assert all(np.isnan(found[name]).all() for name in ("gyration_radius", "elongation", "filling_factor"))
    for one in (rows(closed[:4], Box.periodic(10.0)), rows(closed[:4], Box.open())):
        assert one["percolating"].tolist() == [0]
        # r_g² of 5 points 2 apart: 4 (5² − 1)/12
        assert one["gyration_radius"] == pytest.approx([math.sqrt(8.0)], rel=1e-12, abs=0.0)
    assert unwrapped(rod, closed, Box.periodic(10.0)).shape == (5, 3)  # for pictures
    with pytest.raises(BadInput, match=r"cluster of grain .* touches its own periodic image"):
        unwrapped(rod, closed, Box.periodic(10.0), refuse_percolating=True)
    with pytest.raises(BadInput, match="1 of the aggregates percolate"):
        ensemble_dimension([8, 30, 90], [1.0, 2.0, np.nan], 1.0)
