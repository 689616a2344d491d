"""Contact phase of encounters in open space: a few grains from just before a touch until their clusters are at rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..analysis.ledger_columns import LOSSES
from ..basics.box import Box
from ..basics.errors import BadInput
from ..basics.grains import GrainArrays, Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.state import BROKEN, MADE, SLIPPED
from ..components import components_of
from ..contact.measure import ENERGIES
from ..contact.model import Contact
from ..engine.assemble import build_engine, fitting_forces
from ..engine.engine import Engine
from ..engine.few_grains import FewGrains, measured_clusters
from ..engine.measures import contact_energies, force_columns
from ..forces.base import Force
from ..integrate.parts import Stop
from ..integrate.verlet import Verlet
from ..neighbours.search import Neighbours
from .contact_table import ContactTable
from .ledger import INTERNAL, KINETIC, Ledger

AT_REST = 0.01
"""Energy of vibration and tangential strain of a cluster at rest, in units of ½ k q_c², the smallest elastic energy at
which a contact slips."""
PERIODS = 10.0
"""Time for which the vibration alone must have been low otherwise, in longest periods of the contacts; for clusters of
n more than ten grains n²/10 of these (as of rigid clusters): rings may keep strain."""
CHECK_EVERY, PER_GRAIN = 250, 8
"""Steps between two checks, the larger of the two for n grains."""
APART = 0.05
"""Gap, in smallest radii, from which two clusters are apart, and fly on as rigid bodies."""
LONGEST = 1e5
"""Longest time of a contact phase, in periods of a contact."""


class Settled(NamedTuple):
    """State at the end of a contact phase, and its energies."""

    grains: GrainArrays  # with velocities and spins
    contacts: StrainedContacts
    label: np.ndarray  # (n,) cluster of each grain, from 0
    made: int  # contacts that formed, slipped and broke
    slipped: int
    broken: int
    time: float  # [s]
    steps: int
    energies: dict[str, float]  # changes [J]: `CHANGES`


CHANGES = ("kinetic", "contacts", "distant", *LOSSES)
"""Changes of energies [J] over a contact phase: of motion, as rigid bodies; stored in contacts; of forces at a
distance; and losses by channel. `lost_quieting` is the vibration that is left, which rigid bodies do not have. The sum
is 0 but for errors of the integration."""
SLOWEST = 1e-6
"""Longest period [s] of a contact of which `LONGEST` is a multiple; it holds where nothing touches."""


class ContactPhase:
    """Computes contact phases with the forces of a simulation: all pairs of grains, in open space.

    Parameters
    ----------
    grains : Grains
        Grains of all kinds that occur.
    forces : sequence of Force
        A `Contact` with damping, and forces at a distance without cut-off.
    """

    def __init__(self, grains: Grains, forces: Sequence[Force]):
        own = fitting_forces(tuple(forces), Verlet())
        box, kinds = Box.open(), _apart(grains)
        extra = components_of({}, own, kinds, box)
        search = Neighbours("all pairs", order="as given")
        prototype = build_engine(kinds, own, box, Verlet(), search, 0, extra)
        contact = next(force for force in own if isinstance(force, Contact))
        self.engines = FewGrains(prototype, contact)

    def run(self, grains: GrainArrays, contacts: StrainedContacts) -> Settled:
        """Contact steps until all clusters are at rest, or apart.

        Raises
        ------
        BadInput
            If the steps fail, or nothing comes to rest.
        """
        engine = self.engines.fill(grains, contacts)
        ledger, state = Ledger(force_columns(engine)), engine.regular_state
        before = ledger.row_of(engine)
        every, smallest = max(CHECK_EVERY, PER_GRAIN * len(state.grains)), float(grains.radius.min())
        counts, since, quiet, period = (0, 0, 0), 0.0, 0, math.inf
        while True:
            stop = engine.advance(math.inf, every)
            if stop is not Stop.NONE:
                raise BadInput(
                    f"the contact phase of an encounter stopped after {state.time:.3g} s: {stop.name.lower()}"
                )
            label, vibration, limit, longest = _clusters(engine)
            now = int(state.count[MADE]), int(state.count[SLIPPED]), int(state.count[BROKEN])
            strain = sum(contact_energies(engine)[1:])
            if now != counts or vibration > AT_REST * limit:
                since = state.time
            quiet = quiet + 1 if now == counts and vibration + strain < AT_REST * limit else 0
            counts, period = now, min(period, longest or math.inf)  # 0: nothing is in contact now
            wait = longest * max(PERIODS, len(state.grains) ** 2 / 10.0)
            if label.any():
                if _smallest_gap(state.grains, label) > APART * smallest:
                    break
            elif quiet == 2 or state.time - since > wait:
                break
            if state.time > LONGEST * min(period, SLOWEST):
                raise BadInput(
                    f"an encounter has not come to rest after {state.time:.3g} s; give sand.Contact a damping"
                )
        after = ledger.row_of(engine)
        return Settled(
            GrainArrays(*map(np.copy, state.grains.arrays))._replace(id=grains.id),
            _strained(engine),
            label,
            *counts,
            state.time,
            state.steps,
            _changes(before, after, force_columns(engine)),
        )


def _apart(grains: Grains) -> Grains:
    """One grain of each kind, at least two, on a line, apart from each other."""
    arrays = grains.arrays
    kinds = np.vstack(
        [arrays.radius, arrays.mass, arrays.material, arrays.charge, np.linalg.norm(arrays.moment, axis=0)]
    )
    first = np.unique(kinds, axis=1, return_index=True)[1]
    chosen = grains[first if len(first) > 1 else np.array([0, 0])]
    position = np.zeros((3, len(chosen)))
    position[0] = 3.0 * float(grains.radius.max()) * np.arange(len(chosen))
    return chosen.with_arrays(chosen.arrays._replace(position=position))


def _clusters(engine: Engine) -> tuple[np.ndarray, float, float, float]:
    """Cluster of each grain, largest vibration, smallest ½ k q_c² [J], and longest period [s]."""
    measures = measured_clusters(engine)
    first, label = np.unique(measures.first.astype(np.int64), return_inverse=True)
    joined = first[measures.size[first] > 1.0]
    if not joined.size:
        return label, 0.0, math.inf, 0.0
    return (
        label,
        float(measures.vibration[joined].max()),
        float(measures.limit[joined].min()),
        float(measures.period[joined].max()),
    )


def _smallest_gap(grains: Grains, label: np.ndarray) -> float:
    """Smallest gap [m] of grains of different clusters."""
    x, radius = grains.position, grains.radius
    apart = np.linalg.norm(x[:, None] - x[None], axis=2) - radius[:, None] - radius[None]
    return float(apart[label[:, None] != label[None]].min())


def _strained(engine: Engine) -> StrainedContacts:
    """The contacts of the state with their displacements."""
    table = ContactTable(engine.state, engine.law, engine.table_of(engine.state))
    pair = table["pair"].astype(np.int64)
    return StrainedContacts(pair, table["slide_vector"], table["roll_vector"], table["twist"])


def _changes(before: dict[str, float], after: dict[str, float], forces: Sequence[str]) -> dict[str, float]:
    """`CHANGES` of the rows of the ledger at both ends."""

    def change(*names: str) -> float:
        return math.fsum(after[name] - before[name] for name in names)

    found = {"kinetic": change(*KINETIC) - after[INTERNAL], "contacts": change(*ENERGIES), "distant": change(*forces)}
    found |= {name: change(name) for name in LOSSES}
    return found | {"lost_quieting": found["lost_quieting"] + after[INTERNAL]}
