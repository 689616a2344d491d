"""Every own quantity of the schema reaches arrays, checkpoint, frames, tables, pictures and the viewer."""

import numpy as np
import pytest

import sand
from sand.analysis.quantities import GRAIN_NAMES, measured
from sand.grains import GrainArrays
from sand.schema import BY_NAME, FIELDS, OWN
from sand.setup.encounters import encounter
from sand.viewer.packets import grains_packet

from ..unit.pages import decode


def test_grain_arrays_are_those_of_the_schema():
    """`GrainArrays` names the quantities of the schema in the same order, then material and id."""
    assert GrainArrays._fields == (*(field.name for field in FIELDS), "material", "id")


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """Folder of a short run of five grains in contact, and the values of all own quantities."""
    values = {name: np.linspace(1.0, 2.0, 5) * (k + 1) for k, name in enumerate(OWN)}
    body = sand.setup.chain(5, radius="0.1 um", material="silica")
    grains = sand.Grains(body.position, body.radius, "silica", own=values)
    folder = tmp_path_factory.mktemp("own") / "run"
    sim = sand.Simulation(grains, [sand.Contact()], out=folder)
    sim.run(steps=20)
    return folder, values


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("name", OWN)
def test_an_own_quantity_reaches_every_output(run, name):
    """The values given to `Grains` are those of the resumed grains, of the frames, of xarray, of pictures and packets.

    Frames store them in double precision and packets in single precision (1e-7).
    """
    folder, values = run
    expected, result = values[name], sand.open(folder)
    assert (getattr(sand.resume(folder).grains, name) == expected).all()
    frame = result.frames[-1]
    assert (getattr(frame, name) == expected).all()
    assert (measured(frame, name) == expected).all() and name in GRAIN_NAMES
    assert (result.to_xarray()[name].to_numpy() == expected).all()
    _, arrays = decode(grains_packet(frame, 1.0))
    assert arrays[name] == pytest.approx(expected, rel=1e-7, abs=0.0)


@pytest.mark.parametrize("name", OWN)
def test_an_own_quantity_is_kept_by_set_ups(name):
    """Two bodies on a collision course keep their values, in the order of the bodies."""
    bodies = [sand.Grains([[0, 0, 0]], 1e-7, "silica", own={name: value}) for value in (3.0, 4.0)]
    assert getattr(encounter(*bodies, speed=1.0).grains, name).tolist() == [3.0, 4.0]


def test_wrong_own_quantities_are_refused():
    """An unknown name and a wrong unit: one line each, with the unit of the quantity."""
    name = OWN[0]
    with pytest.raises(sand.BadInput) as caught:
        sand.Grains([[0, 0, 0]], 1e-7, "ice", own={"warmth": 3, name: "3 kg m"})
    assert len(caught.value.problems) == 2
    assert "own: there is no quantity 'warmth'" in str(caught.value)
    assert f"{name} is not in {BY_NAME[name].unit}" in str(caught.value)


def test_without_values_a_quantity_is_missing():
    """Frames without values have zeros; to draw them is refused with the reason."""
    from types import SimpleNamespace

    frame = SimpleNamespace(radius=np.ones(3), pair=np.zeros((0, 2), int))
    with pytest.raises(sand.BadInput, match="is not known: no grain has a value"):
        measured(frame, OWN[0])
