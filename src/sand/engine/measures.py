"""Energies, losses, loads and motion of bodies that are measured in the state of an engine."""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import Any

import numpy as np

from ..analysis.body_motion import BodyMotion
from ..basics.arrays import cluster_arrays
from ..basics.errors import BadInput
from ..basics.state import CONTACTS, State
from ..contact.damping import THERMAL
from ..contact.measure import BODY_ROWS, ENERGIES, contacts_stage, energies_stage, measure_bodies
from ..forces.base import ExternalForce
from ..forces.external_loops import external_energies_for
from ..forces.pair.ewald_force import EwaldForce
from ..forces.pair.long_range_loops import long_range_energies_for, long_range_virial_for
from ..integrate.force_stages import SUM, WHOLE, pair_force_stages, run_rounds
from ..integrate.hooks import Hook
from ..integrate.respa import clear_long_range_loads
from ..integrate.stage_list import hooks_of, variant_of
from ..integrate.stages import NO_STEP
from .compiled_state import CompiledState


def measuring_stages(engine: CompiledState) -> list[tuple[Any, Any]]:
    """The stages of all measurements, with their parameters."""
    shares, time = np.zeros(len(engine.stored_state.grains)), engine.stored_state.time
    stages: list[tuple[Any, Any]] = [(measure_bodies, (np.zeros((BODY_ROWS, 1)), cluster_arrays(1)))]
    if engine.parameters.settings.on:
        stages.append((energies_stage(engine.law), (np.zeros(len(ENERGIES)),)))
        stages.append((contacts_stage(engine.law), (np.zeros((1, 1)),)))
    stages += [(long_range_energies_for(sums), (numbers, shares)) for _, sums, numbers in engine.long_range]
    return stages + [(external_energies_for(f.formula), (f.numbers(), time, shares)) for f in engine.external]


def force_columns(engine: CompiledState) -> list[str]:
    """Columns of the forces in the ledger."""
    return [*(force.column for force, _, _ in engine.long_range), *(force.name for force in engine.external)]


def energies_at_grains(engine: CompiledState, names: Collection[str] | None = None) -> dict[str, np.ndarray]:
    """Energy [J] of each grain (N,) by column: half of each pair energy, and the energies of per-grain forces.

    Of all forces, or of those with these names; in arrays that the next call uses again.
    """
    state = engine.state
    shares = engine.memory_for("shares", lambda n: {name: np.zeros(n) for name in force_columns(engine)})
    for share in shares.values():
        share[:] = 0.0
    for k, (force, _, _) in enumerate(engine.long_range):
        if names is None or force.name in names:
            _add_energies(engine, state, k, shares[force.column])
    for outer in engine.external:
        if names is None or outer.name in names:
            numbers = outer.numbers(), state.time, shares[outer.name]
            external_energies_for(outer.formula).run(engine.table_of(state), numbers)
    return shares


def force_energies(engine: CompiledState) -> dict[str, float]:
    """Total energy [J] of each long-range and per-grain force, by ledger column."""
    return {name: math.fsum(share.tolist()) for name, share in energies_at_grains(engine).items()}


def _add_energies(engine: CompiledState, state: State, k: int, shares: np.ndarray) -> None:
    """Add the energies [J] of long-range force k to those of the grains."""
    table, (_, sums, numbers) = engine.table_of(state), engine.long_range[k]
    if sums.energies_need_rounds:
        run_rounds(sums, engine.content.wide, table, numbers)
    long_range_energies_for(sums).run(table, (numbers, shares))


def external_energy(engine: CompiledState, outer: ExternalForce, time: float) -> float:
    """Energy [J] of a per-grain force on the grains of the regular state, at a time [s]."""
    state = engine.stored_state
    shares = np.zeros(len(state.grains))
    external_energies_for(outer.formula).run(engine.table_of(state), (outer.numbers(), time, shares))
    return math.fsum(shares)


def pair_energy(engine: CompiledState, k: int) -> float:
    """Energy [J] of long-range force k in the regular state."""
    shares = np.zeros(len(engine.stored_state.grains))
    _add_energies(engine, engine.stored_state, k, shares)
    return math.fsum(shares)


