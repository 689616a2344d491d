"""Case files: every error is found and named; reading and writing a case gives the same case."""

import copy
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

import sand
from sand.basics.errors import BadInput, shown
from sand.basics.material import Library
from sand.config.build import simulation_of
from sand.config.case import check_case, read_case
from sand.config.key_errors import validate
from sand.experiments.collision_case import CollisionCase
from sand.experiments.growth_case import GrowSection
from sand.setup.from_frame import from_frame
from sand.simulation.serialise import case_of

GOOD = tomllib.loads("""
[run]
until = "5 ns"
seed = 4
[box]
periodic = "400 nm"
[grains]
number = 8
radius = "10 nm"
material = "iron"
moment = "200 A m^2/kg"
temperature = "300 K"
[forces.contact]
[forces.dipoles]
""")


def changed(**changes):
    """The valid case with changes: `grains__radius="1 K"`; None removes."""
    content = copy.deepcopy(GOOD)
    for key_path, value in changes.items():
        *sections, key = key_path.split("__")
        section = content
        for name in sections:
            section = section.setdefault(name, {})
        if value is None:
            section.pop(key, None)
        else:
            section[key] = value
    return content


def problems_of(content):
    """Error lines of a case, from reading it or from building its simulation."""
    with pytest.raises(BadInput) as caught:
        simulation_of(check_case(content, "some.toml"), None)
    return caught.value.problems


@pytest.mark.parametrize(
    ("content", "part"),
    [
        (b"[run\nuntil = 3", "is not TOML: Expected ']'"),
        (b"[run]\nuntil = 5 ns\n", "line 2"),
        (b"[run]\nuntil = 3\nuntil = 4\n", "is not TOML"),
        (b"\xff\xfe\x00abc", "is not a text file"),
        (None, "there is no file"),
    ],
)
def test_files_that_are_no_cases(tmp_path, content, part):
    """Invalid TOML with its line, other files, missing files: one line with the file's name."""
    path = tmp_path / "some.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(BadInput) as caught:
        read_case(path)
    assert len(caught.value.problems) == 1
    assert part in caught.value.problems[0]
    assert str(path) in caught.value.problems[0]


@pytest.mark.parametrize(
    ("line", "advice"),
    [
        ("temperature = 50 K", 'a value with a unit needs quotation marks: "50 K"'),
        ("temperature = 5e1K  # cold", '"5e1K"'),
        ("moment = 200 A m^2/kg", '"200 A m^2/kg"'),
        ("periodic = [1.2 um, 1.2 um, 1.2 um]", '"1.2 um"'),
        ("periodic = [\n  1.2 um,\n]", '"1.2 um"'),
        ("size = 5 µm", '"5 µm"'),
        ("material = iron", 'text needs quotation marks: "iron"'),
        ("material = {silica = 0.5, iron = half}", '"half"'),
        ("number = 5 # grains\nnumber = 5 # K", None),
        ('radius = "8 nm" "9 nm"', None),
        ("radius = 1e-8,", None),
        ("number = true false", None),
        ("exact_temperature = True", "write true"),
        ("number = 5\n[grains]", None),
        ("number = 5\n[[grains.classes]", None),
    ],
)
def test_a_syntax_error_shows_its_line(tmp_path, line, advice):
    """The line as it is in the file, and advice where a value lacks its quotation marks, else none."""
    path = tmp_path / "some.toml"
    path.write_text(f"[grains]\nkind = 'gas'\n{line}\n", "utf-8")
    with pytest.raises(BadInput) as caught:
        read_case(path)
    (problem,) = caught.value.problems
    assert any(shown(one.strip()) in problem for one in line.split("\n")) and "line " in problem
    assert problem.endswith(advice) if advice else "needs" not in problem


def test_an_empty_file_lacks_its_sections():
    """Both required sections are named."""
    assert len(problems_of({})) == 2


def test_magnetite_with_a_surface_energy_runs():
    """The change that the message about magnetite suggests is sufficient."""
    content = changed(grains__material="mine", materials__mine__like="magnetite")
    content["materials"]["mine"]["surface_energy"] = "0.1 J/m^2"
    material = simulation_of(check_case(content, "some.toml"), None).grains.materials[0]
    assert (material.name, material.surface_energy) == ("mine", 0.1)
    assert material.density == sand.MAGNETITE.density


