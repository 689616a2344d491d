"""Own quantities of any name and unit: read, carried, changed, stored, exported and shown; wrong ones are refused."""

import re
import warnings
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import sand
from sand.analysis.quantities import CONTACT_NAMES, GRAIN_NAMES, measured, names_of
from sand.basics.box import Box
from sand.basics.grains import GrainArrays
from sand.basics.own_quantities import RESERVED, OwnQuantities, joined
from sand.basics.own_units import si_unit, with_own_unit
from sand.basics.schema import FIELDS
from sand.cli.main import main
from sand.io.bodies import read_body, write_body
from sand.io.frame import OF_CONTACTS, OF_GRAINS, Frame, FrameSequence
from sand.plotting.plots import HISTORY
from sand.plotting.render.still import still_picture
from sand.plotting.style import si_prefix
from sand.setup.encounters import encounter
from sand.simulation.change import Change
from sand.viewer.packets import frame_packet
from sand.viewer.series import quantity_ranges

from ..unit.pages import decode

OWN = {
    "temperature": (np.linspace(100.0, 300.0, 5), "K"),
    "heating": ([0.1, -0.2, 0.3, -0.4, 0.5], "mW/cm^2"),
    "constructor": [3.0, 1.0, 4.0, 1.0, 5.0],  # a name that objects of JavaScript have already
    "Oberfläche": "2 cm^2",
    "T": "1e-30 J/(kg K)",
    "age": "0 s",
}
"""Own quantities of five grains, with names and units that may cause trouble."""
EXPECTED = {
    "temperature": ([100.0, 150.0, 200.0, 250.0, 300.0], "K"),
    "heating": ([1.0, -2.0, 3.0, -4.0, 5.0], "W/m^2"),
    "constructor": ([3.0, 1.0, 4.0, 1.0, 5.0], "1"),
    "Oberfläche": ([2e-4] * 5, "m^2"),
    "T": ([1e-30] * 5, "J/kg/K"),
    "age": ([0.0] * 5, "s"),
}
"""The same in SI."""


def five(own=None):
    """A chain of five grains with own quantities."""
    body = sand.setup.chain(5, radius="0.1 um", material="silica")
    return body.with_own(OWN if own is None else own)


def assert_same(own, index=slice(None)):
    """Names, units and values are those of EXPECTED, to the rounding of one multiplication."""
    assert own.units == {name: unit for name, (_, unit) in EXPECTED.items()}
    for name, (values, _) in EXPECTED.items():
        assert own[name] == pytest.approx(np.array(values)[index], rel=3e-16, abs=0.0), name


def test_grain_arrays_are_those_of_the_schema():
    """`GrainArrays` names the quantities of the schema in the same order, then others."""
    assert GrainArrays._fields == (*(field.name for field in FIELDS), "own", "material", "id", "image")


@pytest.mark.parametrize(
    ("given", "unit", "factor"),
    [
        ("K", "K", 1.0),
        ("W/m^2", "W/m^2", 1.0),
        ("mW/cm²", "W/m^2", 10.0),  # 1e-3/1e-4
        ("J/(kg K)", "J/kg/K", 1.0),
        ("1/cm^3", "m^-3", 1e6),
        ("1/s", "s^-1", 1.0),
        ("eV", "J", 1.602176634e-19),  # exact in the SI of 2019
        ("Myr", "s", 1e6 * 365.25 * 86400.0),
        ("degree", "rad", np.pi / 180.0),
        ("rpm", "rad/s", 2.0 * np.pi / 60.0),
        ("kWh", "J", 3.6e6),
        ("L", "m^3", 1e-3),
        ("dyn cm", "N m", 1e-7),
        ("g/cm^3", "kg/m^3", 1e3),
        ("percent", "1", 0.01),
        ("", "1", 1.0),
        ("1", "1", 1.0),
    ],
)
def test_units_become_those_of_si(given, unit, factor):
    """x [given] = factor x [SI]; the factors are definitions of the units. Bound: four roundings, 2**-51."""
    values, found = with_own_unit(([1.0, -2.0], given))
    assert found == unit and values == pytest.approx([factor, -2.0 * factor], rel=4.5e-16, abs=0.0)
    if given and not given[0].isdigit():
        value, found = with_own_unit(f"3 {given}")
        assert found == unit and value == pytest.approx(3.0 * factor, rel=4.5e-16, abs=0.0)
    assert si_unit(unit) == unit


