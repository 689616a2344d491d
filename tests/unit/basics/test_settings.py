"""Settings declared once: constructor, `parameters()`, units, case file and messages follow the annotations."""

import dataclasses
from typing import Annotated, Any, ClassVar

import pytest
from pydantic import TypeAdapter

import sand
from sand.basics.arguments import checked
from sand.basics.descriptions import documented_units
from sand.basics.errors import BadInput
from sand.basics.settings import (
    AlongZ,
    Direction,
    Flag,
    For,
    List,
    Number,
    Settings,
    Table,
    Vector,
    Whole,
    Word,
    declared,
)
from sand.config.case import WallSection
from sand.config.sections import Section, with_keys
from sand.config.template import REQUIRED, keys_of
from sand.forces.registry import FORCES
from sand.integrate.registry import INTEGRATORS
from sand.setup import GrainClass

CLASSES = [
    *FORCES.values(),
    *INTEGRATORS.values(),
    *(sand.Neighbours, sand.Material, sand.Wall, sand.Driven, sand.Deformation, sand.Ramp, GrainClass),
]


@checked
@dataclasses.dataclass(frozen=True)
class Inner(Settings):
    """Settings within others.

    Parameters
    ----------
    size : float, optional
        Size [m].
    """

    size: Annotated[Any, Number("m", above=0.0, most=1.0)] = 0.5

    place: ClassVar[str] = "inner"


@checked
@dataclasses.dataclass(frozen=True)
class Pull(Settings):
    """One field of each kind.

    Parameters
    ----------
    strength : float
        Strength [N].
    shape : str, optional
        Its time dependence.
    end : float, optional
        Its end [s].
    start : float, optional
        Its start [s].
    count : int, optional
        A number.
    on : bool, optional
        Whether it acts.
    point, axis, field : sequence, optional
        Where and whereto.
    indices : list, optional
        Grains.
    inner : Inner, optional
        More.
    """

    strength: Annotated[Any, Number("N", least=0.0)]
    shape: Annotated[str, Word("constant", "ramp")] = "constant"
    end: Annotated[Any, Number("s"), For("shape", "ramp", needed="a time in s, such as '5 us'")] = None
    start: Annotated[Any, Number("s"), For("shape", "ramp", default=0.0)] = None
    count: Annotated[Any, Whole(1, 9, auto=True)] = "auto"
    on: Annotated[bool, Flag()] = True
    point: Annotated[Any, Vector("m")] = (0.0, 0.0, 0.0)
    axis: Annotated[Any, Direction(unit_length=True)] = (0.0, 0.0, 1.0)
    field: Annotated[Any, AlongZ("T")] = 0.0
    indices: Annotated[Any, List(Whole(0), "indices, such as [0, 1]")] = (0,)
    inner: Annotated[Inner, Table(Inner)] = dataclasses.field(default_factory=Inner)

    place: ClassVar[str] = "pull"

    def contradictions(self, wrong):
        """A ramp that ends before its start."""
        if not wrong & {"shape", "start", "end"} and self.shape == "ramp" and not self.end > self.start:
            yield "end must be after start"


def test_values_are_read_and_written():
    """Text with units becomes SI, defaults of a condition are filled in; `parameters()` makes an equal object."""
    one = Pull("2 mN", "ramp", end="5 us", axis=[0, 3, 4], field="1 mT", indices=[3, 4], inner=Inner("10 cm"))
    assert (one.strength, one.end, one.start, one.count) == (2e-3, 5e-6, 0.0, "auto")
    assert (one.axis, one.field, one.indices) == ((0.0, 0.6, 0.8), (0.0, 0.0, 1e-3), (3, 4))
    written = one.parameters()
    assert written["axis"] == [0.0, 0.6, 0.8] and written["inner"] == {"size": 0.1} and written["start"] == 0.0
    assert Pull(**written | {"inner": Inner(**written["inner"])}) == one
    assert TypeAdapter(Pull).validate_python(written) == one
    assert "start" not in Pull(1.0).parameters()
    assert one.units == {"strength": "N", "end": "s", "start": "s", "point": "m", "field": "T"}


