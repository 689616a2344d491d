"""Limits of grains as solids: impacts, overlaps, spins, fields at the surface; settling, and a gas too dense."""

import math
import warnings

import numpy as np
import pytest
from scipy.constants import epsilon_0
from scipy.integrate import quad
from scipy.optimize import brentq

import sand
from sand.basics.state import BROKEN, CHANGED, CLOCK, IMPACT_SPEED, LARGEST_IMPACT, LARGEST_OVERLAP, LEAST_CLOCK
from sand.contact.dmt import LAW as DMT
from sand.contact.impact import impact_share
from sand.contact.jkr import LAW as JKR
from sand.contact.law import contact_periods, largest_pull
from sand.engine.input_checks import check_system
from sand.limits.solid_limits import (
    DEEPEST_OVERLAP,
    ELECTRON_EMISSION,
    FASTEST_IMPACT,
    IDEAL_STRENGTH,
    ION_EMISSION,
    extreme_warnings,
    grain_warnings,
    spin_stress,
    torn_clusters,
)

OPEN = sand.Box.open()
BARE = sand.SILICA.but(name="bare silica", surface_energy=0)
IMPACT, OVERLAP = "impacts are too fast", "grains overlap too deeply"


def texts(grains, forces=(), box=OPEN):
    """Warnings of a start."""
    return check_system(grains, list(forces), box, fresh=True)


def run_texts(make, **until):
    """Warnings that a simulation shows, the simulation, and warnings that it keeps for its summary."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        sim = make()
        sim.run(**until)
    return [str(one.message) for one in caught], sim


# --- impacts and overlaps ----------------------------------------------------------------------------------------


def impact_overlap(share):
    """Largest overlap δ/R = (10π s²)^(2/5) of an impact of s = `share` between spheres without adhesion."""
    return (10.0 * math.pi * share * share) ** 0.4


def impact_pressure(share):
    """Largest pressure p₀/E* = (2/π) (10π s²)^(1/5) of such an impact."""
    return 2.0 / math.pi * (10.0 * math.pi * share * share) ** 0.2


def hertz(speed, r1, r2, material):
    """Largest overlap [m] and pressure [Pa] of an impact: the energies of Hertz' force, integrated and solved."""
    m1, m2 = (4 / 3 * math.pi * material.density * r**3 for r in (r1, r2))
    mass, radius = m1 * m2 / (m1 + m2), r1 * r2 / (r1 + r2)
    modulus = material.young_modulus / (2 * (1 - material.poisson_ratio**2))

    def left(overlap):
        work = quad(lambda x: 4 / 3 * modulus * math.sqrt(radius) * x**1.5, 0.0, overlap, epsabs=0.0)[0]
        return (work - 0.5 * mass * speed**2) / (0.5 * mass * speed**2)

    overlap = brentq(left, 0.0, 10 * radius, xtol=1e-20)
    force = 4 / 3 * modulus * math.sqrt(radius) * overlap**1.5
    return mass, radius, modulus, overlap, 1.5 * force / (math.pi * radius * overlap)


@pytest.mark.parametrize(("r1", "r2"), [(1e-6, 1e-6), (2e-7, 1e-6)])
def test_overlap_and_pressure_of_an_impact(r1, r2):
    """δ/R = (10π s²)^(2/5) and p₀ = (2/π) E* (δ/R)^(1/2) from the energy balance ½ m̄v² = ∫F dδ and p₀ = 3F/2πa²."""
    mass, radius, modulus, overlap, pressure = hertz(50.0, r1, r2, sand.SILICA)
    share = impact_share(50.0, mass, radius, modulus)
    assert impact_overlap(share) == pytest.approx(overlap / radius, rel=1e-9, abs=0.0)
    assert impact_pressure(share) == pytest.approx(pressure / modulus, rel=1e-9, abs=0.0)
    if r1 == r2:  # √(2E*/ρ) = √(Y/(1 − ν²)ρ)
        sound = math.sqrt(54e9 / (1 - 0.17**2) / 2650)
        assert share == pytest.approx(50.0 / sound, rel=1e-12, abs=0.0)


def test_the_limits_of_impact_and_overlap_are_those_of_the_ideal_strength():
    """p₀ = 1.6 σ with σ = Y/10 and Y = 2(1 − ν²)E*: 0.29 to 0.31 E* for ν = 0.32 to 0.17; those of the limits agree."""
    yields = [1.6 * IDEAL_STRENGTH * 2 * (1 - m.poisson_ratio**2) for m in (sand.SILICA, sand.GRAPHITE, sand.IRON)]
    assert min(yields) > 0.28 and max(yields) < 0.315
    assert impact_pressure(FASTEST_IMPACT) == pytest.approx(0.31, abs=0.003, rel=0.0)
    # equal spheres: δ/R = 2 δ/r
    assert 2 / math.pi * math.sqrt(2 * DEEPEST_OVERLAP) == pytest.approx(0.285, abs=0.001, rel=0.0)


