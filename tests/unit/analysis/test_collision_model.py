"""Collision models of growth codes from tables of collisions, and the files that DustPy and mcdust take."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

import sand
from sand.analysis.collision_model import (
    Collisions,
    collisions,
    efficiencies,
    fragment_masses,
    fragment_slope,
    rate_average,
    thresholds,
)
from sand.io.growth_codes import COLUMNS, read_dustpy, write_dustpy, write_mcdust


def table(rows):
    """Columns of rows (speed, target, projectile, fragments)."""
    names = ("speed", "target.grains", "projectile.grains", "fragments")
    return {name: [row[k] for row in rows] for k, name in enumerate(names)}


def test_growth_efficiency():
    """f = (N_1 − N_t)/N_p: 1 sticks, 0 bounces, −N_t/N_p + 1/N_p is dust; the larger body is the target."""
    found = collisions(
        table([(1, 50, 10, [60]), ("2 m/s", 10, 50, "50 10"), (3, 10, 10, [5, 15]), (4, 5, 2, "[1, 1, 1, 1, 1, 1, 1]")])
    )
    assert found.speed.tolist() == [1, 2, 3, 4]
    assert found.growth == pytest.approx([1.0, 0.0, 0.5, -2.0], abs=1e-12)
    assert found.mass_ratio == pytest.approx([5, 5, 1, 2.5], abs=1e-12)
    of_sweep = {"impact.speed": ["1 m/s"], "target.grains": [6], "fragments": ["7"]}  # a key that does not change
    assert collisions(of_sweep, speed="impact.speed", projectile=1).growth.tolist() == [1.0]


def test_averages():
    """Means by hand, with weights; stick − fragment × excavated is the mean of f, which mass conservation asks for."""
    rows = [(5, 40, 20, [60]), (5, 40, 20, [30, 30]), (5, 40, 20, [40, 20]), (9, 40, 20, [20, 20, 20])]
    given = table(rows) | {"weight": [1.0, 2.0, 1.0, 7.0], "phi": [0.3] * 4}
    slow, fast = efficiencies(collisions(given, weight="weight", filling="phi"))
    f, w = np.array([1.0, -0.5, 0.0]), np.array([0.25, 0.5, 0.25])
    assert (slow.mass_ratio, slow.filling, slow.speed, slow.collisions) == (2.0, 0.3, 5.0, 3)
    assert slow.growth == pytest.approx(w @ f, abs=1e-12)
    assert slow.growth_error == pytest.approx(math.sqrt(1.5 * (w**2) @ (f - w @ f) ** 2), abs=1e-12)
    assert (slow.stick, slow.fragment, slow.excavated) == pytest.approx((0.25, 0.5, 0.5), abs=1e-12)
    assert (fast.growth, fast.fragment, fast.excavated) == pytest.approx((-1.0, 1.0, 1.0), abs=1e-12)
    assert math.isnan(fast.growth_error)
    for row in (slow, fast):
        assert row.stick - row.fragment * row.excavated == pytest.approx(row.growth, abs=1e-12)
        assert 0.0 <= row.stick + row.fragment <= 1.0


def test_error_of_the_mean():
    """Without weights the standard error is s/√n with the sample's standard deviation s."""
    rng = np.random.default_rng(1)
    largest = rng.integers(50, 101, 30)
    (row,) = efficiencies(
        collisions(table([(1, 50, 50, [int(n), 100 - int(n)] if n < 100 else [100]) for n in largest]))
    )
    f = (np.maximum(largest, 100 - largest) - 50) / 50
    assert row.growth_error == pytest.approx(f.std(ddof=1) / math.sqrt(30), rel=1e-12, abs=0.0)


def test_threshold():
    """f = 1 − log2(v/10 m/s) at 10, 20 and 40 m/s is 0 at 20 m/s; none below and none above have no threshold."""
    made = [sand.analysis.collision_model.Efficiency(1.0, math.nan, v, 9, f, e, 0, 0, 0) for v, f, e in
            ((10.0, 1.0, 0.1), (20.0, 0.5, 0.1), (40.0, -0.5, 0.1), (80.0, 0.3, 0.1))]  # fmt: skip
    (found,) = thresholds(made[::-1])
    assert found.speed == pytest.approx(20.0 * math.sqrt(2.0), rel=1e-12, abs=0.0)
    assert found.least == pytest.approx(20.0 * 2.0**0.4, rel=1e-12, abs=0.0)
    assert found.most == pytest.approx(20.0 * 2.0**0.6, rel=1e-12, abs=0.0)
    assert thresholds(made[:2])[0].speed == math.inf
    assert thresholds(made[2:])[0].speed == 0.0
    several = [one._replace(mass_ratio=q) for q in (1.0, 8.0) for one in made]
    assert [one.mass_ratio for one in thresholds(several)] == [1.0, 8.0]


def test_rate_average():
    """For a step at v_f it is DustPy's (1 + 3x²/2) e^(−3x²/2), x = v_f/v_rms; for other functions the integral."""
    x = np.array([[0.3, 1.0], [2.0, 5.0]])
    step = rate_average([1.0 - 1e-6, 1.0 + 1e-6], [0.0, 1.0], 1.0 / x)
    assert step == pytest.approx((1.0 + 1.5 * x**2) * np.exp(-1.5 * x**2), rel=1e-4, abs=0.0)
    v, f = [1.0, 3.0, 4.0], [0.2, -1.0, 0.7]

    def density(speed):
        return speed**3 * math.exp(-1.5 * (speed / 2.0) ** 2)

    pieces = ((0, 1), (1, 3), (3, 4), (4, 40))
    mean = sum(quad(lambda s: density(s) * np.interp(s, v, f), a, b)[0] for a, b in pieces) / quad(density, 0, 40)[0]
    assert rate_average(v, f, 2.0) == pytest.approx(mean, rel=1e-8, abs=0.0)


