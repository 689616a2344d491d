"""Design of a sweep: the keys of a case that change, their values, and which values are combined."""

from __future__ import annotations

import ast
import copy
import itertools
import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from ..basics.errors import BadInput, ErrorCollector, each_once, naming, shown
from ..basics.settings import For, Reading, Whole, Word
from ..basics.unit_factors import factor
from ..config.key_errors import keys_at, setting_at
from ..config.sections import PathName, Section, Seed

MOST_RUNS = 1_000_000
"""Largest number of runs of a sweep."""
DIGITS = 10
"""Digits of the values of ranges and random designs, so that they do not depend on the last bit of a logarithm."""
SCALES: dict[str, tuple[Callable[[float], float], Callable[[float], float]]] = {
    "lin": (lambda x: x, lambda x: x),
    "log": (math.log, math.exp),
    "square": (lambda x: x * x, math.sqrt),
}
"""Quantity that is evenly spaced in a range, and its inverse: the value, its logarithm, its square."""
EVERY = "every combination"
DESIGNS = (EVERY, "latin hypercube", "sobol", "halton", "random")
"""Ways to combine values: all combinations, and random ones, by their names in `scipy.stats.qmc`."""
_RANGE = re.compile(rf"({'|'.join(SCALES)})\((.*)\)")
_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")


class Range(NamedTuple):
    """Values between two ends: `number` of them, or for a random design any."""

    scale: str
    first: float
    last: float
    number: int | None
    unit: str
    whole: bool

    def at(self, part: float) -> Any:
        """The value at a part 0 … 1 of the range, as in a case file."""
        if part in (0.0, 1.0):
            value = (self.first, self.last)[int(part)]
        else:
            forth, back = SCALES[self.scale]
            low, high = forth(self.first), forth(self.last)
            value = float(f"{back(low + (high - low) * part):.{DIGITS}g}")
        if self.whole and not self.unit:
            return round(value)
        return f"{value:.{DIGITS}g} {self.unit}" if self.unit else value

    def values(self) -> list[Any]:
        """The values.  Raises BadInput without `number`."""
        if self.number is None:
            raise BadInput(f"how many values? give {self.scale}(FIRST, LAST, NUMBER), or a random design with samples")
        return [self.at(k / (self.number - 1)) for k in range(self.number)]


def range_of(text: Any, whole: bool) -> Range | None:
    """Read 'log(10 m/s, 200 m/s, 10)' or, without the number of values, 'log(10 m/s, 200 m/s)'; None for other values.

    Parameters
    ----------
    whole : bool
        Whether the values are whole numbers.

    Raises
    ------
    BadInput
        If it is such a range with errors.
    """
    match = _RANGE.fullmatch(text.strip()) if isinstance(text, str) else None
    if match is None:
        return None
    scale, parts = match[1], [part.strip() for part in match[2].split(",")]
    ends = [_QUANTITY.fullmatch(part) for part in parts[:2]]
    if len(parts) not in (2, 3) or None in ends:
        raise BadInput(f"{shown(text)} must be {scale}(FIRST, LAST, NUMBER), such as log(10 m/s, 200 m/s, 10)")
    (first, unit), (last, other) = (end.groups() for end in ends if end is not None)
    ratio = 1.0 if unit == other else factor(other, unit) if unit and other else None
    if ratio is None:
        raise BadInput(f"{shown(text)}: both ends need the same unit, such as log(10 m/s, 200 m/s, 10)")
    number = int(parts[2]) if len(parts) == 3 and parts[2].isdecimal() else None
    if len(parts) == 3 and (number is None or not 2 <= number <= MOST_RUNS):
        raise BadInput(f"{shown(text)}: the number of values must be a whole number of at least 2")
    low, high = float(first), float(f"{float(last) * ratio:.{DIGITS}g}")
    if not low < high or (scale == "log" and low <= 0.0) or (scale == "square" and low < 0.0):
        least = {"lin": "", "log": ", above 0", "square": ", at least 0"}[scale]
        raise BadInput(f"{shown(text)}: the first value must be below the last one{least}")
    return Range(scale, low, high, number, unit, whole)


def _seeds(value: Any, name: str) -> list[int]:
    """A number of seeds, from 1, or a list of them.  Raises BadInput."""
    if type(value) is int and 1 <= value <= MOST_RUNS:
        return list(range(1, value + 1))
    if isinstance(value, list) and value and all(type(one) is int and 0 <= one < 2**63 for one in value):
        return each_once(value, name)
    raise BadInput(f"{name} = {shown(value)} must be a number of seeds, such as 3 (1, 2 and 3), or a list such as [7]")


def flat_keys(table: Any, name: str = "vary") -> dict[str, Any]:
    """Values by dotted key, from tables within tables as TOML makes of dotted keys.  Raises BadInput."""
    if not isinstance(table, dict) or {} in table.values():
        raise BadInput(f"{name} = {shown(table)} must be a table of keys with their values")
    found: dict[str, Any] = {}
    for key, value in table.items():
        found |= {f"{key}.{k}": v for k, v in flat_keys(value).items()} if isinstance(value, dict) else {key: value}
    return found