@pytest.mark.parametrize(
    ("given", "lines"),
    [
        ({"strength": -1}, ["pull: strength = -1 must be at least 0 N"]),
        ({"strength": None}, ["pull: strength = None is not a quantity in N"]),
        ({"shape": "rmp"}, ["pull: shape = 'rmp'; did you mean 'ramp'?"]),
        ({"shape": 3, "end": 1.0}, ["pull: shape = 3 must be text; allowed: constant, ramp"]),
        ({"shape": "ramp"}, ["pull: end is missing: shape = 'ramp' needs a time in s, such as '5 us'"]),
        (
            {"end": "x"},
            ["pull: end = 'x' is not used by shape = 'constant'; leave it out, or give shape = 'ramp'"],
        ),
        ({"shape": "ramp", "end": -1.0}, ["pull: end must be after start"]),
        ({"count": 10}, ['pull: count = 10 must be a whole number from 1 to 9, or "auto"']),
        ({"on": 1}, ["pull: on = 1 must be true or false"]),
        ({"point": [0, "1 s", "2 s"]}, ["pull: point y = '1 s'", "pull: point z = '2 s'"]),
        ({"axis": [0, 0, 0]}, ["pull: axis = [0, 0, 0] has no direction; give three numbers, not all 0"]),
        ({"indices": []}, ["pull: indices = [] is empty; give indices, such as [0, 1]"]),
        ({"indices": 3}, ["pull: indices = 3 must be a list; give indices, such as [0, 1]"]),
        ({"indices": [0, -1]}, ["pull: indices[1] = -1 must be a whole number of at least 0"]),
        ({"inner": {"size": 1}}, ["pull: inner = {'size': 1}; give Inner(…)"]),
        ({"strength": "1 m", "on": None, "count": 0}, ["pull: strength", "pull: count", "pull: on"]),
    ],
)
def test_every_mistake_is_one_line(given, lines):
    """What, where, unit, what is allowed; contradictions only of fields that could be read."""
    with pytest.raises(BadInput) as caught:
        Pull(**{"strength": 1.0} | given)
    assert len(caught.value.problems) == len(lines)
    for line, found in zip(lines, caught.value.problems, strict=True):
        assert found.startswith(line)


def test_both_bounds_of_a_range_are_named():
    """Whichever of them a number exceeds."""
    for size in (0.0, 2.0):
        with pytest.raises(BadInput, match=r"inner: size = .* must be above 0 and at most 1 m"):
            Inner(size)


def test_a_section_has_the_keys_of_a_class():
    """With their defaults and descriptions, beside its own keys; conditions of sections are those of classes."""

    @with_keys(Inner)
    class Outer(Section):
        """A section."""

        kind: str = "gas"
        """What."""
        file: Annotated[str | None, For("kind", "file", needed="a name")] = None
        """Which."""
        length: Annotated[Any, Number("m", above=0.0)] = None
        """How long."""

    found = {key.name: (key.meaning, key.default) for key in keys_of(Outer)}
    assert found["size"] == ("Size [m].", 0.5)
    required = {key.name for key in keys_of(WallSection) if key.default is REQUIRED}
    assert required == {"material", "point", "normal"}
    assert Outer(length="1 um").length == 1e-6
    for given, line in (
        ({"kind": "file"}, "file is missing: kind = 'file' needs a name"),
        ({"file": "a"}, "file = 'a' is not used by kind = 'gas'; leave it out, or give kind = 'file'"),
        ({"length": "1 s"}, "length = '1 s' is a time, not a quantity in m"),
    ):
        with pytest.raises(ValueError, match=line):
            Outer(**given)


@pytest.mark.parametrize("kind", CLASSES)
def test_every_field_is_declared_and_described(kind):
    """Each field of a settings class has an annotation, a description, and the unit that the docstring gives."""
    fields = declared(kind)
    others = {field.name for field in dataclasses.fields(kind) if field.init} - set(fields)
    assert others <= {"name"}  # of a material: any text
    keys = keys_of(kind)
    own = [key.name for key in keys if key.name != "like"]  # a key of tables, which names another model
    assert own == [field.name for field in dataclasses.fields(kind) if field.init]
    assert all(key.meaning for key in keys)
    documented = documented_units(kind)
    for name, field in fields.items():
        if field.setting.unit not in ("", "1") and name in documented:
            assert field.setting.unit == documented[name], name
    required = {key.name for key in keys if key.default is REQUIRED}
    assert not required & {name for name, field in fields.items() if field.condition}
