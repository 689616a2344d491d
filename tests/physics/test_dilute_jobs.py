"""Populations of dilute dust in jobs: sweeps, and the kernel of several with the coagulation equation."""

import csv
import json

import numpy as np
import pytest

import sand
from sand.cli.main import main
from sand.experiments.dilute_case import population_of
from sand.experiments.dilute_law import kernel_of_populations
from sand.experiments.growth_boxes import grow
from sand.experiments.sweep_job import SweepJob

pytestmark = pytest.mark.compiled("scattering", "dipoles")

CASE = {
    "method": {"kind": "encounters", "hits": "stick"},
    "run": {"stop": "mean_cluster_size >= 2"},
    "grains": {
        "kind": "gas",
        "number": 100,
        "number_density": "3e8 /m^3",
        "radius": "10 nm",
        "material": "iron",
        "moment": "200 A m^2/kg",
        "temperature": "100 K",
    },
    "forces": {"contact": {"damping": "critical", "settling_time": "5 ns"}, "dipoles": {}},
}


def test_a_sweep_of_populations(tmp_path):
    """A row for each value and seed, with the results of the population of that case; n₀t does not depend on n₀."""
    values = {"vary": {"grains.number_density": ["1e8 /m^3", "3e8 /m^3"]}, "seeds": [1]}
    job = SweepJob("case", tmp_path / "out", values, content=CASE)
    assert job.run()["done"] == 2
    with (tmp_path / "out" / "sweep.csv").open(encoding="utf-8") as file:
        rows = {float(row["grains.number_density"]): row for row in csv.DictReader(file)}
    thin, dense = rows[1e8], rows[3e8]
    grown = population_of(CASE, 1, tmp_path / "one")
    last = {name: float(column[-1]) for name, column in grown.ledger.items()}
    assert (
        float(dense["mean_cluster_size"]) == last["mean_cluster_size"] >= 2.0 and float(dense["hits"]) == last["hits"]
    )
    assert float(dense["time"]) == last["time"] and dense["outcome"] == "finished"
    assert float(thin["time"]) == pytest.approx(3.0 * last["time"], rel=1e-9, abs=0.0)
    again = SweepJob("case", tmp_path / "out", values, content=CASE)
    assert again.left() == []


def test_a_sweep_refuses_what_populations_do_not_have(tmp_path):
    """Keys that encounters lack, misspelt ones, and values out of range: one line each, before the first run."""
    for key, value, words in (
        ("stepping.step", ["1 ps"], "[stepping] is not for encounters"),
        ("grains.number_densty", [1e8], "grains.number_densty: there is no such key; [grains] has: number_density"),
        ("method.hits", ["bounce"], "method.hits = 'bounce'"),
    ):
        with pytest.raises(sand.BadInput) as error:
            SweepJob("case", tmp_path / "out", {"vary": {key: value}}, content=CASE)
        assert words in str(error.value)


def test_the_kernel_of_populations(tmp_path, capsys):
    """The coagulation equation with their K starts with S = 1, dS/dt = n₀K(1,1); `sand analyse` tells the law.

    S − 1 = n₀Kt to first order: at the second of 60 times, where S − 1 is about 0.02, to 5 %.
    """
    folders = grow(CASE, [1, 2], tmp_path / "both")
    found = kernel_of_populations(folders)
    assert found.size[0] == 1.0 and (np.diff(found.size) > 0.0).all()
    start = 3e8 * found.kernel.value[0, 0] * found.time[1]
    assert found.size[1] - 1.0 == pytest.approx(start, rel=0.05, abs=0.0)
    assert main(["analyse", str(tmp_path / "both"), "--out", str(tmp_path / "found"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["ensembles"][0]["kernel"]
    assert told["law"]["factor"]["value"] == found.law.factor.value and told["grain_mass"] == found.mass
    with (tmp_path / "found" / "kernel.csv").open(encoding="utf-8") as file:
        first = next(iter(csv.DictReader(file)))
    assert float(first["kernel"]) == found.kernel.value[0, 0] and int(first["hits"]) == found.kernel.hits[0, 0]


OF_PAIRS = {
    "radii": (
        {"grains": {"classes": [{"share": 0.5, "radius": f"{r} nm"} for r in (9, 10)]}},
        "which differ in radius",
    ),
    "own": ({"method": {"between": "own"}}, "motion of bodies"),
    "charges": ({"grains": {"charge": "1 e"}, "forces": {"charges": {}}}, "charges of bodies"),
}


@pytest.mark.parametrize("name", OF_PAIRS)
def test_a_kernel_that_is_no_function_of_sizes_has_its_reason(tmp_path, capsys, name):
    """Grains that differ, bodies that keep their motion, and equal charges: no K, law or S(t), and one line why."""
    changes, words = OF_PAIRS[name]
    case = {key: table | changes.get(key, {}) for key, table in CASE.items()} | {
        "run": {"stop": "mean_cluster_size >= 1"}
    }
    found = kernel_of_populations(grow(case, [1], tmp_path / "one"))
    assert found.kernel is None and found.law is None and len(found.time) == len(found.rows()) == 0
    assert set(found.missing) == {"kernel", "law", "coagulation"} and words in found.missing["law"]
    with pytest.raises(sand.BadInput, match=words):
        found.table()
    assert main(["analyse", str(tmp_path / "one"), "--out", str(tmp_path / "found")]) == 0
    assert f"unknown: {found.missing['law']}" in capsys.readouterr().out
    assert not (tmp_path / "found" / "kernel.csv").exists()


@pytest.mark.parametrize("size", [1.0, 1.02])
def test_the_analysis_of_a_young_population(tmp_path, capsys, size):
    """Without a hit, and with one of two grains: no law yet, with its reason; all else is there, also with --json."""
    grow(CASE | {"run": {"stop": f"mean_cluster_size >= {size}"}}, [1], tmp_path / "one")
    assert main(["analyse", str(tmp_path / "one"), "--out", str(tmp_path / "found"), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["ensembles"][0]
    assert told["kernel"]["law"] is None and "different sizes" in told["kernel"]["missing"]["law"]
    assert "30 draws" in told["kernel"]["missing"]["coagulation"] and told["mean_size"] >= size
    assert len(told["kernel"]["classes"]) == (size > 1.0)
