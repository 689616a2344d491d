"""Ramps: parameters of forces that follow a piecewise linear function of time.

A force with ramps has the values of their first points; `force_at` gives the force of a time.
"""

from __future__ import annotations

import dataclasses
import itertools
import math
from collections.abc import Iterator, Sequence, Set
from typing import Annotated, Any, ClassVar, TypeVar

from .arguments import checked
from .errors import BadInput, ErrorCollector, did_you_mean, naming
from .settings import List, Number, Setting, Settings, Whole, declared

STEPS = 1000
"""Default number of changes between two points of a ramp."""
MOST_CHANGES = 1_000_000
"""Largest number of changes between two points of a ramp."""
KEYS = ("values", "times", "steps")
"""Keys of a ramp in a case file."""
T = TypeVar("T")


@checked
@dataclasses.dataclass(frozen=True)
class Ramp(Settings):
    """A parameter of a force that changes linearly in time between given points, in equal steps.

    Between two points the parameter has n values, each that of the ramp in the middle of one of n equal intervals. It
    changes at the first end of a step, or of an r-RESPA cycle, in the next interval, so that no change depends on
    output, interruptions or threads. Before the first point and after the last one it is constant.

    Parameters
    ----------
    values : Sequence
        Values at the points, each as the parameter itself takes it: ["10 mT", "0 T"].
    times : Sequence
        Times of the points [s], which must not decrease: ["1 us", "2 us"]. Two points at one time are a jump.
    steps : int, optional
        n, 1 … 10⁶; 1000 by default. Each change costs about as much as a step.

    Raises
    ------
    BadInput
        If there are fewer than two points, values and times differ in number, or times decrease; one line each.
    """

    values: Annotated[Sequence[Any], List(Setting())]
    times: Annotated[Sequence[Any], List(Number("s"))]
    steps: Annotated[int, Whole(1, MOST_CHANGES)] = STEPS

    place: ClassVar[str] = "ramp"

    def contradictions(self, wrong: Set[str]) -> Iterator[str]:
        """Values and times that differ in number, and times that decrease."""
        values, times = ([] if name in wrong else getattr(self, name) for name in ("values", "times"))
        if not wrong and len(values) != len(times):
            yield f"there are {len(values)} values and {len(times)} times; give one time in s for each value"
        elif not wrong and len(values) < 2:
            yield "a ramp has at least two points; give two values and two times in s"
        for k, (earlier, later) in enumerate(itertools.pairwise(times)):
            if later < earlier:
                yield f"times[{k + 1}] = {later:g} s is before times[{k}] = {earlier:g} s; times must not decrease"

    def interval(self, time: float) -> tuple[int, int]:
        """The last point that is not after a time [s], −1 if there is none, and the interval behind it, from 0."""
        point = max((k for k, at in enumerate(self.times) if at <= time), default=-1)
        if point in (-1, len(self.times) - 1):
            return point, 0
        begin, end = self.times[point : point + 2]
        number = min(int((time - begin) / (end - begin) * self.steps), self.steps - 1)
        while number > 0 and time < self._begin(point, number):
            number -= 1
        while number < self.steps - 1 and time >= self._begin(point, number + 1):
            number += 1
        return point, number

    def _begin(self, point: int, number: int) -> float:
        """Begin [s] of an interval."""
        begin, end = self.times[point : point + 2]
        return float(end if number == self.steps else begin + (end - begin) * (number / self.steps))

    def next_change(self, time: float) -> float:
        """Begin [s] of the interval after that of a time [s]; infinite after the last point."""
        point, number = self.interval(time)
        if point == len(self.times) - 1:
            return math.inf
        return float(self.times[0]) if point < 0 else self._begin(point, number + 1)

    def at(self, time: float) -> Any:
        """Value at a time [s]: that in the middle of the present interval.  For values that are numbers or vectors."""
        point, number = self.interval(time)
        if point in (-1, len(self.times) - 1):
            return self.values[max(point, 0)]
        a, b = self.values[point : point + 2]
        part = (number + 0.5) / self.steps
        if isinstance(a, (tuple, list)):
            return tuple(x + part * (y - x) for x, y in zip(a, b, strict=True))
        return a + part * (b - a)


