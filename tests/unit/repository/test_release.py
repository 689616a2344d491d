"""What a release states: version, authors, licence, dependencies and references are the same everywhere."""

import json
import re
import tomllib
from pathlib import Path

from sand.cli import references

TOP = Path(__file__).parents[3]
PROJECT = tomllib.loads((TOP / "pyproject.toml").read_text("utf-8"))["project"]
_RECIPE = (TOP / "recipe" / "meta.yaml").read_text("utf-8")
_VARIABLES = dict(re.findall(r'^{% set (\w+) = "(.+)" %}$', _RECIPE, re.M))
RECIPE = re.sub(r"{{ (\w+) }}", lambda name: _VARIABLES.get(name[1], name[0]), _RECIPE)
"""The recipe with the values of its variables."""
ZENODO = json.loads((TOP / ".zenodo.json").read_text("utf-8"))
PAPER = (TOP / "paper" / "paper.md").read_text("utf-8")
BIBLIOGRAPHY = (TOP / "paper" / "paper.bib").read_text("utf-8")


def test_versions_and_licences():
    """Those of pyproject.toml."""
    assert re.search(r'set version = "(.+)"', RECIPE)[1] == PROJECT["version"] == ZENODO["version"]
    assert re.search(r"^  license: (.+)$", RECIPE, re.M)[1] == PROJECT["license"] == ZENODO["license"]
    assert f"## {PROJECT['version']}" in (TOP / "CHANGELOG.md").read_text("utf-8")


def test_authors():
    """Those of CITATION.cff, no others; the paper has no affiliation of anybody."""
    names = [author["name"] for author in PROJECT["authors"]]
    assert names == [references.AUTHORS] == [creator["name"] for creator in ZENODO["creators"]]
    listed = PAPER[PAPER.index("authors:") : PAPER.index("affiliations:")]
    assert re.findall(r"- name: (.+)", listed) == names
    assert ZENODO["title"] == references.TITLE and ZENODO["keywords"] == PROJECT["keywords"]


def test_dependencies_of_the_recipe():
    """Those of the wheel, under the names of conda-forge."""
    wanted = {line.replace("matplotlib", "matplotlib-base") for line in PROJECT["dependencies"]}
    run = RECIPE[RECIPE.index("  run:") : RECIPE.index("test:")]
    listed = {"".join(line.split()) for line in re.findall(r"^    - (.+)$", run, re.M)}
    assert listed == wanted | {f"python{PROJECT['requires-python']}"}
    assert re.findall(r"^    - (\w+) = (.+)$", RECIPE, re.M) == list(PROJECT["scripts"].items())


def test_references_of_the_paper():
    """Each citation has its entry and each entry its citation; those of `sand methods` are as there."""
    front, text = PAPER.split("---\n", 2)[1:]
    assert "bibliography: paper.bib" in front
    entries = re.findall(r"^@\w+\{(\w+),", BIBLIOGRAPHY, re.M)
    assert sorted(entries) == sorted(set(re.findall(r"@(\w+)", text)))
    assert all(article.bibtex() in BIBLIOGRAPHY for article in references.ARTICLES)
    dois = {article.doi for article in references.ARTICLES if article.doi}
    eprints = {f"arXiv:{article.eprint}" for article in references.ARTICLES if article.eprint}
    assert {one["identifier"] for one in ZENODO["related_identifiers"]} == dois | eprints


def test_the_length_of_the_paper():
    """JOSS asks for 250 to 1000 words (from memory)."""
    assert 250 < len(PAPER.split("---\n", 2)[2].split()) < 1000
