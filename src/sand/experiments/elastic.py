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
from ..basics.errors import BadInput, ErrorCollector, naming
from ..basics.settings import Flag, List, Number, Reading, Settings, Whole
from ..config.case import COMPONENTS
from ..contact.model import Contact
from ..forces.base import Force
from ..forces.gas import Gas
from ..integrate.integrator import Integrator
from ..setup.checks import pairs_in_contact
from ..setup.from_frame import Start
from ..simulation.simulation import Simulation
from ..theory.elastic import affine_shear_moduli
from .elastic_strain import (
    Column,
    affine_of,
    come_to_rest,
    contact_springs,
    density_of,
    drag,
    start_of,
    state_at_rest,
    strain_both_ways,
    without_drag,
)
from .elastic_waves import Knock, Wave, knock, repeated, standing_wave
from .job import ignored
from .laboratory import contact_of, filling_factor, plan, run_to_end, simulation_of
from .laboratory_box import in_box
from .laboratory_loading import BOX, Loading, read_rate

WAVE, STIFFENS = 0.005, 2.3
"""Speed of sound over √(E/ρ) of the solid at φ = 0.1, and its exponent of φ, by which the cost is estimated."""
STRESS_FREE = 1e-6
"""Strain of the relaxed packing whose stress counts as none, when a packing without residual stress comes to rest."""
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
        and the packing as at rest when its stress changes by less than a fifth of it: above 0, at most 0.5. A warning
        says what is not complete after the longest time.
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
    strains: list[float]  # in increasing order
    columns: list[list[Column]]  # responses to each strain along x, y, z
    affine: np.ndarray  # (3, 3) C_ab [Pa] of affine motion
    affine_shear: np.ndarray  # (3, 3) [Pa]
    knocks: dict[Wave, Knock]
    standing: dict[Wave, float]  # phase speeds of standing waves [m/s]

    @property
    def relaxed(self) -> np.ndarray:
        """C_ab = −dP_aa/dε_b (3, 3) [Pa] at the smallest strain."""
        return matrix_of(self.columns[0])

    @property
    def table(self) -> list[dict[str, float]]:
        """A row for each strain: means of the moduli, and the largest values of all else."""
        most = [{name: max(getattr(one, name) for one in each) for name in Column._fields[1:]} for each in self.columns]
        rows = zip(self.strains, self.columns, most, strict=True)
        return [{"strain": strain, **mean_moduli(matrix_of(each)), **other} for strain, each, other in rows]

    @property
    def linear_to(self) -> float:
        """Largest strain up to which the bulk modulus is that of the smallest one within LINEAR."""
        return linear_range([(row["strain"], row["bulk"]) for row in self.table])

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
        matrices, table = {"relaxed": self.relaxed.tolist(), "affine": self.affine.tolist()}, self.table
        return content | matrices | {"table": {name: [row[name] for row in table] for name in table[0]}, "waves": waves}


def matrix_of(columns: Sequence[Column]) -> np.ndarray:
    """C_ab (3, 3) [Pa] of the responses to strains along x, y and z."""
    return np.column_stack([one.moduli for one in columns])