def test_warnings_of_the_extremes_say_number_unit_and_limit():
    """One line each just above the limits, none just below."""
    clock = np.zeros(len(CLOCK))
    clock[LARGEST_OVERLAP], clock[LARGEST_IMPACT], clock[IMPACT_SPEED] = 0.0999, 0.0299, 130.0
    assert extreme_warnings(clock) == {}
    clock[LARGEST_OVERLAP], clock[LARGEST_IMPACT], clock[IMPACT_SPEED] = 0.1234, 0.0321, 145.0
    impact, overlap = extreme_warnings(clock).values()
    assert impact.startswith(IMPACT) and "up to 145 m/s" in impact and "0.0321" in impact and "limit 0.03" in impact
    assert overlap.startswith(OVERLAP) and "0.123 radii" in overlap and "limit 0.1" in overlap
    assert all(text.startswith(about) and "\n" not in text for about, text in extreme_warnings(clock).items())
    clock[LARGEST_OVERLAP], clock[LARGEST_IMPACT] = 0.10004, 0.0300001  # as many digits as show that they are past it
    impact, overlap = extreme_warnings(clock).values()
    assert "0.0300001 of" in impact and "0.10004 radii" in overlap


def pair(speed, r1=1e-6, r2=1e-6, **options):
    grains = sand.Grains(
        [[0, 0, 0], [1.001 * (r1 + r2), 0, 0]], [r1, r2], BARE, velocity=[[speed / 2, 0, 0], [-speed / 2, 0, 0]]
    )
    return sand.Simulation(grains, [sand.Contact()], **options)


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(("speed", "shown"), [(100.0, []), (115.0, [OVERLAP]), (145.0, [IMPACT, OVERLAP])])
def test_an_impact_is_measured_and_warned_of(tmp_path, speed, shown):
    """Hertz at 100, 115, 145 m/s: δ/r = 0.093, 0.104, 0.125; the 0.03 √(2E*/ρ) of bare silica are 137 m/s.

    The largest overlap at an end of a step is below that of the impact by at most ½(π/25)² of it with 25 steps per
    period of a stiffer contact, less than 1 %, and Verlet's error of the energy, less than 1 %.
    """
    found, sim = run_texts(lambda: pair(speed, out=tmp_path / "run", frame_every="1 s"), until="10 ns")
    assert [about for about in (IMPACT, OVERLAP) for text in found if text.startswith(about)] == shown
    summary = sand.open(tmp_path / "run").summary
    *_, overlap, _ = hertz(speed, 1e-6, 1e-6, BARE)
    assert summary["largest_overlap"] == pytest.approx(overlap / 1e-6, rel=0.02, abs=0.0)
    clock = sim.regular_state.clock
    assert clock[IMPACT_SPEED] == pytest.approx(speed, rel=1e-9, abs=0.0)
    kept = [text for text in summary["warnings"] if text.startswith((IMPACT, OVERLAP))]
    assert kept == list(extreme_warnings(clock).values())  # with the numbers of the whole run


@pytest.mark.compiled("contacts")
@pytest.mark.filterwarnings("ignore:grains overlap too deeply")
def test_the_largest_overlap_is_that_of_all_steps(tmp_path):
    """Grains of unequal radii, looked at after each step: the largest of all overlaps over the smaller radius.

    Frames, and a run that is interrupted and resumed, change no bit of it; a second run does not warn again.
    """
    sim, largest = pair(120.0, r1=4e-7, frame_every="1 s"), 0.0
    for _ in range(200):
        sim.run(steps=1)
        state = sim.regular_state
        apart = np.linalg.norm(np.diff(state.grains.position, axis=0))
        largest = max(largest, (1.4e-6 - apart) / 4e-7)
        assert state.clock[LARGEST_OVERLAP] == pytest.approx(largest, rel=1e-12, abs=1e-15)
    kept = [text for text in sim.warnings if text.startswith(OVERLAP)]
    assert kept == [extreme_warnings(state.clock)["grains overlap too deeply for a contact law"]]  # not the first one
    assert largest > DEEPEST_OVERLAP and sim.regular_state.count[BROKEN] == 1  # it has rebounded
    whole = sim.regular_state.clock[LARGEST_OVERLAP : IMPACT_SPEED + 1].tobytes()
    pieces = pair(120.0, r1=4e-7, frame_every="0.05 ns", out=tmp_path / "run")
    pieces.writer.draws = False
    pieces.run(steps=40)
    text = pieces.warnings
    found, again = run_texts(lambda: sand.resume(tmp_path / "run"), steps=160)
    assert again.regular_state.clock[LARGEST_OVERLAP : IMPACT_SPEED + 1].tobytes() == whole
    assert any(one.startswith(OVERLAP) for one in text) and not any(one.startswith(OVERLAP) for one in found)


