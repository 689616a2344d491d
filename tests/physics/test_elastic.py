"""Elastic moduli of packings at rest and waves in them: crystals, a chain, a random packing by its stiffness matrix."""

import math

import numpy as np
import pytest

import sand
from sand.engine.measures import contact_energies
from sand.experiments import elastic_strain
from sand.experiments.elastic import Elastic, contact_springs, measure
from sand.experiments.elastic_waves import Wave, knock, repeated, standing_wave
from sand.setup.from_frame import Start
from sand.theory.elastic import affine_moduli, affine_shear_moduli

from .test_stress import ICE, R, lattice, packing, strained  # noqa: F401, the fixture

pytestmark = pytest.mark.compiled("deformation")
ONE = sand.theory.contact(ICE, R)
D = 2 * R - ONE.rest_overlap
NORMAL, SLIDE = ONE.normal_stiffness, ONE.slide_stiffness * (2 * R / D) ** 2
HALF = D / math.sqrt(2)
FCC = [[0, 0, 0], [0, 0.5, 0.5], [0.5, 0, 0.5], [0.5, 0.5, 0]]


def moduli_of(sim, **settings):
    """Measured moduli of a crystal without waves."""
    return measure(sim.grains, Elastic(box=list(sim.box.lengths), sound=False, **settings))


@pytest.mark.validates(
    "closed form",
    "Elastic moduli of simple cubic and face-centred crystals are those of their springs",
)
def test_crystals(record_bound):
    """Relaxed and affine C_ab are those of springs, also after a strain there and back: no grain of a crystal turns.

    Simple cubic: C11 = k_n/D, C12 = 0. Face-centred: C11 = √2 (k_n + k_s′)/D, C12 = (k_n − k_s′)/√2D, and affine C44 =
    (k_n + k_s′)/√2D, of which each grain's k_s′ also resists a turn.  Strains of ±ε leave terms of (ε D/δ₀)² = 5e-9;
    5e-9 of the strain is what the step at its end adds.
    """
    c11, c12 = math.sqrt(2) * (NORMAL + SLIDE) / D, (NORMAL - SLIDE) / HALF / 2
    for sim, own, other in (
        (lattice([[0, 0, 0]], (4, 4, 4), 3 * [D]), NORMAL / D, 0.0),
        (lattice(FCC, (3, 3, 3), 3 * [2 * HALF]), c11, c12),
    ):
        found = moduli_of(sim, strains=[1e-6])
        expected = own * np.eye(3) + other * (1 - np.eye(3))
        for name, moduli, bound in (("affine", found.affine, 1e-9), ("relaxed", found.relaxed, 3e-8)):
            error = np.abs(moduli - expected).max() / c11
            record_bound(f"largest error of {name} moduli over C11", error, most=bound)
        row, content = found.table[0], found.to_dict()
        assert row["unrecovered"] < 1e-7 and row["made"] == row["broken"] == row["at_limit_strained"] == 0
        assert content["bulk"] == pytest.approx((own + 2 * other) / 3, rel=1e-7, abs=0)
        assert content["shear"] == pytest.approx((own - other) / 2, rel=1e-7, abs=0)
        assert abs(content["residual"]) < 1e-9 * c11 and content["anisotropy"] < 1e-7
    # Σ l_a² H_bb over the contacts of a grain: of the three planes with a, one has no b, and only springs k_s′
    shear = c11 * np.eye(3) + (NORMAL + 3 * SLIDE) / HALF / 2 * (1 - np.eye(3))
    np.testing.assert_allclose(found.affine_shear, shear, rtol=0, atol=1e-9 * c11)


@pytest.mark.usefixtures("packing")
def test_affine_moduli_of_a_moving_packing(packing):  # noqa: F811
    """−∂P_aa/∂ε_b of contacts that slid, rolled and twisted: closed form against second differences of the energy.

    With U(ε_a, ε_b) of the engine at frozen orientations P_aa = −(∂U/∂ε_a)/(V Π_b≠a (1 + ε_b)), the force over an area
    that grows with ε_b, so that C_ab = (∂²U/∂ε_a∂ε_b)/V + (1 − δ_ab) P_aa. Differences of second order with steps
    h = 1e-6 have errors of (h D/δ_c)² = 1e-8, more in contacts near rupture, where dδ/da = 0; rounding is 1e-16/h².
    """
    springs, stress = contact_springs(packing, sand.Contact()), packing.stress()
    pressure, volume, h = np.diag(stress.parts["contacts"]), stress.volume, 1e-6

    def energy(*strain):
        return math.fsum(contact_energies(strained(packing, 1.0 + np.array(strain))))

    found, unit = np.zeros((3, 3)), h * np.eye(3)
    for a in range(3):
        for b in range(3):
            if a == b:
                second = energy(*unit[a]) - 2 * energy(0, 0, 0) + energy(*-unit[a])
                found[a, a] = second / (h * h * volume)
            else:
                ends = [energy(*(p * unit[a] + q * unit[b])) * p * q for p in (1, -1) for q in (1, -1)]
                found[a, b] = math.fsum(ends) / (4 * h * h * volume) + pressure[a]
    expected = affine_moduli(springs, pressure, volume)
    np.testing.assert_allclose(expected, found, rtol=0, atol=2e-5 * np.abs(expected).max())
    assert np.abs(pressure).max() > 1e-4 * np.abs(expected).max()
    assert affine_shear_moduli(springs, volume).diagonal() == pytest.approx(expected.diagonal(), rel=1e-12, abs=0)


