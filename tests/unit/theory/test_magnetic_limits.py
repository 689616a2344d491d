"""Where moments are fixed in the grains: closed forms against numbers worked out by hand and by other routes."""

import math

import numpy as np
import pytest
from scipy.constants import k as BOLTZMANN
from scipy.constants import mu_0
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

import sand
from sand.theory import dipole_energy, magnetic_limits
from sand.theory.magnetic_limits import barrier_density, turning_field

R = 1e-8


def test_iron_by_hand():
    """20 nm iron, K = 4.8e4 J/m³, A = 2e-11 J/m, M_s = 200 A m²/kg × 7874 kg/m³.

    36 √(AK)/(μ₀M_s²) = 36 × 9.798e-4/3.1165e6 = 11.32 nm; 2K/M_s = 0.06096 T; KV/4 = 5.0265e-20 J = 25.33 k_B T at
    143.7 K; four digits are given.  At 300 K τ = 1e-9 s exp(5.0265e-20/4.14195e-21) = 1.86e-4 s.
    """
    limits = magnetic_limits("iron", R, "300 K")
    assert limits.magnetisation == pytest.approx(1.5748e6, rel=1e-12, abs=0.0)
    assert limits.single_domain_radius == pytest.approx(1.132e-8, rel=5e-4, abs=0.0)
    assert limits.anisotropy_field == pytest.approx(0.06096, rel=1e-4, abs=0.0)
    assert limits.blocking_temperature == pytest.approx(143.7, rel=3e-4, abs=0.0)
    assert limits.energy_barrier == pytest.approx(5.0265e-20, rel=1e-4, abs=0.0)
    assert limits.relaxation_time == pytest.approx(1.86e-4, rel=5e-3, abs=0.0)
    assert magnetic_limits(sand.IRON.but(anisotropy_kind="uniaxial"), R).relaxation_time > 1e11


def lowest_path(energy, n, start, end):
    """Lowest possible maximum of an energy along a path on the sphere: over a grid of n × 2n directions, by bisection.

    The path exists at an energy E if start and end are connected in the region below E.
    """
    theta, phi = (np.arange(n) + 0.5) * math.pi / n, np.arange(2 * n) * math.pi / n
    t, p = np.meshgrid(theta, phi, indexing="ij")
    grid = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)])
    values = energy(grid)
    number = np.arange(n * 2 * n).reshape(n, 2 * n)
    beside = [(number, np.roll(number, -1, axis=1)), (number[:-1], number[1:])]
    a, b = (np.concatenate([pair[k].ravel() for pair in beside]) for k in (0, 1))
    ends = [int(np.argmax(np.tensordot(np.array(v) / np.linalg.norm(v), grid, 1).ravel())) for v in (start, end)]
    low, high = values.min(), values.max()
    top = np.maximum(values.ravel()[a], values.ravel()[b])
    for _ in range(25):
        middle = 0.5 * (low + high)
        open_ = top <= middle
        graph = coo_matrix((np.ones(open_.sum()), (a[open_], b[open_])), shape=(2 * n * n, 2 * n * n))
        _, labels = connected_components(graph, directed=False)
        low, high = (low, middle) if labels[ends[0]] == labels[ends[1]] else (middle, high)
    return high - min(values.ravel()[e] for e in ends)


@pytest.mark.parametrize(
    ("k", "kind", "start", "end", "barrier"),
    [
        (1.0, "uniaxial", (0, 0, 1), (0, 0, -1), 1.0),
        (1.0, "cubic", (1, 0, 0), (0, 1, 0), 1 / 4),
        (1.0, "cubic", (0, 0, 1), (0, 1, 0), 1 / 4),
        (-1.0, "cubic", (1, 1, 1), (1, 1, -1), 1 / 12),
        (-1.0, "cubic", (1, 1, 1), (-1, -1, -1), 1 / 12),
    ],
)
def test_barriers_are_those_of_the_lowest_path(k, kind, start, end, barrier):
    """The energy per volume K sin²θ, or K₁ (α₁²α₂² + α₂²α₃² + α₃²α₁²), along the lowest path between easy directions.

    On a grid of spacing h = π/200 a minimum or saddle of curvature up to 2|K| is missed by at most |K| h² = 2.5e-4 |K|.
    The field that turns the moment is the curvature at the easy direction, by differences of angle 1e-4 (error 1e-8,
    rounding 1e-8).
    """

    def energy(n):
        n = np.asarray(n, float)
        if kind == "uniaxial":
            return k * (1 - n[2] ** 2)
        return k * (n[0] ** 2 * n[1] ** 2 + n[1] ** 2 * n[2] ** 2 + n[2] ** 2 * n[0] ** 2)

    assert lowest_path(energy, 200, start, end) == pytest.approx(barrier, abs=2 * (math.pi / 200) ** 2)
    assert barrier_density(k, kind) == pytest.approx(barrier, rel=1e-12, abs=0.0)
    easy = np.array(start) / np.linalg.norm(start)
    aside = np.cross(easy, [0.3, 0.5, -0.8])
    aside /= np.linalg.norm(aside)
    turned = [energy(math.cos(x) * easy + math.sin(x) * aside) for x in (-1e-4, 0.0, 1e-4)]
    assert turning_field(k, kind) == pytest.approx((turned[0] - 2 * turned[1] + turned[2]) / 1e-8, abs=1e-6)


