"""The reference pages are complete: every public name, command, case-file key and ledger column is on them.

The pages are read as text and the directives of autodoc in them are followed in Python, so no build is needed.
"""

import dataclasses
import functools
import importlib
import inspect
import pkgutil
import re
import typing
from pathlib import Path

import click
import pytest

import sand
from sand.analysis.ledger_columns import LOSS_TEXTS
from sand.config.case import Case, MaterialSection
from sand.config.sections import INTEGRATORS
from sand.config.template import keys_of
from sand.experiments.collision_case import CollisionCase
from sand.experiments.growth_case import GrowSection
from sand.experiments.scattering import flight
from sand.experiments.scattering.scatter_case import FlightSection, ScatterCase
from sand.experiments.sweep_design import SweepSection

PAGES = Path(__file__).parents[3] / "docs" / "reference"
PACKAGES = ("setup", "theory", "analysis", "experiments", "io")


@functools.cache
def text() -> str:
    """All pages."""
    return "\n".join(page.read_text("utf-8") for page in sorted(PAGES.iterdir()) if page.suffix in (".md", ".rst"))


def test_words_on_losses_are_those_of_the_ledger():
    """Each row `lost_…` begins with the words that the page shows for it, without its links."""
    rows = re.findall(r"^\| (`lost_.*?) \| J \| (.*?) \|$", (PAGES / "ledger.md").read_text("utf-8"), re.MULTILINE)
    meaning = {
        name: re.sub(r"\[(.*?)\]\(.*?\)", r"\1", text) for names, text in rows for name in re.findall("`(.*?)`", names)
    }
    assert meaning.keys() == {f"lost_{name}" for name in LOSS_TEXTS}
    for name, words in LOSS_TEXTS.items():
        assert meaning[f"lost_{name}"].startswith(words), name


def public(module):
    """The names that autodoc shows of a module: `__all__`, or what is defined and documented in it."""
    if hasattr(module, "__all__"):
        return set(module.__all__)
    return {
        name
        for name, thing in vars(module).items()
        if not name.startswith("_") and getattr(thing, "__module__", "") == module.__name__ and callable(thing)
    }


@functools.cache
def documented() -> set[str]:
    """Full names of all objects on the pages."""
    names = set(re.findall(r"^\.\. auto(?:class|function|exception|data):: (\S+)", text(), re.M))
    for name, options in re.findall(r"^\.\. automodule:: (\S+)\n((?:   :.*\n)*)", text(), re.M):
        names.add(name)
        if ":no-members:" not in options:
            names |= {f"{name}.{member}" for member in public(importlib.import_module(name))}
    return names


def named(path: str):
    """The object of a dotted name."""
    module, _, name = path.rpartition(".")
    return getattr(importlib.import_module(module), name) if module else importlib.import_module(name)


def test_public_names():
    """Every name of `sand.__all__` has a directive; preset materials are named on the page of materials."""
    missing = []
    for name in sand.__all__:
        if name == "__version__" or name in PACKAGES:
            continue
        full = f"sand.{name}" if not name.isupper() else f"sand.basics.material.{name}"
        if full not in documented() or f"sand.{name}" not in text():
            missing.append(name)
    assert not missing


@pytest.mark.parametrize("package", PACKAGES)
def test_public_names_of_packages(package):
    """Every public name of a package and every one of its public modules."""
    module = importlib.import_module(f"sand.{package}")
    if hasattr(module, "__all__"):
        names = {name for name in module.__all__ if f"sand.{package}.{name}" not in documented()}
    else:
        modules = getattr(module, "MODULES", None) or [info.name for info in pkgutil.iter_modules(module.__path__)]
        names = {name for name in modules if f"sand.{package}.{name}" not in documented()}
    assert not names


def test_lazily_loaded_names():
    """The names of sand.experiments.scattering, which its module attribute hook loads."""
    from sand.experiments import scattering

    assert not {name for name in scattering._MODULES if f"sand.experiments.scattering.{name}" not in documented()}


def test_names_exist():
    """No directive names an object that does not exist, or that has no docstring."""
    without = [name for name in documented() if not inspect.getdoc(named(name))]
    assert not without


def test_commands():
    """The page shows the whole group, so every command is on it; all options and commands have a description."""
    from sand.cli.program import COMMANDS
    from sand.cli.program import sand as group

    assert re.search(r"^\.\. click:: sand\.cli\.program:sand\n(   :.*\n)*   :nested: full", text(), re.M)
    assert {module.command.name for module in COMMANDS} == set(group.commands)
    for name, command in group.commands.items():
        assert command.help, name
        assert all(option.help for option in command.params if isinstance(option, click.Option)), name


def sections():
    """Heading and class of every section of every case file."""
    yield "[grow]", GrowSection
    yield "[sweep]", SweepSection
    for case in (Case, CollisionCase, ScatterCase):
        for name, field in case.model_fields.items():
            kind = field.annotation
            kinds = [t for t in typing.get_args(kind) if isinstance(t, type) and t is not type(None) and t is not str]
            kind = kinds[0] if kinds else kind
            if name == "forces":
                for key, inner in kind.model_fields.items():
                    yield f"[forces.{key}]", next(t for t in typing.get_args(inner.annotation) if t is not type(None))
            elif name == "stepping":
                yield from ((f'method = "{word}"', integrator) for word, integrator in INTEGRATORS.items())
            elif name == "materials":
                yield "[materials.NAME]", kind
            else:
                yield f"[{name}]", kind


@pytest.mark.parametrize(("heading", "kind"), sorted({(h, k) for h, k in sections()}, key=lambda s: (s[0], str(s[1]))))
def test_keys_of_case_files(heading, kind):
    """Each section has a heading, and each of its keys a description: below the field, or in the class's docstring."""
    page = (PAGES / "case.rst").read_text("utf-8")
    assert re.search(rf"^.*{re.escape(heading)}.*\n[-~]+\n", page, re.M)
    if kind is FlightSection:
        assert set(kind.model_fields) <= set(inspect.signature(flight).parameters)
        assert not [key for key in kind.model_fields if f"``{key}``" not in page]
    elif kind is MaterialSection:
        assert set(kind.model_fields) == {"like", *(f.name for f in dataclasses.fields(sand.Material))} - {"name"}
    elif hasattr(kind, "model_fields"):
        assert f".. records:: {kind.__module__}.{kind.__name__}\n" in page
        assert all(key.meaning for key in keys_of(kind))
    else:
        assert f".. autoclass:: sand.{kind.__name__}\n" in page
        doc = inspect.getdoc(kind) or ""
        keys = [field.name for field in dataclasses.fields(kind)]
        assert not [key for key in keys if not re.search(rf"^ *(\w+, )*{key}(, \w+)* *(:.*)?$", doc, re.M)]


def test_columns_of_the_ledger():
    """The table has the ledger's columns, in its order."""
    from sand.simulation.ledger import Ledger

    page = (PAGES / "ledger.md").read_text("utf-8")
    rows = [row for row in re.findall(r"^\| (.*?) \|", page, re.M) if row != "column"]
    columns = [name for row in rows for name in (re.findall(r"`(\w+)`", row) or ["force"])]
    assert columns == list(Ledger(["force"], awake=True, stress=True).columns)


def test_tables_that_follow_the_source():
    """Quantities of a grain, preset materials and outcomes are tables and members made from the source itself."""
    assert "{records} sand.basics.schema.FIELDS" in text() and "{records} sand.basics.material.COMMON" in text()
    assert "{records} sand.theory.paper_table" in text()
    assert re.search(r"autoclass:: sand\.Outcome\n   :undoc-members:", text())
