"""Numerical laboratory: a packing is compressed, stretched or sheared, by its periodic box or between two walls."""

from __future__ import annotations

import importlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.box import Box, least_side
from ..basics.errors import BadInput, warn
from ..basics.grains import Grains
from ..basics.units import format_quantity
from ..contact.model import Contact
from ..forces.base import Force
from ..integrate.integrator import Integrator
from ..io.run_folder import TRAJECTORY
from ..setup.checks import pairs_in_contact, refuse_pieces
from ..setup.from_frame import Start
from ..simulation.condition import EVERY
from ..simulation.simulation import Simulation
from ..theory.compression import PackingScales, packing_scales
from .laboratory_loading import Loading
from .laboratory_table import Percolation, shares, table_of

OF_STATE = (
    *("contacts", "made", "moved", "broken", "clusters", "translation", "rotation"),
    *("normal", "sliding", "rolling", "twisting", "total", "tilt"),
)
"""Columns of the ledger that the table repeats, besides pressures and losses."""

REST = 1e-4
"""Relative change of the filling factor below which a packing under a constant pressure may be at rest."""
BALANCE = 0.05
"""Share of a constant pressure by which the mean pressures on floor and lid differ from it at most, at rest."""


def filling_factor(radius: np.ndarray, sides: Any) -> float:
    """Filling factor φ of grains of radii (N,) in a box of lengths (3,) [m]."""
    return 4.0 / 3.0 * math.pi * float((radius**3).sum()) / float(np.prod(sides))


class Plan(NamedTuple):
    """A packing at its start, and how it is loaded; made by `plan`."""

    loading: Loading
    start: Start
    moved: dict[str, Any]  # argument of `Simulation`: the motion of the box, or the walls
    sides: np.ndarray  # lengths of the box (3,) [m]; along z the distance of the walls
    rate: float  # of strain, at the start [1/s]
    until: float  # [s]
    row_every: float  # [s]
    scales: PackingScales

    def filling(self, sides: np.ndarray) -> float:
        """Filling factor φ in a box of these lengths (3,) [m]."""
        return filling_factor(self.start.grains.radius, sides)

    def rate_ratio(self, sides: np.ndarray, rate: float | None = None) -> float:
        """The rate over the largest one that is slow enough at these lengths, see `PackingScales.largest_rate`."""
        moved = ["xyz".index(axis) for axis in self.loading.axes]
        lengths = (self.sides if self.loading.by == "walls" else sides)[moved]  # the speed of a wall is constant
        speeds = (self.rate if rate is None else rate) * lengths
        return float(speeds.max()) / self.scales.largest_rate(self.filling(sides), 1.0)

    def rate_text(self, rate: float) -> str:
        """A rate of strain [1/s], for people, also in units of t_c."""
        return f"{rate:.3g} 1/s, or {rate * self.scales.time:.2g} /t_c"

    def row(self, before: dict[str, float] | None, row: dict[str, float]) -> dict[str, Any]:
        """Row of the table, of two rows of the ledger; the first one has no mean values."""
        way, grains = _way(self.loading), len(self.start.grains)
        sides = way.sides(self, row)
        filling = self.filling(sides)
        axis = "xyz".index(self.loading.axes[0])
        sheared = self.loading.kind == "shear"
        rate = None
        if self.loading.load_is_given and before is not None:
            moved = sides[axis] - way.sides(self, before)[axis]
            rate = abs(float(moved)) / (row["time"] - before["time"]) / float(self.sides[axis])
        known = {
            "time": row["time"],
            "step": row["step"],
            "filling": filling,
            "mean_filling": math.nan if before is None else math.sqrt(filling * self.filling(way.sides(self, before))),
            "strain": self.rate * row["time"] if sheared else float(sides[axis] / self.sides[axis]) - 1.0,
            **{f"side_{name}": float(side) for name, side in zip("xyz", sides, strict=True)},
            **way.means(self, before, row),
            "coordination": 2.0 * row["contacts"] / grains,
            "rate_ratio": self.rate_ratio(sides, rate),
        }
        parts = ("pressure", "mean_pressure", "lost_")
        more = {name: row[name] for name in row if name in OF_STATE or name.startswith(parts)}
        return known | shares(before, row) | more


def _way(loading: Loading) -> Any:
    """The module of the box or of the walls, with the functions that both have, such as `placed` and `means`."""
    return importlib.import_module(f".laboratory_{loading.by}", __package__)


def contact_of(forces: Sequence[Force] | None) -> Contact:
    """The contact model among the forces, the default one if there are none.  Raises BadInput."""
    contact = next((one for one in forces or () if isinstance(one, Contact)), None) if forces else Contact()
    if contact is None:
        raise BadInput("forces: there is no sand.Contact(), by which grains touch; add it")
    return contact


