"""Units within lists, rows, masked arrays and results of functions; other systems of units; paths; sizes of numbers.

A quantity is converted or refused: its bare number is never taken.
"""

import datetime
import os

import numpy as np
import pint
import pytest

import sand
from sand.basics.quantity_array import QuantityArray
from sand.basics.units import in_unit, si
from sand.config.case import check_case
from sand.experiments import kernel_table
from sand.io.run_folder import read_text
from tests.unit.pint_units import UNIT

PAIR = [[0, 0, 0], [1e-6, 0, 0]]
MASKED = np.ma.masked_array([1.0, 2.0], [False, True])


def pint_rows(unit):
    return [np.array([0.0, 1.0, 2.0]) * UNIT.Unit(unit), np.array([1.0, 0.0, 0.0]) * UNIT.Unit(unit)]


def rows_of(package, unit):
    """Two rows with a unit of astropy or unyt."""
    module = pytest.importorskip({"astropy": "astropy.units", "unyt": "unyt"}[package], reason=f"{package} is optional")
    one = module.Unit(unit) if package == "astropy" else getattr(module, unit)
    return [np.array([0.0, 1.0, 2.0]) * one, np.array([1.0, 0.0, 0.0]) * one]


@pytest.mark.parametrize("package", ["pint", "astropy", "unyt"])
def test_units_of_rows_are_kept_or_refused(package):
    """1 um in a row of a list is 1e-6 m; 1 kg is no length."""
    make = pint_rows if package == "pint" else lambda unit: rows_of(package, unit)
    expected = np.array([[0.0, 1e-6, 2e-6], [1e-6, 0.0, 0.0]])
    assert sand.Grains(make("um"), 1e-7, "silica").position == pytest.approx(expected, rel=1e-14, abs=0.0)
    with pytest.raises(sand.BadInput, match=r"position\[0\] = array of shape \(3,\) in kilo|position\[0\] = .* in kg"):
        sand.Grains(make("kg"), 1e-7, "silica")


@pytest.mark.parametrize("radii", [["100 nm", "50 nm"], ["100 nm", 5e-8], [0.1 * UNIT.um, 50 * UNIT.nm]])
def test_lists_of_text_and_quantities(radii):
    assert sand.Grains(PAIR, radii, "silica").radius == pytest.approx([1e-7, 5e-8], rel=1e-14, abs=0.0)


@pytest.mark.parametrize(
    "value",
    [MASKED, MASKED * UNIT.m, [1.0, np.ma.masked], [1.0, True], [1.0, 2j], ["1", "2"], [1.0, None], [[1.0], [1.0, 2.0]],
     np.timedelta64(5), b"1", {1.0: 2.0}, [1 * UNIT.m, 1 * UNIT.s]],
    ids=repr,
)  # fmt: skip
def test_what_is_not_an_array_of_lengths(value):
    """Masks, imaginary parts, truth values and missing units are not dropped."""
    assert in_unit(value, "m") is None


@pytest.mark.parametrize(("unit", "wanted"), [("Hz", "rad/s"), ("rad/s", "Hz"), ("rpm", "Hz"), ("kilohertz", "rad/s")])
def test_frequencies_are_no_angular_velocities(unit, wanted):
    """1 Hz are 2π rad/s, which pint takes for 1 rad/s: refused as text and as a quantity."""
    assert in_unit(f"1 {unit}", wanted) is None
    assert in_unit(UNIT.Quantity(1.0, unit), wanted) is None


def test_units_that_only_the_registry_of_the_user_has():
    registry = pint.UnitRegistry()
    registry.define("monomer_size = 0.3 um = mono")
    assert in_unit(registry.Quantity(2.0, "mono"), "m") == pytest.approx(6e-7, rel=1e-12, abs=0.0)


@pytest.mark.parametrize("package", ["pint", "astropy", "unyt"])
def test_own_quantities_of_other_packages(package):
    """An array with a unit, and rows of one, as for the quantities of SAND."""
    kelvin = pint_rows("mK")[0] if package == "pint" else rows_of(package, "mK")[0]
    for given in (kelvin, list(kelvin), [kelvin[0], 1e-3, "2 mK"]):
        own = sand.Grains([*PAIR, [2e-6, 0, 0]], 1e-7, "silica", own={"heat": given}).own
        assert own["heat"] == pytest.approx([0.0, 1e-3, 2e-3], rel=1e-14, abs=0.0) and own.units == {"heat": "K"}


