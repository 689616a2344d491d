"""Forces between distant grains in a box that is deformed: energies, virials, the work of the boundaries, restarts."""

import itertools
import math

import numpy as np
import pytest

import sand
from sand import components
from sand.components import deformation
from sand.forces.pair.ewald_force import MOST_STRAIN
from sand.io.checkpoint import newest_checkpoint

GROWING = ["4e6 1/s", "-3e6 1/s", "1e6 1/s"]
SHRINKING = ["-4e6 1/s"] * 3
SUMS = {
    "dipoles direct": sand.Dipoles(periodic="ewald", reciprocal="direct", accuracy=1e-6),
    "dipoles in vacuum": sand.Dipoles(periodic="ewald", reciprocal="direct", accuracy=1e-6, boundary="vacuum"),
    "dipoles mesh": sand.Dipoles(periodic="ewald", reciprocal="mesh", accuracy=1e-6),
    "charges direct": sand.Charges(reciprocal="direct", accuracy=1e-6),
    "charges mesh": sand.Charges(reciprocal="mesh", accuracy=1e-6),
}
pytestmark = [
    pytest.mark.compiled("deformation", "dipoles"),
    pytest.mark.filterwarnings("ignore:charges. the net", "ignore:screened_charges"),
]


def grains_in(side, number=3):
    """Grains near a lattice in a cube, with moments in random directions and charges of both signs, not neutral."""
    rng, n = np.random.default_rng(2), number**3
    grid = (np.stack(np.meshgrid(*[np.arange(float(number))] * 3, indexing="ij"), -1).reshape(-1, 3) + 0.5) / number
    position = (grid - 0.5) * side + rng.uniform(-0.03, 0.03, (n, 3)) * side / number
    charge = np.where(np.arange(n) % 2, 1.0, -1.0) * 3e-19
    return sand.Grains(position, "10 nm", "iron", moment=rng.normal(size=(n, 3)) * 3e-18, charge=charge)


def moving(force, rates, **options):
    """A gas of 27 such grains in a cube of 0.4 µm that is deformed."""
    return sand.Simulation(
        grains_in(0.4e-6), [force], box="0.4 um", deformation=sand.Deformation(rates), row_every="10 ns", **options
    )


def at_rest(sim, force, box=None):
    """The same grains in a box that keeps its shape."""
    now = sand.Grains(sim.grains.position, "10 nm", "iron", moment=sim.grains.moment, charge=sim.grains.charge)
    return sand.Simulation(now, [force], box=box or sim.box)


@pytest.mark.validates("self-consistency", "The energy balance closes with Ewald sums in a box that is deformed")
@pytest.mark.parametrize("rates", [SHRINKING, GROWING], ids=["shrinking", "growing"])
@pytest.mark.parametrize("name", ["dipoles direct"])
def test_ewald_sums_follow_the_box(name, rates, record_bound):
    """A gas in a cube that shrinks by 27 %, or whose sides change by +27, −16 and +6 %, in 60 ns.

    At the end, energy and virial are those of a new Ewald sum in the present box, to the accuracy of both, 1e-6 of the
    typical loads; the virial of the loops, of which the work is made, is the tensor of `sim.stress()`, computed by
    other code.  The ledger closes to errors of the steps, as the work −Σ A_a W_aa of each axis is that of the energy
    which is summed; without a new choice of parameters the errors of growing boxes would exceed the accuracy.
    """
    _follows_the_box(name, rates, record_bound)


def _follows_the_box(name, rates, record_bound):
    force = SUMS[name]
    sim = moving(force, rates)
    sim.run(until="60 ns")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert abs(last[force.column] - first[force.column]) > 0.02 * abs(first[force.column])
    other = at_rest(sim, force)
    fresh, tensor = other.loads()["energy"][force.column], other.stress().parts[force.column] * sim.box.volume
    assert last[force.column] == pytest.approx(fresh, abs=1e-6 * np.abs(fresh))
    assert sim.stress().parts[force.column] * sim.box.volume == pytest.approx(tensor, abs=1e-6 * np.abs(tensor).max())
    summed, size = sim.state.cell.far_virial, np.abs(np.diag(tensor)).max()
    # the diagonal of the other code has the exact trace 3U or U, that of the loops is the derivative of what they sum
    assert summed == pytest.approx(np.diag(tensor), abs=3e-5 * size)
    work = sum(abs(last[f"work_{axis}"]) for axis in "xyz")
    record_bound(f"{name}, {rates[1]}: ledger over the work", abs(last["total"] - first["total"]) / work, most=1e-4)
    chosen = sim.state.cell.chosen
    assert np.abs(np.log(np.array(sim.box.lengths) / chosen)).max() <= MOST_STRAIN
    assert 0.0 < abs(last["lost_cutoff_changed"]) < 1e-4 * work


