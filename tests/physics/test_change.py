"""Changes by the user between two runs: `Simulation.change`."""

import re

import numpy as np
import pytest

import sand
from sand.basics.errors import BadInput
from sand.basics.state import CONTACTS
from sand.engine import assemble

from .setups import struck_chain

pytestmark = pytest.mark.filterwarnings(
    "ignore:charges. the cut-off, .* ends an interaction", "ignore:dipoles. the cut-off, .* ends an interaction"
)


def warm_gas(damped=True, **options):
    """Magnetic grains in a field, damped with thermal noise or undamped; contacts form within some nanoseconds."""
    grains = sand.setup.gas(
        20, "0.25 um", radius="10 nm", material="iron", moment="200 A m^2/kg", temperature="100 K", seed=11
    )
    bath = {"damping": "critical", "damping_ratio": 0.2, "bath_temperature": "100 K"} if damped else {}
    contact = sand.Contact(**bath)
    forces = [contact, sand.Dipoles(cutoff="90 nm"), sand.Field("10 mT")]
    return sand.Simulation(grains, forces, box="0.25 um", seed=4, frame_every="1 ns", **options)


def kick_and_switch_off(sim):
    with sim.change() as change:
        change.velocity += [3.0, 0.0, 0.0]
        change.moment[:5] *= 0.5
        change.replace(sand.Field("0 T"))


@pytest.mark.compiled("dipoles")
def test_the_work_of_the_user_is_booked():
    """Δp = M Δv and ΔK = ½M(v_cm + Δv)² − ½M v_cm²; the total of energies and losses stays, and the run goes on.

    All grains get the same Δv: the change of ½Σmv² is Δv·P + ½MΔv².  Sums of 20 terms round by 1e-15 of the largest.
    """
    sim = warm_gas()
    sim.run(until="8.3 ns")
    assert sim.state.count[CONTACTS] > 0 and sim.regular_state.time < sim.time
    before, mass, positions = sim._log_row(), sim.grains.mass.sum(), sim.grains.position.copy()
    kick_and_switch_off(sim)
    after = sim._log_row()
    assert sim.time == 8.3e-9 and (sim.grains.position == positions).all()
    assert after["momentum_x"] - before["momentum_x"] == pytest.approx(3.0 * mass, rel=1e-12, abs=0.0)
    gained = 3.0 * before["momentum_x"] + 4.5 * mass
    assert after["translation"] - before["translation"] == pytest.approx(gained, rel=1e-12, abs=0.0)
    assert after["field"] == 0.0 != before["field"] and after["magnetic"] != before["magnetic"]
    largest = max(abs(before[name]) for name in ("normal", "magnetic", "translation", "lost_forming"))
    assert after["total"] == pytest.approx(before["total"], abs=1e-14 * largest)
    works = before["lost_outside"] - after["lost_outside"]
    energies = ("translation", "rotation", "normal", "sliding", "rolling", "twisting", "magnetic", "field")
    assert works == pytest.approx(sum(after[name] - before[name] for name in energies), rel=1e-9, abs=0.0)
    assert sim.run(until="20 ns").drift < 1e-3


@pytest.mark.compiled("dipoles")
def test_a_changed_run_is_resumed_bit_for_bit(tmp_path):
    """A run that is changed, stopped and resumed has the bits of one that goes on in memory; nothing changes twice."""
    whole, stopped = warm_gas(), warm_gas(out=tmp_path / "run")
    for sim in (whole, stopped):
        sim.run(until="8.3 ns")
        kick_and_switch_off(sim)
        sim.run(until="11 ns")
    whole.run(until="14 ns")
    again = sand.resume(tmp_path / "run")
    again.run(until="14 ns")
    assert again.forces[-1].parameters() == sand.Field("0 T").parameters()
    arrays = [sim.regular_state.to_arrays() for sim in (whole, again)]
    assert [name for name in arrays[0] if arrays[0][name].tobytes() != arrays[1][name].tobytes()] == []
    assert whole.ledger.rows == again.ledger.rows


@pytest.mark.compiled("dipoles")
def test_an_empty_change_changes_no_quantity():
    """Positions, velocities and energies stay the same bits, loads but for rounding; the next step is chosen anew.

    Without damping, whose forces follow from the velocities in the middle of a step.
    """
    sim = warm_gas(damped=False)
    sim.run(until="8.3 ns")
    before, loads = sim._log_row(), sim.loads()
    with sim.change():
        pass
    after = sim._log_row()
    assert {name for name in before if before[name] != after[name]} <= {"lost_outside", "total"}
    assert after["total"] == pytest.approx(before["total"], rel=1e-14, abs=0.0)
    for name in ("force", "torque", "field"):
        assert np.allclose(sim.loads()[name], loads[name], rtol=1e-9, atol=1e-12 * np.abs(loads[name]).max())


