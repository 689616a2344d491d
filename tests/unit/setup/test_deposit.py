"""Random ballistic deposits: heights and densities by brute force, contacts, floor, errors."""

import math

import numpy as np
import pytest

import sand
from sand.setup import deposit

pytestmark = pytest.mark.compiled("small")

R, WIDTH = 1e-7, 1.3e-6
IMAGES = WIDTH * np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0], indexing="ij"), -1).reshape(-1, 2)
REST = 2.0 * R - sand.theory.contact("silica", R).rest_overlap
"""Distance of two grains in equilibrium."""
ON_FLOOR = R - sand.theory.contact("silica", 2.0 * R).rest_overlap
"""Height of a grain at rest on a floor, R = r: the rest overlap is that of two grains of twice the radius."""


def cake(grains=300, **changes):
    """A deposit in a narrow column."""
    return deposit(grains, **({"width": WIDTH, "radius": R, "material": "silica", "seed": 4} | changes))


def height_of_fall(x, before):
    """Height at which a grain that falls at x (2,) stops: all images of all grains before it, one by one."""
    if not len(before):
        return ON_FLOOR
    away = ((before[:, None, :2] + IMAGES - x) ** 2).sum(axis=2)
    on = before[:, 2, None] + np.sqrt(np.maximum(REST**2 - away, 0.0))
    return max(float(np.where(away < REST**2, on, -math.inf).max()), ON_FLOOR)


def bulk_filling(position):
    """Filling factor between 20 and 80 % of the height of a deposit."""
    z = position[:, 2]
    low, high = 0.2 * np.quantile(z, 0.98), 0.8 * np.quantile(z, 0.98)
    return ((z > low) & (z < high)).sum() * 4 / 3 * math.pi * R**3 / (WIDTH**2 * (high - low))


def test_each_grain_stops_at_its_first_touch():
    """z of each grain is the highest of the floor and of √(d² − ρ²) above all images of the grains that fell before."""
    position = cake().grains.position
    for k, x in enumerate(position):
        assert x[2] == pytest.approx(height_of_fall(x[:2], position[:k]), rel=1e-12, abs=1e-20)
    assert (np.abs(position[:, :2]) <= 0.5 * WIDTH).all()
    assert 3 < (position[:, 2] < ON_FLOOR + 1e-15).sum() < 40


@pytest.mark.validates(
    "published figure",
    "Filling factor of random ballistic deposits is 0.149, 0.147 to 0.15 in the literature (from memory)",
)
def test_filling_factor_of_ballistic_deposition(record_bound):
    """φ of grains that stick at the first touch, beside a deposit by brute force with random numbers of numpy.

    The literature on random ballistic deposition has 0.147 to 0.15 (from memory).  The bulk holds about 1,000 grains;
    4 % is more than four standard errors, of fluctuations far below those of free grains, 3 %.
    """
    rng, brute = np.random.default_rng(7), np.zeros((1800, 3))
    for k in range(len(brute)):
        brute[k, :2] = WIDTH * (rng.random(2) - 0.5)
        brute[k, 2] = height_of_fall(brute[k, :2], brute[max(0, k - 500) : k])
    own = bulk_filling(cake(1800).grains.position)
    record_bound("filling factor over that by brute force", own / bulk_filling(brute), least=0.96, most=1.04)
    record_bound("filling factor over 0.149", own / 0.149, least=0.96, most=1.04)


@pytest.mark.parametrize(("contacts", "filling"), [(1, 0.149), (2, 0.23), (3, 0.33)])
def test_contacts_of_grains_that_roll(contacts, filling):
    """Grains roll until they touch two or three grains that fell before; all contacts are in equilibrium.

    At most a tenth of the grains, most on the floor, has fewer; none touches more of them, overlaps another grain or
    the floor. φ is that of 20,000 grains in a column of 30 diameters; that of the narrow one is up to 6 % above it.
    """
    found = cake(1200, contacts=contacts)
    pairs, overlap = found.grains.touching(found.box, 1e-7)
    assert overlap == pytest.approx(np.full(len(pairs), 2 * R - REST), rel=1e-4, abs=0.0)
    older = np.bincount(pairs.max(axis=1), minlength=1200)
    assert older.max() == contacts and (older == contacts).mean() > 0.9
    assert found.grains.position[:, 2].min() == pytest.approx(ON_FLOOR, rel=1e-12, abs=0.0)
    assert bulk_filling(found.grains.position) == pytest.approx(filling, rel=0.08, abs=0.0)


def test_grains_of_many_sizes_rest_on_the_floor():
    """h = r − δ0 of the floor: the lowest point of each grain on it is δ0 of twice its radius below z = 0."""
    found = cake(400, radius="lognormal(0.1 um, 0.2)", seed=2).grains
    on = found.position[:, 2] < found.radius
    rest = [sand.theory.contact("silica", 2.0 * r).rest_overlap for r in found.radius[on]]
    assert on.sum() > 5 and np.ptp(found.radius[on]) > 1e-8
    assert found.radius[on] - found.position[on, 2] == pytest.approx(np.array(rest), rel=1e-6, abs=0.0)


def test_seeds_and_moments():
    """Equal seeds give equal bits; other seeds do not; moments as for all aggregates; the box is open along z."""
    first, again, other = cake(50), cake(50), cake(50, seed=5, moment="material", material="iron")
    assert (first.grains.position == again.grains.position).all()
    assert (first.grains.position[:, :2] != other.grains.position[:, :2]).any()
    assert (np.linalg.norm(other.grains.moment, axis=1) > 0.0).all() and not first.grains.moment.any()
    assert first.box.lengths == (WIDTH, WIDTH, None) and first.contacts is None


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            {"width": "0.5 um"},
            r"width = 500 nm is so narrow that grains could touch through two images; at least 600 nm",
        ),
        ({"width": "3 s"}, "width"),
        ({"contacts": 4}, "contacts = 4"),
        ({"grains": 0}, "grains of a deposit = 0"),
    ],
)
def test_errors(changes, message):
    """One line: what, what is allowed."""
    with pytest.raises(sand.BadInput, match=message):
        cake(**changes)
