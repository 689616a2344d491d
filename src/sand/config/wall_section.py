"""The [[walls]] of case files."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

from pydantic import ValidationError

from ..basics.errors import BadInput, did_you_mean
from ..basics.material import Material
from ..components.walls import Wall, Walls, read_walls
from ..setup.grain_classes import in_library
from .sections import Section, with_keys


@with_keys(Wall, "material")
class WallSection(Section):
    """[[walls]]: a plane to which grains stick; see `sand.Wall`."""

    material: str
    """Preset or name in [materials]."""

    def build(self, materials: dict[str, Material]) -> Wall:
        """Build the wall.  Raises BadInput."""
        given = self.model_dump(exclude_none=True, exclude={"material"})
        return Wall(material=in_library(self.material, materials), **given)


def wall_errors(walls: Any, known: Collection[str]) -> list[str]:
    """Error messages for the numbers in [[walls]], and for materials that do not exist."""
    problems: list[str] = []
    for k, section in enumerate(walls if isinstance(walls, list) else []):
        try:
            wall = WallSection.model_validate(section)
            if wall.material not in known:
                hint = did_you_mean(wall.material, list(known))
                problems.append(f"walls[{k}].material: unknown material '{wall.material}'; {hint}")
            # any valid material will do: its name was checked above
            wall.model_copy(update={"material": "iron"}).build({})
        except ValidationError:
            continue  # reported by the validation of the whole file
        except BadInput as error:
            problems += error.at(f"walls[{k}]").problems
    return problems


def wall_columns(walls: Any) -> list[str]:
    """Columns of the ledger with the [[walls]] of a case file; none if these have errors."""
    try:
        sections = [WallSection.model_validate(one) for one in walls or ()]
        walls = read_walls([one.model_copy(update={"material": "iron"}).build({}) for one in sections])
        built = Walls(walls)
        return [*built.columns(), *built.losses()] if walls else []
    except (ValidationError, BadInput, TypeError):
        return []
