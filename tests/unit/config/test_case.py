"""Case files: every error is found and named; reading and writing a case gives the same case."""

import copy
import tomllib

import numpy as np
import pytest
import tomli_w

import sand
from sand.basics.errors import BadInput
from sand.config.build import simulation_of
from sand.config.case import check_case, read_case
from sand.config.key_errors import validate
from sand.experiments.growth_case import GrowSection
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
    ("changes", "parts"),
    [
        # units and numbers
        ({"grains__radius": "10 ns"}, ["grains.radius", "'10 ns' is not a radius", "give a length"]),
        ({"grains__radius": "10"}, ["grains.radius", "'10' is not a radius"]),
        ({"grains__radius": "-10 nm"}, ["grains.radius", "'-10 nm' must be above 0 m"]),
        ({"grains__radius": 0.0}, ["grains.radius", "must be above 0 m"]),
        ({"grains__radius": float("nan")}, ["grains.radius", "nan is not finite"]),
        ({"grains__temperature": float("inf")}, ["grains.temperature", "inf is not finite"]),
        ({"grains__temperature": "-1 K"}, ["grains.temperature", "must be at least 0 K"]),
        ({"grains__moment": "200 A m"}, ["grains.moment", "'200 A m'", "A m^2/kg"]),
        ({"grains__number": 0}, ["grains.number = 0 must be a whole number of at least 1"]),
        ({"grains__number": 2.5}, ["grains.number = 2.5 must be a whole number"]),
        ({"run__until": "5 m"}, ["run.until", "'5 m' is not a quantity in s"]),
        ({"run__until": float("nan")}, ["run.until", "nan is not finite"]),
        ({"run__steps": 0}, ["run.steps = 0 must be a whole number of at least 1"]),
        ({"run__seed": -1}, ["run.seed = -1 must be a whole number of at least 0"]),
        ({"box__periodic": float("nan")}, ["box.periodic", "nan is not finite"]),
        ({"stepping__step": "3 m"}, ["stepping", "step = '3 m' is not a quantity in s"]),
        ({"stepping__steps_per_period": 3}, ["stepping", "steps_per_period = 3 must be at least 10"]),
        # words
        ({"grains__radus": "10 nm"}, ["grains.radus", "no such key", "did you mean 'radius'?"]),
        ({"forces__dipoles__cutof": "1 nm"}, ["forces.dipoles.cutof", "did you mean 'cutoff'?"]),
        ({"stepping__stp": "auto"}, ["stepping.stp", "did you mean 'step'?"]),
        (
            {"stepping__method": "rigid-clusters", "stepping__steps_per_period": 30},
            ["stepping.steps_per_period", "it is a key of [stepping.contact_stepping]"],
        ),
        ({"grain": {"number": 3}}, ["grain:", "did you mean 'grains'?"]),
        ({"forces__dipole": {}}, ["forces.dipole:", "did you mean 'dipoles'?"]),
        ({"grains__material": "irn"}, ["grains.material", "unknown material 'irn'", "did you mean 'iron'?"]),
        ({"grains__material": "unobtainium"}, ["unknown material 'unobtainium'", "allowed: ice, silica"]),
        ({"grains__kind": "gass"}, ["grains.kind", "'gass'", "'gas'"]),
        ({"grains__spins": "kT"}, ["grains.spins", "did you mean 'kT/2'?"]),
        ({"grains__exact_temperature": "no"}, ["grains.exact_temperature", "= 'no' must be true or false"]),
        ({"forces__contact__slip": "clmp"}, ["forces.contact", "did you mean 'clamp'?"]),
        ({"stepping__method": "verlett"}, ["stepping", "did you mean 'verlet'?"]),
        ({"materials__mine__densty": 1.0}, ["materials.mine.densty", "did you mean 'density'?"]),
        ({"materials__mine__like": "iorn"}, ["materials", "did you mean 'iron'?"]),
        # shapes
        ({"box__periodic": ["1 um", "1 um"]}, ["box.periodic", "one length or three"]),
        ({"grains__radius": ["10 nm", "20 nm"]}, ["radius has 2 entries but there are 8 grains"]),
        ({"grains__radius": ["10 nm", "20 s"]}, ["grains.radius", "radius of grain 1 = '20 s' is not a quantity in m"]),
        # laws, mixtures and classes
        ({"grains__radius": "lognormal(10 nm)"}, ["grains.radius", "lacks its width SIGMA"]),
        ({"grains__radius": "power law(-3.5, 10 nm)"}, ["grains.radius", "wrong number of arguments"]),
        ({"grains__radius": "lognormal(10 nm, 0)"}, ["grains.radius", "sigma", "must be above 0"]),
        ({"grains__material": {"iron": 0.5, "silica": 0.4}}, ["grains.material", "0.5, 0.4 have the sum 0.9"]),
        ({"grains__material": {"iron": 0.99, "silica": 0.01}}, ["fraction 0.01 of 8 grains is no grain of silica"]),
        ({"grains__material": {"irn": 1.0}}, ["grains.material", "unknown material 'irn'", "did you mean 'iron'?"]),
        ({"grains__material": {}}, ["grains.material", "names no material"]),
        ({"grains__material": 3}, ["grains.material", "must be a name, or fractions"]),
        ({"grains__classes": [{"share": 0.5}, {"share": 0.4}]}, ["grains:", "the shares 0.5, 0.4 have the sum 0.9"]),
        ({"grains__classes": [{"share": 0.5}, {"number": 4}]}, ["every class a share, or every class a number"]),
        ({"grains__classes": [{"number": 5}, {"number": 4}]}, ["number = 8", "have the sum 9"]),
        ({"grains__classes": [{"share": 0.99}, {"share": 0.01}]}, ["classes.1", "0.01 of number = 8 is no member"]),
        ({"grains__classes": [{}]}, ["grains.classes.0", "either share", "or number"]),
        ({"grains__classes": [{"share": 1.5}]}, ["grains.classes.0", "share = 1.5 must be above 0 and at most 1"]),
        ({"grains__classes": [{"share": 1, "chrge": 0}]}, ["grains.classes.0.chrge", "did you mean 'charge'?"]),
        ({"grains__classes": [{"share": 1, "charge": "1 V"}]}, ["grains.classes.0", "charge = '1 V'"]),
        (
            {"grains__classes": [{"share": 1, "material": "irn"}]},
            ["grains.classes.0.material", "unknown material 'irn'"],
        ),
        ({"grains__classes": [{"share": 1, "radius": "lognormal(1 nm)"}]}, ["grains.classes.0", "width SIGMA"]),
        ({"grains__classes": [{"share": 1, "kind": "bpc"}]}, ["grains.classes.0", "kind = 'bpc'", "did you mean"]),
        ({"grains__classes": [{"share": 1, "kind": "bpca"}]}, ["grains.classes.0", "grains is missing"]),
        (
            {"grains__classes": [{"share": 1, "grains": 4}]},
            ["grains.classes.0", "grains = 4 is not used by kind = 'grain'"],
        ),
        ({"grains__classes": [{"share": 1, "kind": "file"}]}, ["grains.classes.0", "file is missing"]),
        ({"grains__classes": [{"share": 1, "kind": "file", "file": "none.xyz"}]}, ["grains.classes.0", "none.xyz"]),
        ({"grains__classes": [{"number": 1, "kind": "chain", "grains": 40}], "grains__number": None}, ["too small"]),
        ({"grains__classes": "silica"}, ["grains.classes", "'silica'"]),
        ({"grains__number": [8]}, ["grains.number", "[8]"]),
        ({"forces__field__flux_density": [1, 2]}, ["forces.field", "three components, in T"]),
        ({"run": "5 ns"}, ["run", "'5 ns'"]),
        ({"forces__contact": True}, ["forces.contact", "True"]),
        # missing entries
        ({"run__until": None}, ["run", "until is missing"]),
        ({"grains__number": None}, ["grains", "number is missing", "number = 125"]),
        ({"grains__radius": None}, ["grains", "radius is missing"]),
        ({"run": None}, ["run is missing"]),
        ({"materials__mine__density": "3 g/cm^3"}, ["mine lacks young_modulus, poisson_ratio"]),
        # errors that only the combination of grains, forces and box shows
        ({"box__periodic": "30 nm"}, ["box", "too small", "3 diameters"]),
        ({"box__periodic": "62 nm", "grains__number": 30}, ["too full", "use a larger box or fewer grains"]),
        ({"box__periodic": None}, ["a gas needs a box"]),
        ({"box__periodic": ["1 um", "1 um", "open"]}, ["a gas needs a box"]),
        ({"forces__dipoles__cutoff": "300 nm"}, ["cutoff = 300 nm", "exceeds half the box (200 nm)"]),
        ({"grains__material": "magnetite"}, ["'magnetite' has no surface energy", "surface_energy ="]),
        ({"grains__kind": "given"}, ["came from a script", "sand resume"]),
    ],
)
def test_a_wrong_entry_gives_one_line(changes, parts):
    """The line says where, what was given, and what is allowed or probably meant."""
    problems = problems_of(changed(**changes))
    assert len(problems) == 1, problems
    assert "\n" not in problems[0]
    for part in parts:
        assert part in problems[0]