def test_all_presets_have_the_kind_of_their_crystal():
    """Iron (K₁ > 0) and magnetite (K₁ < 0) are cubic: K₁V/4 and |K₁|V/12; the other presets have no anisotropy."""
    volume, found = 4 / 3 * math.pi * R**3, {}
    for name, material in sand.basics.material.PRESETS.items():
        if material.anisotropy is not None:
            found[name] = magnetic_limits(material, R).energy_barrier / (material.anisotropy * volume)
    assert found == {
        "iron": pytest.approx(1 / 4, rel=1e-12, abs=0.0),
        "magnetite": pytest.approx(-1 / 12, rel=1e-12, abs=0.0),
    }


def test_the_time_that_a_moment_stays():
    """τ = τ₀ exp(|K₁|V/12 k_BT) of magnetite: at the blocking temperature or radius of a time t it is t.

    ln t is then exact to 1e-12.
    """
    for seconds in (1e-6, 100.0, 1e9):
        given = magnetic_limits("magnetite", R, "300 K", seconds)
        blocked = magnetic_limits("magnetite", R, given.blocking_temperature)
        large = magnetic_limits("magnetite", given.blocking_radius, "300 K")
        volume = 4.0 / 3.0 * math.pi * R**3
        barrier = -sand.MAGNETITE.anisotropy / 12 * volume / (BOLTZMANN * given.blocking_temperature)
        for found in (blocked.relaxation_time, large.relaxation_time, 1e-9 * math.exp(barrier)):
            assert math.log(found) == pytest.approx(math.log(seconds), abs=1e-6)
    assert magnetic_limits("iron", "1 um").relaxation_time == math.inf


def test_the_field_of_a_touching_grain():
    """B = −U/μ of two aligned moments M_s V at a distance 2r (Eq. 6), μ₀M_s/12 for every radius: 0.165 T for iron.

    That is 2.7 times the anisotropy field: the moments of the paper's grains would turn inside them.
    """
    limits = magnetic_limits("iron", R)
    moment = limits.magnetisation * 4.0 / 3.0 * math.pi * R**3
    energy = dipole_energy([moment, 0, 0], [moment, 0, 0], [2 * R, 0, 0])
    assert limits.contact_field == pytest.approx(-energy / moment, rel=1e-9, abs=0.0)
    assert limits.contact_field == pytest.approx(0.165, rel=1e-3, abs=0.0)
    assert limits.contact_field / limits.anisotropy_field == pytest.approx(2.7, rel=5e-3, abs=0.0)


def test_one_domain_where_its_field_costs_less_than_a_wall():
    """A wall through the sphere, 4 √(AK) πr², costs what a flux closed by halves saves, half of μ₀M_s²V/6.

    4 √(AK) πr² = (1/2)(μ₀M_s²/6)(4πr³/3) at r = 36 √(AK)/(μ₀M_s²).
    """
    for name in ("iron", "magnetite"):
        material = sand.IRON if name == "iron" else sand.MAGNETITE
        limits = magnetic_limits(name, R)
        r = limits.single_domain_radius
        wall = 4.0 * math.sqrt(material.exchange_stiffness * abs(material.anisotropy)) * math.pi * r**2
        saved = 0.5 * mu_0 * limits.magnetisation**2 / 6.0 * 4.0 / 3.0 * math.pi * r**3
        assert wall == pytest.approx(saved, rel=1e-9, abs=0.0)
