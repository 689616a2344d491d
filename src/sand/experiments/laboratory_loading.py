"""How a packing is loaded: rate or pressure, axes, box or walls; settings of `laboratory`."""

from __future__ import annotations

import re
from collections.abc import Iterator, Set
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

from ..basics.arguments import checked
from ..basics.box import as_box
from ..basics.errors import BadInput, shown
from ..basics.settings import Number, Reading, Settings, Word
from ..basics.units import si
from ..config.commands import LOADINGS
from ..theory.compression import CLOSEST

WAYS = ("box", "walls")
"""By what a packing is loaded: its periodic box, or one of two walls. The functions of each are in laboratory_WAY."""


class Rate(NamedTuple):
    """A rate of strain as given."""

    value: float
    unit: str  # "1/s", "/t_c", or "m/s" for the speed of a wall

    def __str__(self) -> str:
        return f"{self.value!r} {self.unit}"


_PER_CONTACT_TIME = re.compile(r"(.+?)(?:\s+1)?\s*/\s*t_?c")


def read_rate(value: Any, name: str) -> Rate:
    """Read a rate of strain, or a speed.  Raises BadInput for a number without a unit, and for all else."""
    if isinstance(value, Rate):
        return value
    advice = "give '1e-5 /t_c', with the time t_c of a contact, '1e4 1/s', or, by = 'walls', a speed such as '10 cm/s'"
    if isinstance(value, (int, float)):
        raise BadInput(f"{name} = {shown(value)} has no unit; {advice}")
    match = _PER_CONTACT_TIME.fullmatch(value.strip()) if isinstance(value, str) else None
    candidates = [(value, "1/s", "1/s"), (value, "m/s", "m/s")] if match is None else [(match[1], "1", "/t_c")]
    for number, unit, called in candidates:
        try:
            found = si(number, unit, name)
        except BadInput:
            continue
        if found > 0.0:
            return Rate(found, called)
        raise BadInput(f"{name} = {shown(value)} must be above 0: what is done gives the direction")
    raise BadInput(f"{name} = {shown(value)} is no rate of strain; {advice}")


def read_load(value: Any, name: str) -> tuple[float, ...]:
    """Read a pressure [Pa] > 0, or several that follow one another.  Raises BadInput."""
    if not isinstance(value, (list, tuple)):
        return (si(value, "Pa", name, above=0.0),)
    if not value:
        raise BadInput(f"{name} = [] has no pressure; give one such as '1 kPa', or several")
    return tuple(si(one, "Pa", f"{name}[{k}]", above=0.0) for k, one in enumerate(value))


LOAD = Reading(read_load, write=lambda load: load[0] if len(load) == 1 else list(load), unit="Pa")
BOX = Reading(lambda value, name: as_box(value), write=lambda box: list(box.lengths))


