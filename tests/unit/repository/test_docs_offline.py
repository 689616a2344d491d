"""The built docs need no network: resources of other machines are found."""

import importlib.util
import tomllib
from pathlib import Path

import pytest

TOP = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def offline():
    spec = importlib.util.spec_from_file_location("offline", TOP / "docs" / "_ext" / "offline.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize(
    "text",
    [
        '<script defer src="https://cdn.jsdelivr.net/npm/mathjax@4/tex-mml-chtml.js"></script>',
        '<script src="//cdnjs.cloudflare.com/require.js"></script>',
        '<link rel="stylesheet" href="https://fonts.googleapis.com/css">',
        '<link href="HTTP://a.b/c" rel="preload alternate">',
        "<style>@import 'https://a.b/c.css';</style>",
        "<style>p {} @font-face { src: url(https://a.b/c.woff) }</style>",
        '<p style="background: url(//a.b/c.png)">',
        '<img alt="" src="https://a.b/c.png">',
        '<video poster="https://a.b/c.png"></video>',
    ],
)
def test_addresses_that_a_browser_would_load(offline, text):
    """Scripts, styles, fonts and pictures."""
    assert len(offline.loaded_from_elsewhere(f"<html><body>{text}</body></html>")) == 1


@pytest.mark.parametrize(
    "text",
    [
        '<script src="_static/mathjax/tex-chtml.js"></script>',
        '<a href="https://arxiv.org/abs/astro-ph/0201500">the paper</a>',
        '<link rel="canonical" href="https://a.b/">',
        '<link rel="stylesheet" href="_static/styles/furo.css?v=1">',
        '<pre>&lt;script src="https://a.b/c.js"&gt;</pre>',
        '<img src="data:image/png;base64,aGVsbG8=">',
        "<p>see https://a.b and url(https://a.b)</p>",
    ],
)
def test_addresses_that_a_browser_does_not_load(offline, text):
    """Local files, text, and links that a reader follows."""
    assert offline.loaded_from_elsewhere(f"<html><body>{text}</body></html>") == []


def test_style_sheets(offline):
    assert offline.styles_from_elsewhere('@import url("https://a.b/c.css"); a { b: url(x.png) }') == [
        "https://a.b/c.css"
    ]


def test_the_docs_build_runs_the_check():
    """conf.py has the check and MathJax from a package, which the extra `docs` installs."""
    text = (TOP / "docs" / "conf.py").read_text("utf-8")
    assert '"offline"' in text and '"sphinx-mathjax-offline"' in text and "mathjax_path" not in text
    project = tomllib.loads((TOP / "pyproject.toml").read_text("utf-8"))["project"]
    assert any(line.startswith("sphinx-mathjax-offline") for line in project["optional-dependencies"]["docs"])
