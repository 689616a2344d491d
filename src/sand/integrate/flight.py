"""What the integrators of grains without contacts share: checks of their settings, and the end of a step."""

from __future__ import annotations

import math
from typing import Any, ClassVar

from ..basics.state import CHECKED, CYCLE, FLIGHT, LEFT, OUTSIDE, STAGE, STEP, STEP_INCREASES, STEPS, TIME
from ..basics.units import is_word, si
from ..compiler.jit import caller
from ..errors import BadInput, shown
from ..neighbours.skin import invalidate_skins, invalidate_speeds
from .force_calls import sum_external
from .force_stages import ENERGY, WRAPPING
from .motion import wrap_all
from .step_control import INCREASE_INTERVAL
from .verlet import Verlet


class FlightSettings:
    """Base class of the settings of an integrator that acts while there are no contacts.

    Subclasses are frozen dataclasses with the fields of `UNITS` and `contact_stepping: Verlet`.
    """

    contact_stepping: Verlet
    name: ClassVar[str]
    UNITS: ClassVar[dict[str, str]]
    """Numbers and their units; the first is below 1, the others may be "auto"."""

    def __post_init__(self) -> None:
        problems: list[str] = []
        for rank, (key, unit) in enumerate(self.UNITS.items()):
            if rank > 0 and is_word(getattr(self, key), "auto"):
                continue
            below = 1.0 if rank == 0 else math.inf
            try:
                value = si(getattr(self, key), unit, f"stepping: {key}", above=0.0, below=below)
                object.__setattr__(self, key, value)
            except BadInput as error:
                problems.extend(error.problems)
        if not isinstance(self.contact_stepping, Verlet):
            problems.append(f"stepping: contact_stepping = {shown(self.contact_stepping)}; give sand.Verlet(…)")
        if problems:
            raise BadInput(problems)

    def parameters(self) -> dict[str, Any]:
        """Settings in SI units, as in a case file."""
        contact_stepping = {k: v for k, v in self.contact_stepping.parameters().items() if k != "method"}
        own = {key: getattr(self, key) for key in self.UNITS}
        return {"method": self.name, **own, "contact_stepping": contact_stepping}


@caller
def finish_flight_step(s, dt, in_contact, before, work):
    """Advance the time by dt [s], log the work of external forces, wrap positions, count the step.

    `before` is the energy of the time-dependent external forces at the start of the step, `work` what they did on the
    grains in it [J]. A step that ends at a contact (`in_contact`) is counted after the second half of a Verlet step of
    0 s, which forms the contact with new lists, new loads and a new choice of the step.
    """
    invalidate_speeds(s.pair_list)
    invalidate_skins(s.pair_list)
    s.clock[TIME] += dt
    if s.external_work.time_dependent:
        s.lost[OUTSIDE] -= sum_external(s, s.clock[TIME], ENERGY) - before + work
    if s.external_work.position_dependent:
        s.lost[OUTSIDE] -= sum_external(s, s.clock[TIME], WRAPPING)
    wrap_all(s.grains, s.span)
    s.clock[STEP] = s.clock[CYCLE] = s.clock[LEFT] = 0.0
    if in_contact:
        s.pair_list.anchor[0, 0] = math.inf
        s.clock[FLIGHT] = 0.0
        s.count[CHECKED] = s.count[STEP_INCREASES] = s.count[STEPS] - INCREASE_INTERVAL
        s.count[STAGE] = 1
    else:
        s.clock[STEP] = dt
        s.count[STEPS] += 1
