"""Growth in dilute dust: a Monte Carlo of encounters of two bodies, with their flights and contacts.

In thin dust encounters are binary and ballistic, and the gas thermalises speed, spin and orientation of all bodies many
times between two of them.  Growth is then a sequence of encounters whose cost does not depend on the density.  See
`docs/physics/dilute-growth.md`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..basics.arguments import checked
from ..basics.errors import BadInput, shown, warn
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.units import si
from ..compiler.progress import announce
from ..forces.base import Force
from ..io import run_folder as files
from ..io.lock import writing
from ..io.table import read_table
from ..results import Run
from ..simulation.condition import Condition, read_condition
from ..simulation.contact_phase import ContactPhase
from .dilute_body import NO_CONTACTS, Body, body_of, part_of
from .dilute_conditions import (
    MOST_OTHERS,
    check_charges,
    check_forces,
    check_gas,
    check_moments,
    check_population,
    field_of,
)
from .dilute_encounters import RECENT, Encounters
from .dilute_files import PopulationFiles, kept_population, ledger_columns
from .dilute_flight import RigidFlights
from .dilute_hits import HitRule, Resolve, Stick
from .dilute_kernel import Kernel, kernel_of
from .dilute_majorant import Majorant
from .dilute_own import OwnMajorant, thermal_body
from .dilute_population import Population
from .dilute_state import SINGLE_NUMBERS, holds_all, population_from

BETWEEN = ("thermal", "own")
"""What happens between encounters: the gas thermalises all bodies, or they keep momentum and spin."""
HITS = ("resolve", "stick")
"""What becomes of two bodies that touch: contacts are computed until at rest, or they join as they are."""
NOT_BINARY = "not binary"
"""Outcome of a population whose bodies would meet others on their way."""
SEEN_EVERY = 1000
"""Draws between two calls of observers where no hit comes."""


@dataclass(frozen=True)
class Grown:
    """A population at its end, as `grow` returns it.

    Attributes
    ----------
    folder : Path
        Its folder; `sand.open` reads ledger and frames.
    outcome : str
        "finished", or "not binary" if encounters with others became likely.
    """

    folder: Path
    outcome: str

    @cached_property
    def ledger(self) -> Any:
        """Columns of the ledger by name (K,), see `dilute_files.ledger_columns`."""
        return Run(self.folder).ledger

    @cached_property
    def encounters(self) -> dict[str, np.ndarray]:
        """Columns of all draws by name (K,), see `dilute_encounters.Encounter`; `end` as in `dilute_files`."""
        return _columns(self.folder / files.ENCOUNTERS)

    @cached_property
    def aggregates(self) -> dict[str, np.ndarray]:
        """Columns of the aggregates at the end, see `analysis.frame_statistics`; `body` is equal for copies."""
        return _columns(self.folder / files.AGGREGATES)

    def kernel(self, edges: Sequence[int] | None = None) -> Kernel:
        """K by classes of sizes, see `dilute_kernel.kernel_of`."""
        return kernel_of([self.encounters], edges)


def _columns(path: Path) -> dict[str, np.ndarray]:
    """Columns of a table of numbers by name, (K,)."""
    names, *rows = read_table(path)
    return dict(zip(names, np.array(rows, float).reshape(-1, len(names)).T, strict=True))


class Settings(NamedTuple):
    """Checked arguments of a population."""

    grains: Grains
    contacts: StrainedContacts
    forces: tuple[Force, ...]
    density: float  # n₀ [1/m³], of bodies at the start
    temperature: float  # [K]
    condition: Condition | None
    until: float  # [s]
    method: tuple[str, str]  # of `BETWEEN` and `HITS`
    seed: int


@checked
def grow(
    grains: Grains,
    forces: Sequence[Force],
    *,
    number_density: Any,
    temperature: Any,
    out: str | Path,
    stop: str | None = None,
    until: Any = None,
    seed: int = 0,
    between: str = "thermal",
    hits: str = "resolve",
    contacts: StrainedContacts | None = None,
    overwrite: bool = False,
    observers: Sequence[Any] = (),
    case: dict[str, Any] | None = None,
) -> Grown:
    """Grow a population of bodies to its end; called again, it continues an interrupted one with equal bits.

    Bodies, the clusters of the grains, are in a volume at a number density; between two encounters speeds, spins and
    orientations are those of thermal equilibrium, or momenta and spins those after the last encounter.  Pairs of bodies
    are drawn in proportion to an upper bound of their collision rate, and fly from far away as rigid bodies; if they
    touch, contact steps of their grains follow until these are at rest.  When half of the bodies are left,
    all are copied, and the volume is doubled.

    Parameters
    ----------
    grains : Grains
        At least 100 bodies; positions and velocities count only within clusters.
    forces : sequence of Force
        `Contact`, `Dipoles` for magnetic grains, and `Gas`, for checks.
    number_density : float or str
        n₀ of bodies at the start [1/m³] > 0.
    temperature : float or str
        T [K] > 0.
    out : str or Path
        Folder for its files.
    stop : str or None, optional
        Condition on columns of the ledger, such as "mean_cluster_size >= 30".
    until : float or str or None, optional
        End [s]; this or `stop` is required.
    seed : int, optional
        Seed of all random numbers, 0 ≤ seed < 2⁶³.
    between : str, optional
        "thermal": a gas thermalises all bodies between two encounters; "own": they keep momentum and spin, as without
        a gas, and have those of thermal equilibrium at the start.
    hits : str, optional
        "resolve": contacts are computed until at rest; "stick": bodies join at the first touch.
    contacts : StrainedContacts or None, optional
        Contacts of the grains, which make clusters of them.
    overwrite : bool, optional
        Whether files of an earlier run may be replaced.
    observers : sequence, optional
        Called with each row of the ledger, and with one of the same columns at every thousandth draw, which the ledger
        does not have: `observer.see(None, row)`.
    case : dict or None, optional
        Settings for case.toml, by default those of these arguments.

    Raises
    ------
    BadInput
        If an argument is wrong, the dust is too dense, or the gas acts within encounters; if the folder holds something
        else; or if a contact phase fails.
    """
    settings = _checked(grains, forces, number_density, temperature, (stop, until), (between, hits), seed, contacts)
    described = case or _describe(settings, number_density, temperature, stop, until)
    folder = Path(out)
    kept = kept_population(folder) if folder.is_dir() and not overwrite else None
    if kept is not None and _without_end(kept[1].get("case", {})) != _without_end(files.plain(described)):
        raise BadInput(f"{folder} holds a population with other settings; give another folder, or overwrite=True")
    if kept is not None and not holds_all(*kept):
        raise BadInput(
            f"{folder} holds a population of an earlier version of SAND, which cannot go on; give another folder, or "
            "overwrite=True"
        )
    if kept is None:
        begun = _begin(settings, None)  # which refuses what does not fit, before anything is written
        files.make_folder(folder, overwrite=overwrite)
    with writing(folder):
        now, start = begun if kept is None else _begin(settings, kept)
        record = PopulationFiles(folder, files.plain(described), settings.grains, kept, settings.method[0] == "own")
        record.begin(now, start)
        outcome = _advance(now, record, settings, start, observers)
        record.finish(now, outcome)
        if now.bound:
            warn(
                f"{now.bound} of {now.flights} flights ended with the bodies still together, though not in contact; "
                "they count as misses (end = 2 in encounters.csv)"
            )
        found = Grown(folder, outcome)
        _draw(found, settings)
    return found


def _draw(found: Grown, settings: Settings) -> None:
    """The figure of a population, if it has aggregates."""
    from ..plotting.run_figure import save
    from .dilute_figure import dilute_figure

    if not len(found.aggregates.get("grains", ())):
        return
    announce("drawing the figure")
    grains = settings.grains
    moments = np.linalg.norm(grains.moment, axis=1)
    moment = float(moments[moments > 0.0].mean()) if moments.any() else 0.0
    unit = float(grains.radius.mean()), moment, settings.temperature
    save(dilute_figure(found.ledger, found.aggregates, found.encounters, unit), found.folder / files.FIGURE)


def _advance(
    now: Encounters, record: PopulationFiles, settings: Settings, start: float, observers: Sequence[Any]
) -> str:
    """Encounters until the end; returns the outcome.  The end is looked at after hits."""
    while True:
        row = record.rows[-1]
        if settings.condition is not None and settings.condition.holds(row):
            return "finished"
        if now.time >= settings.until:
            return "finished"
        if now.hits_seen >= RECENT and now.recent_others > MOST_OTHERS:
            return NOT_BINARY
        encounter = now.step()
        record.add(now, encounter, start)
        if encounter.end != "hit" and now.event % SEEN_EVERY:
            continue
        row = record.rows[-1] if encounter.end == "hit" else record.row(now, start)
        for each in observers:
            each.see(None, row)


def _begin(settings: Settings, kept: tuple[dict[str, np.ndarray], dict[str, Any]] | None) -> tuple[Encounters, float]:
    """The encounters at the start, or as they were at a checkpoint; and n₀ [1/m³]."""
    between, hits = settings.method
    majorant = (OwnMajorant if between == "own" else Majorant)(settings.temperature)
    contact, forces, gas = check_forces(settings.forces, *settings.method)
    rigid_flights = RigidFlights(majorant.heat, field=field_of(forces) or (0.0, 0.0, 0.0))
    check_charges(settings.forces, settings.grains)
    rule: HitRule = Stick(contact, settings.grains.materials)
    if hits == "resolve":
        rule = Resolve(ContactPhase(settings.grains, forces), rigid_flights, majorant)
    if kept is not None:
        arrays, meta = kept
        now = Encounters(population_from(arrays, meta, majorant), rigid_flights, rule, settings.seed)
        for name in SINGLE_NUMBERS:
            setattr(now, name, meta[name])
        return now, settings.density
    bodies = bodies_of(settings.grains, settings.contacts)
    # bodies that keep their motion begin with that of equilibrium: conditions at the start are those of thermal ones
    population = Population(bodies, len(bodies) / settings.density, Majorant(settings.temperature))
    check_moments(settings.grains, settings.temperature, population)
    check_gas(gas, settings.grains, population, between)
    check_population(population, rigid_flights, settings.density)
    if between == "own":
        bodies = [thermal_body(body, majorant.heat, settings.seed, k) for k, body in enumerate(bodies)]
        population = Population(bodies, population.volume, majorant)
    return Encounters(population, rigid_flights, rule, settings.seed), settings.density


def bodies_of(grains: Grains, contacts: StrainedContacts) -> list[Body]:
    """A body for each cluster of grains."""
    from ..analysis.clusters import cluster_labels

    label = cluster_labels(len(grains), contacts.pair)
    order = np.argsort(label, kind="stable")
    parts = np.split(order, np.flatnonzero(np.diff(label[order])) + 1)
    pieces = (part_of(grains.arrays, contacts, np.sort(part)) for part in parts)
    return [body_of(*piece, number)[0] for number, piece in enumerate(pieces)]


def _checked(
    grains: Grains,
    forces: Sequence[Force],
    density: Any,
    temperature: Any,
    ends: tuple[Any, Any],
    method: tuple[str, str],
    seed: int,
    contacts: StrainedContacts | None,
) -> Settings:
    """Arguments of `grow`.  Raises BadInput."""
    between, hits = method
    if between not in BETWEEN:
        raise BadInput(
            f"between = {shown(between)} must be 'thermal' (a gas thermalises all bodies between encounters) or 'own' "
            "(they keep momentum and spin)"
        )
    if hits not in HITS:
        raise BadInput(
            f"hits = {shown(hits)} must be 'resolve' (contacts until at rest) or 'stick' (joined at the touch)"
        )
    stop, until = ends
    if stop is None and until is None:
        raise BadInput("stop is missing; give one, such as stop='mean_cluster_size >= 30', or until='10 d'")
    condition = None if stop is None else read_condition(stop)
    if condition is not None:
        condition.check(ledger_columns(between == "own"))
    return Settings(
        grains,
        contacts or NO_CONTACTS,
        tuple(forces),
        si(density, "1/m^3", "number_density", above=0.0),
        si(temperature, "K", "temperature", above=0.0),
        condition,
        math.inf if until is None else si(until, "s", "until", above=0.0),
        method,
        seed,
    )


def _describe(settings: Settings, density: Any, temperature: Any, stop: Any, until: Any) -> dict[str, Any]:
    """Settings of a script for case.toml."""
    grains = settings.grains
    run = {"stop": stop, "until": until and si(until, "s", "until"), "seed": settings.seed}
    return {
        "run": {name: value for name, value in run.items() if value is not None},
        "method": {"kind": "encounters", "between": settings.method[0], "hits": settings.method[1]},
        "grains": {
            "kind": "given",
            "number": len(grains),
            "number_density": si(density, "1/m^3", "number_density"),
            "temperature": si(temperature, "K", "temperature"),
            "material": [m.name for m in grains.materials],
        },
        "forces": {force.name: dict(force.parameters()) for force in settings.forces},
    }


def _without_end(case: dict[str, Any]) -> dict[str, Any]:
    """A case without the end of its run, which may be changed."""
    run = {name: value for name, value in case.get("run", {}).items() if name not in ("stop", "until")}
    return case | {"run": run}
