"""The table of `python -m benchmarks`: complete rows and correct verdicts. No time is limited here."""

import csv
import itertools

import numpy as np
import pytest

import sand

table = pytest.importorskip("benchmarks.table", reason="benchmarks are not beside the tests")
from benchmarks import decks, pieces, scaling, settling, steps, timing, worlds  # noqa: E402
from benchmarks.compare import median_interval  # noqa: E402


def test_a_row_passes_if_all_its_limits_are_met():
    """Target, ratio and fraction are judged together; a ratio without a peer is not judged."""
    pair = timing.Pair(2e-9, 10e-9, 5.0)
    good = table.row("x", pair, "ns", 2.5, scale=1e9, of="peer", ratio_asked=4.0, share=0.7, share_asked=0.65)
    assert tuple(good) == table.KEYS
    assert good["met"] is True
    assert (good["ours"], good["peer"], good["ratio"]) == pytest.approx((2.0, 10.0, 5.0), rel=1e-6, abs=0.0)
    assert table.row("x", pair, "ns", 1.5, scale=1e9)["met"] is False
    assert table.row("x", pair, "ns", ratio_asked=6.0)["met"] is False
    assert table.row("x", pair, "ns", share=0.5, share_asked=0.65)["met"] is False
    alone = table.row("x", 2.0, "ns", ratio_asked=6.0)
    assert (alone["met"], alone["peer"], alone["peer_name"]) == (None, None, "")
    assert "MISSED" in table.line(table.row("x", pair, "ns", 1.5, scale=1e9))
    assert "MISSED" not in table.line(alone)


def test_in_turns_takes_the_median_of_paired_ratios():
    """Rounds (1, 4), (2, 4), (4, 4): minima 1 and 4, ratios 4, 2, 1 with the median 2."""
    mine, other = itertools.cycle([1.0, 2.0, 4.0]), itertools.repeat(4.0)
    assert timing.in_turns(lambda: next(mine), lambda: next(other), 3) == (1.0, 4.0, 2.0)


@pytest.mark.compiled("contacts", "small")
@pytest.mark.parametrize(("kind", "contacts"), [("loose", 12), ("fcc", 36), ("gas", 0)])
def test_benchmark_systems_have_the_expected_contacts(kind, contacts):
    """BPCA: N − 1. A grain and its 12 neighbours: 24 more (edges of a cuboctahedron). A gas: none."""
    positions = worlds.PLACES[kind](13)
    apart = np.linalg.norm(positions[:, None] - positions[None], axis=2)[np.triu_indices(13, 1)]
    in_contact = int((apart < 2 * worlds.RADIUS).sum())
    assert in_contact == contacts
    sim = sand.Simulation(worlds.shaken(positions), [sand.Contact()])
    assert len(sim.contacts["pair"]) == in_contact


@pytest.mark.compiled("contacts", "small")
def test_clusters_side_by_side_do_not_touch():
    """25 grains in clusters of 10: 9 + 9 + 4 contacts."""
    sim = sand.Simulation(worlds.shaken(worlds.loose(25, whole=10)), [sand.Contact()])
    assert len(sim.contacts["pair"]) == 22


def test_lammps_input_of_a_grain():
    """Micro units: µm, pg/µm³ (the density of 2000 kg/m³ is 2), m/s."""
    grains = worlds.shaken(np.array([[0.0, 0, 0], [2e-6, 0, 0]]))
    lines = decks.data(grains).splitlines()
    first = lines[lines.index("Atoms # sphere") + 2].split()
    assert [float(word) for word in first] == pytest.approx([1, 1, 1.2, 2.0, -1.0, 0.0, 0.0], rel=1e-6, abs=0.0)
    speed = lines[lines.index("Velocities") + 2].split()[1:4]
    assert [float(word) for word in speed] == pytest.approx(grains.velocity[0].tolist(), rel=1e-6, abs=0.0)


def test_bytes_of_counts_every_array():
    """Arrays of grains, contacts, pairs and lists, at any nesting."""
    system = worlds.lattice(3).state
    parts = (system.grains.arrays, system.contacts, system.pair_list, system.long_range)
    parts += (system.bodies, *system.of_components.values())
    alone = (system.clock, system.count, system.lost, system.cutoff)
    assert pieces.bytes_of(system) == sum(a.nbytes for part in parts for a in part) + sum(a.nbytes for a in alone)


@pytest.mark.compiled("contacts")
def test_a_replay_takes_the_same_steps():
    """Each call ends in the same state, to the bit; a tenth of the steps is for warm-up."""
    sim = worlds.lattice(3)
    sim.run(steps=5)
    again = timing.replayed(sim, 10)
    ends = []
    for _ in range(2):
        assert again() > 0.0
        ends.append(sim.grains.position.copy())
    assert sim.state.steps == 5 + 2 + 10
    assert np.array_equal(*ends)