def test_slope_of_fragments():
    """Sizes drawn from n(m) ∝ m^γ give γ again: the deviation in units of the error is that of a normal number.

    Of 20 samples none deviates by more than 4 errors (probability 1e-3 that one does), and the mean square is 1 to
    within 4 √(2/20).
    """
    rng, sizes = np.random.default_rng(7), np.arange(1, 401)
    deviations = []
    for exponent in np.linspace(-2.5, -1.2, 20):
        share = sizes**exponent / (sizes**exponent).sum()
        drawn = rng.choice(sizes, 2000, p=share).astype(float)
        drawn[0] = 400.0
        one = np.ones(1)
        given = Collisions(one, one, one, one, one, [np.concatenate([[1e4], np.sort(drawn)[::-1]])])
        found = fragment_slope(given)
        assert found.fragments == 2000
        deviations.append((found.exponent - exponent) / found.error)
    assert np.abs(deviations).max() < 4.0
    assert np.mean(np.square(deviations)) == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / 20.0))


def test_masses_of_fragments():
    """Parts of the mass by hand: they have the sum 1, and weights count."""
    given = table([(5, 6, 4, [5, 3, 1, 1]), (5, 6, 4, [10]), (7, 6, 4, [10])]) | {"w": [3.0, 1.0, 1.0]}
    (key, slow), (_, fast) = fragment_masses(collisions(given, weight="w"), [0.0, 0.15, 0.45, 1.0])
    assert key[0] == 1.5 and math.isnan(key[1]) and key[2] == 5.0
    assert slow == pytest.approx([0.75 * 0.2, 0.75 * 0.3, 0.75 * 0.5 + 0.25], abs=1e-12)
    assert fast == pytest.approx([0.0, 0.0, 1.0], abs=1e-12)


def test_table_for_dustpy(tmp_path):
    """Written and read again: cgs speeds, empty cells for what is not known, the same numbers."""
    rows = efficiencies(collisions(table([(5, 40, 20, [60]), (5, 40, 20, [30, 30]), (9, 40, 20, [20, 20, 20])])))
    write_dustpy(tmp_path / "a.csv", rows)
    assert (tmp_path / "a.csv").read_text("utf-8").splitlines()[0] == ",".join(COLUMNS)
    found = read_dustpy(tmp_path / "a.csv")
    assert found["speed_cm_s"].tolist() == [500.0, 900.0]
    for name, field in (("growth_efficiency", "growth"), ("p_stick", "stick"), ("p_frag", "fragment")):
        assert found[name].tolist() == [getattr(row, field) for row in rows]
    assert np.isnan(found["filling_factor"]).all() and math.isnan(found["growth_efficiency_error"][1])
    with pytest.raises(sand.BadInput, match="there is no row to write"):
        write_dustpy(tmp_path / "b.csv", [])
    (tmp_path / "c.csv").write_text("a,b\n1,2\n", "utf-8")
    with pytest.raises(sand.BadInput, match="is not a table of write_dustpy"):
        read_dustpy(tmp_path / "c.csv")


def test_lines_for_mcdust(tmp_path):
    """Names and units of setup.par: cm, g/cm³ and cm/s; a threshold that is not known is refused."""
    write_mcdust(tmp_path / "setup.par", 7.6, 1e-7, 2600.0 * 0.4)
    found = dict(line.split() for line in (tmp_path / "setup.par").read_text("utf-8").splitlines())
    assert {name: float(value) for name, value in found.items()} == pytest.approx(
        {
            "monomer_radius_[cm]": 1e-5,
            "material_density_[g/cm3]": 1.04,
            "fragmentation_velocity_[cm/s]": 760.0,
            "erosion_mass_ratio": 10.0,
        },
        rel=1e-8,
        abs=0.0,
    )
    with pytest.raises(sand.BadInput) as caught:
        write_mcdust(tmp_path / "x", math.inf, 0.0, 1000.0)
    assert caught.value.problems == ["speed = inf must be above 0", "radius = 0 must be above 0"]


@pytest.mark.parametrize(
    ("change", "lines"),
    [
        ({"speed": None}, ["the table has no column 'speed' for speed; did you mean 'speeds'?"]),
        ({"fragments": [[20, 10]]}, ["column 'fragments' has 1 rows, but 'speed' has 2"]),
        ({"fragments": [[30], "x"]}, ["fragments, row 1 = 'x' must be numbers of grains, such as [493, 5, 2]"]),
        ({"fragments": [[30], [29]]}, ["row 1: the fragments have 29 grains, the bodies 30"]),
        (
            {"speed": [1, "3 kg"]},
            ["speed, row 1 = '3 kg' is a mass, not a quantity in m/s; give a number in SI or text such as '10 m/s'"],
        ),
        ({"speed": [1, -1]}, ["speed, row 1 = -1 must be above 0 m/s"]),
    ],
)  # fmt: skip
def test_messages(change, lines):
    """One line for a column that is missing, and for values that are impossible."""
    given = table([(1, 20, 10, [30]), (2, 20, 10, [30])]) | change
    if given["speed"] is None:
        given["speeds"] = given.pop("speed")
    with pytest.raises(sand.BadInput) as caught:
        collisions(given)
    assert caught.value.problems == lines