def springs_at_rest(sim):
    """Moduli (3, 3) of a packing of equal grains at rest, by its stiffness matrix; forces are 0 in all contacts.

    Springs k_n, k_s, k_r, k_t against n·Δu, ζ = (2r/D)(Δu − n n·Δu) − r (θ1 + θ2)×n, ξ = −R (θ1 − θ2)×n and
    (θ1 − θ2)·n, with displacements u and turns θ of the grains, and ε l in Δu: E = ½ |B x + A ε|² is least for
    x = −B⁺ A ε, and C = (A + B x)ᵀ (A + B x)/V.
    """
    pair, x = sim.contacts["pair"].astype(int), sim.grains.position
    count, unit = len(x), np.eye(3)
    rows, box = [], []
    for i, j in pair.tolist():
        l = sim.box.nearest(x[i] - x[j])
        n = l / np.linalg.norm(l)
        turn = -np.cross(unit, n).T  # −θ × n
        across = unit - np.outer(n, n)
        modes = [
            (NORMAL, n[None], 0 * n[None], 0 * n[None]),
            (ONE.slide_stiffness, 2 * R / D * across, R * turn, R * turn),
            (ONE.roll_stiffness, 0 * across, R / 2 * turn, -R / 2 * turn),
            (ONE.twist_stiffness, 0 * n[None], n[None], -n[None]),
        ]
        for stiffness, moved, first, second in modes:
            block = np.zeros((len(moved), 2, count, 3))
            block[:, 0, i] += moved
            block[:, 0, j] -= moved
            block[:, 1, i] += first
            block[:, 1, j] += second
            rows.append(math.sqrt(stiffness) * block.reshape(len(moved), -1))
            box.append(math.sqrt(stiffness) * moved * l)  # of strains along x, y, z
    a, b = np.concatenate(box), np.concatenate(rows)
    scale = np.repeat([1.0, 1.0 / R], 3 * count)  # turns in units of 1/R
    left = a - (b * scale) @ np.linalg.lstsq(b * scale, a, rcond=1e-12)[0]
    return left.T @ left / sim.box.volume


def test_a_disordered_packing_against_its_stiffness_matrix():
    """C_ab of a face-centred crystal with a third of its grains left out, which relaxes far below affine motion.

    The packing is strained until it is at rest within `accuracy` = 1e-3 by time alone, of which the last doubling
    leaves at most as much.
    """
    whole = lattice(FCC, (3, 3, 3), 3 * [2 * HALF])
    kept = np.sort(np.random.default_rng(5).permutation(108)[:72])
    grains = sand.Grains(whole.grains.position[kept], R, ICE)
    sim = sand.Simulation(grains, [sand.Contact()], box=list(whole.box.lengths))
    expected = springs_at_rest(sim)
    found = moduli_of(sim, strains=[1e-6], accuracy=1e-3)
    assert found.affine[0, 0] > 1.2 * expected[0, 0]
    np.testing.assert_allclose(found.relaxed, expected, rtol=0, atol=2e-3 * expected.max())
    assert found.table[0]["at_limit_strained"] == 0 and found.table[0]["unrecovered"] < 2e-3


def test_a_soft_packing_is_at_rest(monkeypatch):
    """A porous packing, a hundred times softer than affine motion, is strained when its stress changes no longer.

    In the last doubling of the time no element of P changed by more than a fifth of `accuracy` of the largest one,
    whatever the strain; in the next one no more than twice as much, as creep slows down in logarithmic time. What is
    not complete after the last doubling is said.
    """
    body = sand.setup.bcca(64, radius=R, material=ICE, seed=1)
    settings = Elastic(compress_to=0.2, rate="1e-3 /t_c", strains=[1e-3], sound=False)
    found = measure(body, settings)
    content, stress, share = found.to_dict(), found.rest.stress().total, 0.2 * settings.accuracy
    assert found.affine[0, 0] > 50 * found.relaxed[0, 0]
    assert content["residual_change"] < share * np.abs(stress).max() and content["at_rest"]
    later = found.rest.copy()
    later.run(until=2 * later.time)
    np.testing.assert_allclose(later.stress().total, stress, rtol=0, atol=2 * share * np.abs(stress).max())
    monkeypatch.setattr(elastic_strain, "DOUBLINGS", 2)
    with pytest.warns(UserWarning) as said:
        early = measure(body, settings)
    texts = "\n".join(str(one.message) for one in said)
    assert "the packing is not at rest after" in texts and "the response to a strain of 0.001 along z is not" in texts
    assert not early.to_dict()["at_rest"]