def test_quantities_of_pint_have_their_unit():
    """A quantity of pint, of any registry, is read with its unit; a plain number has none."""
    import pint

    registry = pint.UnitRegistry(cache_folder=None)
    found = five({"heating": registry.Quantity([1, 2, 3, 4, 5], "mW/cm^2"), "ratio": registry.Quantity(0.5, "")}).own
    assert found.units == {"heating": "W/m^2", "ratio": "1"} and found["ratio"].tolist() == [0.5] * 5
    assert found["heating"] == pytest.approx([10, 20, 30, 40, 50], rel=4.5e-16, abs=0.0)


@pytest.mark.parametrize(
    "given", ["25 degC", (25.0, "degC"), "3 dB", "5 parrots", (["a"], "K"), "warm", None, ("3", "K")]
)
def test_what_is_no_quantity_is_refused(given):
    """Unknown units, and those with an offset or a logarithm: one line, with what to write."""
    with pytest.raises(
        sand.BadInput, match=r"own: warmth = .* no quantity; .* text with a unit such as '300 K'"
    ) as caught:
        five({"warmth": given})
    assert len(caught.value.problems) == 1 and "degC" in str(caught.value)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("surface heat", "such as 'surface_heat'"),
        ("heat,flux", "such as 'heat_flux'"),
        ("3d", "such as 'own_3d'"),
        ("lambda", "such as 'own_lambda'"),
        ("_heat", "such as 'heat'"),
        ("__proto__", "such as 'proto'"),
        ("", "such as 'heat'"),
        ("x" * 61, "61 characters; at most 60"),
        (3, "must be text, not 3"),
        ("radius", "has a meaning in SAND already"),
        ("Radius", "has a meaning in SAND already"),
        ("cluster", "has a meaning in SAND already"),
        ("still", "has a meaning in SAND already"),
        ("copy", "has a meaning in SAND already"),
    ],
)
def test_names_that_cannot_be_used_are_refused(name, message):
    """One line, with a name that can be used; the name proposed can be."""
    with pytest.raises(sand.BadInput, match=re.escape(message)) as caught:
        five({name: "1 K"})
    assert len(caught.value.problems) == 1
    proposed = re.search(r"such as '(\w+)'", str(caught.value))
    assert proposed is None or five({proposed[1]: "1 K"}).own


def test_all_mistakes_are_named_at_once():
    """Names, units, shapes and values that are not finite: one line each, beside those of other arguments."""
    own = {"surface heat": 1, "a": "1 parrot", "b": [1, 2], "c": [1, 2, 3, 4, np.nan], "µ": 1, "μ": 2}
    with pytest.raises(sand.BadInput) as caught:
        sand.Grains(np.zeros((5, 3)), "1 parrot", "silica", own=own)
    assert len(caught.value.problems) == 6


def test_no_name_hides_another_meaning():
    """Names of attributes, quantities, figures, columns and variables are reserved, so that no quantity hides one."""
    grains, frame = five(), Frame.__new__(Frame)
    public = [name for cls in (Change, FrameSequence, Frame, type(grains)) for name in dir(cls) if name[0] != "_"]
    public += [*Change.__annotations__, *vars(grains), *dir(frame), *OF_GRAINS, *OF_CONTACTS]
    public += [*GRAIN_NAMES, *CONTACT_NAMES, *HISTORY, "still", *GrainArrays._fields, "grain", "axis", "frame", "time"]
    assert {name.casefold() for name in public if name[0] != "_"} <= RESERVED


def test_names_that_others_confuse_are_refused():
    """OVITO reads columns of dump files in lower case, and T.png is t.png on some file systems."""
    with pytest.raises(sand.BadInput, match="'heat' and 'Heat' differ by capitals at most"):
        five({"Heat": "1 K", "heat": "2 K"})
    with pytest.raises(sand.BadInput, match="'age' and 'Age' differ by capitals at most"):
        five({"Age": "1 s"}).with_own({"age": "2 s"})
    assert five({"age": "1 s"}).with_own({"age": "2 s"}).age.tolist() == [2.0] * 5