WRONG = {
    "change.velocity[0] = np.nan": "velocity of grain 0 is .*: numbers must be finite",
    "change.spin = [1.0, 2.0]": r"spin has shape \(2,\) but must be \(20, 3\)",
    "change.velocity[2] = 4e8": "velocity of grain 2 is 6.9.*must be below that of light",
    "change.mass = 3": "a change has no 'mass'",
    "change.replace(sand.Charges())": "the simulation has no 'charges'",
    "change.forces = ()": "the contact model cannot change",
    "change.forces = (*change.forces, sand.Gravity([0, 0, 1]))": "the ledger of this run has no column for gravity",
    "change.replace(sand.Contact())": "the contact model cannot change",
}


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("wrong", WRONG)
def test_wrong_changes_leave_the_simulation_as_it_is(wrong):
    """One line each; grains and forces stay, and an exception in the block cancels the change."""
    sim = warm_gas()
    velocity, forces = sim.grains.velocity.copy(), sim.forces
    with pytest.raises(BadInput, match=WRONG[wrong]), sim.change() as change:
        change.velocity[1] = 1.0
        exec(wrong, {"change": change, "sand": sand, "np": np})
    assert (sim.grains.velocity == velocity).all() and sim.forces == forces


def touching(gap=0.0):
    """Two clusters, of three and two touching silica grains in a row, and a single grain, in a box of 0.4 µm."""
    x = np.array([0.0, 19.99e-9, 39.98e-9, 100e-9, 119.99e-9, 160e-9])
    grains = sand.Grains(np.stack([x - 90e-9, 0 * x, 0 * x], axis=1), "10 nm", "silica", charge=2e-18)
    return sand.Simulation(grains, [sand.Contact(damping="critical"), sand.Charges(cutoff="120 nm")], box="0.4 um")


@pytest.mark.compiled("listed")
def test_contacts_of_grains_that_stay_keep_their_state():
    """Pointers, twist and losses of the contacts 0-1, 1-2, 3-4 without grain 2 are those of the first and the third.

    The energy of what was removed is in `lost_outside`: total after − total before = 0 to rounding, and the masses,
    charges and velocities of the others stay the same bits, as do identities.
    """
    sim = touching()
    sim.run(steps=200)
    state, before = sim.regular_state.copy(), sim._log_row()
    assert np.sort(state.contacts.pair[:, :3].T).tolist() == [[0, 1], [1, 2], [3, 4]]
    with sim.change() as change:
        change.remove(2)
        assert change.id.tolist() == [0, 1, 3, 4, 5] and change.velocity.shape == (5, 3)
    now, after = sim.regular_state, sim._log_row()
    assert np.sort(now.contacts.pair[:, :2].T).tolist() == [[0, 1], [2, 3]] and now.count[CONTACTS] == 2
    for name in ("pointer1", "pointer2", "twist", "formed", "lost"):
        old, new = getattr(state.contacts, name), getattr(now.contacts, name)
        assert (old[..., [0, 2]] == new[..., :2]).all(), name
    rows = [0, 1, 3, 4, 5]
    for name in ("position", "velocity", "spin", "orientation", "charge", "mass", "radius"):
        assert (getattr(state.grains, name)[rows] == getattr(now.grains, name)).all(), name
    energies = ("translation", "rotation", "normal", "sliding", "rolling", "twisting", "coulomb")
    work = sum(after[name] - before[name] for name in energies)
    assert work != 0.0 and after["lost_outside"] - before["lost_outside"] == pytest.approx(-work, rel=1e-9, abs=0.0)
    assert after["total"] == pytest.approx(before["total"], rel=1e-12, abs=0.0)
    assert after["made"] == before["made"] and after["broken"] == before["broken"]
    assert sim.run(steps=200).drift < 5e-3  # 1e-3 without a change