@checked
@dataclass(frozen=True)
class Loading(Settings):
    """How a packing is loaded.

    Parameters
    ----------
    kind : str
        "compress", "stretch" or "shear".
    rate : float or str, optional
        Rate of strain > 0, needed unless a packing is compressed by a pressure: in units of the time t_c = √(m̄ δ_c/F_c)
        of a contact of two mean grains, "1e-5 /t_c", or "1e4 1/s". The box shrinks or grows exponentially,
        dL/dt = ∓rate × L. A wall moves with a constant speed: rate times the distance of the walls at the start, or a
        speed, "10 cm/s".
    to : float, optional
        Where it ends, needed with a rate: of "compress" a filling factor φ, at most 0.74; of "stretch" the strain
        L/L₀ − 1, and of "shear" the strain, the distance that the faces have slid over the distance between them.
    by : str, optional
        What moves: the periodic "box", or one of two "walls" normal to z, the box being periodic along x and y. "shear"
        slides the images above and below along x, or the lid.
    along : str, optional
        Axis of the strain, "x", "y" or "z"; "all" for equal strains of a box that is compressed. "auto", the default:
        "all" for a box that is compressed, x for one that is stretched, z between walls. Shear is along x, and grows
        along z.
    box : float or str or sequence, optional
        Sides of the box at the start [m], one or three; between walls those along x and y count. By default those of a
        frame, or of a cube that holds the body with a gap of a tenth of a radius.
    every : float, optional
        Change of ln φ, or strain, from row to row of the table, 0.02 by default; of a packing compressed by a pressure
        the part of its time.
    pressure : float or str or sequence, optional
        Between walls: the force on the lid over its area [Pa] > 0, with which it moves freely along z; its mass is that
        of all grains. "compress" by one pressure ends when the packing is at rest; several follow one another, the load
        growing or falling exponentially in equal times. "shear" takes one.
    until : float or str, optional
        Time [s] > 0 at which a compression by a pressure ends at the latest; with several, that of the last one.

    Raises
    ------
    BadInput
        If a setting is unknown, out of range, or contradicts another one; one line for each.
    """

    kind: Annotated[str, Word(*LOADINGS)]
    rate: Annotated[Any, Reading(read_rate, write=str)] = None
    to: Annotated[Any, Number(above=0.0)] = None
    by: Annotated[str, Word(*WAYS)] = "box"
    along: Annotated[str, Word("auto", "all", "x", "y", "z")] = "auto"
    box: Annotated[Any, BOX] = None
    every: Annotated[Any, Number(least=1e-4, most=0.5)] = 0.02
    pressure: Annotated[Any, LOAD] = None
    until: Annotated[Any, Number("s", above=0.0)] = None

    place: ClassVar[str] = ""

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """Keys that are for another kind of test."""
        if not {"kind", "to"} & wrong and self.kind == "compress" and self.to is not None and self.to > CLOSEST:
            yield f"to = {self.to:g} is above {CLOSEST}, the filling factor of the closest packing of equal grains"
        if wrong & {"kind", "rate", "by", "along", "pressure", "until", "to"}:
            return
        if problems := list(self._load_problems()):
            yield from problems
            return
        if self.by == "box" and self.rate.unit == "m/s":
            yield "rate is a speed, which is for by = 'walls'; give a rate such as '1e-5 /t_c'"
        allowed = self.axes_allowed
        if self.along not in ("auto", *allowed):
            advice = f"give {' or '.join(map(repr, allowed))}" if allowed else "leave it out"
            yield f"along = {self.along!r} is not for {self.kind} with by = {self.by!r}; {advice}"

    def _load_problems(self) -> Iterator[str]:
        """Keys of a given load without those of a given strain, or the reverse."""
        if self.pressure is not None and self.by == "box":
            yield (
                "pressure is for by = 'walls'; a periodic box follows a pressure in a case of `sand run`, with "
                "law = 'pressure' in [deformation]"
            )
            return
        if self.pressure is not None and self.kind == "stretch":
            yield "pressure presses the lid against the packing, which is for compress and shear; leave it out"
        if self.pressure is not None and self.kind == "shear" and len(self.pressure) > 1:
            yield "pressure has several values, which are for compress; shear takes one"
        examples = {"rate": "'1e-5 /t_c'", "to": "0.4", "until": "'100 us'"}
        of_rate, of_load = ("rate", "to"), ("until",)
        needed, unused = (of_load, of_rate) if self.load_is_given else (of_rate, of_load)
        by = "a pressure" if self.load_is_given else "a rate"
        for name in needed:
            if getattr(self, name) is None:
                yield f"{name} is missing; add it, for example {name} = {examples[name]}"
        for name in unused:
            if getattr(self, name) is not None:
                ends = " and ".join(needed)
                yield f"{name} is not used by {self.kind} with {by}, which has {ends}; leave it out"

    @property
    def load_is_given(self) -> bool:
        """Whether the load is given, and the strain is measured."""
        return self.kind == "compress" and self.pressure is not None

    @property
    def load_is_constant(self) -> bool:
        """Whether one load is given, under which the packing comes to rest."""
        return self.load_is_given and len(self.pressure) == 1

    @property
    def axes_allowed(self) -> tuple[str, ...]:
        """Values of `along` besides "auto", the default first."""
        if self.kind == "shear":
            return ()
        return ("z",) if self.by == "walls" else ("all", "x", "y", "z") if self.kind == "compress" else ("x", "y", "z")

    @property
    def axes(self) -> str:
        """Axes whose length changes; of shear the axis along which the velocity changes."""
        if self.kind == "shear":
            return "z"
        axis = self.axes_allowed[0] if self.along == "auto" else self.along
        return "xyz" if axis == "all" else axis