def test_letters_are_those_that_python_reads():
    """Python reads the micro sign µ (U+00B5) in a script as the Greek letter μ (U+03BC)."""
    assert five({"µ": "1 K"}).µ.tolist() == [1.0] * 5


def test_grains_carry_own_quantities():
    """Attributes, parts, copies, other grains made with them, and bodies on a collision course."""
    grains = five()
    assert_same(grains.own)
    assert_same(grains[1:3].own, slice(1, 3))
    assert_same(grains.copy().own)
    assert_same(five({"heating": "3 K", **{name: 0 for name in OWN if name != "heating"}}).with_own(OWN).own)
    assert five({"a": "1 m"}).with_own({"b": "2 s"}).own.units == {"a": "m", "b": "s"}
    assert_same(sand.Grains(grains.position, grains.radius, "silica", own=grains.own).own)
    assert_same(grains.own.taken([4, 0]), [4, 0])
    assert_same(encounter(grains, grains[[4, 0]], speed=1.0).grains.own, [0, 1, 2, 3, 4, 4, 0])
    assert not grains.temperature.flags.writeable and "heating" in dir(grains)
    assert repr(grains.own).startswith("<own quantities temperature [K]: array of shape (5,), heating [W/m^2]")


def test_sets_of_grains_that_differ_are_refused():
    """Bodies of which one lacks a quantity, or has it in another unit, cannot be put together."""
    one, other = five({"heat": "1 J", "age": "1 s"}), five({"heat": "1 K"})
    with pytest.raises(sand.BadInput) as caught:
        encounter(one, other, speed=1.0)
    assert "projectile: it has no own quantity age, which other grains have" in str(caught.value)
    assert "projectile: it has heat in K, other grains in J" in str(caught.value)
    assert joined([five({"work": "1 J"}).own, five({"work": "1 N m"}).own], ["", ""]).units == {"work": "J"}


@pytest.mark.parametrize("name", ["temperature", "own"])
def test_assignment_names_the_argument(name):
    """Quantities cannot be assigned; the message shows how to give them."""
    with pytest.raises(sand.BadInput, match=r"make new grains, sand.Grains\(…, own={"):
        setattr(five(), name, 3.0)