def test_numbers_are_si_and_text_has_units():
    """`until = 5e-9` and `until = "5 ns"` are the same case, as are a cube's one length and its three."""
    text = check_case(GOOD, "some.toml")
    content = changed(run__until=5e-9, grains__radius=1e-8, box__periodic=[4e-7, 4e-7, 4e-7])
    assert check_case(content, "some.toml") == text


@pytest.mark.compiled("dipoles", "contacts")
@pytest.mark.parametrize(
    "changes",
    [
        {},
        {"forces__dipoles__cutoff": "none"},
        {"forces__dipoles": None, "grains__moment": None},
        pytest.param({"forces__field__flux_density": "1 mT", "stepping__step": "1 ps"}, marks=pytest.mark.validate),
        {"run__frame_every": "1 ns", "run__until": None, "run__steps": 50},
        {"grains__material": "mine", "materials__mine": {"like": "silica", "surface_energy": "50 mJ/m^2"}},
    ],
)
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_the_case_a_run_writes_is_the_case_it_ran(tmp_path, changes):
    """case.toml builds the same grains and forces, the same bits after steps, and the same case.toml."""
    case = check_case(changed(**changes), "some.toml")
    first = simulation_of(case, tmp_path / "one")
    first.run(until=case.run.until, steps=case.run.steps)
    again = read_case(tmp_path / "one" / "case.toml")
    second = simulation_of(again, tmp_path / "two")
    second.run(until=again.run.until, steps=again.run.steps)
    assert same_bits(first, second)
    assert (tmp_path / "one" / "case.toml").read_bytes() == (tmp_path / "two" / "case.toml").read_bytes()
    ends = (case.run.until or np.inf, case.run.steps or np.inf)
    assert case_of(first, *ends) == case_of(second, *ends)


def same_bits(one, other):
    """True if all arrays of two states are equal bit by bit."""
    a, b = one.state.to_arrays(), other.state.to_arrays()
    return a.keys() == b.keys() and all(a[name].tobytes() == b[name].tobytes() for name in a)


@pytest.mark.compiled("dipoles")
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_case_and_script_are_the_same_physics():
    """The same parameters in a case and in a script give the same bits."""
    from_case = simulation_of(check_case(GOOD, "some.toml"), None)
    box = sand.Box.periodic("400 nm")
    grains = sand.setup.gas(
        8, box, radius="10 nm", material=sand.IRON, moment="200 A m^2/kg", temperature="300 K", seed=4
    )
    from_script = sand.Simulation(grains, [sand.Contact(), sand.Dipoles()], box=box, seed=4)
    for simulation in (from_case, from_script):
        simulation.run(steps=3000)
    assert from_case.time == from_script.time > 0.0
    assert same_bits(from_case, from_script)


@pytest.mark.parametrize("exact", [True, False])
def test_velocities_of_a_case_are_scaled_or_drawn(exact):
    """`exact_temperature` of a case file is that of `sand.setup.gas`; the run's folder keeps it."""
    case = check_case(changed(grains__exact_temperature=exact), "some.toml")
    given = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg", "temperature": "300 K", "seed": 4}
    grains = sand.setup.gas(8, "400 nm", exact_temperature=exact, **given)
    assert (simulation_of(case, None).grains.velocity == grains.velocity).all()
    assert case.grains.recipe()["exact_temperature"] is exact


def test_a_gas_between_walls_of_a_case():
    """`extent` of [grains] is that of `sand.setup.gas`; the run's folder keeps it; other kinds refuse it."""
    case = check_case(changed(box__periodic=["400 nm", "400 nm", "open"], grains__extent="0.5 um"), "some.toml")
    given = {"radius": "10 nm", "material": "iron", "moment": "200 A m^2/kg", "temperature": "300 K", "seed": 4}
    grains = sand.setup.gas(8, sand.Box.periodic("400 nm", "400 nm", None), extent="0.5 um", **given)
    assert (simulation_of(case, None).grains.position == grains.position).all()
    assert case.grains.recipe()["extent"] == "0.5 um"
    with pytest.raises(sand.BadInput, match="extent = '1 um' is not used by kind = 'file'"):
        check_case(changed(grains={"kind": "file", "file": "a.gsd", "extent": "1 um"}), "some.toml")


def test_an_index_of_a_list_is_named():
    """Errors in entry 0 of a list are named like those of other entries."""
    for seeds, key_path in (([-1, 2], r"grow.seeds\[0\] = -1"), ([2, -1], r"grow.seeds\[1\] = -1")):
        with pytest.raises(sand.BadInput, match=key_path):
            validate(GrowSection, {"seeds": seeds}, "c", table="grow")