def linear_range(moduli: Sequence[tuple[float, float]]) -> float:
    """Largest of some increasing strains up to which the modulus is that of the first one within LINEAR."""
    last = moduli[0][0]
    for strain, modulus in moduli:
        if abs(modulus / moduli[0][1] - 1.0) > LINEAR:
            break
        last = strain
    return last


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
        rest = _at_start(start_of(loaded.simulation), given, options)
    progress("coming to rest", 0.05)
    springs = contact_springs(rest, contact)
    stiffest = math.sqrt(np.diag(affine_of(rest, springs)).max() / density_of(rest))
    slowed = standing_wave(without_drag(rest), Wave(0, 0), min(how.strains), stiffest)
    time = float(rest.box.lengths[0] or 0.0) / (2.0 * math.pi * slowed)
    with rest.change() as change:
        change.replace(drag(rest.grains, time))
    least = min(*how.strains, STRESS_FREE) * density_of(rest) * slowed**2
    found = come_to_rest(rest, time, 0.2 * how.accuracy, least)
    springs = contact_springs(rest, contact)
    at_rest = state_at_rest(rest, *found)
    strains = sorted(how.strains)
    columns: list[list[Column]] = []  # for each strain those of the axes
    for k, strain in enumerate(strains):
        columns.append([])
        for axis, name in enumerate("xyz"):
            progress(f"strain {strain:g} along {name}", 0.1 + 0.2 * (3 * k + axis) / len(strains))
            columns[k].append(strain_both_ways(rest, axis, strain, time, how.accuracy))
    knocks, standing, moduli = {}, {}, mean_moduli(matrix_of(columns[0]))
    for axis, name in enumerate("xyz" if how.sound else ""):
        progress(f"waves along {name}", 0.7 + 0.1 * axis)
        many = repeated(start_of(rest), axis, how.copies)
        free = Simulation(
            many.grains, given, box=many.box, contacts=many.contacts, frame_every="1 s", stepping=stepping, seed=seed
        )
        for wave, one in ((Wave(axis, axis), "longitudinal"), (Wave(axis, (axis + 1) % 3), "shear")):
            static = math.sqrt(max(moduli[one], 0.0) / density_of(rest))
            standing[wave] = standing_wave(free, wave, strains[0], stiffest, static)
            knocks[wave] = knock(free, wave, strains[0], standing[wave])
    affine, shear = affine_of(rest, springs), affine_shear_moduli(springs, rest.box.volume)
    return Moduli(rest, at_rest, strains, columns, affine, shear, knocks, standing)


class Begun(NamedTuple):
    """The beginning of a measurement."""

    simulation: Simulation  # of the packing in its box, or of its compression
    until: float  # time of all motions together [s], about


def begin(body: Any, how: Elastic, forces: Sequence[Force] | None, options: dict[str, Any]) -> Begun:
    """The packing in its box, or its compression, and how long all takes.  Raises BadInput."""
    given = list(forces or [Contact()])
    contact_of(given)
    if any(isinstance(force, Gas) for force in given):
        raise BadInput("forces: grains are brought to rest by a drag of its own; leave gas out")
    if how.compress_to is None:
        start = _in_its_box(body, how)
        made, lengths, before = _at_start(start, given, options), np.array(start.box.lengths, float), 0.0
        filling = filling_factor(start.grains.radius, lengths)
    else:
        with naming("compress_to"):
            planned = plan(body, _compression(how), given)
        made, filling, before = simulation_of(planned, given, **options), how.compress_to, planned.until
        lengths = planned.sides * (planned.filling(planned.sides) / filling) ** (1.0 / 3.0)
    solid = made.grains.materials[0]
    speed = WAVE * math.sqrt(solid.young_modulus / solid.density) * (10.0 * filling) ** STIFFENS
    number = 20.0 + 200.0 * len(how.strains) + (250.0 * how.copies if how.sound else 0.0)
    return Begun(made, before + number * float(lengths.max()) / (2.0 * math.pi * speed))


def _compression(how: Elastic) -> Loading:
    with naming("compress_to"):
        return Loading("compress", how.rate, how.compress_to, box=how.box)


def _at_start(start: Start, forces: Sequence[Force], options: dict[str, Any]) -> Simulation:
    """A packing in its box without velocity, with a drag.  Raises BadInput if it does not percolate."""
    if start.box.tilt:
        raise BadInput(
            "the box is tilted; the moduli need a box with right angles, such as a frame of sand compress has"
        )
    grains = start.grains.copy()
    grains.arrays.velocity[...], grains.arrays.spin[...] = 0.0, 0.0
    made = Simulation(
        grains,
        [*forces, drag(grains, 1.0)],
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
        given = in_box(how.box, given, "xyz")
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