def plan(body: Grains | Start, loading: Loading, forces: Sequence[Force] | None = None) -> Plan:
    """Place a body in a box, or between walls.

    Parameters
    ----------
    body : Grains or Start
        A body in one piece, or a frame of an earlier run, with its contacts and box, from `sand.setup.from_frame`.
    loading : Loading
        How it is loaded.
    forces : sequence of Force or None, optional
        `[sand.Contact()]` by default.

    Raises
    ------
    BadInput
        If the body is not in one piece, or does not fit into the box, or its end has been reached.
    """
    given = body if isinstance(body, Start) else Start(body, None, Box.open(), "")
    contact = contact_of(forces)
    if given.contacts is not None and not len(given.contacts.pair):
        raise BadInput(f"the frame has no contacts, and nothing to {loading.kind}; take an earlier or a later one")
    pairs = pairs_in_contact(given.grains, given.box)[0] if given.contacts is None else given.contacts.pair
    way, grains = _way(loading), given.grains
    start, sides = way.placed(loading, given, contact)
    joined = [np.asarray(one, np.int64) for one in (pairs, way.joined(given, contact))]
    refuse_pieces(grains, np.concatenate(joined), given.box, "the body")
    settings = {name: getattr(contact, name) for name in ("roll_factor", "rolling_limit", "surface_energy_factor")}
    scales = packing_scales(grains.materials[int(grains.material[0])], float(grains.radius.mean()), **settings)
    units = {"1/s": 1.0, "/t_c": scales.time, "m/s": float(sides[2])}
    rate = math.nan if loading.load_is_given else loading.rate.value / units[loading.rate.unit]
    found = Plan(loading, start, {}, sides, rate, 0.0, 0.0, scales)
    filling = found.filling(sides)
    if loading.kind == "compress" and loading.to is not None and loading.to <= filling:
        raise BadInput(f"to = {loading.to:g} is not above the filling factor at the start, {filling:.3g}")
    until, row_every = way.times(loading, filling, rate)
    found = found._replace(until=until, row_every=row_every)
    found = found._replace(moved=way.moved(found, contact))
    smallest, needed = float(way.last_sides(found).min()), least_side(grains.radius)
    if loading.by == "box" and smallest < needed <= sides.min():
        first, least = (format_quantity(float(f"{side:.3g}"), "m") for side in (smallest, needed))
        raise BadInput(
            f"to = {loading.to:g}: a side of the box is {first} then; with less than {least} two grains could touch "
            "through two images: give a smaller one, or more grains"
        )
    return found


def slow_from(planned: Plan) -> str:
    """The largest rate at the start of a plan that is slow enough; warns if no part of the plan is.

    Empty for a given load.
    """
    if planned.loading.load_is_given:
        return ""
    first, last = (planned.rate_ratio(sides) for sides in (planned.sides, _way(planned.loading).last_sides(planned)))

    good = f"{planned.rate_text(planned.rate / first)}, at the start"
    if (times := min(first, last)) > 1.0:
        warn(
            f"the rate, {planned.rate_text(planned.rate)}, is too fast for a static stress, {times:.2g} times where "
            f"the packing is densest; the largest good rate is {good}"
        )
    return good


class Loaded(NamedTuple):
    """A packing that was loaded."""

    plan: Plan
    table: list[dict[str, Any]]  # rows; columns are those of docs/laboratory.md
    simulation: Simulation  # at its end

    def to_dict(self) -> dict[str, Any]:
        """Results for JSON."""
        planned, last = self.plan, self.table[-1]
        most = max(self.table[1:], key=lambda row: row["stress"], default=last)
        return {
            "kind": planned.loading.kind,
            "by": planned.loading.by,
            "largest_load": max(planned.loading.pressure or (0.0,)),
            "grains": len(planned.start.grains),
            "radius": float(planned.start.grains.radius.mean()),
            "filling_at_start": planned.filling(planned.sides),
            "rate": planned.rate,
            "contact_time": planned.scales.time,
            "largest_rate_at_start": planned.rate / planned.rate_ratio(planned.sides),
            "surface_energy": planned.scales.surface_energy,
            "roll_energy": planned.scales.roll_energy,
            "pressure_scale": planned.scales.pressure,
            **{name: last[name] for name in ("time", "step", "filling", "strain", "stress", "coordination")},
            "largest_stress": most["stress"],
            "strain_of_largest": most["strain"],
            "largest_at_end": most is last,
            **({"at_rest": at_rest(planned, self.simulation.ledger.rows)} if planned.loading.load_is_constant else {}),
            "drift": self.simulation.ledger.drift,
            "table": {name: [row[name] for row in self.table] for name in last},
        }