@pytest.mark.compiled("contacts")
def test_columns_that_pad_a_vector_do_not_count():
    """Five contacts of a chain at rest, computed as eight: the overlap is that of the contacts."""
    chain = sand.setup.aggregates.chain(6, radius="0.1 um", material="silica")
    sim = sand.Simulation(chain, [sand.Contact()])
    sim.run(steps=10)
    rest = sand.theory.contact("silica", "0.1 um").rest_overlap / 1e-7
    assert sim.regular_state.clock[LARGEST_OVERLAP] == pytest.approx(rest, rel=1e-6, abs=0.0)


@pytest.mark.compiled("contacts")
def test_overlaps_and_impacts_at_walls_count():
    """A bare grain hits a fixed wall at 100 m/s: R = r, m̄ = m in Hertz' balance; s is half of that of two grains."""
    grain = sand.Grains([[0, 0, 1.002e-6]], "1 um", BARE, velocity=[[0, 0, -100.0]])
    wall = sand.Wall([0, 0, 0], [0, 0, 1], BARE)
    found, sim = run_texts(lambda: sand.Simulation(grain, [sand.Contact()], walls=[wall]), until="10 ns")
    mass, modulus = float(grain.mass[0]), BARE.young_modulus / (2 * (1 - BARE.poisson_ratio**2))
    clock, share = sim.regular_state.clock, impact_share(100.0, mass, 1e-6, modulus)
    assert clock[LARGEST_IMPACT] == pytest.approx(share, rel=1e-9, abs=0.0)
    assert clock[LARGEST_OVERLAP] == pytest.approx(impact_overlap(share), rel=0.02, abs=0.0)
    assert [text for text in found if text.startswith(OVERLAP)] and not any(text.startswith(IMPACT) for text in found)


@pytest.mark.compiled("contacts")
def test_a_grain_pressed_between_walls_is_warned_of():
    """Walls that approach by 0.18 and 0.22 r: overlaps of 0.09 and 0.11 r, each to 0.01 r of the swing at 2 m/s.

    The grain begins to move with the walls' mean velocity, and so hits both at 1 m/s: by Hertz δ = 0.0023 r.
    """
    walls = [
        sand.Wall([0, 0, 0], [0, 0, 1], BARE, velocity=[0, 0, 1.0]),
    ]
    walls.append(sand.Wall([0, 0, 2e-6], [0, 0, -1], BARE, velocity=[0, 0, -1.0]))
    for share, warned in ((0.09, False), (0.11, True)):
        grain = sand.Grains([[0, 0, 1e-6]], "1 um", BARE)
        found, sim = run_texts(
            lambda grain=grain: sand.Simulation(grain, [sand.Contact()], walls=walls), until=share * 1e-6
        )
        assert sim.regular_state.clock[LARGEST_OVERLAP] == pytest.approx(share, abs=0.01, rel=0.0)
        assert len(found) == warned and all(text.startswith(OVERLAP) for text in found)


def test_a_clock_of_an_earlier_version_goes_on():
    """A checkpoint without the extremes, as in tests/reference, is read: they begin at 0, times of events at its time.

    With events at 0 a collision that is resumed would count as at rest for all the time before.
    """
    sim = sand.Simulation(sand.Grains([[0, 0, 0]], "1 um", "silica"), [sand.Contact()])
    state = sim.regular_state
    saved = {name: array.copy() for name, array in state.to_arrays().items()}
    saved["clock"] = np.arange(1.0, LEAST_CLOCK + 1.0)
    state.from_arrays(saved)
    assert state.clock.tolist() == [*saved["clock"], *[0.0] * (CHANGED - LEAST_CLOCK), state.time, state.time]


# --- spins ---------------------------------------------------------------------------------------------------------


