"""Attributes that cannot change after construction are refused in one line; others are checked."""

import pytest

import sand
from sand.basics.schema import CHANGEABLE, FIELDS
from sand.forces.registry import FORCES


@pytest.fixture
def sim():
    grains = sand.Grains([[0, 0, 0], [3e-8, 0, 0]], 1e-8, "silica")
    return sand.Simulation(grains, [sand.Contact()])


ARGUMENTS = ("stepping", "neighbours", "seed", "contacts", "walls", "driven", "out")
RESULTS = ("time", "steps", "state", "start", "temperature", "ledger", "writer", "choices", "is_sound")


@pytest.mark.parametrize("name", ARGUMENTS)
def test_arguments_cannot_be_assigned(sim, name):
    """An assigned argument would be written to files while the dynamics use the old one: build a new simulation."""
    with pytest.raises(sand.BadInput, match=rf"^{name} of a simulation .*build a new one: sand\.Simulation\("):
        setattr(sim, name, None)


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("forces", "change.replace(sand.Field("),
        ("box", "change.box = "),
        ("grains", "change.velocity"),
        *((name, f"change.{name}[…] = …") for name in CHANGEABLE),
        *((name, f"change.replace(sand.{kind.__name__}(…))") for name, kind in FORCES.items() if name != "contact"),
    ],
)
def test_what_can_change_names_the_code(sim, name, code):
    """Whatever `change` can change is refused with the line to write, also under the name of a force or a quantity."""
    with pytest.raises(sand.BadInput) as refused:
        setattr(sim, name, 0)
    (line,) = refused.value.problems
    assert line.startswith(f"{name} of a simulation cannot be assigned; write: with sim.change() as change: {code}")


@pytest.mark.compiled("fields")
def test_the_code_in_the_messages_runs():
    """Box, forces and quantities are changed by what the messages say."""
    grains = sand.Grains([[0, 0, 0], [3e-8, 0, 0]], 1e-8, "silica", moment="1e-18 A m^2")
    sim = sand.Simulation(grains, [sand.Contact(), sand.Field("1 mT")], box="1 um")
    with sim.change() as change:
        change.replace(sand.Field("2 mT"))
        change.box = "3 um"
        change.velocity[...] = 1.0
    assert sim.forces[1] == sand.Field("2 mT") and sim.box == sand.Box.periodic("3 um")
    assert (sim.grains.velocity == 1.0).all()


def test_what_cannot_change_says_so(sim):
    """The contact model and the positions: a new simulation is built."""
    for name, part in (
        ("contact", "the contact model"),
        ("position", "position of the grains"),
        ("radius", "radius of"),
    ):
        with pytest.raises(sand.BadInput, match=rf"^{part}.*build a new one"):
            setattr(sim, name, 0)
    with pytest.raises(sand.BadInput, match=r"in a simulation: with sim\.change\(\) as change: change\.velocity"):
        sim.grains.velocity = 0.0


@pytest.mark.parametrize("name", RESULTS)
def test_results_cannot_be_assigned(sim, name):
    """Results are computed, so assignment is refused."""
    with pytest.raises(sand.BadInput, match=rf"^{name} of a simulation follows from its run"):
        setattr(sim, name, 0)


@pytest.mark.parametrize("name", [*(field.name for field in FIELDS), "material", "materials", "id"])
def test_quantities_of_grains_cannot_be_assigned(sim, name):
    """Neither of a simulation nor of grains outside of one: the arrays do not change."""
    before = {field.name: getattr(sim.grains, field.name).copy() for field in FIELDS}
    for grains in (sim.grains, sim.start):
        with pytest.raises(sand.BadInput, match=rf"^{name} of grains cannot be assigned; make new grains"):
            setattr(grains, name, 1.0)
    assert all((getattr(sim.grains, key) == value).all() for key, value in before.items())
    assert not set(vars(sim.grains)) - {"arrays", "materials", "own_units"}


def test_misspelt_names_are_refused(sim):
    """Assignment to an unknown attribute suggests the right name."""
    with pytest.raises(sand.BadInput, match="a simulation has no 'focres'; did you mean 'forces'"):
        sim.focres = []
    with pytest.raises(sand.BadInput, match="grains have no 'velocty'; did you mean 'velocity'"):
        sim.grains.velocty = 0.0
    assert not hasattr(sim, "focres") and not hasattr(sim.grains, "velocty")


def test_the_forces_of_a_simulation_cannot_change(sim):
    """`forces` is no list that could be appended to."""
    assert isinstance(sim.forces, tuple)
    with pytest.raises(sand.BadInput, match=r"slip of sand\.Contact cannot be assigned; make a new one"):
        sim.forces[0].slip = "reset"
    with pytest.raises(sand.BadInput, match=r"lengths of sand\.Box cannot be assigned"):
        sim.box.lengths = (1.0, 1.0, 1.0)
    assert list(sim.forces) == [sand.Contact()]


def test_assignable_attributes_are_checked(sim):
    """`frame_every` and `observers` apply from the next `run` on."""
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


def test_a_single_force_is_accepted_as_a_list():
    """A force without brackets is a list of one."""
    grains = sand.Grains([[0, 0, 0]], 1e-8, "silica", moment="1e-18 A m^2")
    assert list(sand.Simulation(grains, sand.Contact()).forces) == [sand.Contact()]


def test_derived_classes_may_have_attributes_of_their_own():
    """Subclasses may assign new attributes."""

    class Mine(sand.Simulation):
        def __init__(self, *given, label, **more):
            super().__init__(*given, **more)
            self.label = label

    sim = Mine(sand.Grains([[0, 0, 0]], 1e-8, "silica"), label="first")
    sim.label = "second"
    assert sim.label == "second"
    with pytest.raises(sand.BadInput, match="box of a simulation"):
        sim.box = None
