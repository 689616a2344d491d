"""From objects to the numbers the compiled driver takes."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..core.box import Box
from ..core.constants import MAGNETIC
from ..core.errors import BadInput
from ..core.grains import Grains
from ..core.material import SILICA
from ..core.world import CONTACT_STEP, GRAIN1, GRAIN2, MADE, STAGE, STEPS, World, contact_arrays, near_pairs
from ..forces.base import Force, GrainForce, compose
from ..forces.contact import Contact
from ..forces.dipoles import Dipoles
from ..kernels.dipoles import OFF
from ..kernels.outside import energy_sum_for, is_ours
from ..physics.adhesion import rest_overlap, rest_radius
from ..physics.contact import Bond
from ..physics.dipole import Cutoff
from ..stepping.advance import ContactRules, DipoleRules, Rules, Stop, driver_for
from ..stepping.control import IMPACT_PART, Control
from ..stepping.verlet import Verlet

SPREAD = 8
"""Columns for contacts and near pairs per grain to begin with; they grow when needed."""
IDLE = 1e5
"""Longest step in sound-crossing times of a grain, for worlds in which nothing happens."""
MOST_OVERLAP = (2.0, 1e-3)
"""Overlaps at the start may reach 2 δ0 or 1e-3 radii, whichever is more."""


@dataclass
class Engine:
    """A world and the compiled code that moves it.

    Attributes:
        world: the state.
        rules: everything that does not change, as the kernels take it.
        warnings: what the forces had to say about these grains.
    """

    world: World
    rules: Rules
    warnings: list[str]
    _advance: Callable
    _outside: Sequence[GrainForce]

    def advance(self, until: float, most_steps: int) -> Stop:
        """Up to `most_steps` steps, or to the first at or after `until` [s]; arrays grow as needed."""
        w = self.world
        last = w.steps + most_steps
        while True:
            stop = Stop(
                self._advance(
                    w.grains.arrays,
                    w.contacts,
                    w.near,
                    w.clock,
                    w.count,
                    w.lost,
                    self.rules,
                    float(until),
                    last - w.steps,
                )
            )
            if stop is Stop.CONTACTS_FULL:
                w.grow_contacts()
            elif stop is Stop.PAIRS_FULL:
                w.grow_pairs()
            else:
                return stop

    def begin(self) -> None:
        """Contacts of grains that touch at the start, nothing booked, and the first loads."""
        w = self.world
        w.count[STAGE] = 1
        w.clock[CONTACT_STEP] = math.inf
        self.advance(-math.inf, 1)
        w.count[STEPS] = w.count[MADE] = 0
        w.lost[:] = 0.0
        w.contacts.lost[:] = 0.0

    def outside_energies(self) -> dict[str, float]:
        """Energy [J] of each per-grain force by name."""
        w = self.world
        return {
            force.name: energy_sum_for(force.formula)(w.grains.arrays, w.time, force.numbers())
            for force in self._outside
        }

    def culprits(self) -> tuple[int, ...]:
        """The grains that the last stop was about."""
        return tuple(sorted({int(self.world.count[g]) for g in (GRAIN1, GRAIN2)} - {-1}))


def build_engine(grains: Grains, forces: Sequence[Force], box: Box, stepping: Verlet, *, fresh: bool = True) -> Engine:
    """Check that everything fits together and translate it.

    Args:
        fresh: a new start, whose overlaps are looked at; a restart may be in the middle of an impact.

    Raises:
        BadInput: every problem at once.
    """
    problems: list[str] = []
    warnings: list[str] = []
    _refuse_doubles(forces)
    for force in forces:
        try:
            warnings += force.check(grains, box)
        except BadInput as error:
            problems += error.problems
    contact = next((f for f in forces if isinstance(f, Contact)), None)
    dipoles = next((f for f in forces if isinstance(f, Dipoles)), None)
    outside = [f for f in forces if isinstance(f, GrainForce)]
    reach = float(grains.radius.min())
    least = 2.0 * (2.0 * float(grains.radius.max()) + reach)
    if box.shortest < least:
        problems.append(
            f"box = {box.describe()} is too small: its shortest side must be at least {least:.3g} m, "
            "or a grain would meet two images of its neighbour"
        )
    if problems:
        raise BadInput(problems)
    world = World(
        grains.copy(),
        box,
        contact_arrays(len(grains), SPREAD * len(grains), len(Bond._fields)),
        near_pairs(len(grains), SPREAD * len(grains)),
    )
    world.grains.arrays.position[...] = box.wrap(grains.position).T
    composed, numbers = compose(outside)
    rules = Rules(
        box.span,
        _contact_rules(contact, grains, stepping),
        _dipole_rules(dipoles, grains, box),
        numbers,
        Control(
            fixed=0.0 if stepping.step == "auto" else stepping.step,
            reach=reach,
            energy_scale=dipoles.energy_scale(grains) if dipoles else 0.0,
            accuracy=stepping.accuracy,
            outer_field=math.fsum(f.flux_density_size() for f in outside),
            impact=IMPACT_PART / stepping.steps_per_period,
            longest=IDLE * min(sound_crossing(grains, number) for number in range(len(grains.materials))),
        ),
    )
    engine = Engine(
        world, rules, warnings, driver_for(composed, all(is_ours(force.formula) for force in outside)), outside
    )
    if contact is not None and fresh:
        _refuse_overlaps(engine, contact)
    return engine


def sound_crossing(grains: Grains, number: int) -> float:
    """r √(ρ/E) [s] of the smallest grain of one material."""
    material = grains.materials[number]
    radius = float(grains.radius[grains.material == number].min())
    return radius * math.sqrt(material.density / material.young_modulus)


def _refuse_doubles(forces: Sequence[Force]) -> None:
    names = [getattr(force, "name", None) for force in forces]
    problems = [
        f"forces: {force!r} is not a force; give sand.Contact(), sand.Dipoles(), …"
        for force, name in zip(forces, names, strict=True)
        if not isinstance(name, str) or not isinstance(force, Force)
    ]
    doubles = sorted({str(n) for n in names if n is not None and names.count(n) > 1})
    problems += [f"forces: '{name}' is given more than once; keep one" for name in doubles]
    if problems:
        raise BadInput(problems)


def _contact_rules(contact: Contact | None, grains: Grains, stepping: Verlet) -> ContactRules:
    law = contact or Contact()
    # without a Contact nothing ever touches, and materials may lack what contacts need
    pairings = law.pairings(grains.materials if contact else (SILICA,) * len(grains.materials))
    return ContactRules(
        on=contact is not None,
        pairings=pairings,
        release=law.beyond == "release",
        follow=law.stiffness == "dt97",
        damped=law.damping != "none",
        per_period=stepping.steps_per_period,
    )


def _dipole_rules(dipoles: Dipoles | None, grains: Grains, box: Box) -> DipoleRules:
    way, cutoff = dipoles.way(grains, box) if dipoles else (OFF, Cutoff(math.inf, 0.0))
    return DipoleRules(way, MAGNETIC, cutoff)


def _refuse_overlaps(engine: Engine, contact: Contact) -> None:
    """Raises BadInput naming the grains (first ten pairs) that overlap by too much at the start."""
    import numpy as np
    from scipy.spatial import cKDTree

    grains, box = engine.world.grains, engine.world.box
    position, radius = grains.position, grains.radius
    lengths = np.array([v if v is not None else 0.0 for v in box.lengths])
    shifted = np.where(lengths > 0.0, np.mod(position + 0.5 * lengths, np.where(lengths > 0.0, lengths, 1.0)), position)
    tree = cKDTree(shifted, boxsize=lengths)
    pairs = tree.query_pairs(2.0 * float(radius.max()), output_type="ndarray")
    overlap = grains.overlaps(pairs, box)
    table = contact.pairings(grains.materials)
    problems = []
    for (i, j), delta in zip(pairs[overlap > 0.0], overlap[overlap > 0.0], strict=True):
        reduced = radius[i] * radius[j] / (radius[i] + radius[j])
        gamma, modulus = table[:2, grains.material[i], grains.material[j]]
        rest = rest_overlap(rest_radius(gamma, reduced, modulus), reduced)
        limit = max(MOST_OVERLAP[0] * rest, MOST_OVERLAP[1] * min(radius[i], radius[j]))
        if delta > limit:
            problems.append(
                f"grains {i} and {j} overlap by {delta:.3g} m at the start; at most {limit:.3g} m may be: "
                "move them apart"
            )
    if len(problems) > 10:
        problems[10:] = [f"… and {len(problems) - 10} more overlapping pairs"]
    if problems:
        raise BadInput(problems)
