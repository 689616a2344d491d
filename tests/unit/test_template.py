"""`sand new`: a case file with every key, made from the classes that read the keys."""

import tomllib

import pytest

import sand
from sand.cli.main import main
from sand.config.build import simulation_of
from sand.config.case import BoxSection, GrainsSection, MaterialSection, RunSection, WallSection, check_case, read_case
from sand.config.template import EXAMPLES, REQUIRED, keys_of, template
from sand.forces.registry import FORCES
from sand.integrate.registry import INTEGRATORS
from sand.neighbours.settings import Neighbours
from sand.setup import GrainClass
from sand.simulation.driven import Driven

MODELS = [RunSection, BoxSection, GrainsSection, GrainClass, MaterialSection, Neighbours]


def tables_of(text):
    """Lines of each table, by its name, comments before a table left out."""
    tables, lines = [], []
    for line in text.splitlines():
        if line.lstrip("#").startswith("["):
            lines = []
            tables.append((line.lstrip("#"), lines))
        elif line and not line.startswith("# "):
            lines.append(line)
    return tables


def test_the_file_is_a_valid_case(tmp_path, monkeypatch, capsys):
    """It is read by `sand run`, describes the gas of `EXAMPLES`, and is not overwritten."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "first"]) == 0
    assert "sand run first.toml" in capsys.readouterr().out
    text = (tmp_path / "first.toml").read_text("utf-8")
    assert tomllib.loads(text)["grains"] == EXAMPLES["grains"]
    simulation = simulation_of(read_case("first.toml"), None)
    assert len(simulation.grains) == 100 and simulation.temperature == pytest.approx(300.0, rel=1e-12, abs=0.0)
    for name in ("first", "first.toml"):
        assert main(["new", name]) == 2
        assert "first.toml exists" in capsys.readouterr().err
    assert (tmp_path / "first.toml").read_text("utf-8") == text
    assert main(["new", "nowhere/first"]) == 2
    assert "there is no folder nowhere" in capsys.readouterr().err


def test_every_key_is_there_with_its_meaning():
    """All keys of all sections, forces and integrators; each has a description above it."""
    text = template("a.toml")
    tables = tables_of(text)
    expected = [{key.name for key in keys_of(kind)} for kind in (*MODELS[:5], WallSection, *FORCES.values())]
    expected[2] -= {"classes"}
    expected += [{"method"} | {key.name for key in keys_of(kind)} for kind in INTEGRATORS.values()]
    expected += [{key.name for key in keys_of(kind)} for kind in (Neighbours, Driven)]
    assert [{line.lstrip("#").split(" =")[0] for line in lines} for _, lines in tables] == expected
    assert [f"[forces.{name}]" for name in FORCES] == [name for name, _ in tables if name.startswith("[forces.")]
    before = ""
    for line in text.splitlines():
        if " =" in line and not line.startswith("# "):
            assert before.startswith("# "), line
        before = line
    for kind in (*MODELS[:4], *FORCES.values(), *INTEGRATORS.values()):
        assert all(key.meaning for key in keys_of(kind)), kind
    assert max(map(len, text.splitlines())) <= 120


def test_the_defaults_shown_are_the_defaults():
    """A table with all the keys that have a default, the # removed, is accepted and equals the table without them."""
    base = {name: table for name, table in tomllib.loads(template("a.toml")).items() if name != "forces"}
    plain = check_case(base, "a.toml")
    for name, lines in tables_of(template("a.toml")):
        values = tomllib.loads("\n".join(line.lstrip("#") for line in lines if not line.endswith("=")))
        table = name.strip("[]").split(".")
        if name == "[grains]":
            values.pop("frame")  # of kind "file"
            case = check_case({**base, "grains": {**values, **base["grains"]}}, "a.toml")
            assert case.grains.recipe() == plain.grains.recipe()
        elif table[0] == "forces" and not any(key.default is REQUIRED for key in keys_of(FORCES[table[1]])):
            given, kind = (
                values if table[1] != "contact" else {**values, **EXAMPLES["forces.contact"]},
                FORCES[table[1]],
            )
            if table[1] != "gas":
                assert check_case({**base, "forces": {table[1]: given}}, "a.toml").forces.build()[0].name == kind.name
        elif name in ("[stepping]", "[neighbours]"):
            case = check_case({**base, table[0]: values}, "a.toml")
            kind = INTEGRATORS[values["method"]] if name == "[stepping]" else Neighbours
            assert getattr(case, table[0]) == kind()


def test_parts_of_a_class_are_documented():
    """Keys that share a line of the docstring have the same text."""
    meaning = {key.name: key.meaning for key in keys_of(GrainClass)}
    assert meaning["dimension"] == meaning["prefactor"] != ""
    assert {key.name: key.default for key in keys_of(sand.Gas)}["temperature"] is REQUIRED
