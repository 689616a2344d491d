"""Wrong walls: one line for each mistake.  Nothing is compiled."""

import pytest

import sand
from sand.components.walls import Walls
from sand.config.case import check_case
from sand.engine.component import Setup
from sand.engine.step_parameters import ForcesByType

from ...plugins import ForestRuth

ONE = sand.Grains([[0, 0, 1e-6]], 5e-7, "silica")
FLOOR = sand.Wall([0, 0, 0], [0, 0, 1], "silica", name="floor")


@pytest.mark.parametrize(
    ("wall", "options", "message"),
    [
        (sand.Wall([0, 0, 0.7e-6], [0, 0, 1], "silica"), {}, "cuts grain 0"),
        (sand.Wall([0, 0, 3e-6], [0, 0, 1], "silica"), {}, "lies behind wall"),
        (FLOOR, {"contact": None}, "there is no sand.Contact"),
        (FLOOR, {"stepping": ForestRuth()}, "ForestRuth does not know walls; use stepping=sand.Verlet"),
        (FLOOR, {"box": sand.Box.periodic("5 um")}, "along z, along which the box is periodic"),
        (FLOOR, {"contact": sand.Contact(surface_energy_factor=sand.Ramp([1, 0.5], [0, "1 us"]))}, "ramps"),
    ],
)
def test_walls_must_fit_the_simulation(wall, options, message):
    """One line that says what to do."""
    given = {"contact": sand.Contact(), "box": sand.Box(), "stepping": sand.Verlet()} | options
    forces = ForcesByType(given["contact"], [], [], [])
    setup = Setup(ONE, forces, given["box"], given["stepping"], sand.Neighbours(), True)
    (problem,) = Walls([wall]).problems(setup)
    assert message in problem


def test_a_condition_may_name_columns_of_walls():
    """Also of walls of a material of the case; a misspelt one is refused."""
    case = {
        "run": {"stop": "floor_force_z > 1e-9 and wall_contacts == 2"},
        "grains": {"kind": "gas", "number": 2, "radius": "1 um"},
        "materials": {"glass": {"like": "silica"}},
        "forces": {"contact": {}},
        "walls": [{"name": "floor", "point": [0, 0, "-9 um"], "normal": [0, 0, 1], "material": "glass"}],
    }
    assert check_case(case, "case").walls[0].material == "glass"
    case["run"]["stop"] = "flor_force_z > 1e-9"
    with pytest.raises(sand.BadInput, match="did you mean 'floor_force_z'"):
        check_case(case, "case")
    case["walls"][0]["material"] = "glas"
    with pytest.raises(
        sand.BadInput, match=r"\[\[walls\]\] no. 1: material: unknown material 'glas'; did you mean 'glass'"
    ):
        check_case(case, "case")


def test_a_condition_may_name_every_column_of_walls():
    """Those of forces and positions, and the energy that moving walls took."""
    case = {
        "run": {"until": "1 us"},
        "grains": {"kind": "gas", "number": 2, "radius": "10 nm", "material": "silica"},
        "box": {"periodic": ["1 um", "1 um", "open"]},
        "walls": [{"point": [0, 0, "-1 um"], "normal": [0, 0, 1], "material": "silica", "name": "floor"}],
        "forces": {"contact": {}},
    }
    for column in ("lost_walls", "floor_force_z", "wall_contacts"):
        check_case(case | {"run": {"until": "1 us", "stop": f"{column} > 1"}}, "a.toml")
    with pytest.raises(sand.BadInput, match="wall_force"):
        check_case(case | {"run": {"until": "1 us", "stop": "wall_force > 1"}}, "a.toml")
