"""Errors of input: long values, many entries, units of arrays, missing packages. Nothing is compiled."""

import operator
import pickle
import sys

import numpy as np
import pytest

import sand
from sand.basics.quantity_array import QuantityArray
from sand.config.case import check_case
from sand.io.bodies import write_body
from sand.io.run_folder import LEDGER, TRAJECTORY
from sand.simulation.contact_table import ContactTable
from tests.unit.pint_units import UNIT


@pytest.fixture(scope="module")
def namespace(tmp_path_factory):
    """Names of expressions: two grains, a simulation before its first step, an empty table, a folder with a frame."""
    grains = sand.Grains([[0, 0, 0], [3e-8, 0, 0]], 1e-8, "silica")
    run = tmp_path_factory.mktemp("run")
    write_body(run / "body.gsd", grains)
    (run / "body.gsd").rename(run / TRAJECTORY)
    (run / LEDGER).write_text("step,total\n0,1.0\n")
    table = ContactTable.__new__(ContactTable)
    table.update({"pair": np.zeros((0, 2), int), "overlap": np.zeros(0)})
    sim = sand.Simulation(grains, [sand.Contact()])
    return {"sand": sand, "grains": grains, "sim": sim, "table": table, "run": str(run)}


LONG = "x" * 5000


@pytest.mark.parametrize(
    "make",
    [
        lambda: sand.Grains([[0, 0, 0]], 1e-8, LONG),
        lambda: sand.Grains([[0, 0, 0]], 1e-8, "iron", **{LONG: 1}),
        lambda: sand.Contact(slip="a b " * 2000),
        lambda: getattr(sand, LONG),
        lambda: check_case({"run": {"until": LONG, "stop": LONG}, LONG: {}, "grains": {"material": LONG}}, "case"),
    ],
)
def test_long_values_are_shortened(make):
    """Values of thousands of characters lose their middle in messages; the end of the message stays."""
    with pytest.raises(sand.BadInput) as caught:
        make()
    assert all(len(problem) <= 1500 and not problem.endswith("…") for problem in caught.value.problems)
    path = "/" + "folder/" * 40 + "file.toml"
    assert path in str(sand.BadInput(f"there is no file {path}"))


def test_many_wrong_entries_are_counted():
    """Of thousands of wrong entries of a list the first hundred are described."""
    with pytest.raises(sand.BadInput) as caught:
        sand.Driven(["x"] * 5000)
    assert len(caught.value.problems) == 101 and caught.value.problems[-1] == "… and 4900 more errors"


@pytest.mark.parametrize("value", [np.full((2, 3), 1.0) * UNIT.Unit("cm/s"), "1 cm/s"])
def test_what_numpy_writes_into_a_change_keeps_its_unit(value):
    """Functions of NumPy that write into an array of a change convert text and quantities, or refuse them."""
    everywhere = np.ones((2, 3), bool)
    writers = [
        lambda array, value: np.copyto(array, value),
        lambda array, value: np.copyto(dst=array, src=value),
        lambda array, value: np.putmask(array, everywhere, value),
        lambda array, value: np.place(array, everywhere, value),
        lambda array, value: np.put(array, range(6), value),
        lambda array, value: array.put(range(6), value),
        lambda array, value: operator.iadd(array, value),
        lambda array, value: operator.isub(array, f"-{value}" if isinstance(value, str) else -value),
    ]
    for write in writers:
        array = QuantityArray(np.zeros((2, 3)), "m/s", "velocity")
        write(array, value)
        assert np.asarray(array) == pytest.approx(np.full((2, 3), 0.01), rel=1e-15, abs=0.0)
        with pytest.raises(sand.BadInput, match=r"velocity = .* is a length, not a quantity in m/s"):
            write(array, "1 m" if isinstance(value, str) else value * UNIT.s)
    array.fill("2 mm/s")
    np.copyto(plain := np.zeros((2, 3)), array)
    assert (plain == 2e-3).all()
    array += [1.0, 2.0, 3.0]
    assert array[0].tolist() == [1.002, 2.002, 3.002]


@pytest.mark.parametrize(
    ("slip", "package"),
    [("table.to_pandas()", "pandas"), ("table.to_xarray()", "xarray"), ("sand.open(run).to_pandas()", "pandas")],
)
def test_missing_optional_package_is_named(namespace, monkeypatch, slip, package):
    """The line names the package to install."""
    monkeypatch.setitem(sys.modules, package, None)  # importing it fails
    with pytest.raises(sand.BadInput, match=f"needs {package}, which is not installed: pip install {package}"):
        eval(slip, dict(namespace))


def test_membership_and_get_of_tables(namespace):
    """`in` and `get` work as for any mapping, `hasattr` for grains and simulations."""
    assert "overlp" not in namespace["table"] and namespace["table"].get("overlp") is None
    assert not hasattr(namespace["grains"], "velocty") and not hasattr(namespace["sim"], "grain")


def test_all_wrong_settings_are_reported_together():
    """Types and ranges, one line each."""
    with pytest.raises(sand.BadInput) as caught:
        sand.Contact(slip=3, slide_factor=-1.0, roll_factor="x")
    assert len(caught.value.problems) == 3
    with pytest.raises(sand.BadInput) as caught:
        sand.RigidClusters(step_fraction=-1.0, contact_stepping="verlet")
    assert len(caught.value.problems) == 2
    with pytest.raises(sand.BadInput) as caught:
        sand.Grains([[0, 0, 0]], 1e-8, "iron", velocty=1, spim=2)
    assert [line.split(";")[1] for line in caught.value.problems] == [
        " did you mean 'velocity'?",
        " did you mean 'spin'?",
    ]
    again = pickle.loads(pickle.dumps(caught.value))  # as a worker process sends it
    assert again.problems == caught.value.problems and str(again) == str(caught.value)
