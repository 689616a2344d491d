"""Case files with every key, its meaning, unit and default, from the classes that read the keys; that of `sand run`."""

from __future__ import annotations

import ast
import contextlib
import dataclasses
import inspect
import itertools
import shlex
import textwrap
from collections.abc import Iterator
from typing import Any, NamedTuple

import tomli_w
from pydantic import BaseModel

from ..basics.descriptions import docstring, parameter_docs
from ..basics.material import LIKE, listed_presets
from ..basics.settings import Whole
from ..forces.registry import FORCES
from ..integrate.registry import INTEGRATORS
from ..neighbours.search import Neighbours
from ..setup.grain_classes import GrainClass
from .case import COMPONENTS, BoxSection, Case, GrainsSection, MaterialSection, RunSection

WIDTH = 110
"""Columns of comments."""
HEAD = """\
# Case file of `sand {command}` with every key.  Check it: sand info {name}   Run it: sand {command} {name}
# Numbers are SI, or text with a unit such as "10 nm".  A line that begins with # and no space is a key, or a table,
# that is not in use, with its default value; remove the # to use it.
"""
Values = dict[str, Any]
"""Values of keys by table: a dict, or of a list of tables one for each."""
EXAMPLES: Values = {
    "run": {"until": "20 us", "frame_every": "0.1 us", "seed": 1},
    "box": {"periodic": "3 um"},
    "grains": {"kind": "gas", "number": 100, "radius": "0.1 um", "material": "silica", "temperature": "300 K"},
    "forces.contact": {"damping": "critical", "damping_ratio": 0.2},
}
"""Keys in use, by table: a gas of silica grains with damped contacts."""
MAGNETIC: Values = {
    "run": {"until": "5 us", "frame_every": "25 ns", "seed": 1},
    "box": {"periodic": "1.2 um"},
    "grains": {
        "kind": "gas",
        "number": 100,
        "material": "iron",
        "moment": "200 A m^2/kg",
        "temperature": "30 K",
    },
    "grains.classes": [{"share": 0.8, "radius": "7 nm"}, {"share": 0.2, "radius": "11 nm"}],
    "forces.contact": {"damping": "critical", "damping_ratio": 0.2, "settling_time": "5 ns"},
    "forces.dipoles": {"periodic": "ewald"},
    "stepping": {"method": "rigid-clusters"},
}
"""Keys in use, by table: a gas of magnetic grains of iron of two sizes.

Both are within the range where moments are permanent: above the blocking radius, 5.9 nm at 30 K, and below that of a
single domain, 11.3 nm (`sand.theory.magnetic_limits`).
"""


REQUIRED = object()
"""Default of a key that its table must have."""


class Key(NamedTuple):
    """A key of a table."""

    name: str
    meaning: str
    default: Any  # None: the key is left out; REQUIRED


class Table(NamedTuple):
    """A table of a case file."""

    head: str  # such as "[run]"
    note: str
    keys: list[Key]


def run_tables() -> list[Table]:
    """The tables of case files of `sand run`."""
    return [
        Table("[run]", "", keys_of(RunSection)),
        Table("[box]", "", keys_of(BoxSection)),
        Table("[grains]", "", [key for key in keys_of(GrainsSection) if key.name != "classes"]),
        Table("[[grains.classes]]", summary(GrainClass), keys_of(GrainClass)),
        material_table(),
        *force_tables(),
        stepping_table(),
        Table("[neighbours]", summary(Neighbours), keys_of(Neighbours)),
        *(Table(_head(name), _purpose(name, own), keys_of(own)) for name, own in COMPONENTS.items()),
    ]


def _head(name: str) -> str:
    """The head of the table of a component, of which a case has one or a list."""
    return f"[{name}]" if Case.model_fields[name].default is None else f"[[{name}]]"


def _purpose(name: str, section: type) -> str:
    """What the table of a component is for."""
    text = summary(section).removeprefix(f"[[{name}]]: ")
    return text[:1].upper() + text[1:]


def force_tables() -> list[Table]:
    """The tables of all forces."""
    return [Table(f"[forces.{force}]", summary(kind), keys_of(kind)) for force, kind in FORCES.items()]


def stepping_table() -> Table:
    """The table [stepping] with the keys of all integrators, each after its method."""
    meaning = f'Integrator; allowed: {", ".join(INTEGRATORS)}. clusters = "rigid" stands for "rigid-clusters".'
    keys = {"method": Key("method", meaning, next(iter(INTEGRATORS)))}
    for method, kind in INTEGRATORS.items():
        for key in keys_of(kind):
            keys.setdefault(key.name, key._replace(meaning=f'With "{method}": {key.meaning}'))
    note = "How the grains are moved. " + " ".join(f'"{name}": {summary(kind)}' for name, kind in INTEGRATORS.items())
    return Table("[stepping]", note, list(keys.values()))


