"""Grains: derived quantities, read-only views, and errors of wrong input."""

import copy
import math

import numpy as np
import pytest

import sand
from sand.basics.grains import GrainArrays
from sand.basics.schema import FIELDS


def two(**changes):
    given = {"position": [[0, 0, 0], [3e-8, 0, 0]], "radius": "10 nm", "material": sand.IRON} | changes
    return sand.Grains(**given)


def test_derived_quantities():
    """m = ρ (4/3)π r³, I = (2/5) m r², moment = specific moment × mass along +z, orientation (0,0,0,1)."""
    grains = two(moment="200 A m^2/kg", radius=[1e-8, 2e-8], material=["iron", sand.SILICA])
    mass = np.array([7874.0, 2650.0]) * 4 / 3 * math.pi * np.array([1e-8, 2e-8]) ** 3
    assert grains.mass == pytest.approx(mass, rel=1e-6, abs=0.0)
    assert grains.inertia == pytest.approx(0.4 * mass * grains.radius**2, rel=1e-6, abs=0.0)
    assert grains.moment == pytest.approx(np.outer(200 * mass, [0, 0, 1]), rel=1e-6, abs=0.0)
    assert (grains.orientation == [0, 0, 0, 1]).all()
    assert [m.name for m in grains.materials] == ["iron", "silica"]


def test_moments_of_the_material():
    """moment="material" uses the material's moment per mass."""
    grains = two(moment="material", material=["iron", sand.SILICA])
    assert grains.moment[:, 2] == pytest.approx([200 * grains.mass[0], 0.0], rel=1e-6, abs=0.0)


def test_every_quantity_of_the_table_is_there():
    """Public shape (N,) or (N, width), a read-only view without a copy."""
    grains = two()
    for field in FIELDS:
        view = getattr(grains, field.name)
        assert view.shape == ((2,) if field.width == 1 else (2, field.width))
        assert np.shares_memory(view, getattr(grains.arrays, field.name))
        with pytest.raises(ValueError):
            view[...] = 0.0
    assert {f.name for f in FIELDS} | {"own", "material", "id", "image"} == set(GrainArrays._fields)


def test_a_copy_is_independent():
    """A snapshot does not change with the original."""
    grains = two()
    snapshot, deep = grains.copy(), copy.deepcopy(grains)
    grains.arrays.position[0, 0] = 1.0
    assert snapshot.position[0, 0] == 0.0
    assert deep.position[0, 0] == 0.0


def test_materials_are_checked():
    """All errors at once; a modified copy is checked, too; unknown keys get a suggestion."""
    with pytest.raises(sand.BadInput) as caught:
        sand.Material("x", -1, -1, "3 kg", 0.7)
    assert len(caught.value.problems) == 4
    with pytest.raises(sand.BadInput, match="did you mean 'surface_energy'"):
        sand.IRON.but(surface_energi=1.0)
    assert sand.IRON.but(surface_energy="1 J/m^2").surface_energy == 1.0
    assert sand.IRON.rolling_limit == 1e-9
    assert sand.MAGNETITE.surface_energy is None


def test_parts_of_grains():
    """An index, slice, mask or list gives new grains with the same quantities, and only the materials that they use."""
    rng = np.random.default_rng(3)
    kinds = [sand.IRON, sand.SILICA, sand.SILICA, sand.IRON]
    vectors = {name: rng.normal(size=(4, 3)) for name in ("position", "velocity", "spin", "moment")}
    grains = sand.Grains(
        **vectors, radius=[1e-8, 2e-8, 3e-8, 4e-8], material=kinds, charge=[1, 2, 3, 4], own={"age": [4, 3, 2, 1]}
    )
    grains.arrays.orientation[:] = rng.normal(size=(4, 4))
    for index in (2, -1, slice(1, 3), [3, 0], np.array([False, True, True, False]), slice(None, None, -1)):
        part, numbers = grains[index], np.atleast_1d(np.arange(4)[index])
        for name in GrainArrays._fields:
            if name not in ("material", "id"):
                assert (getattr(part.arrays, name) == getattr(grains.arrays, name)[..., numbers]).all()
        assert [part.materials[k] for k in part.material] == [kinds[k] for k in numbers]
        assert part.id.tolist() == list(range(len(numbers))) and set(part.material) == set(range(len(part.materials)))
        again = sand.Grains(part.position, part.radius, [kinds[k] for k in numbers])
        assert (again.material == part.material).all()  # as a resumed run numbers them
    grains[0].arrays.position[0, 0] = 5.0
    assert grains.position[0, 0] != 5.0
    assert [one.radius[0] for one in grains] == grains.radius.tolist()
    assert repr(grains[1:]) == "<3 grains of silica, iron, radius 20 nm to 40 nm>"
    assert repr(grains[0]) == "<1 grain of iron, radius 10 nm>"


@pytest.mark.parametrize(
    "index", [4, -5, slice(4, 9), np.zeros(4, bool), [True, False], 1.5, "a", np.zeros((2, 2), int)]
)
def test_no_such_grains(index):
    """One line with the number of grains; an IndexError, so that loops end."""
    grains = sand.Grains(np.zeros((4, 3)), 1e-8, "iron")
    with pytest.raises(IndexError, match=r"grains\[.*\] names no grain: there are 4; give an index") as error:
        grains[index]
    assert isinstance(error.value, sand.BadInput) and "\n" not in str(error.value)
