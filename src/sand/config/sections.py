"""Building blocks of the tables of all case files: annotated types of values, and the choice of the integrator."""

from __future__ import annotations

from collections.abc import Callable, Collection
from typing import Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, create_model

from ..basics.arguments import MOST_GRAINS, MOST_SEED, MOST_STEPS
from ..basics.grains import moment_size
from ..basics.paths import checked_name
from ..basics.units import si
from ..errors import did_you_mean
from ..integrate.registry import INTEGRATORS
from ..integrate.rigid.rigid_clusters import RigidClusters
from ..integrate.verlet import Verlet
from ..setup.grain_classes import material_as_given, radius_as_given
from ..simulation.cadence import duration, read_cadence


class Section(BaseModel):
    """A table of a case file; unknown keys in it are errors."""

    model_config = ConfigDict(extra="forbid", arbitrary_types_allowed=True)


def quantity(unit: str, **bounds: float) -> Any:
    """Type of a number with a unit, given as text or in SI; `bounds` as for `units.si`."""
    return Annotated[Any, BeforeValidator(_named(lambda value, name: si(value, unit, name, **bounds)))]


def word(allowed: Collection[str]) -> Any:
    """Type of a word out of a few."""

    def read(value: str, info: ValidationInfo) -> str:
        if value not in allowed:
            raise ValueError(f"{info.field_name} = {value!r}; {did_you_mean(value, list(allowed))}")
        return value

    return Annotated[str, AfterValidator(read)]


def _named(function: Callable[[Any, str], Any]) -> Callable[[Any, ValidationInfo], Any]:
    """Validator from a function of a value and the name of its key."""
    return lambda value, info: function(value, str(info.field_name))


def _checked_moment(value: Any) -> Any:
    moment_size(value, np.ones(1))
    return value


Duration = Annotated[Any, BeforeValidator(_named(duration))]
"""A time span [s]."""
Cadence = Annotated[Any, BeforeValidator(_named(lambda value, name: read_cadence(value, name).setting))]
"""A cadence of output: by time, by steps, or logarithmic in time."""
SaveCadence = Annotated[Any, BeforeValidator(_named(lambda value, name: read_cadence(value, name, wall=True).setting))]
"""A cadence of checkpoints, also by wall time."""
PathName = Annotated[str, AfterValidator(_named(checked_name))]
"""Name of a file or folder."""
Moment = Annotated[Any, AfterValidator(_checked_moment)]
"""A magnetic moment, absolute or per mass; stays as given."""
Radii = Annotated[Any, AfterValidator(radius_as_given)]
"""Radii: a length, which becomes SI, a law of radii as text, or a list."""
Materials = Annotated[Any, AfterValidator(material_as_given)]
"""The name of a material, a list of names, or fractions by name."""
Count = Annotated[int, Field(ge=1, le=MOST_GRAINS, strict=True)]
"""A number of grains."""
Steps = Annotated[int, Field(ge=1, le=MOST_STEPS, strict=True)]
"""A number of steps."""
Seed = Annotated[int, Field(ge=0, le=MOST_SEED, strict=True)]
"""Seed of random numbers."""


CLUSTERS = {"grains": Verlet.name, "rigid": RigidClusters.name}
"""`clusters` of the [stepping] table, and the `method` that it stands for."""


def method_of(table: dict[str, Any]) -> str:
    """The integrator that a [stepping] table selects by `method`, or by `clusters`."""
    return str(table.get("method", CLUSTERS.get(str(table.get("clusters", "grains")), "")))


def _without_method(value: Any) -> Any:
    """The [stepping] table without `method` and `clusters`, evaluated by `with_integrator`.

    Raises ValueError if they are unknown or contradict each other.
    """
    if not isinstance(value, dict) or not {"method", "clusters"} & set(value):
        return value
    value = dict(value)
    method, clusters = value.pop("method", None), value.pop("clusters", None)
    if method is not None and str(method) not in INTEGRATORS:
        raise ValueError(f"method = {method!r}; {did_you_mean(str(method), list(INTEGRATORS))}")
    if clusters is not None and str(clusters) not in CLUSTERS:
        raise ValueError(f"clusters = {clusters!r}; {did_you_mean(str(clusters), list(CLUSTERS))}")
    if None not in (method, clusters) and (clusters == "rigid") != (method == CLUSTERS["rigid"]):
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