@pytest.mark.parametrize(
    ("value", "unit", "expected"),
    [
        ("100 gauss", "T", 0.01), ("1 kG", "T", 0.1), ("100 Oe", "T", 0.01), ("2 emu", "A m^2", 2e-3),
        ("2 erg/G", "A m^2", 2e-3), ("200 emu/g", "A m^2/kg", 200.0), ("1 gauss/hour", "T/s", 1e-4 / 3600.0),
        ("1 statC", "C", 1.0 / 2997924580.0), (UNIT.Quantity(100, "gauss"), "T", 0.01),
        ("25 degC", "K", 298.15), ("25 °C", "K", 298.15), ("77 degF", "K", 298.15),
        (UNIT.Quantity(25, "degC"), "K", 298.15), ("2 meV", "K", 2e-3 * 1.602176634e-19 / 1.380649e-23),
        (datetime.timedelta(microseconds=5), "s", 5e-6), (np.timedelta64(5, "us"), "s", 5e-6),
        ("60 rpm", "rad/s", 2.0 * np.pi), ("5 Gs", "s", 5e9),
    ],
    ids=str,
)  # fmt: skip
def test_other_systems_of_units(value, unit, expected):
    """1 G = 1e-4 T = 1 Oe in empty space; 1 emu = 1 erg/G; T = E/k_B for an energy in eV; 1 statC = 1/(10 c) C."""
    assert in_unit(value, unit) == pytest.approx(expected, rel=1e-12, abs=0.0)


@pytest.mark.parametrize(
    ("text", "unit", "advice"),
    [("25 C", "K", "degC"), ("100 A/m", "T", "μ0 H"), ("1 MHz", "rad/s", "2π"), ("1e6 rad/s", "Hz", "2π")],
)
def test_units_that_are_meant_for_others(text, unit, advice):
    with pytest.raises(sand.BadInput, match=f"x = '{text}' is .*, not a quantity in {unit}; .*{advice}"):
        si(text, unit, "x")


def test_arrays_of_functions_are_converted_by_their_documented_units():
    """K(m1, m2) = (m1 + m2) m³/(kg s) of 1 g and 1 g is 2e-3 m³/s; results of a kernel have a unit, too."""
    grams = np.array([1.0, 2.0]) * UNIT.gram
    assert kernel_table.on_grid(lambda a, b: a + b, grams)[0, 0] == pytest.approx(2e-3, rel=1e-14, abs=0.0)
    litres = kernel_table.on_grid(lambda a, b: (a + b) * UNIT.Unit("litre/s"), [1.0, 2.0])
    assert litres[0, 0] == pytest.approx(2e-3, rel=1e-12, abs=0.0)
    rod = np.array(PAIR) * 1e6 * UNIT.um
    assert sand.analysis.shape.gyration_radius(rod) == pytest.approx(0.5e-6, rel=1e-12, abs=0.0)
    with pytest.raises(sand.BadInput, match=r"position .*is a mass, not a quantity in m"):
        sand.analysis.shape.gyration_radius(np.array(PAIR) * UNIT.kg)
    with pytest.raises(sand.BadInput, match=r"x = .* is not a number"):
        sand.analysis.fits.power_law(np.array([1.0, 2.0]) * UNIT.s, [1.0, 2.0])


def test_entries_of_a_change_are_converted():
    """Also those of views; results of arithmetic are plain arrays."""
    velocity = QuantityArray(np.zeros((2, 3)), "m/s", "velocity")
    velocity[0] = np.array([1.0, 0.0, 0.0]) * UNIT.Unit("cm/s")
    velocity[1][2] = "5 mm/s"
    assert velocity.tolist() == [[0.01, 0.0, 0.0], [0.0, 0.0, 0.005]]
    assert type(2.0 * velocity) is np.ndarray
    with pytest.raises(sand.BadInput, match=r"velocity = .* is a length, not a quantity in m/s"):
        velocity[0] = 1.0 * UNIT.m
    with pytest.raises(sand.BadInput, match="velocity: could not broadcast"):
        velocity[0] = [1.0, 2.0]