@pytest.mark.parametrize(
    "content",
    [
        {"run": {"until": "1 us", **{f"key{k}": k for k in range(5000)}}},
        {"forces": {f"key{k}": {} for k in range(5000)}},
        {"grains": {"number": 2, "radius": "1 um", "material": [f"name{k}" for k in range(5000)]}},
        {"walls": [{"point": [0, 0, 0], "normal": [0, 0, 1], "material": f"name{k}"} for k in range(500)]},
    ],
)
def test_the_first_of_many_mistakes_are_described(content):
    """The first hundred of each kind, as each description takes milliseconds; the others are counted."""
    whole = {"run": {"until": "1 us"}, "grains": {"number": 2, "radius": "1 um"}}
    with pytest.raises(BadInput) as caught:
        check_case(whole | content, "case")
    assert 100 < len(caught.value.problems) < 220
    assert sum("more errors" in problem for problem in caught.value.problems) == 1


@pytest.mark.filterwarnings("ignore:grain 0 has a radius of")
def test_grains_above_a_millimetre_have_their_unit(tmp_path):
    """The case that a run writes has the unit again; a number without one is refused (messages.txt), up to 1 mm not."""
    for given, radius in (("8 m", 8.0), (["8 m"] * 8, 8.0), ("1.5 mm", 1.5e-3), (1e-3, 1e-3)):
        case = check_case(changed(grains__radius=given, box__periodic="100 m"), "case")
        simulation = simulation_of(case, None)
        again = check_case(case_of(simulation, 1e-9, 1e9, None), "case")
        assert (simulation_of(again, None).grains.radius == radius).all()
    grains = sand.setup.gas(2, "100 m", radius=np.array([0.5, 0.6]), material="ice", seed=1)
    assert sorted(grains.radius) == [0.5, 0.6]


def test_case_is_ignored_in_names_of_materials():
    """Of presets and own materials, of grains, classes, mixtures, walls and bodies, as in Python; exact names first.

    A case that a run writes with such a name is read again.
    """
    own = {"Dust": {"like": "Silica", "density": 2000.0}, "dust": {"like": "ice", "density": 900.0}}
    wall = {"material": "SILICA", "point": [0, 0, "-90 nm"], "normal": [0, 0, 1]}
    for given, name, density in (
        ("Silica", "silica", 2650.0),
        ("Dust", "Dust", 2000.0),
        ("dust", "dust", 900.0),
        ({"SILICA": 0.5, "Iron": 0.5}, "silica", 2650.0),
    ):
        content = changed(grains__material=given, box__periodic=["400 nm", "400 nm", "open"], grains__extent="150 nm")
        case = check_case(content | {"materials": own, "walls": [wall]}, "case")
        assert case.components()["walls"][0].material.name == "silica"
        content["forces"].pop("dipoles")
        content["grains"]["moment"] = 0.0
        simulation = simulation_of(check_case(content | {"materials": own}, "case"), None)
        found = {one.name: one.density for one in simulation.grains.materials}
        assert found[name] == density
        again = check_case(case_of(simulation, 1e-9, 1e9, None), "case")
        assert {one.name for one in simulation_of(again, None).grains.materials} == set(found)
    body = {"kind": "grain", "radius": "0.1 um", "material": "SILICA"}
    collision = {"target": body, "projectile": body, "impact": {"speed": 1.0}, "forces": {"contact": {}}}
    assert CollisionCase.model_validate(collision).approach(0).grains.materials[0].name == "silica"
    with pytest.raises(BadInput, match="did you mean 'silica'"):
        check_case(changed(grains__material="Silca"), "case")


def test_names_of_materials_that_are_not_unique():
    """A name that two others have but for their case is refused; in files that SAND has written case counts."""
    library = Library({"Dust": sand.ICE, "dust": sand.IRON})
    assert library["Dust"] is sand.ICE and library["dust"] is sand.IRON and library["ICE"] is sand.ICE
    with pytest.raises(BadInput, match="'DUST' is not unique; give 'Dust' or 'dust'"):
        library["DUST"]
    frame = SimpleNamespace(materials=("Ice",), pair=None, overlap=None, position=None)
    with pytest.raises(BadInput, match="unknown material 'Ice'"):
        from_frame(frame, library)
