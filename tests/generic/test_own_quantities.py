"""Every own quantity of the schema reaches arrays, checkpoint, frames, tables, pictures and the viewer."""

from types import SimpleNamespace

import numpy as np
import pytest

import sand
from sand.analysis.quantities import GRAIN_NAMES, measured
from sand.box import Box
from sand.grains import GrainArrays
from sand.io.bodies import read_body, write_body
from sand.schema import BY_NAME, FIELDS, OWN
from sand.setup.encounters import encounter
from sand.viewer.packets import grains_packet
from sand.viewer.series import quantity_ranges

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


@pytest.mark.parametrize("name", OWN)
def test_an_own_quantity_is_kept_by_body_files(name, tmp_path):
    """The grains read from a GSD file of a body have the values of those written."""
    body = sand.Grains([[0, 0, 0], [2e-7, 0, 0]], 1e-7, "silica", own={name: [3.0, 4.0]}, charge=[0.0, 0.5])
    write_body(tmp_path / "body.gsd", body)
    found = read_body(tmp_path / "body.gsd")
    assert getattr(found, name).tolist() == [3.0, 4.0]
    assert found.charge.tolist() == [0.0, 0.5]


def test_ranges_of_own_quantities_have_signs():
    """The colour scale of values −5 … 3 begins at −5; other quantities are magnitudes."""
    zeros, own = np.zeros((2, 3)), {OWN[0]: np.array([-5.0, 3.0])}
    frame = SimpleNamespace(radius=np.ones(2), mass=np.ones(2), pair=np.zeros((0, 2), int), **own)
    frame.velocity = frame.spin = frame.moment = zeros
    frame.force, frame.share, frame.position, frame.box = zeros[:0], np.zeros((0, 4)), zeros, Box.open()
    assert quantity_ranges([frame])[OWN[0]] == [-5.0, 3.0]


def test_assignment_names_the_argument():
    """Quantities cannot be assigned; the message shows how to give them."""
    grains = sand.Grains([[0, 0, 0]], 1e-7, "silica")
    with pytest.raises(sand.BadInput, match=f'own={{"{OWN[0]}": …}}'):
        setattr(grains, OWN[0], 3.0)


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
    frame = SimpleNamespace(radius=np.ones(3), pair=np.zeros((0, 2), int))
    with pytest.raises(sand.BadInput, match="is not known: no grain has a value"):
        measured(frame, OWN[0])