class Heating(sand.Updater):
    """Warms all grains by 2 K, and at step 10 exchanges the last grain."""

    every = "5 steps"

    def act(self, simulation):
        with simulation.change() as state:
            state.temperature += 2.0
            state.own["heating"] = ([simulation.steps] * len(state.grains), "mW/cm^2")
            state.constructor[0] = simulation.time
            if simulation.steps == 10:
                state.remove([4])
                grain = {**dict.fromkeys(("constructor",), 9.0), "T": "9 J/kg/K", "age": "9 s"}
                grain |= {"temperature": "77 K", "heating": "9 W/m^2", "Oberfläche": "9 m^2"}
                state.add(sand.Grains([[5e-6, 0, 0]], "0.1 um", "silica", own=grain))
                assert [values[-1] for values in state.grains.own.values()] == [77.0, 9.0, 9.0, 9.0, 9.0, 9.0]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A run of 20 steps with the updater, interrupted at step 12, and the same one without interruption."""
    folder = tmp_path_factory.mktemp("own") / "run"
    sim = sand.Simulation(five(), [sand.Contact()], out=folder, updaters=[Heating()], frame_every="2 steps")
    sim.run(steps=12)
    sand.resume(folder, updaters=[Heating()]).run(steps=8)
    whole = sand.Simulation(five(), [sand.Contact()], updaters=[Heating()])
    whole.run(steps=12)
    copy = whole.copy()
    whole.run(steps=8)
    copy.run(steps=8)
    return folder, whole.grains, copy.grains


@pytest.mark.compiled("contacts")
def test_changes_survive_an_interruption_bit_by_bit(run):
    """Grains of a run that was resumed, of one without interruption and of a copy are equal; the change is in frames.

    Five grains at 100 … 300 K gain 2 K at steps 5, 10, 15, 20; the last is replaced at step 10 by one of 77 K.
    """
    folder, whole, copy = run
    resumed = sand.resume(folder, updaters=[Heating()]).grains
    for grains in (resumed, copy):
        assert grains.own.units == whole.own.units
        assert all((a == b).all() for a, b in zip(grains.arrays, whole.arrays, strict=True))
    assert whole.temperature.tolist() == [108.0, 158.0, 208.0, 258.0, 81.0]
    frames = {frame.step: frame for frame in sand.open(folder).frames}
    assert_same(frames[4].own)
    assert frames[6].temperature.tolist() == [102.0, 152.0, 202.0, 252.0, 302.0]
    assert frames[12].temperature.tolist() == [104.0, 154.0, 204.0, 254.0, 77.0]
    assert frames[12].own["heating"].tolist() == [100.0] * 4 + [9.0]
    assert frames[12].Oberfläche.tolist() == pytest.approx([2e-4] * 4 + [9.0], rel=3e-16, abs=0.0)
    assert (frames[20].own["constructor"] == whole.constructor).all()
    assert sand.open(folder).frames.temperature[-1].tolist() == whole.temperature.tolist()


@pytest.mark.compiled("contacts")
def test_own_quantities_do_not_change_the_motion():
    """A change of own quantities alone leaves every other array of the state as it is, bit by bit."""

    class Clock(sand.Updater):
        every = "3 steps"

        def act(self, simulation):
            with simulation.change() as state:
                state.age[...] = simulation.time

    def end(updaters):
        grains = five()
        grains.arrays.velocity[0] = [1.0, 0.0, 0.0, 0.0, -1.0]
        sim = sand.Simulation(grains, [sand.Contact()], updaters=updaters)
        sim.run(steps=50)
        return sim

    with_clock, without = end([Clock()]), end([])
    assert with_clock.grains.age[0] > 0.0
    arrays = with_clock.state.to_arrays()
    for name, array in without.state.to_arrays().items():
        assert name == "grains/own" or (arrays[name] == array).all(), name


@pytest.mark.compiled("contacts")
def test_a_change_between_two_steps_is_kept():
    """Where a run ends at a time at which no step ends, a change is in the state shown and in that of the next step."""
    sim = sand.Simulation(five(), [sand.Contact()])
    sim.run(steps=3)
    step = sim.time / 3
    sim.run(until=sim.time + 2.4 * step)
    with sim.change() as state:
        state.temperature = "5 K"
    assert sim.grains.temperature.tolist() == [5.0] * 5
    sim.run(steps=4)
    assert sim.grains.temperature.tolist() == [5.0] * 5


@pytest.mark.compiled("contacts")
def test_wrong_changes_are_refused():
    """A quantity that the simulation lacks, one left out, a wrong unit: one line each; nothing is changed."""
    sim = sand.Simulation(five(), [sand.Contact()])
    with pytest.raises(sand.BadInput) as caught, sim.change() as state:
        state.own["charm"] = 1.0
        del state.own["age"]
        state.temperature = "3 m"
        state.own["heating"] = [1.0, 2.0]
    assert [problem.split(";")[0][:44] for problem in caught.value.problems] == [
        "own: the simulation has no 'charm'",
        "temperature = '3 m' is a length, not a quant",
        "heating has shape (2,) but must be (5,) for 5 grains (own quantity, in W/m^2)"[:44],
        "own: 'age' cannot be left out of a simulatio",
    ]
    with pytest.raises(sand.BadInput, match="the grains added have no own quantity T"), sim.change() as state:
        state.add(sand.Grains([[5e-6, 0, 0]], "0.1 um", "silica", own={"temperature": "77 K"}))
    with pytest.raises(sand.BadInput, match="no 'temperatur' to assign; did you mean 'temp"), sim.change() as state:
        state.temperatur = 3.0
    assert_same(sim.grains.own)


@pytest.mark.compiled("contacts")
def test_spatial_sorting_keeps_the_rows():
    """With grains in the order of a space-filling curve, also while an updater writes, row k is grain k."""

    class Number(sand.Updater):
        every = "4 steps"

        def act(self, simulation):
            with simulation.change() as state:
                state.number[...] = 10.0 * np.arange(len(state.grains)) + simulation.steps

    grains = sand.setup.lattice(4, 4, 4, radius="0.1 um", material="silica")
    rng = np.random.default_rng(2)
    shuffled = grains[rng.permutation(len(grains))]
    own = sand.Grains(shuffled.position, shuffled.radius, "silica", own={"number": np.arange(64)})
    sim = sand.Simulation(own, [sand.Contact()], updaters=[Number()], neighbours=sand.Neighbours(order="curve"))
    sim.run(steps=3)
    assert sim.grains.number.tolist() == list(range(64))
    sim.run(steps=7)
    assert sim.grains.number.tolist() == [10 * k + 8 for k in range(64)]


@pytest.mark.compiled("contacts")
def test_frames_give_tables_starts_and_pages(run):
    """xarray has values of each frame with units, a start from a frame and packets of the page have the values.

    Packets hold single precision (2**-24).
    """
    folder, whole, _ = run
    last = sand.open(folder).frames[-1]
    start = sand.setup.from_frame(last, {"silica": sand.SILICA})
    assert start.grains.own.units == whole.own.units
    assert all((start.grains.own[name] == whole.own[name]).all() for name in whole.own)
    _, arrays = decode(frame_packet(0, last, np.zeros(5), 1.0, compact=True))
    for name in whole.own:
        assert arrays[f"own/{name}"] == pytest.approx(whole.own[name], rel=6e-8, abs=0.0)
        assert (measured(last, name) == whole.own[name]).all() and name in names_of(last)
    assert quantity_ranges([last])["temperature"] == [81.0, 258.0]
    assert quantity_ranges([five_frame()])["heating"] == [-4.0, 5.0]


def five_frame(index=slice(None)):
    """A frame of grains of `five`."""
    from sand.io.bodies import contacts_of
    from sand.io.frame_chunks import stored_frame

    grains = five()[index]
    return Frame(stored_frame(0, 0.0, grains, Box.open(), contacts_of(grains)))


def test_xarray_has_units():
    """Variables of the data set have the dimensions frame and grain, and their unit."""
    pytest.importorskip("xarray")
    result = sand.results.Run.__new__(sand.results.Run)
    result.__dict__["frames"] = [five_frame(), five_frame()]
    data = result.to_xarray()
    assert data["heating"].dims == ("frame", "grain") and data["heating"].attrs == {"units": "W/m^2"}
    assert data["heating"].to_numpy() == pytest.approx(np.array([EXPECTED["heating"][0]] * 2), rel=3e-16, abs=0.0)


@pytest.mark.parametrize("ending", ["gsd", "xyz"])
def test_body_files_keep_own_quantities(ending, tmp_path):
    """The grains read from a file of a body have the own quantities and charges of those written, bit by bit."""
    grains = five()
    charged = sand.Grains(grains.position, grains.radius, "silica", own=grains.own, charge=np.arange(5) * 0.5)
    write_body(tmp_path / f"body.{ending}", charged)
    found = read_body(tmp_path / f"body.{ending}")
    assert found.own.units == grains.own.units and found.charge.tolist() == charged.charge.tolist()
    assert all((found.own[name] == grains.own[name]).all() for name in grains.own)


def test_a_wrong_column_of_a_body_is_named(tmp_path):
    """A file that announces an own quantity without its column is refused."""
    write_body(tmp_path / "body.xyz", five())
    text = (tmp_path / "body.xyz").read_text(encoding="utf-8").replace(":heating:R:1", ":heat:R:1")
    (tmp_path / "body.xyz").write_text(text, encoding="utf-8")
    with pytest.raises(sand.BadInput, match="own= names heating, but Properties has no heating:R:1"):
        read_body(tmp_path / "body.xyz")


def columns_of(text, form):
    """Columns of an exported frame by name, and units, if the format has them."""
    lines = text.splitlines()
    if form == "xyz":
        properties = re.search(r"Properties=(\S+)", lines[1])[1].split(":")
        names = [name for name, width in zip(properties[::3], properties[2::3], strict=True) for _ in range(int(width))]
        units = dict(entry.split("=") for entry in re.search(r' own="([^"]*)"', lines[1])[1].split(";"))
        return dict(zip(names, zip(*(line.split() for line in lines[2:]), strict=True), strict=True)), units
    if form == "lammps-dump":
        head = next(k for k, line in enumerate(lines) if line.startswith("ITEM: ATOMS"))
        names = [name.removeprefix("d_") for name in lines[head].split()[2:]]
        return dict(zip(names, zip(*(line.split() for line in lines[head + 1 :]), strict=True), strict=True)), None
    arrays = [each for each in ElementTree.fromstring(text).iter("DataArray") if each.get("Name") in EXPECTED]
    keys = {each.get("Name"): each.find("InformationKey") for each in arrays}
    return {each.get("Name"): each.text.split() for each in arrays}, {name: key.text for name, key in keys.items()}


@pytest.mark.parametrize("form", ["xyz", "vtk", "lammps-dump"])
def test_exports_keep_own_quantities(form, tmp_path):
    """The exported numbers are those of the frame, bit by bit, with units where the format has a place for them."""
    from sand.io.export import export_frames

    path = export_frames([five_frame()], tmp_path / "run", form, lambda count, pair: np.zeros(count, int))[-1]
    columns, units = columns_of(path.read_text(encoding="utf-8"), form)
    for name, values in five().own.items():
        assert [float(text) for text in columns[name]] == values.tolist()
        assert units is None or units[name] == EXPECTED[name][1]


def test_an_export_that_cannot_keep_them_says_so(tmp_path):
    """Data files of LAMMPS have no column for own quantities; without any there is no warning."""
    from sand.io.export import export_frames

    def export(frame):
        export_frames([frame], tmp_path / "run", "lammps-data", lambda count, pair: np.zeros(count, int))

    with pytest.warns(UserWarning, match="no place for own quantities: temperature, .* left out; lammps-dump has them"):
        export(five_frame())
    plain = five_frame()
    plain.own = OwnQuantities({}, {})
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        export(plain)


def test_prefixes_are_written_where_they_mean_it():
    """1 µm^2 is (1e-6 m)², so that areas, masses and the like have a power of ten; the product is unchanged."""
    assert si_prefix(3e-7, "m") == (1e-9, "nm") and si_prefix(3e-7, "W/m^2") == (1e-9, "nW/m^2")
    assert si_prefix(2e-4, "m^2") == (1e-6, "10⁻⁶ m^2") and si_prefix(3e4, "kg/m^3") == (1e3, "10³ kg/m^3")
    assert si_prefix(2.0, "m^2") == (1.0, "m^2") and si_prefix(5e-4, "s^-1") == (1e-6, "10⁻⁶ s^-1")


@pytest.mark.slow
@pytest.mark.draws
def test_pictures_show_own_quantities():
    """Colours of grains follow the values, the legend has name and unit; a wrong name is refused with a proposal."""
    still = still_picture(five_frame(), colour="Oberfläche", size=(300, 200))
    assert any("Oberfläche" in text.get_text() for text in still.texts)
    still = still_picture(five_frame(), colour="heating", size=(300, 200))
    assert any("heating" in text.get_text() and "W/m^2" in text.get_text() for text in still.texts)
    assert len(np.unique(still.scene.colour, axis=0)) == 5
    with pytest.raises(sand.BadInput, match="no quantity 'heatin'; did you mean 'heating'"):
        still_picture(five_frame(), colour="heatin")


@pytest.mark.slow
@pytest.mark.draws
def test_commands_know_own_quantities(tmp_path, capsys):
    """`sand plot` draws histograms and colours of the run's own quantities, and proposes them for misspelt names."""
    write_body(tmp_path / "body.gsd", five())
    source = str(tmp_path / "body.gsd")
    words = ["--what", "still,heating", "--colour", "temperature", "--size", "300x200"]
    assert main(["plot", source, *words]) == 0
    assert {path.name for path in (tmp_path / "body-plots").iterdir()} == {"still.png", "heating.png"}
    assert main(["plot", source, "--what", "heatin", "--colour", "temperatur"]) != 0
    message = capsys.readouterr().err
    assert "did you mean 'heating'?" in message and "did you mean 'temperature'?" in message
