"""Every copy of the page carries the licences of what is bundled in it."""

import re

import pytest

from sand.basics.errors import BadInput
from sand.io.page_bundle import PAGE, read_bundle
from sand.viewer.dataset import run_dataset
from sand.viewer.html import write_page

from ..synthetic_trajectories import write_trajectory

HOLDERS = {
    "three": "three.js authors",
    "fflate": "Arjun Barrett",
    "uplot": "Leon Sorokin",
    "SAND, grainview": "The SAND developers",
}


@pytest.fixture(scope="module")
def bundle():
    """Script and sheet of styles as they were built."""
    try:
        return read_bundle()
    except BadInput as why:
        pytest.skip(str(why))


def licences_in(text):
    """The comment that a script or sheet begins with."""
    found = re.match(r"/\*!\n(.*?)\*/\n", text, re.DOTALL)
    assert found, f"no licences at the beginning of {text[:60]!r}; build the page again"
    return found[1]


def test_script_and_styles_begin_with_the_licences(bundle):
    """Name, version, copyright and full text of each package; the style sheet has those of uPlot alone."""
    script, sheet = (licences_in(part) for part in bundle)
    for name, holder in HOLDERS.items():
        assert re.search(rf"^{name} [0-9(]", script, re.MULTILINE), name
        assert re.search(rf"^Copyright .*{re.escape(holder)}$", script, re.MULTILINE), holder
    assert script.count("Permission is hereby granted") == script.count("OTHER DEALINGS IN") == 3
    assert "Redistribution and use in source and binary forms" in script
    assert "Leon Sorokin" in sheet and "OTHER DEALINGS IN" in sheet
    assert (PAGE / "licences.txt").read_text("utf-8") == script


def test_html_files_contain_the_licences(bundle, tmp_path, monkeypatch):
    """`sand view --html` embeds script and style sheet with their first comments."""
    write_trajectory(tmp_path / "a.gsd", [[(0, 1)], []], 3)
    monkeypatch.setattr("sand.viewer.html.read_bundle", lambda: bundle)
    write_page(run_dataset(tmp_path / "a.gsd"), tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text("utf-8")
    for part in bundle:
        assert licences_in(part) in text