def test_open_axes_of_a_box_have_the_word_of_case_files():
    assert sand.Box.periodic("3 um", "3 um", "open") == sand.Box.periodic(3e-6, 3e-6, None)


def test_parameters_of_own_forces_have_any_size():
    """c may be the speed of light, or above it; its unit is still checked."""

    @sand.external_force(c="m/s", wave="m/s")
    def pull(grain, p):
        return (0.0, 0.0, 0.0), 0.0 * p.c * p.wave[0]

    found = pull(c=299792458.0, wave=(3e9, 0.0, 0.0))
    assert (found.values["c"], found.values["wave"][0]) == (299792458.0, 3e9)
    with pytest.raises(sand.BadInput, match="pull: c = '1 m' is a length, not a quantity in m/s"):
        pull(c="1 m", wave=(0.0, 0.0, 0.0))


def test_the_home_folder_in_paths(tmp_path, monkeypatch):
    """`~` in arguments of functions and in keys of case files."""
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    home = os.path.expanduser("~")
    kernel_table.write_csv("~/k.csv", lambda a, b: a + b, [1.0, 2.0])
    assert (tmp_path / "k.csv").exists()
    grains = {"number": 5, "radius": "0.1 um", "material": "silica"}
    case = {"run": {"until": "1 us", "out": "~/run"}, "box": {"periodic": "3 um"}, "grains": grains}
    assert check_case(case, "case").run.out == os.path.join(home, "run")
    with pytest.raises(sand.BadInput, match="there is no folder") as caught:
        sand.open("~/nothing")
    assert home in str(caught.value) and "~" not in str(caught.value)


def test_files_that_are_not_utf8_are_named_with_line_and_encoding(tmp_path):
    file = tmp_path / "case.toml"
    file.write_bytes("# first\n# Körner\n".encode("latin-1"))
    with pytest.raises(sand.BadInput, match="not UTF-8: line 2, '# Körner', has byte 0xf6, 'ö' in Latin-1; save"):
        read_text(file)
    file.write_bytes("ß".encode("latin-1"))
    with pytest.raises(sand.BadInput, match="line 1"):
        read_text(file)


def test_many_unknown_keys_are_counted():
    """Only the first hundred are described."""
    case = {"run": {"until": "1 us"}, "grains": {}, "forces": {f"key{k}": {} for k in range(20_000)}}
    with pytest.raises(sand.BadInput) as caught:
        check_case(case, "case")
    assert "more errors" in caught.value.problems[-1] and len(caught.value.problems) <= 110


NO_ARRAYS = [np.array(1.0), UNIT.Quantity(1.0, "mol"), np.ma.masked, np.timedelta64(5, "us"), [[]], 10**5000]


class NoNumber:
    """An object whose conversions fail."""

    def __float__(self):
        raise ZeroDivisionError

    def __repr__(self):
        raise RuntimeError


@pytest.mark.parametrize("odd", [*NO_ARRAYS, NoNumber()], ids=lambda odd: type(odd).__name__)
@pytest.mark.parametrize(
    "call",
    [
        lambda v: sand.Grains(v, 1e-7, "silica"),
        lambda v: sand.Grains(PAIR, 1e-7, v),
        lambda v: sand.Box(v),
        lambda v: sand.Ramp(v, [0.0, 1.0]),
        lambda v: sand.Driven(v),
        lambda v: sand.Driven([0], velocity=v),
        lambda v: sand.Simulation(sand.Grains(PAIR, 1e-7, "silica"), v),
        lambda v: sand.Grains(PAIR, 1e-7, "silica").overlaps(v, sand.Box.open()),
        lambda v: sand.analysis.clusters.cluster_labels(v, [[0, 1]]),
        lambda v: sand.analysis.clusters.mean_cluster_size(v),
        lambda v: sand.analysis.shape.filling_factor(np.array(PAIR), v),
        lambda v: sand.analysis.network.network(2, v),
        lambda v: sand.setup.encounter(*2 * (sand.Grains(PAIR, 1e-7, "silica"),), speed=1.0, along=v),
        lambda v: sand.Dipoles(cut=v),
    ],
)
def test_odd_arguments_are_errors_of_the_input(call, odd):
    """Never an internal error."""
    try:
        call(odd)
    except sand.SandError as error:
        assert len(str(error)) < 600
