"""Sequential collisions: an aggregate collides with a copy of itself, and what grows from it does so again."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any

import numpy as np

from ..basics.arguments import checked
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.settings import Whole
from ..basics.units import seed_given, whole_number
from ..config.sections import Section
from ..forces.base import Force
from ..integrate.integrator import Integrator
from ..setup.checks import largest_cluster
from ..simulation.simulation import Simulation
from .collision import Ending, approach, prepare, run_to_end
from .collision_case import CollisionCase
from .collision_outcome import Collision

MOST_COLLISIONS = 20
"""Largest number of collisions; each doubles the number of grains."""


@checked
def collide_in_sequence(
    body: Grains,
    collisions: int,
    *,
    speed: Any,
    impact_parameter: Any = 0.0,
    seed: int = 1,
    forces: Sequence[Force] | None = None,
    stepping: Integrator | None = None,
    ending: Ending | None = None,
    observers: Sequence[Any] = (),
) -> list[Collision]:
    """Simulate collisions of an aggregate with a copy of itself, each in random orientations.

    The largest body that one collision leaves is the aggregate of the next one, at rest: its contacts are kept; their
    sliding, rolling and twisting displacements, spins and vibrations are not.

    Parameters
    ----------
    body : Grains
        The first aggregate, such as a single grain. Grains that overlap are in contact.
    collisions : int
        Number of collisions, 1 … 20; if all stick, the last one leaves N 2^collisions grains.
    speed, impact_parameter : float or str
        Of each collision, see `sand.setup.encounter`.
    seed : int, optional
        Seed of the orientations.
    forces, stepping, observers : optional
        As for `collision.collide`.
    ending : Ending or None, optional
        When each collision ends; `Ending()` by default.

    Returns
    -------
    list of Collision
        Outcomes, in order.

    Raises
    ------
    BadInput
        As `collision.collide`.
    """
    number = whole_number(collisions, "collisions", most=MOST_COLLISIONS)
    pair, outcomes = np.zeros((0, 2), np.int64), []
    for each in np.random.SeedSequence(seed_given(seed)).generate_state(number).tolist():
        start = approach(body, body, speed=speed, impact_parameter=impact_parameter, along="x", seed=each)
        both = np.concatenate([pair, pair + len(body)])
        none = np.zeros((len(both), 3))
        bonds = StrainedContacts(both, none, none, none[:, 0])
        simulation = prepare(start, forces, stepping, contacts=bonds, observers=observers)
        outcomes.append(run_to_end(start, simulation, ending or Ending()))
        body, pair = _largest_at_rest(simulation)
    return outcomes


def _largest_at_rest(simulation: Simulation) -> tuple[Grains, np.ndarray]:
    """The largest body of a simulation, at rest, and its contacts (C, 2)."""
    grains, pair = simulation.grains, np.asarray(simulation.contacts["pair"], np.int64)
    chosen = largest_cluster(pair, len(grains))
    number = np.full(len(grains), -1)
    number[chosen] = np.arange(len(chosen))
    body = grains[chosen]
    body.arrays.velocity[...] = 0.0
    body.arrays.spin[...] = 0.0
    found = number[pair]
    return body, found[(found >= 0).all(axis=1)]


class SequenceSection(Section):
    """Section [sequence]: the target collides with a copy of itself, and so does what grows from it."""

    collisions: Annotated[int, Whole(1, MOST_COLLISIONS)]
    """Number of collisions; each doubles the number of grains, if the bodies stick."""


class SequenceCase(CollisionCase):
    """Case file of sequential collisions: that of a collision, with [sequence] in place of [projectile]."""

    projectile: None = None  # type: ignore[assignment]
    sequence: SequenceSection

    def body(self, seed: int) -> Grains:
        """The first aggregate.  Raises BadInput."""
        return self.target.build(self.materials_by_name(), seed)

    def collide(self, seed: int, observers: Sequence[Any] = ()) -> list[Collision]:
        """Simulate the collisions.  Raises BadInput."""
        forces, stepping = self.physics()
        impact = self.impact
        return collide_in_sequence(
            self.body(seed),
            self.sequence.collisions,
            speed=impact.speed,
            impact_parameter=impact.impact_parameter,
            seed=seed,
            forces=forces,
            stepping=stepping,
            ending=self.ending(),
            observers=observers,
        )