def chain(number):
    """A periodic chain of grains at rest along x."""
    x = (np.arange(number) + 0.5 - number / 2) * D
    grains = sand.Grains(np.column_stack([x, 0 * x, 0 * x]), R, ICE)
    return sand.Simulation(grains, [sand.Contact()], box=[number * D, 1e-6, 1e-6], frame_every="1 s")


MASS = ICE.density * 4 / 3 * math.pi * R**3


@pytest.mark.validates("closed form", "Speed of waves and pulses in a chain is that of its springs")
def test_waves_of_a_chain(record_bound):
    """ω = 2 √(k/m) sin(kD/2), so that c = ω/k is D √(k/m) sin(κ)/κ with κ = π/N; a pulse runs at D √(k/m).

    The turn of a wave is read between moments that differ by a factor 1.05, a line in place of a sine: 5e-4. A pulse of
    standard deviation 0.08 L has waves with kD ~ 1/(0.08 N), slower by (kD)²/8 to (kD)²/24: 0.3 % for N = 48, as much
    as the fit of its form allows.
    """
    fast = D * math.sqrt(NORMAL / MASS)
    for number in (6, 16):
        kappa = math.pi / number
        found = standing_wave(chain(number), Wave(0, 0), 1e-6, fast)
        ratio = found / (fast * math.sin(kappa) / kappa)
        record_bound("speed of a standing wave over D √(k/m) sin κ/κ", ratio, least=1 - 5e-4, most=1 + 5e-4)
    # a chain 20 times softer than its upper bound: v/c = 3e-4 changes overlaps by 6 %, v/c = 6e-3 would open contacts
    found, kappa = standing_wave(chain(8), Wave(0, 0), 3e-4, 20 * fast), math.pi / 8
    assert found == pytest.approx(fast * math.sin(kappa) / kappa, rel=1e-3, abs=0)
    pulse = knock(chain(48), Wave(0, 0), 1e-6, 1.2 * fast)
    record_bound("speed of a pulse over D √(k/m)", pulse.speed / fast, least=0.995, most=1.005)
    assert pulse.misfit < 0.02 and abs(pulse.drift) < 1e-3
    apart, late = np.diff(pulse.distances)[1:], np.diff(pulse.arrivals)[1:]  # the first overlaps with the layer
    assert late == pytest.approx(apart / fast, rel=0.02, abs=0)


def test_waves_in_a_crystal():
    """Of a simple cubic crystal c_L = √(C11/ρ), and c_T = √(k_s′/2Dρ): grains turn by half the shear.

    Long waves: sin κ/κ with κ = π/16 is 1 − 0.64 %, also of transverse waves within a few tenths of a percent; pulses
    of waves with kD ~ 0.8 are slower by 1 to 2 %.
    """
    found = measure(lattice([[0, 0, 0]], (4, 4, 4), 3 * [D]).grains, Elastic(box=3 * [4 * D], strains=[1e-6]))
    content, slower = found.to_dict(), math.sin(math.pi / 16) / (math.pi / 16)
    fast = math.sqrt(NORMAL / D / content["density"])
    turned = math.sqrt(SLIDE / 2 / D / content["density"])
    assert content["speed_longitudinal_static"] == pytest.approx(fast, rel=1e-6, abs=0)
    assert content["speed_longitudinal_standing"] == pytest.approx(slower * fast, rel=1e-3, abs=0)
    assert content["speed_transverse_standing"] == pytest.approx(turned, rel=5e-3, abs=0)
    assert content["speed_longitudinal"] == pytest.approx(fast, rel=0.02, abs=0)
    assert content["speed_transverse"] == pytest.approx(turned, rel=0.02, abs=0)
    assert all(abs(wave["drift"]) < 1e-3 for wave in content["waves"])


def test_copies_side_by_side(packing):  # noqa: F811
    """Three copies of a packing have its stress, three times its contacts, and the displacements of these."""
    table = packing.contacts
    bonds = sand.basics.initial_pairs.StrainedContacts(
        *(np.array(table[name]) for name in ("pair", "slide_vector", "roll_vector", "twist"))
    )
    many = repeated(Start(packing.grains.copy(), bonds._replace(pair=bonds.pair.astype(int)), packing.box, ""), 1, 3)
    sim = sand.Simulation(many.grains, [sand.Contact()], box=many.box, contacts=many.contacts)
    assert len(sim.contacts["pair"]) == 3 * len(table["pair"])
    one, found = packing.stress(), sim.stress()
    size = np.abs(one.parts["contacts"]).max()
    np.testing.assert_allclose(found.total, one.total, rtol=0, atol=1e-6 * size)
    assert found.volume == pytest.approx(3 * one.volume, rel=1e-12, abs=0)