def test_several_mistakes_are_reported_together(tmp_path):
    """Every error of a file: one line each with file and key."""
    path = tmp_path / "many.toml"
    content = changed(
        run__until="5 m",
        box__periodic="1 K",
        grains__radius="10 ns",
        grains__temprature="3 K",
        grains__material="irn",
        forces__dipoles__cutof=1,
        stepping__step="3 m",
        stepping__accuracy=-1,
    )
    path.write_text(tomli_w.dumps(content))
    with pytest.raises(BadInput) as caught:
        read_case(path)
    problems = caught.value.problems
    assert len(problems) == 8
    assert all(line.startswith(f"{path}: ") and "\n" not in line for line in problems)
    key_paths = ["run.until", "box.periodic", "grains.radius", "grains.temprature", "grains.material", "dipoles.cutof"]
    for key_path in [*key_paths, "step = '3 m'", "accuracy = -1"]:
        assert sum(key_path in line for line in problems) == 1, key_path


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


def test_an_empty_name_of_a_material_is_refused():
    """An empty string is an unknown material, not a missing key."""
    with pytest.raises(sand.BadInput, match=r"grains.material: unknown material ''"):
        check_case(
            {
                "run": {"steps": 10},
                "box": {"periodic": "1 um"},
                "grains": {"number": 2, "radius": "10 nm", "material": ""},
            },
            "c",
        )


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
