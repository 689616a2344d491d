"""Designs of sweeps: ranges, combinations, random designs, and keys of cases."""

import math

import numpy as np
import pytest

from sand.basics.errors import BadInput
from sand.config.key_errors import validate
from sand.experiments.sweep_cases import CASES
from sand.experiments.sweep_design import (
    Design,
    SweepSection,
    changed_content,
    key_error,
    range_of,
    read_varied,
    takes_whole_numbers,
    without_keys,
)

CASE = {
    "target": {"kind": "bpca", "grains": 6, "radius": "0.1 um"},
    "projectile": {"kind": "grain", "radius": "0.1 um"},
    "impact": {"speed": "3 m/s"},
    "forces": {"contact": {}},
}
MODEL = CASES["collide"].model(CASE)


def design(**section):
    return Design(validate(SweepSection, section, "case", table="sweep"), lambda key: key.endswith("grains"))


def numbers(values):
    return np.array([float(str(value).split()[0]) for value in values])


@pytest.mark.parametrize(
    ("text", "spaced"),
    [
        ("lin(1 um, 3 um, 5)", lambda x: x),
        ("log(10 m/s, 200 m/s, 10)", np.log),
        ("square(0 b, 1 b, 6)", np.square),
    ],
)
def test_ranges_are_evenly_spaced(text, spaced):
    """The value, its logarithm or its square has equal steps, to the ten digits that are kept; ends are exact."""
    values = range_of(text, False).values()
    first, last, number = (part.strip() for part in text.partition("(")[2].rstrip(")").split(","))
    assert [values[0], values[-1], len(values)] == [first, last, int(number)]
    steps = np.diff(spaced(numbers(values)))
    assert steps == pytest.approx(steps.mean(), rel=1e-8, abs=0.0)


def test_ends_in_different_units():
    """100 nm to 1 um: the values are in the first unit."""
    assert range_of("lin(100 nm, 1 um, 3)", False).values() == ["100 nm", "550 nm", "1000 nm"]


def test_whole_numbers_of_a_range():
    """A logarithmic range of numbers of grains is rounded; a sweep computes equal ones once."""
    assert range_of("log(1, 8, 7)", True).values() == [1, 1, 2, 3, 4, 6, 8]
    assert takes_whole_numbers(MODEL, "projectile.grains") and not takes_whole_numbers(MODEL, "impact.speed")


def test_every_combination():
    """The last key changes fastest; keys that change together are one factor of the product."""
    made = design(vary={"a": [1, 2], "b": "lin(0 m, 1 m, 2)"}, together=[{"c": [5, 6], "d": ["x", "y"]}])
    found = list(made.combinations())
    assert found[0] == {"a": 1, "b": "0 m", "c": 5, "d": "x"} and found[1] == {"a": 1, "b": "0 m", "c": 6, "d": "y"}
    assert len(found) == 8 and len({tuple(one.items()) for one in found}) == 8


def test_dotted_keys_of_toml():
    """`impact.speed = …` in [sweep.vary] is a table within a table; both forms are the same."""
    (values,) = design(vary={"impact": {"speed": [1], "along": ["x"]}}).combinations()
    assert values == {"impact.speed": 1, "impact.along": "x"}


@pytest.mark.parametrize("kind", ["latin hypercube", "sobol", "halton", "random"])
def test_random_designs(kind):
    """Values stay in their ranges, the mean of log v is that of a uniform distribution, and the seed decides.

    The standard error of the mean of 512 uniform numbers is 1/√(12 · 512) = 0.013 of the range: the bound is 5 of it.
    """
    section = {"vary": {"v": "log(1 m/s, 100 m/s)", "n": [1, 2, 3, 4]}, "design": kind, "samples": 512}
    found = list(design(**section).combinations())
    parts = np.log(numbers(one["v"] for one in found)) / math.log(100.0)
    assert len(found) == 512 and parts.min() >= 0.0 and parts.max() <= 1.0
    assert parts.mean() == pytest.approx(0.5, abs=0.064)
    assert found == list(design(**section).combinations())
    assert found != list(design(**section, design_seed=1).combinations())
    if kind == "latin hypercube":  # one point in each of 512 layers, so that each word occurs equally often
        assert sorted(int(part * 512 - 1e-6) for part in parts) == list(range(512))
        assert np.bincount([one["n"] for one in found]).tolist() == [0, 128, 128, 128, 128]


