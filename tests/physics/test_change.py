"""Changes by the user between two runs: `Simulation.change`."""

import numpy as np
import pytest

import sand
from sand.errors import BadInput
from sand.state.state import CONTACTS


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
    assert after["momentum_x"] - before["momentum_x"] == pytest.approx(3.0 * mass, rel=1e-12)
    gained = 3.0 * before["momentum_x"] + 4.5 * mass
    assert after["translation"] - before["translation"] == pytest.approx(gained, rel=1e-12)
    assert after["field"] == 0.0 != before["field"] and after["magnetic"] != before["magnetic"]
    largest = max(abs(before[name]) for name in ("normal", "magnetic", "translation", "lost_forming"))
    assert after["total"] == pytest.approx(before["total"], abs=1e-14 * largest)
    works = before["lost_outside"] - after["lost_outside"]
    energies = ("translation", "rotation", "normal", "sliding", "rolling", "twisting", "magnetic", "field")
    assert works == pytest.approx(sum(after[name] - before[name] for name in energies), rel=1e-9)
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
    assert after["total"] == pytest.approx(before["total"], rel=1e-14)
    for name in ("force", "torque", "field"):
        assert np.allclose(sim.loads()[name], loads[name], rtol=1e-9, atol=1e-12 * np.abs(loads[name]).max())


WRONG = {
    "change.velocity[0] = np.nan": "velocity of grain 0 is .*: numbers must be finite",
    "change.spin = [1.0, 2.0]": r"spin has shape \(2,\) but must be \(20, 3\)",
    "change.velocity[2] = 4e8": "velocity of grain 2 is 6.9.*must be below that of light",
    "change.mass = 3": "a change has no 'mass'",
    "change.replace(sand.Charges())": "the simulation has no 'charges'",
    "change.forces = ()": "a change keeps the kinds of forces, contact, dipoles, field",
    "change.replace(sand.Contact())": "the contact model cannot change",
    "change.moment[:] = 0": "dipoles would act on no grain",
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