@pytest.mark.validates(
    "self-consistency",
    "The energy balance closes with Ewald sums of dipoles and charges, direct and by meshes, in a box that is deformed",
)
@pytest.mark.validate
@pytest.mark.parametrize("rates", [SHRINKING, GROWING], ids=["shrinking", "growing"])
@pytest.mark.parametrize("name", ["dipoles in vacuum", "dipoles mesh", "charges direct", "charges mesh"])
def test_other_ewald_sums_follow_the_box(name, rates, record_bound):
    """As above."""
    _follows_the_box(name, rates, record_bound)


STEPS_OF_BOX = {
    "automatic steps": (["-4e8 1/s", "1e8 1/s", "-1e8 1/s"], "exponential", "auto"),
    "fixed steps": ("-1e8 1/s", "exponential", "10 ps"),
    "fixed steps, linear law": ("-8e7 1/s", "linear", "10 ps"),
    "linear law": ("-2e8 1/s", "linear", "auto"),
}


@pytest.mark.parametrize("name", STEPS_OF_BOX)
def test_the_sides_never_change_by_more_than_an_ewald_sum_allows(name, monkeypatch):
    """|ln L/L₀| ≤ MOST_STRAIN when the parameters are chosen anew, for steps that strain the box by up to 1e-3.

    A side that follows a constant rate or length per time has its largest change just before it is looked at.  At a
    rate of −4e8 1/s automatic steps are bounded by their strain; with the linear law that of a fixed step grows.
    """
    rates, law, step = STEPS_OF_BOX[name]
    changes, follow = [], deformation.follow_box

    def watched(engine, cell, fixed, fastest):
        changes.append(np.abs(np.log(cell.span[:3] / cell.chosen)).max())
        follow(engine, cell, fixed, fastest)

    monkeypatch.setattr(deformation, "follow_box", watched)
    sim = sand.Simulation(
        grains_in(0.4e-6), [SUMS["dipoles direct"]], box="0.4 um", deformation=sand.Deformation(rates, law=law),
        stepping=sand.Verlet(step=step),
    )  # fmt: skip
    for _ in range(14):
        sim.run(steps=15)
    lengths = np.array(sim.box.lengths)
    assert np.abs(np.log(lengths / 0.4e-6)).max() > 20.0 * MOST_STRAIN
    assert 0.2 * MOST_STRAIN < max(changes) <= MOST_STRAIN


@pytest.mark.parametrize("name", ["dipoles direct", "charges mesh"])
def test_the_virial_of_the_loops_is_the_derivative_of_the_energy(name):
    """W_aa = −∂U/∂ε_a at fixed fractions of the box, by energies of new Ewald sums in boxes strained by ±2e-4.

    All sums have an accuracy of 1e-6, and errors that change by 1e-6 of U at most between the boxes: 1e-6 |U|/4e-4 in
    W, 2.5e-3 |U| at most; they are far smaller, as both have nearly the same parameters.
    """
    force = SUMS[name]
    sim = moving(force, GROWING)
    sim.run(until="10 ns")
    summed, lengths = sim.state.cell.far_virial, np.array(sim.box.lengths)
    for a in range(3):
        energies = []
        for strain in (-2e-4, 2e-4):
            factor = np.where(np.arange(3) == a, 1.0 + strain, 1.0)
            strained = sand.Grains(
                sim.grains.position * factor, "10 nm", "iron", moment=sim.grains.moment, charge=sim.grains.charge
            )
            box = sand.Box.periodic(*(lengths * factor))
            energies.append(sand.Simulation(strained, [force], box=box).loads()["energy"][force.column])
        found = (energies[0] - energies[1]) / 4e-4
        assert summed[a] == pytest.approx(found, abs=1e-4 * np.abs(summed).max())


