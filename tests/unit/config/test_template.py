"""`sand new`: a case file with every key, made from the classes that read the keys."""

import json
import tomllib
import warnings

import numpy as np
import pytest

import sand
from sand.cli.main import main
from sand.cli.new import READERS
from sand.components.deformation import Deformation
from sand.components.driven import Driven
from sand.config.build import simulation_of
from sand.config.case import (
    BoxSection,
    Case,
    GrainsSection,
    MaterialSection,
    RunSection,
    WallSection,
    check_case,
    read_case,
)
from sand.config.key_errors import keys_at
from sand.config.template import EXAMPLES, REQUIRED, keys_of, template
from sand.experiments.collision_case import CollisionCase
from sand.experiments.dilute_case import NOT_FOR, NOT_OF_GRAINS, NOT_OF_RUN
from sand.experiments.growth_case import GrowSection
from sand.experiments.laboratory_case import CASES as LOADINGS
from sand.experiments.scattering.scatter_case import ScatterCase
from sand.experiments.sweep_design import SweepSection
from sand.experiments.sweep_population import SweptPopulation
from sand.experiments.templates import DILUTE_FORCES, TEMPLATES
from sand.forces.registry import FORCES
from sand.integrate.registry import INTEGRATORS
from sand.neighbours.search import Neighbours
from sand.setup import GrainClass

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
    expected = [{key.name for key in keys_of(kind)} for kind in (*MODELS[:5], *FORCES.values())]
    expected[2] -= {"classes"}
    expected += [{"method"} | {key.name for kind in INTEGRATORS.values() for key in keys_of(kind)}]
    expected += [{key.name for key in keys_of(kind)} for kind in (Neighbours, WallSection, Driven, Deformation)]
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


def test_the_magnetic_gas_is_one_whose_moments_are_permanent(tmp_path, monkeypatch):
    """Two sizes, both above the blocking radius at the temperature of the case and below that of a single domain.

    The radii are those of `magnetic_limits`: E_B(r) = k_B T ln(t f) for the first, the estimate from wall and
    stray-field energies for the second; `sand.Simulation` warns outside of them.
    """
    monkeypatch.chdir(tmp_path)
    assert main(["new", "iron", "--for", "magnetic"]) == 0
    case = read_case("iron.toml")
    assert [one.share for one in case.grains.classes] == [0.8, 0.2]
    limits = sand.theory.magnetic_limits(sand.IRON, 1e-8, case.grains.temperature)
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        simulation = simulation_of(case, None)
    radii, number = np.unique(simulation.grains.radius, return_counts=True)
    assert number.tolist() == [80, 20]
    assert limits.blocking_radius < radii.min() and radii.max() < limits.single_domain_radius
    assert not [one for one in told if "moments" in str(one.message)]
    assert simulation.grains.body_moment.any(axis=1).all()


def test_a_class_without_a_source_has_the_meanings_of_its_base():
    """Python 3.13 finds no source of a class that `create_model` makes, older ones none of a class of another name."""
    made = type("Made", (MaterialSection,), {"__module__": MaterialSection.__module__})
    assert keys_of(made) == keys_of(MaterialSection)


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
            for method, kind in INTEGRATORS.items() if name == "[stepping]" else [("", Neighbours)]:
                own = {key.name: values[key.name] for key in keys_of(kind) if key.name in values}
                case = check_case({**base, table[0]: own | ({"method": method} if method else {})}, "a.toml")
                assert getattr(case, table[0]) == kind()


def test_parts_of_a_class_are_documented():
    """Keys that share a line of the docstring have the same text."""
    meaning = {key.name: key.meaning for key in keys_of(GrainClass)}
    assert meaning["dimension"] == meaning["prefactor"] != ""
    assert {key.name: key.default for key in keys_of(sand.Gas)}["temperature"] is REQUIRED


MODEL = {"run": Case, "collide": CollisionCase, "scatter": ScatterCase, "grow": Case, "sweep": CollisionCase} | LOADINGS
MODEL |= {"encounters": SweptPopulation.model({}), "magnetic": Case}
READER = {command: command for command in TEMPLATES} | READERS


