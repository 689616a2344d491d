"""What the tables of all case files are made of."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import AfterValidator, BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo

from ..arguments import MOST_GRAINS, MOST_SEED, MOST_STEPS
from ..io.run_folder import checked_name
from ..simulation.stop import duration
from ..units import si


class Section(BaseModel):
    """A table of a case file; an unknown key in it is a mistake."""

    model_config = ConfigDict(extra="forbid", arbitrary_types_allowed=True)


def quantity(unit: str, **bounds: float) -> Any:
    """A number with a unit, as text or in SI."""

    def read(value: Any, info: ValidationInfo) -> float:
        return si(value, unit, str(info.field_name), **bounds)

    return Annotated[Any, BeforeValidator(read)]


def _duration(value: Any, info: ValidationInfo) -> float:
    return duration(value, str(info.field_name))


def _name(value: str, info: ValidationInfo) -> str:
    return checked_name(value, str(info.field_name))


Duration = Annotated[Any, BeforeValidator(_duration)]
"""[s]"""
PathName = Annotated[str, AfterValidator(_name)]
"""Of a file or folder."""
Count = Annotated[int, Field(ge=1, le=MOST_GRAINS, strict=True)]
"""A number of grains."""
Steps = Annotated[int, Field(ge=1, le=MOST_STEPS, strict=True)]
"""A number of steps."""
Seed = Annotated[int, Field(ge=0, le=MOST_SEED, strict=True)]
"""Of random numbers."""