def simulation_of(planned: Plan, forces: Sequence[Force] | None = None, **options: Any) -> Simulation:
    """Set up the simulation of a plan; options are those of `Simulation`.  Raises BadInput."""
    start, given = planned.start, [Contact()] if forces is None else forces
    simulation = Simulation(
        start.grains,
        given,
        box=start.box,
        contacts=start.contacts,
        frame_every=planned.row_every,
        stress=True,
        **planned.moved,
        **options,
    )
    simulation.origin = start.note
    return simulation


def run_to_end(planned: Plan, simulation: Simulation) -> Loaded:
    """Run the simulation of a plan, which may have been resumed, to its end.

    Warns if a packing is not at rest then under a constant load.

    Raises
    ------
    BadInput
        If it stopped for physical reasons.
    Interrupted
        By Ctrl-C.
    """
    seen = Percolation()
    simulation.observers = [*simulation.observers, seen]
    if simulation.writer is not None:
        simulation.writer.draws = False  # the figure of the table is drawn by the job
    steady = planned.loading.load_is_constant
    stop = (lambda running: at_rest(planned, running.ledger.rows)) if steady else None
    if stop is None or simulation.steps % EVERY or not stop(simulation):  # else it had ended before it was resumed
        result = simulation.run(max(planned.until, simulation.time), stop=stop)
        if result.outcome.is_physics:
            raise BadInput(f"the {planned.loading.kind} test cannot be computed to its end: {result}")
    rows = simulation.ledger.rows
    if steady and not at_rest(planned, rows):
        warn(unrest(planned, rows))
    if simulation.writer is not None:
        seen.see_frames(simulation.writer.folder / TRAJECTORY, rows)
    return Loaded(planned, table_of(planned, rows, seen), simulation)


def window(planned: Plan) -> float:
    """Time for which a packing must be at rest [s]: a tenth of that of the plan, or a row if it is longer."""
    return max(0.1 * planned.until, planned.row_every) + 0.5 * planned.row_every


def recent(planned: Plan, rows: Sequence[dict[str, float]]) -> tuple[float, float, float]:
    """Relative change of φ in the last `window`, and the mean pressures of the grains on lid and floor [Pa]."""
    way, since = _way(planned.loading), rows[-1]["time"] - window(planned)
    last = [row for k, row in enumerate(rows) if row["time"] >= since or k >= len(rows) - 2]
    filling, means = [planned.filling(way.sides(planned, row)) for row in last], way.means(planned, last[0], last[-1])
    return max(filling) / min(filling) - 1.0, means["mean_pressure_lid"], means["mean_pressure_floor"]


def at_rest(planned: Plan, rows: Sequence[dict[str, float]]) -> bool:
    """Whether a packing bears its constant load P, at the last row or at the one before.

    In the last `window` φ changes by less than REST, and the pressures on lid and floor are P within BALANCE. A run
    that stops at rest writes one more row.
    """
    load = planned.loading.pressure[0]
    for some in (rows, rows[:-1]):
        if len(some) > 1 and some[-1]["time"] - some[0]["time"] > window(planned):
            change, *pressures = recent(planned, some)
            if change < REST and max(abs(one - load) for one in pressures) <= BALANCE * load:
                return True
    return False


def unrest(planned: Plan, rows: Sequence[dict[str, float]]) -> str:
    """In what a packing is not at rest, and what to do."""
    change, *pressures = recent(planned, rows)
    lid, floor, load = (format_quantity(float(f"{one:.3g}"), "Pa") for one in (*pressures, planned.loading.pressure[0]))
    return (
        f"not at rest after {format_quantity(planned.until, 's')}: pressure on the lid {lid}, on the floor {floor}, "
        f"for {load}, change of the filling factor {100 * change:.2g} %; give a longer until, or damping"
    )


@checked
def load(
    body: Any,
    loading: Loading,
    *,
    forces: Sequence[Force] | None = None,
    stepping: Integrator | None = None,
    seed: int | None = None,
    out: str | Path | None = None,
    overwrite: bool = False,
    observers: Sequence[Any] = (),
) -> Loaded:
    """Compress, stretch or shear a packing, and measure its stress.

    Parameters
    ----------
    body : Grains or Start
        A body in one piece, or a frame of an earlier run from `sand.setup.from_frame`.
    loading : Loading
        How it is loaded.
    forces : sequence of Force or None, optional
        `[sand.Contact()]` by default.
    stepping, seed, out, overwrite, observers : optional
        As for `sand.Simulation`.

    Returns
    -------
    Loaded
        Table and simulation.

    Raises
    ------
    BadInput
        As `plan` and `sand.Simulation`, or if it stopped for physical reasons.
    """
    planned = plan(body, loading, forces)
    slow_from(planned)
    options = {"stepping": stepping, "seed": seed, "out": out, "overwrite": overwrite, "observers": observers}
    return run_to_end(planned, simulation_of(planned, forces, **options))