@pytest.mark.parametrize("command", list(TEMPLATES))
def test_each_command_has_a_case_with_all_its_keys(command):
    """Keys of each table are those that the reader of the command accepts, by its model; each has a meaning."""
    text, model = TEMPLATES[command]("a.toml"), MODEL[command]
    ignored = {"run": {"stop", "seed", "out"}} if command == "grow" else {}  # of sand run alone
    if command == "encounters":
        ignored = {"run": {"seed", *NOT_OF_RUN}, "grains": {*NOT_OF_GRAINS}}
    found = {}
    for head, lines in tables_of(text):
        found.setdefault(head.strip("[]"), set()).update(line.lstrip("#").split(" =")[0] for line in lines)
    if READER[command] == "grow":
        assert found.pop("grow") == set(GrowSection.model_fields)
    if command == "sweep":
        assert found.pop("sweep") == set(SweepSection.model_fields)
    tables = set(keys_at(model, ())) - {"materials", "forces", "stepping"}
    expected = {name: set(keys_at(model, (name,))) - ignored.get(name, set()) for name in tables}
    if "grains" in expected:
        expected["grains"] -= {"classes"}
        expected["grains.classes"] = set(keys_at(model, ("grains", "classes")))
        expected["walls"], expected["driven"] = set(WallSection.model_fields), {key.name for key in keys_of(Driven)}
    expected["materials.NAME"] = set(MaterialSection.model_fields)
    if "forces" in model.model_fields:
        expected |= {f"forces.{name}": set(keys_at(model, ("forces", name))) for name in FORCES}
        expected["stepping"] = {"method"}.union(*({key.name for key in keys_of(kind)} for kind in INTEGRATORS.values()))
    if command == "encounters":
        kept = {f"forces.{name}": own and set(own) for name, own in DILUTE_FORCES.items()}
        expected = {k: kept.get(k) or v for k, v in expected.items() if k not in NOT_FOR and k != "stepping"}
        expected = {k: v for k, v in expected.items() if not k.startswith("forces.") or k in kept}
    assert found == expected
    before, heads, is_further = "", set(), False
    for line in text.splitlines():
        if line.lstrip("#").startswith("["):  # a further table of a list in use has only its keys in use
            is_further, heads = line in heads, {*heads, line}
        elif " =" in line and not line.startswith("# ") and not before.startswith("#[") and not is_further:
            assert before.startswith("# "), line
        before = line
    assert max(map(len, text.splitlines())) <= 120
    assert f"sand {READER[command]} a.toml" in text.splitlines()[0]


@pytest.mark.parametrize("command", list(TEMPLATES))
def test_each_table_is_there_once(command):
    """But for those of lists in use: a # that is removed never gives a second table of the same name."""
    heads = [name for name, _ in tables_of(TEMPLATES[command]("a.toml")) if not name.startswith("[[")]
    assert len(heads) == len(set(heads))


@pytest.mark.parametrize("command", list(TEMPLATES))
def test_each_key_is_read(command, tmp_path, capsys):
    """A key with its default, or with a value of a wrong type, is never "no such key", and a misspelt one is."""
    text, path = TEMPLATES[command]("a.toml"), tmp_path / "a.toml"
    lines = text.splitlines()
    heads = [k for k, line in enumerate(lines) if line.lstrip("#").startswith("[")]
    for first, end in zip(heads, [*heads[1:], len(lines)], strict=True):
        name = lines[first].lstrip("#")
        used_tables = "\n".join(line for line in lines if line and not line.startswith("#"))
        others = used_tables.splitlines()
        body = [line.lstrip("#") for line in lines[first + 1 : end] if line and not line.startswith("# ")]
        if name == "[stepping]":  # the keys of one of the methods
            method = tomllib.loads(text).get("stepping", {}).get("method", "verlet")
            own = {"method", *(key.name for key in keys_of(INTEGRATORS[method]))}
            body = [line for line in body if line.split(" =")[0] in own]
        whole = [line if not line.endswith("=") else f"{line} {{}}" for line in body]
        k = others.index(name) if name in others else None
        used = {line.split(" =")[0] for line in (others[k + 1 :] if k is not None else [])}
        added = [line for line in whole if k is None or line.split(" =")[0] not in used]
        case = [*others, name, *added] if k is None else [*others[: k + 1], *added, *others[k + 1 :]]
        for wrong in (False, True):
            more = ["not_a_key = 1"] if wrong else []
            place = case.index(name) + 1
            path.write_text("\n".join([*case[:place], *more, *case[place:]]), "utf-8")
            main(["info", str(path)])
            unknown = [line for line in capsys.readouterr().err.splitlines() if "there is no such key" in line]
            assert len(unknown) == len(more), (name, unknown)


@pytest.mark.compiled("small")  # that of sand collide builds aggregates
@pytest.mark.parametrize("command", list(TEMPLATES))
def test_info_describes_each_case(command, tmp_path, monkeypatch, capsys):
    """`sand new NAME --for COMMAND` writes a case that `sand info` accepts for that command."""
    monkeypatch.chdir(tmp_path)
    assert main(["new", "my case", "--for", command, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {"file": "my case.toml", "command": READER[command]}
    assert main(["info", "my case.toml"]) == 0
    out = capsys.readouterr().out
    assert "a valid" in out
    assert (f"sand {READER[command]} 'my case.toml'" in out) is (READER[command] != "run")
    assert tomllib.loads((tmp_path / "my case.toml").read_text("utf-8")) == tomllib.loads(TEMPLATES[command]("x"))


@pytest.mark.compiled("scattering", "contacts")
@pytest.mark.parametrize("command", ["collide", "scatter", "grow"])
def test_each_case_runs(command, tmp_path, monkeypatch, capsys):
    """As it is written, but for a lower accuracy and an earlier end, which shorten this test."""
    monkeypatch.chdir(tmp_path)
    text = TEMPLATES[command]("a.toml").replace("relative_error = 0.05", "relative_error = 0.3")
    text = text.replace('until = "20 us"', 'until = "20 ns"').replace("grains = 16", "grains = 3")
    (tmp_path / "a.toml").write_text(text.replace("seeds = [1, 2, 3, 4]", "seeds = [1]"), "utf-8")
    assert main([command, "a.toml", "--quiet"]) == 0, capsys.readouterr().err
    assert capsys.readouterr().out == ""