def test_stress_of_a_spinning_sphere():
    """ρω²r²/4 = ω² ∫ρ x dV/πr² over half of the sphere, summed over slices: exact; the warning is at a tenth of Y."""
    rho, r, w = 7874.0, 1e-8, 1e11
    force = w**2 * quad(lambda x: rho * x * math.pi * (r**2 - x**2), 0.0, r, epsabs=0.0)[0]
    assert spin_stress(rho, r, w) == pytest.approx(force / (math.pi * r**2), rel=1e-12, abs=0.0)
    limit = math.sqrt(4 * IDEAL_STRENGTH * 210e9 / rho) / r
    for factor, warned in ((0.999, False), (1.001, True)):
        grains = sand.Grains([[0, 0, 0], [1e-7, 0, 0]], r, "iron", spin=[[0, 0, 0], [0, factor * limit, 0]])
        found = [text for text in texts(grains, [sand.Contact()]) if text.startswith("grains spin too fast")]
        assert len(found) == warned
        assert not warned or ("grain 1 spins at 3.27e+11 rad/s" in found[0] and "21.04 GPa" in found[0]), found


def spun(number, spin, material="silica"):
    """A chain of touching grains along x that turns about z like a rigid body."""
    chain = sand.setup.aggregates.chain(number, radius="0.1 um", material=material)
    place = chain.position - chain.position.mean(0)
    return sand.Grains(
        place, chain.radius, material, velocity=np.cross([0, 0, spin], place), spin=np.tile([0, 0, spin], (number, 1))
    )


def test_pull_off_forces():
    """3πγR of JKR within 1e-4, 4πγR of DMT, 0 without adhesion."""
    pairing = sand.Contact().pairing(sand.SILICA, sand.SILICA)
    force = math.pi * 0.025 * 0.5e-7
    assert largest_pull(JKR, pairing, 1e-7, 1e-7) == pytest.approx(3 * force, rel=1e-4, abs=0.0)
    assert largest_pull(DMT, pairing, 1e-7, 1e-7) == pytest.approx(4 * force, rel=1e-12, abs=0.0)
    assert largest_pull(JKR, sand.Contact().pairing(BARE, BARE), 1e-7, 1e-7) == 0.0


@pytest.mark.parametrize("number", [2, 5, 8])
def test_a_cluster_that_spins_too_fast_is_named(number):
    """Chain of n at distance D: the half that begins at the middle contact pulls with ω² m Σ x; F_c = 3πγR holds it."""
    place = spun(number, 0.0).position[:, 0]
    pull = float(spun(1, 0.0).mass[0]) * place[place > 1e-12].sum()
    limit = math.sqrt(3 * math.pi * 0.025 * 0.5e-7 / pull)
    for factor, warned in ((0.999, False), (1.001, True)):
        grains = spun(number, factor * limit)
        pairs = np.stack([np.arange(number - 1), np.arange(1, number)], axis=1)
        found = torn_clusters(grains, sand.Contact(), pairs, OPEN)
        assert len(found) == warned
        assert not warned or f"{number} grains around grain 0 spin at" in found[0]
    assert torn_clusters(grains, sand.Contact(), pairs[:0], OPEN) == []


@pytest.mark.compiled("contacts")
def test_a_cluster_that_spins_too_fast_tears():
    """At 1.5 times the limit a dimer breaks and a start says so; at a third of it, neither."""
    limit = math.sqrt(3 * math.pi * 0.025 * 0.5e-7 / (float(spun(1, 0.0).mass[0]) * spun(2, 0.0).position[1, 0]))
    for factor in (1.5, 1 / 3):
        found, sim = run_texts(lambda f=factor: sand.Simulation(spun(2, f * limit), [sand.Contact()]), until="20 ns")
        assert any(text.startswith("a cluster spins too fast") for text in found) == (factor > 1)
        assert sim.ledger["broken"][-1] == (factor > 1)


# --- fields --------------------------------------------------------------------------------------------------------


def fields(charge, *forces):
    """The warning about fields of a grain of 10 nm with a charge [C]."""
    grains = sand.Grains([[0, 0, 0], [1e-7, 0, 0]], 1e-8, "iron", charge=[0.0, charge])
    return [text for text in texts(grains, forces) if text.startswith("the electric field at the surface")]


@pytest.mark.parametrize(
    ("sign", "limit", "emitted"), [(-1, ELECTRON_EMISSION, "electrons"), (1, ION_EMISSION, "ions")]
)
def test_fields_beyond_emission(sign, limit, emitted):
    """E = |q|/4πε₀r², and that of an electric field where both have one direction; just above and below the limit."""
    largest = sign * 4 * math.pi * epsilon_0 * 1e-16 * limit
    outer = sand.ElectricField([0, 0.6 * limit, 0.0])
    ramp = sand.ElectricField(sand.Ramp([[0, 0, 0], [0, 0, 0.6 * limit]], ["1 ns", "2 ns"]))
    for factor, warned in ((0.999, False), (1.001, True)):
        assert len(fields(factor * largest)) == warned
        if sign < 0:  # for a positive grain the outer field would free electrons first
            assert len(fields(0.4 * factor * largest, outer)) == warned
            assert len(fields(0.4 * factor * largest, ramp)) == warned  # the strongest of the ramp
    (text,) = fields(1.001 * largest)
    assert "at grain 1" in text and f"emits {emitted} above about {limit / 1e9:g} GV/m" in text


