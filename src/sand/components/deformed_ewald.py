"""Forces between distant grains in a box that is deformed: which there are, and the parameters of their Ewald sums.

While the box is deformed, the loops sum energies at constant α, r_c and integers n of the wave vectors, whose exact
derivatives are the virials (`forces.pair.ewald_loops`, `mesh_loops`).  Before ln L of a side has changed by more than
MOST_STRAIN, the parameters are chosen anew, for the same accuracy; the change of the energy is `lost_cutoff_changed`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np

from ..basics.arrays import CellArrays
from ..basics.box import box_of
from ..basics.state import CUTOFF_CHANGED
from ..engine.component import Setup
from ..engine.engine import Engine
from ..engine.measures import pair_energy
from ..engine.step_parameters import ForcesByType
from ..forces.base import Force
from ..forces.pair.dipoles import Dipoles
from ..forces.pair.ewald import EwaldChoice
from ..forces.pair.ewald_force import MOST_STRAIN, EwaldForce
from .deformation_stage import LARGEST_STRAIN


def problems_of_forces(setup: Setup) -> Iterator[str]:
    """Why forces between distant grains cannot be summed in a box that is deformed, a sentence each."""
    where = "in a box that is deformed"
    for force in setup.forces.long_range:
        if isinstance(force, EwaldForce) and force.uses_ewald(setup.grains, setup.box):
            continue
        if isinstance(force, Dipoles) and force.follows_clusters(setup.box):
            yield f"dipoles need periodic = 'ewald' or a cutoff in m {where}; an automatic one follows the clusters"
        elif force.sums(setup.box, False, setup.grains).virial is None:
            yield f"the loops of the force '{force.name}' give no virial, which is needed {where}; leave it out"
        elif force.choose(setup.grains, setup.box).radius is None:
            yield f"the force '{force.name}' needs a cutoff in m {where}"


def with_choices(forces: ForcesByType, setup: Setup) -> tuple[ForcesByType, float]:
    """The forces with parameters of Ewald sums for the box, or those of a checkpoint; the largest fixed cut-off [m]."""
    saved, lengths, largest, found = setup.saved.get("cell/ewald"), np.array(setup.box.lengths), 0.0, []
    for force in forces.long_range:
        if not isinstance(force, EwaldForce) or not force.uses_ewald(setup.grains, setup.box):
            largest = max(largest, force.choose(setup.grains, setup.box).radius or 0.0)
            found.append(force)
        elif saved is not None and saved[force.sources.order].any():
            found.append(force.with_choice(_choice_of(saved[force.sources.order])))
        else:
            found.append(force.for_moving_box(setup.grains, lengths))
    return forces._replace(long_range=found), largest


def store_choices(forces: Sequence[Force], rows: np.ndarray) -> None:
    """Store the parameters of Ewald sums in `CellArrays.ewald`."""
    for force in forces:
        if isinstance(force, EwaldForce) and force.chosen is not None:
            rows[force.sources.order] = *force.chosen[:8], *force.chosen.nodes, force.chosen.order


def _choice_of(row: np.ndarray) -> EwaldChoice:
    alpha, radius, largest, waves, degree, product, force, field, x, y, z, order = row.tolist()
    nodes = int(x), int(y), int(z)
    return EwaldChoice(alpha, radius, largest, int(waves), int(degree), product, force, field, nodes, int(order))


def use_choices(engine: Engine, cell: CellArrays, fixed: float) -> None:
    """Use the parameters of `cell`, and lists that reach as far; loads stay as they are.  `fixed` is a cut-off [m]."""
    grains, search, long_range, widest = engine.stored_state.grains, engine.parameters.search, [], fixed
    for force, sums, numbers in engine.long_range:
        if isinstance(force, EwaldForce) and force.chosen is not None:
            choice = _choice_of(cell.ewald[force.sources.order])
            force, widest = force.with_choice(choice), max(widest, choice.radius)
            numbers = force.numbers(grains, box_of(cell.chosen))
        long_range.append((force, sums, numbers))
    engine.set_forces(long_range, engine.external)
    contacts = 2.0 * float(grains.radius.max()) + engine.parameters.criteria.pair_gap
    engine.set_parameters(search=search._replace(reach=max(widest, contacts) + search.margin))
    engine.rebuild_list()


def follow_box(engine: Engine, cell: CellArrays, fixed: float, fastest: float) -> None:
    """Choose the parameters anew if sides may soon have changed by MOST_STRAIN, at rates up to `fastest` [1/s].

    They last for the time t = (MOST_STRAIN − ε − change)/fastest.  The step that passes t, of a strain x of at most
    LARGEST_STRAIN, changes ln L by up to ε = x + x² > −ln(1 − x).
    """
    state = engine.stored_state
    forces = [force for force, _, _ in engine.long_range]
    sums = [k for k, force in enumerate(forces) if isinstance(force, EwaldForce) and force.chosen is not None]
    if not sums or state.time < cell.lasts[0]:
        return
    change = float(np.abs(np.log(cell.span[:3] / cell.chosen)).max())
    lasting = MOST_STRAIN - LARGEST_STRAIN * (1.0 + LARGEST_STRAIN)
    if change > 0.5 * lasting:
        before, change = math.fsum(pair_energy(engine, k) for k in sums), 0.0
        cell.chosen[:] = cell.span[:3]
        ewald = [force for force in forces if isinstance(force, EwaldForce) and force.chosen is not None]
        store_choices([force.for_moving_box(state.grains, cell.chosen) for force in ewald], cell.ewald)
        use_choices(engine, cell, fixed)
        engine.sort_in_space()
        engine.stepper.sum_loads(engine)
        state.lost[CUTOFF_CHANGED] += before - math.fsum(pair_energy(engine, k) for k in sums)
    cell.lasts[0] = state.time + max(lasting - change, 0.0) / fastest if fastest > 0.0 else math.inf
