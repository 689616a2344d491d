"""Building blocks of the tables of all case files: annotated types of values, and the choice of the integrator."""

from __future__ import annotations

import inspect
import typing
from collections.abc import Callable, Iterable
from typing import Annotated, Any, ClassVar, Self, TypeVar

import numpy as np
from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    ValidationInfo,
    create_model,
    field_validator,
    model_validator,
)

from ..basics.arguments import MOST_SEED
from ..basics.errors import did_you_mean, each_once
from ..basics.grains import moment_size
from ..basics.paths import checked_name
from ..basics.settings import For, List, Reading, Setting, Whole
from ..integrate.integrator import methods_of_clusters, moves_bodies
from ..integrate.registry import INTEGRATORS
from ..integrate.verlet import Verlet
from ..simulation.cadence import duration, read_cadence


class Section(BaseModel):
    """A table of a case file; unknown keys in it are errors.

    Annotations say what a key takes and for which value of another key it is, as those of `Settings` do.
    """

    model_config = ConfigDict(extra="forbid", arbitrary_types_allowed=True)
    described_by: ClassVar[Any] = None
    """Class or function whose arguments are keys of the table, and whose docstring describes them."""

    @field_validator("*", mode="before")
    @classmethod
    def _as_declared(cls, value: Any, info: ValidationInfo) -> Any:
        """The value of a key, read as its annotation says."""
        about = cls.model_fields[str(info.field_name)].metadata
        setting = next((each for each in about if isinstance(each, Setting)), None)
        return value if value is None or setting is None else setting.read(value, str(info.field_name))

    @model_validator(mode="after")
    def _fits(self) -> Self:
        """Keys that are missing, not used, or contradict each other."""
        problems = []
        for name, condition in self.conditions().items():
            present = getattr(self, condition.word)
            if present not in condition.values and name in self.model_fields_set:
                problems.append(condition.unused(name, getattr(self, name), present))
            if present in condition.values and condition.needed and getattr(self, name) is None:
                problems.append(condition.missing(name, present))
        problems += self.contradictions()
        if problems:
            raise ValueError("\n".join(problems))
        return self

    @classmethod
    def conditions(cls) -> dict[str, For]:
        """Keys that are for some values of another one."""
        about = ((name, each) for name, field in cls.model_fields.items() for each in field.metadata)
        return {name: each for name, each in about if isinstance(each, For)}

    def contradictions(self) -> Iterable[str]:
        """Messages about keys that do not fit together."""
        return ()


S = TypeVar("S", bound=Section)


def with_keys(kind: Any, *without: str, optional: bool = False) -> Callable[[type[S]], type[S]]:
    """Decorator of a section: it also has the arguments of a settings class or function as keys.

    Parameters
    ----------
    kind : type or callable
        The class or function.
    without
        Arguments that are no keys.
    optional : bool, optional
        All keys may be left out, and are None then.
    """

    def decorate(section: type[S]) -> type[S]:
        hints, keys = typing.get_type_hints(kind), {}
        for name, argument in inspect.signature(kind).parameters.items():
            if name not in without:
                default = ... if argument.default is argument.empty else argument.default
                of = hints[name] if hints[name] in (str, bool) else Any
                keys[name] = (of | None, None) if optional else (of, default)
        section.described_by = kind
        made = create_model(section.__name__, __base__=section, __module__=section.__module__, **keys)  # type: ignore[call-overload]
        made.__doc__ = section.__doc__
        return typing.cast(type[S], made)

    return decorate


def _checked_moment(value: Any, name: str) -> Any:
    """Check a magnetic moment.  Raises BadInput."""
    moment_size(value, np.ones(1))
    return value


Duration = Annotated[Any, Reading(duration)]
"""A time span [s]."""
Cadence = Annotated[Any, Reading(lambda value, name: read_cadence(value, name).setting)]
"""A cadence of output: by time, by steps, or logarithmic in time."""
SaveCadence = Annotated[Any, Reading(lambda value, name: read_cadence(value, name, wall_time=True).setting)]
"""A cadence of checkpoints, also by wall time."""
PathName = Annotated[str, AfterValidator(lambda value, info: checked_name(value, str(info.field_name)))]
"""Name of a file or folder."""
Moment = Annotated[Any, Reading(_checked_moment)]
"""A magnetic moment, absolute or per mass; stays as given."""


class _Seeds(List):
    """A list of seeds, each of which is used once."""

    def read(self, value: Any, name: str) -> tuple[Any, ...]:
        """The seeds."""
        return tuple(each_once(super().read(value, name), name))


Seed = Annotated[int, Whole(0, MOST_SEED)]
"""Seed of random numbers."""
Seeds = Annotated[list[int], _Seeds(Whole(0, MOST_SEED), "seeds, such as [1, 2]")]
"""Seeds of random numbers, at least one."""


def method_of(table: dict[str, Any]) -> str:
    """The integrator that a [stepping] table selects by `method`, or by `clusters`."""
    return str(table.get("method", methods_of_clusters().get(str(table.get("clusters", Verlet.clusters)), "")))


def _without_method(value: Any) -> Any:
    """The [stepping] table without `method` and `clusters`, evaluated by `with_integrator`.

    Raises ValueError if they are unknown or contradict each other.
    """
    if not isinstance(value, dict) or not {"method", "clusters"} & set(value):
        return value
    value = dict(value)
    method, clusters = value.pop("method", None), value.pop("clusters", None)
    if method is not None and str(method) not in INTEGRATORS:
        advice = f"{did_you_mean(str(method), list(INTEGRATORS))}; one of your own needs --import MODULE"
        raise ValueError(f"method = {method!r}; {advice}")
    words = methods_of_clusters()
    if clusters is not None and str(clusters) not in words:
        raise ValueError(f"clusters = {clusters!r}; {did_you_mean(str(clusters), list(words))}")
    bodies = [moves_bodies(INTEGRATORS[name]) for name in (method, words.get(str(clusters))) if name is not None]
    if None not in (method, clusters) and len(set(bodies)) > 1:
        raise ValueError(f"clusters = {clusters!r} contradicts method = {method!r}; leave one of them out")
    return value


Stepping = Annotated[Verlet, BeforeValidator(_without_method)]
"""The [stepping] table; `with_integrator` replaces the class by that of its `method`."""


def with_integrator(model: type[Any], content: dict[str, Any]) -> type[Any]:
    """The model of a case file whose [stepping] table has the keys of the integrator that `content` selects."""
    given = content.get("stepping")
    integrator = INTEGRATORS.get(method_of(given)) if isinstance(given, dict) else None
    if integrator is None or integrator is model.model_fields["stepping"].annotation:
        return model
    section: Any = Annotated[integrator, BeforeValidator(_without_method)]
    return create_model(model.__name__, __base__=model, stepping=(section, integrator()))