def several(value: Any, name: str) -> list[dict[str, Any]]:
    """A list of tables of keys.  Raises BadInput."""
    if not isinstance(value, list):
        raise BadInput(f"{name} must be a list of tables, [[sweep.{name}]]")
    return [flat_keys(one, name) for one in value]


class SweepSection(Section):
    """Section [sweep]: keys of the case that change from run to run, their values, seeds and results."""

    vary: Annotated[dict[str, Any], Reading(flat_keys)] = Field(default_factory=dict)
    """Keys with their values: a list, one value, or a range with the number of values: `lin(1 um, 3 um, 5)`, spaced
    evenly, `log(10 m/s, 200 m/s, 10)`, evenly in the logarithm, `square(0 b, 1 b, 6)`, evenly in the square."""
    together: Annotated[list[Any], Reading(several)] = Field(default_factory=list)
    """Tables of keys that change together, each with equally many values: [[sweep.together]]."""
    seeds: Annotated[Any, Reading(_seeds)] = None
    """Seeds of each combination: how many, from 1, or a list; none: those of the case."""
    design: Annotated[str, Word(among=DESIGNS)] = EVERY
    """Which values are combined: `every combination`, or a random design with `samples` combinations."""
    samples: Annotated[
        int | None, Whole(1, MOST_RUNS), For("design", *DESIGNS[1:], needed="a number of combinations, such as 100")
    ] = None
    """Combinations of a random design, in which ranges without a number of values, `log(10 m/s, 200 m/s)`, give any
    value."""
    design_seed: Annotated[Seed, For("design", *DESIGNS[1:])] = 0
    """Seed of a random design."""
    files: Annotated[str, Word("all", "none")] = "all"
    """What is kept of a run besides its row: `all` files of `sand run`, by which it is also resumed; or `none`."""
    out: PathName | None = None
    """Folder of the sweep."""


class Design:
    """Combinations of values of a sweep.

    Parameters
    ----------
    section : SweepSection
        Keys with their values, and how these are combined.
    whole : callable
        Whether a key takes whole numbers.

    Raises
    ------
    BadInput
        All errors of values and combinations.
    """

    def __init__(self, section: SweepSection, whole: Callable[[str], bool]):
        self.section, errors = section, ErrorCollector()
        tables = [*({key: value} for key, value in section.vary.items()), *section.together]
        self.groups = [errors.take(self._group, table, whole, instead={}) for table in tables]
        keys = [key for table in tables for key in table]
        errors.problems += [f"{key}: its values are given twice" for key in dict.fromkeys(keys) if keys.count(key) > 1]
        if not keys and section.seeds is None:
            errors.problems.append(
                "nothing changes: give keys with values, --vary KEY=VALUES or [sweep.vary], or seeds"
            )
        errors.done()
        number = section.samples or math.prod(len(next(iter(group.values()))) for group in self.groups)
        number *= len(section.seeds or [0])
        if number > MOST_RUNS:
            raise BadInput(f"{number:.2g} runs are more than {MOST_RUNS:.0e}; give fewer values, or fewer seeds")

    def _group(self, table: Mapping[str, Any], whole: Callable[[str], bool]) -> dict[str, Any]:
        """Values of keys that change together: lists, or for a random design ranges."""
        errors = ErrorCollector()
        found = {key: errors.take(self._values, key, given, whole(key), instead=[]) for key, given in table.items()}
        errors.done()
        numbers = {key: len(values) for key, values in found.items() if isinstance(values, list)}
        if len(set(numbers.values())) > 1:
            texts = " and ".join(f"{key} {number}" for key, number in numbers.items())
            raise BadInput(f"keys that change together need equally many values; there are {texts}")
        return found

    def _values(self, key: str, given: Any, whole: bool) -> list[Any] | Range:
        """The values of one key.  Raises BadInput."""
        with naming(key):
            if self.section.design != EVERY and (one := range_of(given, whole)) and one.number is None:
                return one
            found: list[Any] = []
            for entry in given if isinstance(given, list) else [given]:
                spread = range_of(entry, whole)
                found += [entry] if spread is None else spread.values()
        if not found:
            raise BadInput(f"{key}: there is no value; give a list such as [500, 4000]")
        return found

    def combinations(self) -> Iterator[dict[str, Any]]:
        """Values by key, of each combination; the last key changes fastest."""
        for parts in self._parts():
            yield {
                key: values[part] if isinstance(values, list) else values.at(part)
                for group, part in zip(self.groups, parts, strict=True)
                for key, values in group.items()
            }

    def _parts(self) -> Iterator[tuple[Any, ...]]:
        """Of each combination and group: the index of the value in lists, or the part 0 … 1 of ranges."""
        if self.section.design == EVERY or not self.groups:
            yield from itertools.product(*(range(len(next(iter(group.values())))) for group in self.groups))
            return
        numbers = [min((len(v) for v in group.values() if isinstance(v, list)), default=0) for group in self.groups]
        for row in _points(self.section, len(self.groups)).tolist():
            yield tuple(min(int(u * n), n - 1) if n else u for u, n in zip(row, numbers, strict=True))