@pytest.mark.compiled("small")
@pytest.mark.filterwarnings("ignore:an electric field is switched on")
def test_charges_and_spins_that_change_are_warned_of_at_the_next_row():
    """Charges given by changes: one warning, though a later one has another number."""
    grains = sand.Grains([[0, 0, 0]], 1e-8, "iron")
    sim = sand.Simulation(grains, [sand.ElectricField("1 V/m")], row_every="1 ns", frame_every="10 ns")
    sim.run(until="1 ns")
    with pytest.warns(UserWarning, match="surface of grains is too strong") as caught:
        for k in (1, 2):
            with sim.change() as change:
                change.charge[:] = -k * 1e-16
            sim.run(until=2 * k * 1e-9)
    assert sum("too strong" in str(one.message) for one in caught) == 1
    assert set(grain_warnings(sim.grains, sim.forces)) == {"the electric field at the surface of grains is too strong"}


# --- settling and gas ------------------------------------------------------------------------------------------------


def test_settling_below_a_contact_period():
    """The longest period of two grains of the largest radius, that of rolling; for the normal one rebounds end, too.

    Periods by `contact_periods` are those of the frequencies k_n/m̄, 7k_s/2m̄, k_rR²/Ī, k_t/Ī of `sand.theory.contact`.
    """
    numbers = sand.theory.contact("silica", "0.5 um")
    mass = float(sand.Grains([[0, 0, 0]], 5e-7, "silica").mass[0])
    inertia = 0.4 * mass * 2.5e-13
    squares = {
        "normal": numbers.normal_stiffness * 2 / mass,
        "sliding": 7 * numbers.slide_stiffness / mass,
        "rolling": numbers.roll_stiffness * 2.5e-7**2 * 2 / inertia,
        "twisting": numbers.twist_stiffness * 2 / inertia,
    }
    pairing = sand.Contact().pairing(sand.SILICA, sand.SILICA)
    periods = contact_periods(JKR, pairing, 5e-7, 5e-7, mass, mass)
    for mode, square in squares.items():
        assert periods[mode] == pytest.approx(2 * math.pi / math.sqrt(square), rel=1e-9, abs=0.0)
    assert max(periods, key=periods.get) == "rolling"
    grains = sand.Grains([[0, 0, 0], [1e-5, 0, 0]], [1e-7, 5e-7], "silica")

    def found(time, **options):
        given = texts(grains, [sand.Contact(settling_time=time, **options)])
        return [text for text in given if "settling_time" in text]

    longest = periods["rolling"]
    assert found(1.001 * longest) == [] and len(found(0.999 * longest)) == 1
    (text,) = found(0.5 * periods["normal"])
    assert "period of rolling of two grains of radius 500 nm, 215.6 ns" in text and "hardly rebound" in text
    assert "hardly rebound" not in found(0.5 * longest)[0] and "use 2.156 us or more" in text
    assert found(0.999 * longest, roll_factor=0) == []  # no rolling: that of twisting, 167 ns
    assert len(found(sand.Ramp([longest * 2, longest / 2], ["1 ns", "2 ns"]))) == 1
    assert texts(sand.Grains([[0, 0, 0]], 1e-6, BARE), [sand.Contact(settling_time="1 ps")]) == []  # no springs


def test_a_dense_gas_without_a_cross_section():
    """λ = m/√2ρσ with σ = 2e-19 m² of H2: below one radius a warning; the density of λ = r is m/(√2 r σ)."""
    mass, radius = 2.34 * 1.66053906660e-27, 1e-6
    density = mass / (math.sqrt(2) * radius * 2e-19)
    grains = sand.Grains([[0, 0, 0]], radius, "silica")
    for factor, warned in ((0.999, False), (1.001, True)):
        found = [text for text in texts(grains, [sand.Gas("300 K", density=factor * density)]) if "free path" in text]
        assert len(found) == warned
    assert "999 nm (for a cross_section of 2e-19 m^2, that of H2; give that of the gas)" in found[0]
    known = sand.Gas("300 K", density=density / 9.9, cross_section="2e-19 m^2")
    (text,) = [text for text in texts(grains, [known]) if "free path" in text]
    assert "9.9 um, the largest radius" in text