@pytest.mark.validates("self-consistency", "The energy balance of screened charges in a box that grows closes")
def test_a_cutoff_of_charges_in_a_plasma_stays_as_it_is(record_bound):
    """Screened charges with a cut-off of 0.15 µm: the ledger closes, and the run ends at twice the cut-off.

    The error is that of steps: 2e-5, 5e-6 and 1e-6 of the work after 70 ns in steps of 0.2, 0.1 and 0.05 ns.
    """
    force = sand.ScreenedCharges("0.05 um", cutoff="0.15 um")
    sim = moving(force, SHRINKING, stepping=sand.Verlet(step="0.1 ns"))
    sim.run(until="70 ns")
    first, last = sim.ledger.rows[0], sim.ledger.rows[-1]
    assert abs(last["yukawa"]) > 1.5 * abs(first["yukawa"])
    error = abs(last["total"] - first["total"]) / abs(last["lost_box"])
    record_bound("screened charges: ledger over the work", error, most=1e-4)
    assert last["yukawa"] == pytest.approx(at_rest(sim, force).loads()["energy"]["yukawa"], rel=1e-12, abs=0.0)
    assert sim.run(until="100 ns").outcome is sand.Outcome.BOX_TOO_SMALL
    assert 0.3e-6 <= sim.box.lengths[0] <= 0.3e-6 / (1.0 - 1e-3)


def test_interruptions_change_no_bit_of_an_ewald_sum(tmp_path):
    """The parameters are chosen at the same steps, and are the same, with frequent output and after a restart."""
    force = SUMS["dipoles direct"]
    one, often, first = (
        moving(force, GROWING, **more)
        for more in ({}, {"frame_every": "0.31 ns"}, {"out": tmp_path / "run", "frame_every": "7 ns"})
    )
    for sim in (one, often):
        sim.run(steps=900)
    first.run(until="31.234567 ns")
    other, again = first.copy(), None
    again = moving(force, GROWING, restart=newest_checkpoint(tmp_path / "run", components.groups()))
    for sim in (other, again):
        sim.run(steps=900 - sim.steps)
    states = [sim.regular_state.to_arrays() for sim in (one, often, other, again)]
    assert one.ledger["lost_cutoff_changed"][-1] != 0.0 and one.state.cell.chosen[0] != 0.4e-6
    for name, each in itertools.product(states[0], states[1:]):
        assert each[name].tobytes() == states[0][name].tobytes(), name


@pytest.mark.validate
@pytest.mark.parametrize("force", [sand.Charges(reciprocal="mesh"), sand.Dipoles(periodic="ewald", reciprocal="mesh")])
def test_threads_change_no_bit_of_an_ewald_sum(force):
    """1000 grains, whose sums are divided into blocks, at unequal rates: the same bits with 1 and 2 threads."""
    ends = []
    for threads in (1, 2):
        sand.set_threads(threads)
        law = sand.Deformation(GROWING)
        sim = sand.Simulation(grains_in(1.4e-6, 10), [force], box="1.4 um", deformation=law)
        sim.run(steps=60)
        ends.append({name: array.tobytes() for name, array in sim.regular_state.to_arrays().items()})
    sand.set_threads(None)
    assert ends[0] == ends[1]


def test_a_mean_pressure_begins_with_the_first_one():
    """A gas of free grains at its own pressure 2K/3V: rates that follow this pressure over a long time stay near 0.

    With the running mean 0 at the start, the box would shrink at the largest rate at first.  K and V change by less
    than the strain, 1e-6, so that the excess is of that order.
    """
    rng = np.random.default_rng(5)
    grains = sand.Grains(rng.uniform(-1e-6, 1e-6, (30, 3)), "0.1 um", "ice", velocity=rng.normal(size=(30, 3)))
    pressure = float((grains.mass * (grains.velocity**2).sum(axis=1)).sum()) / 3.0 / 4e-6**3
    law = sand.Deformation("1e6 1/s", law="pressure", pressure=pressure, time="1 us")
    sim = sand.Simulation(grains, [], box="4 um", deformation=law)
    sim.run(until="50 ns")
    assert math.log(sim.box.lengths[0] / 4e-6) == pytest.approx(0.0, abs=1e-6)


def test_what_has_no_cutoff_is_refused():
    """One line each, which says what to do."""
    grains, where = grains_in(0.4e-6), "in a box that is deformed"
    law = sand.Deformation("-1e4 1/s")
    for force, line in (
        (sand.Dipoles(), f"dipoles need periodic = 'ewald' or a cutoff in m {where}; an automatic one follows the"),
        (sand.Attraction(cutoff=None), f"the force 'attraction' needs a cutoff in m {where}"),
    ):
        with pytest.raises(sand.BadInput) as caught:
            sand.Simulation(grains, [force], box="0.4 um", deformation=law)
        assert caught.value.problems[0].startswith(f"deformation: {line}") and len(caught.value.problems) == 1
