"""Conditions that end a run: comparisons of ledger columns or the wall time with numbers, or a function of the user."""

from __future__ import annotations

import contextlib
import operator
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

from ..analysis.ledger_columns import AWAKE
from ..basics.errors import BadInput, did_you_mean, shown
from ..basics.units import si
from ..io.ledger_table import TEMPERATURES
from .ledger import MOMENTA, NUMBERS
from .stress import PRESSURES

EVERY, EVERY_LONG = 100, 1
"""Regular steps between two checks of a condition, and those of rigid clusters, which are up to 1000 times as long."""
WALL = "wall"
"""Name of the wall time of the present call of `run` [s] in a condition, beside the columns of the ledger."""
GIVEN = "given"
"""Text of a condition that is a function of a script, in case.toml."""
LONGEST, DEEPEST = 1000, 20
"""Characters of a condition, and parentheses within parentheses."""
EXAMPLE = "'clusters == 1' or 'mean_cluster_size >= 20 and time > 1 us'"
OPERATORS: dict[str, Callable[[float, float], bool]] = {
    "<=": operator.le,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
    "<": operator.lt,
    ">": operator.gt,
}
_PARTS = re.compile(r"(\(|\)|<=|>=|==|!=|<|>|\band\b|\bor\b)")

Row = Mapping[str, float]


@dataclass(frozen=True)
class Condition:
    """A condition on a row of the ledger.

    Attributes
    ----------
    text : str
        The condition as the user wrote it.
    names : tuple[str, ...]
        Columns in it.
    holds : Callable[[Row], bool]
        Whether a row meets it.
    """

    text: str
    names: tuple[str, ...]
    holds: Callable[[Row], bool] = field(compare=False)

    every: ClassVar[int] = EVERY

    def check(self, columns: Sequence[str]) -> None:
        """Refuse columns that the ledger lacks.  Raises BadInput."""
        known = [*columns, WALL]
        unknown = [name for name in dict.fromkeys(self.names) if name not in known]
        if unknown:
            raise BadInput(
                f"stop = {shown(self.text)}: unknown quantity '{name}'; {did_you_mean(name, known)}" for name in unknown
            )


@dataclass(frozen=True)
class OwnCondition:
    """A condition given by a function of the simulation, which is called every so many regular steps."""

    function: Callable[[Any], Any]
    every: int = EVERY

    @property
    def text(self) -> str:
        """Text in case.toml."""
        return GIVEN

    def holds(self, simulation: Any) -> bool:
        """Call the function.  Raises BadInput if it returns neither True nor False."""
        found = self.function(simulation)
        try:
            return bool(found)
        except (TypeError, ValueError):
            raise BadInput(f"the function that ends the run returned {shown(found)}; return True or False") from None


def unit_of(column: str) -> str:
    """SI unit of a column of the ledger."""
    if column in ("time", WALL):
        return "s"
    if column in ("step", *NUMBERS, AWAKE):
        return "1"
    if column in MOMENTA:
        return "J s" if column.startswith("angular") else "kg m/s"
    if column in TEMPERATURES:
        return "K"
    return "Pa" if column in PRESSURES else "J"


def read_condition(text: Any) -> Condition:
    """Read a condition: comparisons `quantity operator number`, joined by and, or and parentheses.

    `and` binds more strongly than `or`. The text is never evaluated as Python. Names of quantities are not checked
    here, see `Condition.check`.

    Raises
    ------
    BadInput
        If the text is not such a condition.
    """
    if not isinstance(text, str) or not text.strip():
        raise BadInput(f"stop = {shown(text)} is not a condition; write {EXAMPLE}")
    if len(text) > LONGEST:
        raise BadInput(f"stop = {shown(text)} has {len(text)} characters, more than {LONGEST}")
    reader = _Reader(text.strip())
    return Condition(reader.text, tuple(reader.names), reader.holds)


class _Reader:
    """Reads one condition by recursive descent: or < and < comparison or parentheses."""

    def __init__(self, text: str):
        self.text, self.names = text, list[str]()
        self._parts = [part.strip() for part in _PARTS.split(text) if part.strip()]
        self._depth = 0
        self.holds = self._either()
        if self._parts:
            raise self._error(f"{shown(self._parts[0])} is not expected there")

    def _error(self, what: str) -> BadInput:
        return BadInput(f"stop = {shown(self.text)}: {what}; write {EXAMPLE}")

    def _next(self) -> str:
        return self._parts[0] if self._parts else ""

    def _joined(self, word: str, part: Callable[[], Callable[[Row], bool]]) -> Iterator[Callable[[Row], bool]]:
        yield part()
        while self._next() == word:
            self._parts.pop(0)
            yield part()

    def _either(self) -> Callable[[Row], bool]:
        parts = list(self._joined("or", self._both))
        return lambda row: any(holds(row) for holds in parts)

    def _both(self) -> Callable[[Row], bool]:
        parts = list(self._joined("and", self._one))
        return lambda row: all(holds(row) for holds in parts)

    def _one(self) -> Callable[[Row], bool]:
        if self._next() != "(":
            return self._comparison()
        self._parts.pop(0)
        self._depth += 1
        if self._depth > DEEPEST:
            raise self._error(f"more than {DEEPEST} parentheses within each other")
        holds = self._either()
        if self._next() != ")":
            raise self._error("a parenthesis is not closed")
        self._parts.pop(0)
        self._depth -= 1
        return holds

    def _comparison(self) -> Callable[[Row], bool]:
        name, sign, number = (*self._parts[:3], "", "", "")[:3]
        del self._parts[:3]
        if not re.fullmatch(r"[^\W\d]\w*", name) or sign not in OPERATORS:
            found = " ".join(part for part in (name, sign, number) if part)
            what = "it ends too early" if not found else f"{shown(found)} is not a comparison"
            raise self._error(f"{what}; a comparison is a quantity, one of {' '.join(OPERATORS)}, and a number")
        value: Any = number
        with contextlib.suppress(ValueError):
            value = float(number)  # SI
        unit = unit_of(name)
        if unit == "1" and isinstance(value, str):
            raise self._error(f"{name} is compared with a number without a unit, not with {shown(number)}")
        try:
            limit = si(value, unit, name)
        except BadInput as error:
            raise BadInput(f"stop = {shown(self.text)}: {problem}" for problem in error.problems) from None
        self.names.append(name)
        compare = OPERATORS[sign]
        return lambda row: compare(row[name], limit)