def _points(section: SweepSection, dimensions: int) -> np.ndarray:
    """Points of a random design in the unit cube, (samples, dimensions)."""
    rng = np.random.default_rng(section.design_seed)
    if section.design == "random":
        return rng.random((section.samples or 0, dimensions))
    import warnings

    from scipy.stats import qmc

    kinds = {"latin hypercube": qmc.LatinHypercube, "sobol": qmc.Sobol, "halton": qmc.Halton}
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of numbers of Sobol points that are no powers of 2, and of the name of `seed`
        return np.asarray(kinds[section.design](dimensions, seed=rng).random(section.samples))


def key_error(model: type, content: Mapping[str, Any], key: str) -> str | None:
    """Error message for a dotted key that a case does not have; None if it has it.

    Parameters
    ----------
    model : type
        Model of the case file.
    content : mapping
        Content of the case file, whose optional tables must exist.
    """
    parts, node = key.split("."), content
    for k, name in enumerate(parts):
        place = ".".join(parts[:k])
        if isinstance(node, list):
            names = [str(n) for n in range(len(node))]
        elif isinstance(node, Mapping):
            names = keys_at(model, tuple(parts[:k])) or list(node)
        else:
            return f"{key}: {place} is no table"
        if name not in names and place == "materials" and not names:
            return f"{key}: the case has no table [materials.{name}]; add it to the case file"
        if name not in names:
            where = f"[{place}] has" if place else "there are the tables"
            return f"{key}: there is no such key; {where}: {', '.join(names)}"
        inside = node[int(name)] if isinstance(node, list) else node.get(name, {} if k == 0 else None)
        if inside is None and k + 1 < len(parts):
            return f"{key}: the case has no table [{place}.{name}]; add it to the case file"
        node = inside
    return None if len(parts) > 1 else f"{key} is a table; give one of its keys: {', '.join(keys_at(model, (key,)))}"


def takes_whole_numbers(model: type, key: str) -> bool:
    """Whether a dotted key of a case takes whole numbers."""
    return isinstance(setting_at(model, tuple(key.split("."))), Whole)


def changed_content(content: dict[str, Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """The content of a case file with other values of dotted keys; tables that do not change are shared."""
    whole = dict(content)
    for key, value in values.items():
        node: Any = whole
        *tables, last = key.split(".")
        for name in tables:
            at: Any = int(name) if isinstance(node, list) else name
            inside = copy.copy(node[at]) if isinstance(node, list) or at in node else {}
            node[at] = node = inside
        node[int(last) if isinstance(node, list) else last] = value
    return whole


def without_keys(content: Mapping[str, Any], keys: list[str]) -> dict[str, Any]:
    """The content of a case file without these dotted keys."""
    whole = dict(content)
    for key in keys:
        table, dot, rest = key.partition(".")
        if not dot:
            whole.pop(table, None)
        elif isinstance(inside := whole.get(table), dict):
            whole[table] = (
                without_keys(inside, [rest]) if "." in rest else {k: v for k, v in inside.items() if k != rest}
            )
            if not whole[table]:
                del whole[table]
    return whole


def value_read(case: Any, key: str, given: Any) -> Any:
    """The value of a dotted key as a checked case has it, in SI, if it is a number, a flag or a word; else as given."""
    node = case
    for name in key.split("."):
        if isinstance(node, (list, tuple)):
            node = node[int(name)] if int(name) < len(node) else None
        else:
            node = node.get(name) if isinstance(node, dict) else getattr(node, name, None)
    return node if type(node) in (bool, int, float, str) else given


def read_varied(text: str) -> dict[str, Any]:
    """Keys and values of `--vary`: 'KEY=1,2,3', several that change together separated by ';'.  Raises BadInput."""
    found: dict[str, Any] = {}
    for part in split_outside(text, ";"):
        key, sign, values = part.partition("=")
        if not sign or not key.strip() or not values.strip():
            raise BadInput(f"--vary {shown(text)} must be KEY=VALUES, such as impact.speed='10 m/s, 20 m/s'")
        found[key.strip()] = [_value(one.strip()) for one in split_outside(values, ",")]
    return found


def split_outside(text: str, mark: str) -> list[str]:
    """Parts of a text between marks that are not within brackets or quotes."""
    parts, depth, quote = [""], 0, ""
    for char in text:
        if quote:
            quote = "" if char == quote else quote
        elif char in "\"'":
            quote = char
        depth += (char in "([{") - (char in ")]}") if not quote else 0
        if char == mark and depth == 0 and not quote:
            parts.append("")
        else:
            parts[-1] += char
    return parts


def _value(text: str) -> Any:
    """A value as in TOML, or text without quotes."""
    if text in ("true", "false"):
        return text == "true"
    try:
        value = ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):
        return text
    return value if isinstance(value, (int, float, str, list)) else text