def refuse_forces_without_virial(engine: CompiledState) -> None:
    """Raise BadInput if the virial of a long-range force cannot be computed."""
    without = [force.name for force, sums, _ in engine.long_range if sums.virial is None]
    if without:
        raise BadInput(
            f"stress: the loops of {without[0]} (a tree, or loops of your own) give no stress; sum all pairs instead, "
            "such as with open = 'pairs', or leave stress out"
        )


def pair_virials(engine: CompiledState) -> dict[str, np.ndarray]:
    """Virial (3, 3) [J] of each long-range force by ledger column, W_ab = Σ r_a F_b of all pairs and images.

    Energies of Ewald sums are homogeneous, of degree −3 for dipoles and −1 for charges, if α follows the size of the
    box: the trace is set to 3U or U, which are more accurate than a derivative at constant α.
    """
    refuse_forces_without_virial(engine)
    state, found = engine.state, {}
    table, arrays = engine.table_of(state), state.grains.arrays
    for k, (force, sums, numbers) in enumerate(engine.long_range):
        out, shares = np.zeros(9), np.zeros(len(state.grains))
        long_range_virial_for(sums).run(table, (numbers, out))
        virial = out.reshape(3, 3)
        if isinstance(force, EwaldForce) and sums.reciprocal_virial is not None:
            run_rounds(sums, engine.content.wide, table, numbers)
            virial = virial + sums.reciprocal_virial(arrays, table["span"], numbers)
            _add_energies(engine, state, k, shares)
            trace = (2 * force.sources.order + 1) * math.fsum(shares.tolist())
            virial = virial + (trace - virial.trace()) / 3.0 * np.eye(3)
        found[force.column] = virial
    return found


def pair_loads(engine: CompiledState, k: int) -> np.ndarray:
    """Forces and torques (2, 3, N) of long-range force k, in the stored order; those of the state stay as they are."""
    state, (_, sums, numbers) = engine.stored_state, engine.long_range[k]
    own = state.long_range
    kept = own.force.copy(), own.torque.copy()
    clear_long_range_loads(own)
    pair_force_stages(sums, engine.content.wide)[SUM].run(engine.table_of(state), numbers, WHOLE)
    found = np.array([own.force, own.torque])
    own.force[...], own.torque[...] = kept
    return found


def contact_energies(engine: CompiledState) -> list[float]:
    """Energies [J] stored by the contacts, see `contact.measure.ENERGIES`."""
    state, results = engine.state, engine.memory_for("contacts", lambda _: (np.zeros(len(ENERGIES)),))
    results[0][:] = 0.0
    if state.count[CONTACTS]:
        energies_stage(engine.law).run(engine.table_of(state), results)
    for stage, _ in engine.content.of_components.get(Hook.ENERGIES, ()):
        stage.run(engine.table_of(state), results)
    return list(results[0].tolist())


def losses(engine: CompiledState) -> np.ndarray:
    """Losses [J] up to the time of `state`, in the order of `basics.state.LOST`.

    With a bath they include the work in the half kick at the end of the last step (`contact.bath_work`).
    """
    state = engine.state
    if variant_of(engine.parameters.settings) != THERMAL:
        return state.lost
    kept = [(array, array.copy()) for array in state.sums()]
    record_bath_work(engine, state)
    found = state.lost.copy()
    for array, values in kept:
        array[...] = values
    return found


def record_bath_work(engine: CompiledState, state: State) -> None:
    """Record the work of the bath in the half kick at the end of the last step, if no step follows it."""
    if variant_of(engine.parameters.settings) != THERMAL:
        return
    with engine.heavy_grains(state):
        for stage, numbers in hooks_of(engine.content, engine.parameters)[Hook.BATH_WORK]:
            stage.run(engine.table_of(state), numbers, NO_STEP)


def body_motion(engine: CompiledState) -> BodyMotion:
    """Motion of each body, as `analysis.body_motion` has it."""
    results = engine.memory_for("bodies", lambda n: (np.zeros((BODY_ROWS, n)), cluster_arrays(n)))
    bodies = measure_bodies.run(engine.table_of(engine.state), results)
    found = results[0][:, :bodies].copy()
    return BodyMotion(found[0].astype(np.int64), *found[1:])