@pytest.mark.compiled("listed")
def test_a_changed_set_moves_as_a_new_simulation_of_it():
    """Grains removed and added before the first step: loads and energies are those of a simulation of the same grains.

    The sums have the same terms in the same order; the tolerance allows for the rounding of sums over grains.
    """
    whole, sim = touching(), touching()
    more = sand.Grains([[-0.13e-6, 0, 0], [0.05e-6, 0.05e-6, 0]], "10 nm", "silica", velocity=[0, 1, 0], charge=1e-18)
    with sim.change() as change:
        change.remove([0, 5])
        change.add(more)
        change.velocity[:] += [0.0, 0.0, 0.5]
    assert sim.grains.id.tolist() == [1, 2, 3, 4, 6, 7]
    grains = sim.grains
    given = {name: getattr(grains, name) for name in ("velocity", "charge")}
    new = sand.Simulation(sand.Grains(grains.position, grains.radius, "silica", **given), whole.forces, box=whole.box)
    ours, theirs = sim.loads(), new.loads()
    scale = np.abs(theirs["force"]).max()
    assert scale > 0.0 and np.allclose(ours["force"], theirs["force"], rtol=1e-9, atol=1e-12 * scale)
    for name, energy in theirs["energy"].items():
        assert ours["energy"][name] == pytest.approx(energy, rel=1e-9, abs=1e-30), name
    assert (sim.grains.velocity[-1] == [0.0, 1.0, 0.5]).all()


@pytest.mark.compiled("listed")
def test_added_grains_that_touch_have_initial_contacts():
    """A grain that touches another is in contact at once, without a loss: lost_forming and the count stay."""
    sim = touching()
    sim.run(steps=100)
    before = sim._log_row()
    place = sim.grains.position[5] + [0.0, sim.grains.radius[5] + 8e-9 - 1e-12, 0.0]
    with sim.change() as change:
        change.add(sand.Grains([place], "8 nm", "iron"))
    after = sim._log_row()
    assert after["contacts"] == before["contacts"] + 1 and sim.contacts["pair"][-1].tolist() in ([5, 6], [6, 5])
    for name in ("made", "lost_forming", "total"):
        assert after[name] == pytest.approx(before[name], rel=1e-12, abs=0.0)
    assert [m.name for m in sim.grains.materials] == ["silica", "iron"]
    assert sim.run(steps=200).drift < 5e-3


@pytest.mark.compiled("listed")
def test_the_box_and_its_scale():
    """Positions stay in a larger box; scaled, the centre of each cluster moves by (f − 1) R and its shape stays.

    The energy of charges with a cut-off changes, and its change is booked.
    """
    sim = touching()
    sim.run(steps=50)
    position, total = sim.grains.position.copy(), sim._log_row()["total"]
    with sim.change() as change:
        change.box = "0.5 um"
    assert (sim.grains.position == position).all() and sim.box.lengths == (0.5e-6,) * 3
    with sim.change() as change:
        change.scale_box(0.9)
    moved = sim.grains.position - position
    for cluster in ([0, 1, 2], [3, 4], [5]):
        centre = position[cluster].mean(axis=0)
        assert np.allclose(moved[cluster], -0.1 * centre, rtol=0, atol=1e-20)
    assert sim.box.lengths[0] == pytest.approx(0.45e-6, rel=1e-15, abs=0.0) and sim.state.box == sim.box
    assert sim._log_row()["total"] == pytest.approx(total, rel=1e-12, abs=0.0)
    assert sim.run(steps=50).drift < 5e-3


@pytest.mark.compiled("listed")
def test_a_force_left_out_and_given_again():
    """Without charges their column is 0 and its energy is booked; the force can come back, and a gas be added."""
    sim = touching()
    sim.run(steps=50)
    before = sim._log_row()
    with sim.change() as change:
        charges, change.forces = change.forces[1], change.forces[:1]
    without = sim._log_row()
    assert without["coulomb"] == 0.0 != before["coulomb"]
    assert without["lost_outside"] == pytest.approx(before["coulomb"], rel=1e-9, abs=0.0)
    sim.run(steps=50)
    with sim.change() as change:
        change.forces = (*change.forces, charges, sand.Gas(temperature="100 K", pressure="1 mbar"))
    assert sim._log_row()["coulomb"] != 0.0
    assert sim.run(steps=50).drift < 5e-3