def rampable(force: type[T]) -> type[T]:
    """Decorator of a force, a frozen dataclass: fields annotated with `RAMP` also take a `Ramp`, or the table of one.

    The fields of a force with ramps have the values of the first points, in SI; `ramps_of` gives the ramps.  They are
    part of its equality and of its settings.
    """
    read, parameters, equals = force.__post_init__, force.parameters, force.__eq__  # type: ignore[attr-defined]
    label = str(getattr(force, "place", force.name))  # type: ignore[attr-defined]

    def read_with_ramps(self: Any) -> None:
        errors, ramps = ErrorCollector(), {}
        names = [key for key, field in declared(force).items() if field.ramp]
        fields = {one.name: getattr(self, one.name) for one in dataclasses.fields(self)}
        for key, value in fields.items():
            if isinstance(value, (Ramp, dict)):
                ramps[key] = errors.take(_as_ramp, value, f"{label}: {key}")
                if key not in names:
                    errors.problems.append(_not_rampable(label, key, names))
        if not ramps:
            read(self)
            return
        errors.done()
        first = {key: ramp.values[0] for key, ramp in ramps.items()}
        points = {
            key: [errors.take(force, **fields | first | {key: value}) for value in ramp.values]
            for key, ramp in ramps.items()
        }
        errors.problems = list(dict.fromkeys(errors.problems))  # those of other parameters are found at each point
        errors.done()
        for key, value in vars(next(iter(points.values()))[0]).items():
            object.__setattr__(self, key, value)
        read_values = {key: [getattr(one, key) for one in found] for key, found in points.items()}
        found = {key: dataclasses.replace(ramp, values=read_values[key]) for key, ramp in ramps.items()}
        object.__setattr__(self, "ramps", found)

    def parameters_with_ramps(self: Any) -> dict[str, Any]:
        """Settings in SI units, as in a case file."""
        return parameters(self) | {key: ramp.parameters() for key, ramp in ramps_of(self).items()}

    def equal(self: Any, other: Any) -> Any:
        same = equals(self, other)
        return same if same is NotImplemented else same and ramps_of(self) == ramps_of(other)

    changed = {"__post_init__": read_with_ramps, "parameters": parameters_with_ramps, "__eq__": equal}
    for name, method in changed.items():
        setattr(force, name, method)
    return force


def _as_ramp(value: Any, where: str) -> Ramp:
    """A ramp, or the table of one in a case file.  Raises BadInput."""
    if isinstance(value, Ramp):
        return value
    problems = [f"{where}: there is no key '{key}'; {did_you_mean(str(key), KEYS)}" for key in value if key not in KEYS]
    problems += [
        f"{where}: {key} is missing; a ramp is a table such as "
        "{ values = ['10 mT', '0 T'], times = ['1 us', '2 us'] }"
        for key in KEYS[:2]
        if key not in value
    ]
    if problems:
        raise BadInput(problems)
    with naming(where):
        return Ramp(**value)


def _not_rampable(label: str, key: str, names: Sequence[str]) -> str:
    others = f"parameters with ramps: {', '.join(names)}" if names else f"no parameter of {label} can be a ramp"
    return f"{label}: {key} cannot be a ramp; {others}"


def ramps_of(force: Any) -> dict[str, Ramp]:
    """The ramps of a force by parameter, with values in SI; empty if it has none."""
    found: dict[str, Ramp] = getattr(force, "ramps", {})
    return found


def force_at(force: Any, time: float) -> Any:
    """The force with the values of its ramps at a time [s]; the force itself if it has no ramps."""
    ramps = ramps_of(force)
    return dataclasses.replace(force, **{key: ramp.at(time) for key, ramp in ramps.items()}) if ramps else force


def forces_at_points(force: Any) -> list[Any]:
    """The force with every combination of the values at points of its ramps; the force itself if it has none."""
    ramps = ramps_of(force)
    points = itertools.product(*(ramp.values for ramp in ramps.values()))
    return [dataclasses.replace(force, **dict(zip(ramps, values, strict=True))) for values in points]