@pytest.mark.compiled("contacts", "small")
def test_scaling_skips_systems_that_do_not_fit_in_memory(monkeypatch):
    """The row says so in place of numbers."""
    monkeypatch.setattr(scaling, "available", lambda: 0.0)
    rows = list(scaling.rows(True))
    assert len(rows) == 11
    assert all("needs" in one["skipped"] for one in rows)


def test_coverage_of_the_interval_of_a_median():
    """The extremes of 7 rounds cover the median with 1 - 2/2^7 = 98.4 %, the 6th and 15th of 20 with 95.9 %.

    No interval of 5 rounds is wide enough.  Coverage is counted in 4000 sets of skewed numbers with median 1: standard
    error at most 0.35 %, tolerance four times that.
    """
    rng = np.random.default_rng(3)
    for rounds, expected in ((7, 0.984), (20, 0.959)):
        sets = np.exp(rng.exponential(size=(4000, rounds)) - np.log(2.0))
        inside = np.mean([low <= 1.0 <= high for _, low, high in map(median_interval, sets)])
        assert abs(inside - expected) < 4.0 * 0.0035
    assert median_interval([3.0, 1.0, 2.0, 9.0, 5.0]) == (3.0, -np.inf, np.inf)


@pytest.mark.compiled("contacts")
def test_bytes_per_step_of_a_contact():
    """Per contact: pair 8, pointers 48, twist 8, loads 72, flag 1, side 4 bytes; constants only if not uniform.

    A lattice of 3 x 3 x 3 grains has 54 contacts.
    """
    sim = worlds.lattice(3)
    per_grain = sum(a.nbytes for a in sim.state.grains.arrays) / 27
    constants = 0 if sim.state.uniform_contacts else 8 * sim.state.contacts.constants.shape[0]
    side = sim.state.contacts.side.nbytes / sim.state.contacts.side.size
    assert steps.touched_bytes(sim) == pytest.approx(54 * (137 + side + constants) + 27 * per_grain, rel=1e-6, abs=0.0)


@pytest.mark.parametrize("count", [16, 32])
def test_slowest_bending_of_a_chain_is_that_of_a_beam(count):
    """Free beam: Ω = 4.730² √(B/μ)/(n d)², B = k_r R² d, μ = m/d; γ = ζ Ω²/ω_r, ω_r of rolling.

    Sliding and the rotation of grains shorten the beam's frequency, and n grains are a beam of n d only to 1/n²: 2 %.
    """
    value, _ = settling.slowest_bending(count)
    numbers = sand.theory.contact("iron", 1e-8)
    mass, distance = sand.IRON.density * 4 / 3 * np.pi * 1e-24, 2e-8 - numbers.rest_overlap
    bending = numbers.roll_stiffness * numbers.reduced_radius**2
    expected = 4.73004**2 / count**2 / distance * np.sqrt(bending / mass)
    assert value.imag == pytest.approx(expected, rel=0.02, abs=0.0)
    assert -value.real == pytest.approx(0.2 * abs(value) ** 2 * numbers.roll_period / (2 * np.pi), rel=0.01, abs=0.0)


def test_the_table_of_decay_times_is_that_of_the_linear_modes():
    """docs/physics/settling.csv has the periods and decay times of the linear modes; simulations agree to 2 %."""
    with settling.TABLE.open(encoding="utf-8", newline="") as file:
        head, *rows = list(csv.reader(file))
    assert head == list(settling.COLUMNS) and [int(row[0]) for row in rows] == list(settling.LENGTHS)
    for row in rows:
        value, _ = settling.slowest_bending(int(row[0]))
        expected = 2e9 * np.pi / value.imag, -1e9 / value.real, -0.5e9 / value.real
        assert [float(text) for text in row[1:4]] == pytest.approx(expected, rel=5e-3, abs=0.0)
        assert float(row[4]) == pytest.approx(expected[2], rel=0.02, abs=0.0)


@pytest.mark.filterwarnings("ignore:contacts of iron")
@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("count", [4, 8])
def test_bending_of_a_damped_chain_decays_as_its_linear_mode(count):
    """Energy of a simulated chain that starts in its slowest mode: exp(−2γ t) of the eigenvalue −γ + iΩ, 1 %.

    Velocity Verlet changes Ω by (Ω dt)²/24 < 1e-4, hence γ ∝ Ω² by 2e-4; the energy falls twice a period, by ζ Ω/ω_r
    about a straight line, and the fit extends over whole periods.
    """
    value, shape = settling.slowest_bending(count)
    assert settling.simulated_decay(count, value, shape) == pytest.approx(-0.5 / value.real, rel=0.01, abs=0.0)