MISTAKES = {
    "change.remove([3, 25, -1])": ["remove: there is no grain 25; there are 6, 0 to 5"],
    "change.remove([True, False])": [r"remove: array of shape \(2,\), but there are 6 grains"],
    "change.remove([0.5])": ["remove: .* must be whole numbers"],
    "change.remove(range(6))": ["remove: all 6 grains would be removed"],
    "change.remove(9); change.add(3)": ["remove: there is no grain 9", "add: 3 must be sand.Grains"],
    "change.add(sand.Grains([[-80e-9, 0, 0]], '10 nm', 'silica'))": [
        "grains 0 and 6 overlap by 1e-08 m after the change, in whose numbers 6 to 6 are those added",
        "grains 1 and 6 overlap",
    ],
    "change.add(sand.Grains([[0, 0, 3e-7]], '10 nm', 'silica')); change.charge[0] = np.nan": [
        "charge of grain 0",
        "grain 6 lies outside the box",
    ],
    "change.velocity = np.zeros((6, 2)); change.remove(0)": [r"velocity has shape \(5, 2\) but must be \(5, 3\)"],
    "change.box = '0.12 um'": ["grain 0 and 2 more lies outside the box"],
    "change.scale_box(-1)": ["factor of scale_box"],
    "change.scale_box(0.1)": ["box = .* is too small|overlap|outside"],
}


@pytest.mark.compiled("listed")
@pytest.mark.parametrize("wrong", MISTAKES)
def test_every_mistake_has_a_line_and_nothing_is_changed(wrong):
    """All mistakes at once, one line each."""
    sim = touching()
    before = {name: array.tobytes() for name, array in sim.state.to_arrays().items()}
    with pytest.raises(BadInput) as caught, sim.change() as change:
        exec(wrong, {"change": change, "sand": sand, "np": np})
    assert len(caught.value.problems) >= len(MISTAKES[wrong])
    for pattern in MISTAKES[wrong]:
        assert re.search(pattern, str(caught.value)), str(caught.value)
    assert sim.box.lengths == (0.4e-6,) * 3 and len(sim.grains) == 6 == sim._system.next_id
    assert (sim.grains.id == np.arange(6)).all()
    assert len(before) == len(sim.state.to_arrays())


@pytest.mark.compiled("listed")
def test_a_box_that_cuts_a_contact_is_refused():
    """Two grains that touch across the boundary at x = ±0.2 µm are apart in a box of 0.5 µm."""
    grains = sand.Grains([[-0.19e-6, 0, 0], [0.19e-6, 0, 0], [0, 0, 0]], "10 nm", "silica", charge=1e-18)
    sim = sand.Simulation(grains, [sand.Contact(damping="critical"), sand.Charges(cutoff="120 nm")], box="0.4 um")
    with pytest.raises(BadInput, match="would be cut by the boundary of the new box"), sim.change() as change:
        change.box = "0.5 um"
    with sim.change() as change:
        change.scale_box(1.25)
    assert sim.state.count[CONTACTS] == 1
    gap = sim.grains.overlaps(np.array([[0, 1]]), sim.box)[0]
    assert gap == pytest.approx(grains.overlaps(np.array([[0, 1]]), sand.Box.periodic(0.4e-6))[0], abs=1e-21)


@pytest.mark.compiled("dipoles")
def test_charges_sum_all_images_after_a_change_to_a_periodic_box(monkeypatch):
    """From an open box and from a slab: forces are those of a new simulation, bit by bit; a slab is warned of.

    The loops are those of many grains, which tests of the sums compile, too.
    """
    monkeypatch.setattr(assemble, "WIDE_FROM", 1)
    grains = sand.setup.gas(8, None, extent=1e-6, radius=1e-8, material="silica", temperature="300 K", seed=1)
    charge = 8e-19 * np.where(np.arange(8) % 2, 1.0, -1.0)
    given = {"velocity": grains.velocity, "charge": charge}
    grains, slab = sand.Grains(grains.position, 1e-8, "silica", **given), sand.Box.periodic(1.2e-6, 1.2e-6, None)
    whole = sand.Simulation(grains, [sand.Contact(), sand.Charges()], box=1.2e-6).loads()
    for before in (sand.Box.open(), slab):
        sim = sand.Simulation(grains, [sand.Contact(), sand.Charges()], box=before)
        with sim.change() as change:
            change.box = 1.2e-6
        assert (sim.loads()["force"] == whole["force"]).all() and np.abs(whole["force"]).max() > 0.0
        with sim.change() as change:
            change.box = slab
        assert any("ends an interaction that is not small" in text for text in sim.warnings)


@pytest.mark.compiled("contacts")
def test_a_copy_made_within_a_change_runs():
    """The copy has the state before the change, and no open change: it can run, which the original cannot yet."""
    setup = struck_chain()
    sim = sand.Simulation(setup.grains, setup.forces)
    sim.run(steps=5)
    with sim.change() as change:
        change.velocity[0] = 0.0
        other = sim.copy()
        assert other.run(steps=5).steps == 10
        with pytest.raises(sand.BadInput, match="end the block first"):
            sim.run(steps=5)
    assert (sim.grains.velocity[0] == 0.0).all() and sim.steps == 5