def template(name: str, command: str = "run", tables: list[Table] | None = None, used: Values = EXAMPLES) -> str:
    """Text of a case file with all keys; those of `used` are in use, all others are in comments.

    Parameters
    ----------
    name : str
        Name of the file, for its first line.
    command : str, optional
        The command that reads it.
    tables : list of Table, optional
        Its tables; those of `sand run` by default.
    used : dict of str to dict or list, optional
        Values of the keys in use, by table.
    """
    chosen = run_tables() if tables is None else tables
    parts = ("\n" + "\n".join(_lines(table, _used_of(table, used))) + "\n" for table in chosen)
    return HEAD.format(name=shlex.quote(name), command=command) + "".join(parts)


def _used_of(table: Table, used: Values) -> list[dict[str, Any]]:
    """Values of the keys in use of a table, of each one of a list."""
    given = used.get(table.head.strip("[]"), {})
    return given if isinstance(given, list) else [given]


def _lines(table: Table, given: list[dict[str, Any]]) -> Iterator[str]:
    """Lines of a table: its note, its name, and each key with its meaning; of further ones only the keys in use."""
    used, *further = given
    yield from _comment(table.note)
    yield table.head if used else f"#{table.head}"
    for key in table.keys:
        default = "required" if key.default is REQUIRED else "default: none" if key.default is None else ""
        if key.name in used and not default:
            default = f"default: {_toml(key.default)}"
        yield from _comment(f"{key.meaning} ({default})" if default else key.meaning)
        if key.name in used:
            yield f"{key.name} = {_toml(used[key.name])}"
        else:
            yield f"#{key.name} = {'' if default else _toml(key.default)}".rstrip()
    for values in further:
        yield from ("", table.head, *(f"{name} = {_toml(value)}" for name, value in values.items()))


def _comment(text: str) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent="# ", subsequent_indent="# ", break_on_hyphens=False)


def _toml(value: Any) -> str:
    if isinstance(value, list):
        return f"[{', '.join(map(_toml, value))}]"
    if isinstance(value, dict):
        return f"{{{', '.join(f'{_toml(key)} = {_toml(one)}' for key, one in value.items())}}}"
    return tomli_w.dumps({"key": value}).strip().removeprefix("key = ").replace("\n", "")


def summary(kind: type) -> str:
    """The first line of the docstring of a class."""
    return docstring(kind).partition("\n")[0]


def material_table() -> Table:
    """The table [materials.NAME]."""
    note = f"A new material, or changes to a preset. Presets: {listed_presets()}."
    return Table("[materials.NAME]", note, keys_of(MaterialSection))


def keys_of(kind: Any) -> list[Key]:
    """Keys of a table with meaning and default: the fields of a section (a pydantic model), or of a dataclass."""
    if issubclass(kind, BaseModel):
        described_by = getattr(kind, "described_by", None)
        notes = (parameter_docs(described_by) if described_by else {}) | _attribute_docstrings(kind)
        return [
            Key(
                name,
                notes.get(name, "") + _bounds(field.metadata),
                REQUIRED if field.is_required() else field.get_default(call_default_factory=True),
            )
            for name, field in kind.model_fields.items()
        ]
    meanings = parameter_docs(kind)
    paper = [Key("like", LIKE, None)] * hasattr(kind, "with_paper")
    return paper + [
        Key(one.name, meanings.get(one.name, ""), _default_of(one)) for one in dataclasses.fields(kind) if one.init
    ]


def _default_of(one: Any) -> Any:
    """Default of a field of a dataclass; None of one that is a table of its own."""
    if one.default is not dataclasses.MISSING:
        return one.default
    return REQUIRED if one.default_factory is dataclasses.MISSING else None


def _bounds(metadata: list[Any]) -> str:
    """Text for the range of a whole number, or nothing."""
    return next((f" {each.range.capitalize()}." for each in metadata if isinstance(each, Whole)), "")


def _attribute_docstrings(kind: type) -> dict[str, str]:
    """The text below each attribute of a class and of its bases."""
    found: dict[str, str] = {}
    for owner in reversed(kind.__mro__):
        if not owner.__module__.startswith("sand."):
            continue
        with contextlib.suppress(OSError):  # a class made while the program runs has no source; its bases have theirs
            body = ast.parse(textwrap.dedent(inspect.getsource(owner))).body[0]
            lines = getattr(body, "body", [])
            for entry, text in itertools.pairwise(lines):
                named = isinstance(entry, ast.AnnAssign) and isinstance(entry.target, ast.Name)
                if named and isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                    found[entry.target.id] = " ".join(str(text.value.value).split())
    return found