def test_options_of_the_command_line():
    """Commas and semicolons within brackets and quotes separate nothing; values are as in TOML, or text."""
    assert read_varied("a=1, 2.5,x y,true,'1'") == {"a": [1, 2.5, "x y", True, "1"]}
    assert read_varied("a=log(10 m/s, 200 m/s, 10); b.c=[1,2],[3,4]") == {
        "a": ["log(10 m/s, 200 m/s, 10)"],
        "b.c": [[1, 2], [3, 4]],
    }


def test_changed_content():
    """Tables that do not change are shared, and the original is untouched; a table that is missing is made."""
    made = changed_content(CASE, {"impact.speed": 5.0, "stepping.accuracy": 1e-6})
    assert CASE["impact"] == {"speed": "3 m/s"} and "stepping" not in CASE
    assert made["impact"] == {"speed": 5.0} and made["stepping"] == {"accuracy": 1e-6}
    assert made["target"] is CASE["target"]
    walls = {"walls": [{"at": 1}, {"at": 2}]}
    assert changed_content(walls, {"walls.1.at": 3}) == {"walls": [{"at": 1}, {"at": 3}]}
    assert without_keys(made, ["impact.speed", "stepping"]) == {
        key: CASE[key] for key in ("target", "projectile", "forces")
    }


@pytest.mark.parametrize(
    ("key", "message"),
    [
        ("projectile.grain", "there is no such key; [projectile] has: kind, file, "),
        ("impact.q", "there is no such key; [impact] has: speed, impact_parameter, along, turn, seeds, end, "),
        ("angle.of", "there is no such key; there are the tables: target, projectile, impact, materials, forces, "),
        ("impact", "is a table; give one of its keys: speed, "),
        ("forces.dipoles.cutoff", "the case has no table [forces.dipoles]; add it to the case file"),
        ("materials.ice.density", "the case has no table [materials.ice]; add it to the case file"),
        ("impact.speed.x", "impact.speed is no table"),
    ],
)
def test_keys_that_do_not_exist(key, message):
    assert message in key_error(MODEL, CASE, key)
    assert key_error(MODEL, CASE, "stepping.accuracy") is None  # of a table that has defaults


@pytest.mark.parametrize(
    ("section", "message"),
    [
        ({}, "nothing changes: give keys with values, --vary KEY=VALUES or [sweep.vary], or seeds"),
        ({"vary": {"a": []}}, "a: there is no value; give a list such as [500, 4000]"),
        ({"vary": {"a": "log(10 m/s, 200 m/s)"}}, "a: how many values? give log(FIRST, LAST, NUMBER), or a random"),
        ({"vary": {"a": "lin(3, 1, 4)"}}, "a: 'lin(3, 1, 4)': the first value must be below the last one"),
        ({"vary": {"a": "log(0, 1, 4)"}}, "a: 'log(0, 1, 4)': the first value must be below the last one, above 0"),
        ({"vary": {"a": "lin(1 m, 2 s, 4)"}}, "'lin(1 m, 2 s, 4)': both ends need the same unit, such as log(10 m/s"),
        ({"vary": {"a": "lin(1 m, 2, 4)"}}, "'lin(1 m, 2, 4)': both ends need the same unit"),
        ({"vary": {"a": "lin(1, 2, 1)"}}, "the number of values must be a whole number of at least 2"),
        ({"vary": {"a": "lin(1, x, 4)"}}, "'lin(1, x, 4)' must be lin(FIRST, LAST, NUMBER), such as log("),
        ({"together": [{"a": [1, 2], "b": [1]}]}, "keys that change together need equally many values; there are a 2"),
        ({"vary": {"a": [1]}, "together": [{"a": [1], "b": [2]}]}, "a: its values are given twice"),
        ({"vary": {"a": list(range(1001)), "b": list(range(1001))}}, "1e+06 runs are more than 1e+06; give fewer"),
        ({"vary": {"a": [1, 2, 3]}, "seeds": 500_000}, "1.5e+06 runs are more than 1e+06; give fewer values, or"),
        ({"vary": {"a": [1]}, "design": "sobol"}, "samples is missing: design = 'sobol' needs a number"),
        ({"vary": {"a": [1]}, "samples": 8}, "samples = 8 is not used by design = 'every combination'; leave it out"),
        ({"vary": 3}, "vary = 3 must be a table of keys with their values"),
        ({"vary": {"a": [1]}, "seeds": 0}, "seeds = 0 must be a number of seeds, such as 3 (1, 2 and 3), or a list"),
    ],
)  # fmt: skip
def test_wrong_designs(section, message):
    with pytest.raises(BadInput) as refused:
        design(**section)
    assert message in str(refused.value)
