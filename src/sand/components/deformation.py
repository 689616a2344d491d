"""A periodic box that is deformed, with velocities of grains relative to its flow: `sand.Deformation`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Set
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np

from ..basics.arguments import checked
from ..basics.arrays import CellArrays
from ..basics.box import Box, MovingSpan, TiltedSpan, box_of, least_side
from ..basics.errors import BadInput, shown
from ..basics.ramps import force_at, forces_at_points, rampable, ramps_of
from ..basics.settings import RAMP, For, Number, Reading, Settings, Word
from ..basics.state import BODIES, CELL, CONTACTS, TILT, TIME, State
from ..basics.units import si
from ..basics.vectors import components, three
from ..contact.law import ContactLaw
from ..engine.component import Component, Setup
from ..engine.engine import Engine
from ..engine.step_parameters import ForcesByType
from ..forces.pair.ewald_force import MOST_STRAIN
from ..integrate.hooks import HookStages
from ..integrate.parts import ContactParameters
from .deformation_stage import (
    EXPONENTIAL,
    LARGEST_STRAIN,
    LAWS,
    LINEAR,
    PRESSURE,
    RATE,
    SHEAR,
    DeformationNumbers,
    deformation_stages,
    stages_of_part,
)
from .deformed_bodies import stages_with_bodies
from .deformed_ewald import follow_box, problems_of_forces, store_choices, use_choices, with_choices

AXES = "xyz"
OF_SHEAR = ("tilt", "shear", "work_shear", "mean_shear_stress")
OF_BOX = (
    *("box_x", "box_y", "box_z", "filling", "work_x", "work_y", "work_z"),
    *("mean_pressure_x", "mean_pressure_y", "mean_pressure_z", *OF_SHEAR),
)
"""Columns of the ledger; the last ones are those of a box that is sheared."""
LEAST_STRAIN = 1e-9
"""Least strain of an axis between two rows for a mean of the pressure."""
REFUSED = {
    "walls": "walls",
    "driven": "driven grains",
}
"""Components that do not work in a box that is deformed, and what sentences call them."""


def _rates(value: Any, name: str) -> tuple[float, ...]:
    """One rate [1/s] along all axes, or three."""
    return three(value, "1/s", name) if components(value) is not None else (si(value, "1/s", name),) * 3


def _not_zero(value: Any, name: str) -> float:
    """A pressure [Pa] other than 0.  Raises BadInput."""
    if number := si(value, "Pa", name):
        return number
    raise BadInput(f"{name} = {shown(value)} must not be 0, which has no scale for the rates; give a pressure in Pa")


@checked
@rampable
@dataclass(frozen=True)
class Deformation(Settings):
    """A periodic box that is deformed: compressed, stretched, sheared, or led by a pressure.

    Velocities of grains are those relative to the flow A x of the box, with its rates of strain A. In the laboratory
    they are u + A x, and grains and box move by Newton's law.

    Parameters
    ----------
    rate : float, str or sequence, optional
        Rates of strain [1/s], one for all axes or three: below 0 the box becomes smaller; or a `Ramp`. 0 by default.
    law : str, optional
        "exponential": dL/dt = rate L. "linear": dL/dt = rate L₀, with the length L₀ at the start, or after the last
        change of the box. "pressure": dL/dt = rate L (P̄ − P)/\\|P\\|, at most rate L, so that the pressure comes to P.
    pressure : float or str, optional
        P [Pa], other than 0, with law = "pressure": above 0 in compression; or a `Ramp`. With three equal rates it is
        the mean of the axes, otherwise that along each of them.
    time : float or str, optional
        Time [s] > 0 of the running mean P̄ of the pressure, with law = "pressure".
    shear : float or str, optional
        Rate of simple shear dv_x/dz [1/s]: the velocity along x grows along z, and images above slide over those below;
        or a `Ramp`. With law = "linear" the velocity of the images is constant, that of this rate at the start.

    Raises
    ------
    BadInput
        If a value has a wrong unit, or is out of range; one line each.
    """

    rate: Annotated[Any, Reading(_rates, unit="1/s"), RAMP] = 0.0
    law: Annotated[str, Word(*LAWS)] = EXPONENTIAL
    pressure: Annotated[
        Any, Reading(_not_zero, unit="Pa"), For("law", PRESSURE, needed="a pressure in Pa, such as '1 kPa'"), RAMP
    ] = None
    time: Annotated[Any, Number("s", above=0.0), For("law", PRESSURE, needed="a time in s, such as '10 ns'")] = None
    shear: Annotated[Any, Number("1/s"), RAMP] = None

    name: ClassVar[str] = "deformation"

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """Rates below 0 that follow a pressure."""
        if not wrong & {"rate", "law"} and self.law == PRESSURE and min(self.rate) < 0.0:
            yield f"rate = {min(self.rate):g} 1/s must be at least 0 with law = 'pressure', whose sign follows P̄ − P"


def read_deformation(value: Any) -> tuple[Deformation, ...]:
    """A deformation, or None.  Raises BadInput."""
    if value is not None and not isinstance(value, Deformation):
        raise BadInput(f"deformation = {shown(value)}; give sand.Deformation('-1e4 1/s')")
    return () if value is None else (value,)


def box_columns(*, sheared: bool) -> list[str]:
    """Columns of the ledger of a box that is deformed."""
    return list(OF_BOX if sheared else OF_BOX[: -len(OF_SHEAR)])


class DeformedBox(Component):
    """A box that is deformed (`Deformation`), and the work of its boundaries."""

    name = "deformation"
    noun = "forces"
    every_step = True
    groups: ClassVar[Mapping[str, type]] = {CELL: CellArrays}

    in_parts = True
    is_part = False
    """Whether it acts in contact steps of awake clusters."""
    _box: Box
    _lengths: np.ndarray

    def for_part(self) -> Component:
        """As `Component.for_part`."""
        part = DeformedBox(self.items)
        part.is_part = True
        return part

    @property
    def holds(self) -> bool:  # type: ignore[override]
        """As `moves_box`: loads on awake clusters act on grains, which move relative to the flow within them."""
        return self.moves_box

    @property
    def given(self) -> Deformation:
        """What the user gave."""
        deformation: Deformation = self.items[0]
        return deformation

    @property
    def moves_box(self) -> bool:  # type: ignore[override]
        """Whether any rate is ever other than 0; otherwise the steps are those of a box that keeps its shape."""
        return bool(self.items) and any(any((*each.rate, each.shear)) for each in forces_at_points(self.given))

    def shears(self, box: Box) -> bool:
        """Whether the box is tilted, or has a rate of shear, also if that is 0 at first."""
        return bool(box.tilt or (self.items and self.given.shear is not None))

    def span(self, box: Box) -> MovingSpan | TiltedSpan:
        """As `Component.span`."""
        return box.moving_span(sheared=self.shears(box))

    def problems(self, setup: Setup) -> list[str]:
        """As `Component.problems`."""
        if self.is_part:
            return []
        found, where = [], "cannot be used in a box that is deformed; leave one of them out"
        for axis, length in zip(AXES, setup.box.lengths, strict=True):
            if length is None:
                found.append(f"axis {axis} of the box is open, but a box that is deformed has three periodic ones")
        if self.moves_box:
            others = [REFUSED[each.name] for each in setup.components if each.name in REFUSED]
            sheared = self.shears(setup.box)
            others += [f"the force '{each.name}'" for each in setup.forces.long_range if sheared]
            positions = [each for each in setup.forces.external if getattr(each, "position_dependent", False)]
            others += [f"the force '{each.name}', whose energy depends on the position," for each in positions]
            moves_bodies = getattr(setup.stepping, "moves_bodies", False)
            if moves_bodies and self.given.law == PRESSURE:
                found.append("rigid clusters cannot be used with law = 'pressure'; give rates, or use sand.Verlet")
            if moves_bodies and setup.forces.gas:
                found.append("rigid clusters cannot be used with a gas in a box that is deformed; use sand.Verlet")
            if setup.stepping.name != "verlet" and (sheared or not moves_bodies):
                others.append(f"stepping = '{setup.stepping.name}'")
            found += [f"{other} {where}" for other in others]
            points = forces_at_points(self.given)
            step, rates = getattr(setup.stepping, "step", "auto"), [(*each.rate, each.shear or 0.0) for each in points]
            if step != "auto" and step * np.abs(rates).max() > LARGEST_STRAIN:
                found.append(f"a step of {step:g} s strains the box by more than {LARGEST_STRAIN:g}; use step = 'auto'")
            found += [] if sheared else problems_of_forces(setup)
        return [f"deformation: {line}" for line in found]

    def at_start(self, forces: ForcesByType, setup: Setup) -> ForcesByType:
        """The forces, with parameters of Ewald sums that last while the box is deformed."""
        self._ewald, self._cutoff = np.zeros((2, 12)), 0.0
        if self.moves_box and not self.is_part:
            forces, self._cutoff = with_choices(forces, setup)
            store_choices(forces.long_range, self._ewald)
        return forces

    def stages(self, setup: Setup, law: ContactLaw, settings: ContactParameters) -> HookStages:
        """Stages of the deformation; none if all rates are 0."""
        self._box = setup.box
        self._lengths = self._lengths_of_sums = np.array(setup.box.lengths, np.float64)
        if not self.moves_box:
            return {}
        if self.is_part:
            return stages_of_part(bool(setup.forces.long_range))
        shortest = max(least_side(setup.grains.radius), 2.0 * self._cutoff)
        number, time = LAWS.index(self.given.law), self.given.time or 0.0
        numbers = DeformationNumbers(number, time, shortest, bool(setup.forces.long_range), self.shears(setup.box))
        if getattr(setup.stepping, "moves_bodies", False):
            return stages_with_bodies(numbers)
        return deformation_stages(numbers)

    def add_arrays(self, state: State, law: ContactLaw, settings: ContactParameters) -> None:
        """Give a new state the box in memory."""
        state.add_groups(self.groups, {})
        cell = _cell_of(state)
        cell.span[:], cell.start[:] = state.fixed_box.moving_span(sheared=True), self._box.lengths
        cell.ewald[:], cell.chosen[:] = self._ewald, self._lengths

    def begin(self, engine: Engine) -> None:
        """Set rates and pressure of the present intervals of the ramps, and A where rates have changed."""
        cell, given = _cell_of(engine.stored_state), force_at(self.given, engine.stored_state.time)
        cell.goal[0] = given.pressure or 0.0
        rates = (*given.rate, given.shear or 0.0)
        if (cell.rate != rates).any():
            cell.rate[:], cell.lasts[0] = rates, min(cell.lasts[0], engine.stored_state.time)
            longer = cell.start / cell.span[:3] if given.law == LINEAR else np.ones(3)
            if given.law != PRESSURE:
                cell.span[RATE:TILT] = cell.rate[:3] * longer
            # A_xz L_x L_z is constant while dH/dt is, as A → A F⁻¹ leaves it
            cell.span[SHEAR] = cell.rate[3] * longer[0] * longer[2]
        if cell.ewald.any() and (cell.chosen != self._lengths_of_sums).any():
            self._lengths_of_sums = cell.chosen.copy()
            use_choices(engine, cell, self._cutoff)

    def next_time(self, engine: Engine) -> float:
        """Next time [s] at which a ramp changes a rate or the pressure, or Ewald sums need other parameters."""
        ramps, state = ramps_of(self.given).values(), engine.stored_state
        lasts = float(_cell_of(state).lasts[0]) if self._ewald.any() else math.inf
        return min([lasts, *(ramp.next_change(state.time) for ramp in ramps)])

    def update(self, engine: Engine) -> None:
        """As `begin`; choose the parameters of Ewald sums anew, where the box has changed."""
        self.begin(engine)
        cell = _cell_of(engine.stored_state)
        longer = cell.start / cell.span[:3] if self.given.law == LINEAR else 1.0
        follow_box(engine, cell, self._cutoff, (1.0 + 2.0 * MOST_STRAIN) * float(np.abs(cell.rate[:3] * longer).max()))
        self._lengths_of_sums = cell.chosen.copy()

    def kept(self, kept: np.ndarray) -> Component:
        """The same deformation."""
        return DeformedBox(self.items)

    def saved_for_change(self, state: State, box: Box) -> dict[str, np.ndarray]:
        """As `Component.saved_for_change`; the work up to the change is kept for `changed`."""
        self._work = present_work(state)
        return {}

    def changed(self, arrays: dict[str, np.ndarray], *, regroups: bool) -> None:
        """Take over the lengths of a box that the user has changed; the work up to then was that of the box before."""
        time, span = arrays["clock"][TIME], arrays["cell/span"]
        arrays["cell/work"], arrays["cell/strain"] = self._work, np.zeros(4)
        arrays |= {"cell/ewald": self._ewald, "cell/chosen": self._lengths, "cell/lasts": np.zeros(1)}
        given = force_at(self.given, time)
        if (arrays["cell/rate"] != (*given.rate, given.shear or 0.0)).any():
            arrays["cell/changed"] = np.array([time])
        if box_of(span, span[TILT]) != self._box:
            arrays["cell/changed"] = np.nextafter([time], math.inf)
            arrays["cell/start"] = np.array(self._box.lengths, np.float64)
            words = np.array(self._box.moving_span(sheared=True))
            words[[*range(RATE, TILT), SHEAR]] = span[[*range(RATE, TILT), SHEAR]]
            arrays["cell/span"] = words

    def choices(self) -> dict[str, str]:
        """The settings, for the description of a run."""
        return {self.name: ", ".join(f"{name} = {value}" for name, value in self.given.parameters().items())}

    def columns(self) -> list[str]:
        """Lengths of the box, filling factor, work of the boundaries and pressure; of shear the same."""
        return box_columns(sheared=self.shears(self._box))

    def losses(self) -> list[str]:
        """The energy that the boundaries took from the grains."""
        return ["lost_box"]

    def row(self, state: State) -> dict[str, float]:
        """Values of the columns; the pressure is that of the present moment."""
        cell, grains = _cell_of(state), state.grains.arrays
        lengths, volume = cell.span[:3], float(np.prod(cell.span[:3]))
        work, pressure = present_work(state), present_virial(state, with_motion=True) / volume
        filling = 4.0 / 3.0 * math.pi * math.fsum(grains.radius**3) / volume
        values = [*lengths, filling, *work[:3], *pressure[:3], cell.span[TILT], cell.shear[0], work[3], -pressure[3]]
        named = {name: float(value) for name, value in zip(OF_BOX, values, strict=True)}
        return {name: named[name] for name in self.columns()} | {"lost_box": -math.fsum(work)}

    def means(self, state: State, before: Mapping[str, float] | None, now: Mapping[str, float]) -> dict[str, float]:
        """The pressure P_aa = −ΔW_a / ∫ V dL_a / L_a since the row before, from the work W_a on the grains.

        That of shear, ΔW / ∫ V dγ, is the shear stress −P_zx, positive if it opposes the motion.

        For rates in constant ratios, the integral is Δ ln L_a times the logarithmic mean of the volumes.  With a strain
        below LEAST_STRAIN the quotient would be rounding.  There is no mean over a change by the user, nor along an
        axis that turns from shrinking to growing or back, whose strains cancel.
        """
        found: dict[str, float] = {}
        if before is None or before["time"] < _cell_of(state).changed[0]:
            return found
        rates = [force_at(self.given, row["time"]) for row in (before, now)]
        (first, last), turns = (one.rate for one in rates), math.prod(one.shear or 0.0 for one in rates) < 0.0
        volumes = [math.prod(row[f"box_{axis}"] for axis in AXES) for row in (before, now)]
        ratio = math.log(volumes[1] / volumes[0])
        mean = (volumes[1] - volumes[0]) / ratio if abs(ratio) > 1e-6 else 0.5 * (volumes[0] + volumes[1])
        for a, axis in enumerate(AXES):
            strain = math.log(now[f"box_{axis}"] / before[f"box_{axis}"])
            if abs(strain) > LEAST_STRAIN and first[a] * last[a] >= 0.0:
                found[f"mean_pressure_{axis}"] = (before[f"work_{axis}"] - now[f"work_{axis}"]) / (mean * strain)
        if "shear" in before and abs(sheared := now["shear"] - before["shear"]) > LEAST_STRAIN and not turns:
            found["mean_shear_stress"] = (now["work_shear"] - before["work_shear"]) / (mean * sheared)
        return found

    def parameters(self) -> dict[str, Any]:
        """Its table in a case file, SI."""
        return self.given.parameters()


def present_virial(state: State, *, with_motion: bool = False) -> np.ndarray:
    """W_aa and W_zx (4,) [J] of contacts and long-range forces, and of motion, with the loads of a state.

    Rigid bodies have that of `deformed_bodies`, and no contacts.
    """
    grains, contacts, used = state.grains.arrays, state.contacts, int(state.count[CONTACTS])
    cell, bodies, moving = _cell_of(state), state.bodies, np.ones(len(state.grains), bool)
    virial = np.append(cell.far_virial, 0.0)
    if state.count[BODIES]:
        moving, firsts = bodies.asleep == 0, np.unique(bodies.first[bodies.asleep == 1])
        virial = cell.virial.copy()
        virial[:3] += with_motion * (bodies.momentum[:, firsts] ** 2 / bodies.mass[firsts]).sum(axis=1)
    x, y, z = grains.velocity
    virial += with_motion * (grains.mass * np.array([x * x, y * y, z * z, z * x]))[:, moving].sum(axis=1)
    first, second = grains.position[:, contacts.pair[:, :used]].swapaxes(0, 1)
    branch = state.box.nearest((first - second).T).T
    force = contacts.force[:, :used] * moving[contacts.pair[0, :used]]
    return np.asarray(virial + np.append((branch * force).sum(axis=1), (branch[2] * force[0]).sum()))


def present_work(state: State) -> np.ndarray:
    """Work (4,) [J] of the boundaries, with that since the virial was last summed."""
    cell = _cell_of(state)
    return np.asarray(cell.work - 0.5 * cell.strain * (cell.virial + present_virial(state)))


def _cell_of(state: State) -> CellArrays:
    cell: CellArrays = state.of_components[CELL]
    return cell
