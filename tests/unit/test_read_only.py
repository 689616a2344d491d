"""What cannot be changed once it is built is refused in a line; what can be is checked. Nothing is compiled."""

import pytest

import sand
from sand.schema import FIELDS


@pytest.fixture
def sim():
    grains = sand.Grains([[0, 0, 0], [3e-8, 0, 0]], 1e-8, "silica")
    return sand.Simulation(grains, [sand.Contact()])


ARGUMENTS = ("forces", "box", "stepping", "neighbours", "seed", "contacts", "grains", "out")
RESULTS = ("time", "steps", "state", "start", "temperature", "ledger", "writer", "choices", "is_sound")


@pytest.mark.parametrize("name", ARGUMENTS)
def test_arguments_cannot_be_assigned(sim, name):
    """They would be written to the files while the dynamics go on with the old ones: build a new simulation."""
    with pytest.raises(sand.BadInput, match=rf"^{name} of a simulation .*build a new one: sand\.Simulation\("):
        setattr(sim, name, None)


@pytest.mark.parametrize("name", RESULTS)
def test_results_cannot_be_assigned(sim, name):
    with pytest.raises(sand.BadInput, match=rf"^{name} of a simulation follows from its run"):
        setattr(sim, name, 0)


@pytest.mark.parametrize("name", [*(field.name for field in FIELDS), "material", "materials", "id"])
def test_quantities_of_grains_cannot_be_assigned(sim, name):
    """Neither of a running simulation nor of grains that are not in one yet: the arrays stay as they were."""
    before = {field.name: getattr(sim.grains, field.name).copy() for field in FIELDS}
    for grains in (sim.grains, sim.start):
        with pytest.raises(sand.BadInput, match=rf"^{name} of grains cannot be assigned; make new grains"):
            setattr(grains, name, 1.0)
    assert all((getattr(sim.grains, key) == value).all() for key, value in before.items())
    assert not set(vars(sim.grains)) - {"arrays", "materials"}


def test_misspelt_names_are_refused(sim):
    with pytest.raises(sand.BadInput, match="a simulation has no 'focres'; did you mean 'forces'"):
        sim.focres = []
    with pytest.raises(sand.BadInput, match="grains have no 'velocty'; did you mean 'velocity'"):
        sim.grains.velocty = 0.0
    assert not hasattr(sim, "focres") and not hasattr(sim.grains, "velocty")


def test_forces_are_no_list_to_be_changed(sim):
    assert isinstance(sim.forces, tuple)
    with pytest.raises(sand.BadInput, match=r"slip of sand\.Contact cannot be assigned; make a new one"):
        sim.forces[0].slip = "reset"
    with pytest.raises(sand.BadInput, match=r"lengths of sand\.Box cannot be assigned"):
        sim.box.lengths = (1.0, 1.0, 1.0)
    assert list(sim.forces) == [sand.Contact()]


def test_what_can_be_assigned_is_checked(sim):
    """`frame_every` and `observers` take effect in the next `run`."""
    sim.frame_every = "1 ns"
    assert sim.frame_every == 1e-9
    one = sand.Observer()
    sim.observers = (one,)
    sim.observers.append(one)
    assert sim.observers == [one, one]
    for value in ("often", 0.0, "1 m"):
        with pytest.raises(sand.BadInput, match="frame_every = "):
            sim.frame_every = value
    with pytest.raises(sand.BadInput, match="observers = 7"):
        sim.observers = 7
    assert sim.frame_every == 1e-9


def test_a_single_force_stands_for_a_list():
    grains = sand.Grains([[0, 0, 0]], 1e-8, "silica")
    assert list(sand.Simulation(grains, sand.Contact()).forces) == [sand.Contact()]


def test_derived_classes_may_have_attributes_of_their_own():
    class Mine(sand.Simulation):
        def __init__(self, *given, label, **more):
            super().__init__(*given, **more)
            self.label = label

    sim = Mine(sand.Grains([[0, 0, 0]], 1e-8, "silica"), label="first")
    sim.label = "second"
    assert sim.label == "second"
    with pytest.raises(sand.BadInput, match="box of a simulation"):
        sim.box = None
