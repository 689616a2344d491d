"""Elastic moduli of a packing at rest, by small strains of its periodic box, and the speed of sound by a knock."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence, Set
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from ..analysis.clusters import percolation_axes
from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.errors import BadInput, ErrorCollector, naming, warn
from ..basics.grains import Grains
from ..basics.initial_pairs import StrainedContacts
from ..basics.settings import Flag, List, Number, Reading, Settings, Whole
from ..config.case import COMPONENTS
from ..contact.law import contact_constants
from ..contact.model import Contact
from ..forces.base import Force
from ..forces.gas import Gas
from ..integrate.integrator import Integrator
from ..setup.checks import pairs_in_contact
from ..setup.from_frame import Start
from ..simulation.simulation import Simulation
from ..theory.elastic import ContactSprings, affine_moduli, affine_shear_moduli
from .elastic_waves import Knock, Wave, knock, repeated, standing_wave
from .job import ignored
from .laboratory import BOX, Loading, contact_of, filling_factor, plan, read_rate, run_to_end, scales_of, simulation_of
from .laboratory_box import in_box

AT_LIMIT = 1.0 - 1e-6
"""Share of the limit of sliding, rolling or twisting above which a contact counts as one that slips."""
DOUBLINGS = 9
"""How often the time in which a packing comes to rest is doubled, at most."""
WAVE, STIFFENS = 0.36, 2.3
"""Speed of sound over √(3E_roll/(r³ρ)) at φ = 0.1, and its exponent of φ, by which the cost is estimated (ice)."""
LINEAR = 0.05
"""Largest change of the bulk modulus from that of the smallest strain in the linear range."""


@checked
@dataclass(frozen=True)
class Elastic(Settings):
    """How the moduli of a packing are measured.

    Parameters
    ----------
    strains : list of float, optional
        Strains ε of the box, 0 < ε ≤ 0.01, each applied as +ε and −ε along x, y and z; the moduli are those of the
        smallest one, and the others show how far it is linear.
    accuracy : float, optional
        The response to a strain counts as complete when it changes by less than this share while the time is doubled,
        and the packing as at rest when its stress changes by less than a fifth of it: above 0, at most 0.5.
    sound : bool, optional
        Whether the speed of sound is measured.
    copies : int, optional
        How often the packing is repeated along a wave, 1 … 100: longer waves are less slowed by dispersion.
    compress_to : float, optional
        Filling factor to which the aggregate is compressed first; by default it must fill a periodic box already.
    rate : str, optional
        Rate of this compression, as that of `sand.experiments.laboratory.Loading`.
    box : float or str or sequence, optional
        Sides of the periodic box at the start, one or three; by default those of a frame, or, with `compress_to`, of a
        cube that holds the aggregate.

    Raises
    ------
    BadInput
        If a setting is out of range; one line for each.
    """

    strains: Annotated[Any, List(Number(above=0.0, most=0.01))] = (1e-6, 1e-4)
    accuracy: Annotated[Any, Number(above=0.0, most=0.5)] = 0.05
    sound: Annotated[bool, Flag()] = True
    copies: Annotated[int, Whole(1, 100)] = 4
    compress_to: Annotated[Any, Number(above=0.0)] = None
    rate: Annotated[Any, Reading(read_rate, write=str)] = "1e-4 /t_c"
    box: Annotated[Any, BOX] = None

    place: ClassVar[str] = ""

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """No strain, and what the compression refuses."""
        if not wrong & {"strains"} and not len(self.strains):
            yield "strains is empty; give at least one, such as 1e-6"
        if not wrong & {"compress_to", "rate"} and self.compress_to is not None:
            errors = ErrorCollector()
            errors.take(_compression, self)
            yield from errors.problems


class Moduli(NamedTuple):
    """Moduli of a packing, and its waves; computed by `measure`."""

    rest: Simulation  # the packing at rest
    at_rest: dict[str, float]  # filling factor, residual stress, …
    table: list[dict[str, float]]  # a row for each strain, in increasing order
    affine: np.ndarray  # (3, 3) C_ab [Pa] of affine motion
    affine_shear: np.ndarray  # (3, 3) [Pa]
    relaxed: np.ndarray  # (3, 3) C_ab = −dP_aa/dε_b [Pa] at the smallest strain
    knocks: dict[Wave, Knock]
    standing: dict[Wave, float]  # phase speeds of standing waves [m/s]

    @property
    def linear_to(self) -> float:
        """Largest strain up to which the bulk modulus is that of the smallest one within LINEAR."""
        first, last = self.table[0]["bulk"], self.table[0]["strain"]
        for row in self.table:
            if abs(row["bulk"] / first - 1.0) > LINEAR:
                break
            last = row["strain"]
        return last

    def speed(self, polarised: str, of: str) -> float:
        """Mean speed [m/s] of "longitudinal" or "transverse" waves, `of` a "knock" or "standing"; NaN without waves."""
        found: dict[Wave, float] = self.standing if of == "standing" else {w: k.speed for w, k in self.knocks.items()}
        chosen = [c for wave, c in found.items() if (wave.along == wave.polarised) == (polarised == "longitudinal")]
        return float(np.mean(chosen)) if chosen else math.nan

    def to_dict(self) -> dict[str, Any]:
        """Results for JSON."""
        moduli, density = mean_moduli(self.relaxed), self.at_rest["density"]
        shear = self.affine_shear[~np.eye(3, dtype=bool)].mean()
        content = {
            **self.at_rest,
            **moduli,
            "linear_to": self.linear_to,
            **{f"affine_{name}": value for name, value in mean_moduli(self.affine).items()},
            "affine_shear_direct": float(shear),
        }
        for kind, modulus in (("longitudinal", moduli["longitudinal"]), ("transverse", moduli["shear"])):
            static = math.sqrt(max(modulus, 0.0) / density)
            content |= {f"speed_{kind}": self.speed(kind, "knock"), f"speed_{kind}_static": static}
            content[f"speed_{kind}_standing"] = self.speed(kind, "standing")
            content[f"speed_{kind}_ratio"] = content[f"speed_{kind}"] / static if static else math.nan
        waves = [
            {
                "along": "xyz"[wave.along],
                "polarised": "xyz"[wave.polarised],
                "speed": one.speed,
                "widening": one.widening,
                "misfit": one.misfit,
                "standing": self.standing[wave],
                "drift": one.drift,
                "distances": one.distances.tolist(),
                "arrivals": one.arrivals.tolist(),
                "times": one.times.tolist(),
                "passed": one.passed.T.tolist(),
            }
            for wave, one in self.knocks.items()
        ]
        matrices = {"relaxed": self.relaxed.tolist(), "affine": self.affine.tolist()}
        return (
            content
            | matrices
            | {"table": {name: [row[name] for row in self.table] for name in self.table[0]}, "waves": waves}
        )


def mean_moduli(moduli: np.ndarray) -> dict[str, float]:
    """Bulk, longitudinal and shear modulus [Pa] of C_ab (3, 3), as if it were isotropic, and its anisotropy.

    M = C11, C12: means over the axes; K = (M + 2 C12)/3, G = (M − C12)/2; anisotropy: largest less smallest C_aa, over
    M.
    """
    diagonal = np.diag(moduli)
    m, c12 = float(diagonal.mean()), float(moduli[~np.eye(3, dtype=bool)].mean())
    return {
        "bulk": (m + 2.0 * c12) / 3.0,
        "longitudinal": m,
        "shear": 0.5 * (m - c12),
        "anisotropy": float(np.ptp(diagonal)) / m,
    }


@checked
def measure(
    body: Any,
    settings: Elastic | None = None,
    *,
    forces: Sequence[Force] | None = None,
    stepping: Integrator | None = None,
    seed: int | None = None,
    observers: Sequence[Any] = (),
    progress: Callable[..., None] = ignored,
) -> Moduli:
    """Bring a packing to rest, and measure its elastic moduli and the speed of sound.

    Parameters
    ----------
    body : Grains or Start
        A packing that fills a periodic box: a frame of an earlier run from `sand.setup.from_frame`, or grains with the
        `box` of the settings; or an aggregate, with `compress_to`.
    settings : Elastic or None, optional
        `Elastic()` by default.
    forces : sequence of Force or None, optional
        `[sand.Contact()]` by default; without a gas.
    stepping, seed, observers : optional
        As for `sand.Simulation`.
    progress : callable, optional
        Called with a text and the fraction that is done.

    Returns
    -------
    Moduli
        Moduli and waves.

    Raises
    ------
    BadInput
        If the box is not periodic along x, y and z, the packing does not percolate along all of them, the forces do not
        fit, or a run stopped for physical reasons.
    """
    how = Elastic() if settings is None else settings
    contact, given = contact_of(forces), list(forces or [Contact()])
    options: dict[str, Any] = {"stepping": stepping, "seed": seed, "observers": observers}
    rest = begin(body, how, forces, options).simulation
    if how.compress_to is not None:
        progress("compressing", 0.0)
        planned = plan(body, _compression(how), given)
        loaded = run_to_end(planned, simulation_of(planned, given, **options))
        rest = _at_start(_start_of(loaded.simulation), given, options)
    progress("coming to rest", 0.05)
    springs = contact_springs(rest, contact)
    stiffest = math.sqrt(np.diag(_affine(rest, springs)).max() / _density(rest))
    slowed = standing_wave(_without_drag(rest), Wave(0, 0), how.strains[0], stiffest)
    time = float(rest.box.lengths[0] or 0.0) / (2.0 * math.pi * slowed)
    with rest.change() as change:
        change.replace(_drag(rest.grains, time))
    least = min(how.strains) * _density(rest) * stiffest**2
    changed = come_to_rest(rest, time, 0.2 * how.accuracy, least)
    springs = contact_springs(rest, contact)
    at_rest = _at_rest(rest, changed)
    table, matrices = [], []
    strains = sorted(how.strains)
    for k, strain in enumerate(strains):
        columns = []
        for axis in range(3):
            progress(f"strain {strain:g} along {'xyz'[axis]}", 0.1 + 0.6 * (3 * k + axis) / (3 * len(strains)))
            columns.append(strain_both_ways(rest, axis, strain, time, how.accuracy))
        moduli = np.column_stack([one.moduli for one in columns])
        matrices.append(moduli)
        most = {name: max(getattr(one, name) for one in columns) for name in Column._fields[1:]}
        table.append({"strain": strain, **mean_moduli(moduli), **most})
    knocks, standing = {}, {}
    for axis in range(3 if how.sound else 0):
        many = repeated(_start_of(rest), axis, how.copies)
        free = Simulation(
            many.grains, given, box=many.box, contacts=many.contacts, frame_every="1 s", stepping=stepping, seed=seed
        )
        for wave in (Wave(axis, axis), Wave(axis, (axis + 1) % 3)):
            progress(f"waves along {'xyz'[axis]}", 0.7 + 0.1 * axis)
            standing[wave] = standing_wave(free, wave, strains[0], stiffest)
            knocks[wave] = knock(free, wave, strains[0], standing[wave])
    volume = rest.box.volume
    return Moduli(
        rest,
        at_rest,
        table,
        _affine(rest, springs),
        affine_shear_moduli(springs, volume),
        matrices[0],
        knocks,
        standing,
    )


class Begun(NamedTuple):
    """The beginning of a measurement."""

    simulation: Simulation  # of the packing in its box, or of its compression
    until: float  # time of all motions together [s], about


def begin(body: Any, how: Elastic, forces: Sequence[Force] | None, options: dict[str, Any]) -> Begun:
    """The packing in its box, or its compression, and how long all takes.  Raises BadInput."""
    given = list(forces or [Contact()])
    contact = contact_of(given)
    if any(isinstance(force, Gas) for force in given):
        raise BadInput("forces: grains are brought to rest by a drag of its own; leave gas out")
    if how.compress_to is None:
        start = _in_its_box(body, how)
        made, sides, before = _at_start(start, given, options), np.array(start.box.lengths, float), 0.0
        filling, scales = filling_factor(start.grains.radius, sides), scales_of(start.grains, contact)
    else:
        with naming("compress_to"):
            planned = plan(body, _compression(how), given)
        made, sides, before = simulation_of(planned, given, **options), planned.sides, planned.until
        filling, scales = how.compress_to, planned.scales
        sides = sides * (planned.filling(sides) / filling) ** (1.0 / 3.0)
    speed = WAVE * scales.wave_speed * (10.0 * filling) ** STIFFENS
    waves = 250.0 * how.copies if how.sound else 0.0
    return Begun(
        made, before + (20.0 + 200.0 * len(how.strains) + waves) * float(sides.max()) / (2.0 * math.pi * speed)
    )


def _compression(how: Elastic) -> Loading:
    with naming("compress_to"):
        return Loading("compress", how.rate, how.compress_to, box=how.box)


def _at_start(start: Start, forces: Sequence[Force], options: dict[str, Any]) -> Simulation:
    """A packing in its box without velocity, with a drag.  Raises BadInput if it does not percolate."""
    grains = start.grains.copy()
    grains.arrays.velocity[...], grains.arrays.spin[...] = 0.0, 0.0
    made = Simulation(
        grains,
        [*forces, _drag(grains, 1.0)],
        box=start.box,
        contacts=start.contacts,
        deformation=COMPONENTS["deformation"](0.0),
        frame_every="1 s",
        **options,
    )
    pairs = pairs_in_contact(grains, start.box)[0] if start.contacts is None else start.contacts.pair
    refuse_no_network(grains.position, np.asarray(pairs, np.int64), start.box)
    return made


def _in_its_box(body: Any, how: Elastic) -> Start:
    """A packing in the periodic box that it fills.  Raises BadInput."""
    given = body if isinstance(body, Start) else Start(body, None, Box.open(), "")
    if not given.box.is_open:
        given = in_box(how, given, "xyz")
    elif how.box is None:
        raise BadInput(
            "box: the aggregate fills no periodic box, and a free body has no modulus; give compress_to, the filling "
            "factor to which it is compressed first, or the box that it fills"
        )
    elif None in how.box.lengths:
        raise BadInput(f"box: its {'xyz'[how.box.lengths.index(None)]} axis is open; give a length")
    else:
        wrapped = given.grains.copy()
        wrapped.arrays.position[...] = how.box.wrap(given.grains.position).T
        given = Start(wrapped, given.contacts, how.box, given.note)
    return given


def refuse_no_network(position: np.ndarray, pairs: np.ndarray, box: Box) -> None:
    """Raise BadInput if contacts (C, 2) do not join grains to their own images along x, y and z."""
    if not len(pairs):
        raise BadInput("the packing has no contacts; compress it first, with compress_to")
    found = percolation_axes(position, pairs, box)
    if missing := [axis for k, axis in enumerate("xyz") if not found[:, k].any()]:
        raise BadInput(
            f"no contacts join the grains to their own images along {', '.join(missing)}, so that the packing does not "
            "resist a strain; give a box that it fills, or compress it, with compress_to"
        )


class Column(NamedTuple):
    """Response to a small strain of the box along one axis."""

    moduli: np.ndarray  # (3,) −dP_aa/dε [Pa]
    changed: float  # relative change of these in the second half of the time
    unrecovered: float  # what stays of the change of stress when the box is as before, over the change
    at_limit: int  # largest number of contacts at a limit
    made: int
    broken: int
    drift: float  # energy error over the kinetic and elastic energy


def strain_both_ways(rest: Simulation, axis: int, strain: float, time: float, accuracy: float) -> Column:
    """Strain two copies of a packing by ± ε, read the stress when they are at rest, and return.

    The moduli are −(P(+ε) − P(−ε))/2ε: what goes on without a strain is in both, and cancels.
    """
    pair, length = [rest.copy(), rest.copy()], float(rest.box.lengths[axis] or 0.0)
    for each, sign in zip(pair, (1.0, -1.0), strict=True):
        _stretch(each, axis, length * (1.0 + sign * strain), time)
    begun, held, before, moduli, changed = pair[0].time, 4.0 * time, None, np.zeros(3), math.inf
    for _ in range(DOUBLINGS):
        for each in pair:
            each.run(until=begun + held)
        moduli = -(_pressure(pair[0]) - _pressure(pair[1])) / (2.0 * strain)
        if before is not None and (changed := _change(moduli, before)) < accuracy:
            break
        before, held = moduli, 2.0 * held
    limits = max(_at_limit(each) for each in pair)
    made, broken = (
        max(each.ledger.rows[-1][name] - rest.ledger.rows[-1][name] for each in pair) for name in ("made", "broken")
    )
    for each in pair:
        _stretch(each, axis, length, time)
        each.run(until=each.time + held)
    left = np.abs(_pressure(pair[0]) - _pressure(pair[1])).max() / (2.0 * strain * np.abs(moduli).max())
    drift = max(abs(each.ledger.drift) for each in pair)
    return Column(moduli, changed, float(left), limits, int(made), int(broken), drift)


def come_to_rest(simulation: Simulation, time: float, accuracy: float, least: float) -> float:
    """Run until the stress changes by less than `accuracy`, or `least` [Pa], while the time is doubled.

    Returns the last change [Pa]. Warns if it is still larger after DOUBLINGS.
    """
    before, held, start = _pressure(simulation), 4.0 * time, simulation.time
    for _ in range(DOUBLINGS):
        simulation.run(until=start + held)
        now = _pressure(simulation)
        changed = float(np.abs(now - before).max())
        if changed < max(accuracy * np.abs(now).max(), least):
            return changed
        before, held = now, 2.0 * held
    warn(f"the packing is not at rest after {simulation.time:.3g} s: its stress still changes by {changed:.3g} Pa")
    return changed


def contact_springs(simulation: Simulation, contact: Contact) -> ContactSprings:
    """The contacts of a packing and their springs, with the present normal stiffness of the contact law."""
    table, grains, law = simulation.contacts, simulation.grains, contact.contact_law
    pair = np.asarray(table["pair"], np.int64)
    constants_of, stiffness = contact_constants(law), np.zeros((2, len(pair)))
    materials = [grains.materials[k] for k in grains.material]
    for c, (i, j) in enumerate(pair.tolist()):
        numbers = (float(value) for value in (*grains.radius[[i, j]], *grains.mass[[i, j]]))
        constants, overlap = constants_of(contact.pairing(materials[i], materials[j]), *numbers), table["overlap"][c]
        root = law.radius_root(overlap, constants)
        stiffness[:, c] = law.stiffness(overlap, root, constants), constants.slide_stiffness
        if contact.stiffness == "dt97":
            stiffness[1, c] *= root * root
    branch = simulation.box.nearest(grains.position[pair[:, 0]] - grains.position[pair[:, 1]])
    vectors = table["slide_vector"], table["roll_vector"]
    return ContactSprings(branch, grains.radius[pair], *vectors, table["normal_force"], *stiffness)


def _start_of(simulation: Simulation) -> Start:
    """Grains, contacts and box of a simulation, as the start of another one."""
    table = simulation.contacts
    bonds = (np.array(table[name]) for name in ("slide_vector", "roll_vector", "twist"))
    pair = np.asarray(table["pair"], np.int64)
    return Start(simulation.grains.copy(), StrainedContacts(pair, *bonds), simulation.box, "")


def _drag(grains: Grains, time: float) -> Gas:
    """A drag by which the velocity of the quickest grain to stop falls to 1/e in a time [s]."""
    unit = Gas(300.0, density=1.0, brownian=False, cross_section=1e-40)
    return Gas(300.0, density=unit.shortest_time(grains) / time, brownian=False, cross_section=1e-40)


def _without_drag(simulation: Simulation) -> Simulation:
    free = simulation.copy()
    with free.change() as change:
        change.forces = tuple(force for force in change.forces if not isinstance(force, Gas))
    return free


def _stretch(simulation: Simulation, axis: int, length: float, time: float) -> None:
    """Bring a side of the box to a length [m] in a time [s], by a constant velocity."""
    rates = np.zeros(3)
    rates[axis] = (length / float(simulation.box.lengths[axis] or 1.0) - 1.0) / time
    deformation = COMPONENTS["deformation"]
    for each, ends in ((deformation(tuple(rates), law="linear"), simulation.time + time), (deformation(0.0), None)):
        with simulation.change() as change:
            change.deformation = each
        if ends is not None:
            simulation.run(until=ends)


def _pressure(simulation: Simulation) -> np.ndarray:
    return np.diag(simulation.stress().total).copy()


def _change(now: np.ndarray, before: np.ndarray) -> float:
    return float(np.abs(now - before).max() / np.abs(now).max())


def _density(simulation: Simulation) -> float:
    return float(simulation.grains.mass.sum()) / simulation.box.volume


def _affine(simulation: Simulation, springs: ContactSprings) -> np.ndarray:
    pressure = np.diag(simulation.stress().parts["contacts"])
    return affine_moduli(springs, pressure, simulation.box.volume)


def _at_limit(simulation: Simulation) -> int:
    shares = [simulation.contacts[name] for name in ("slide_share", "roll_share", "twist_share")]
    return int((np.max(shares, axis=0) > AT_LIMIT).sum())


def _at_rest(simulation: Simulation, changed: float) -> dict[str, float]:
    """What describes the packing at rest."""
    stress, grains, contacts = simulation.stress(), simulation.grains, simulation.contacts
    kinetic = float(stress.parts["kinetic"].trace()) * stress.volume / 2.0
    residual = {f"residual_{axis}": float(stress.total[a, a]) for a, axis in enumerate("xyz")}
    return {
        "grains": len(grains),
        "filling": filling_factor(grains.radius, simulation.box.lengths),
        "density": _density(simulation),
        "coordination": 2.0 * len(contacts["pair"]) / len(grains),
        "at_limit": _at_limit(simulation),
        "residual": stress.pressure,
        **residual,
        "residual_change": changed,
        "kinetic": kinetic,
        "time": simulation.time,
        "steps": simulation.steps,
        "drift": simulation.ledger.drift,
    }
