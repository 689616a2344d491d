"""`view()` of a simulation and of an opened run, and opening of browsers."""

import os
import stat

import numpy as np
import pytest

import sand
from sand.viewer import browser, show

from ..pages import blocks

pytestmark = pytest.mark.usefixtures("bundle")


@pytest.fixture
def opened_addresses(monkeypatch):
    """Addresses opened in a browser."""
    seen = []
    monkeypatch.setattr(show, "open_page", lambda url: seen.append(url) or True)
    return seen


@pytest.mark.compiled("fields")
def test_view_of_a_run(finished_run, opened_addresses, tmp_path):
    """`view` writes view.html in the run's folder or a given path, opens it, and returns its path."""
    folder, sim = finished_run
    path = sim.view()
    assert path == folder / "view.html" and opened_addresses == [path.resolve().as_uri()]
    manifest, _, packets = blocks(path)
    assert len(packets) == 6 and "rotating" in manifest["field"]["text"]
    assert sim.view(tmp_path / "b.html") == tmp_path / "b.html"
    assert sand.open(folder).view(str(tmp_path / "c.html")) == tmp_path / "c.html"
    assert (tmp_path / "b.html").read_bytes() == (tmp_path / "c.html").read_bytes() == path.read_bytes()
    path.unlink()
    with pytest.raises(sand.BadInput, match="no folder"):
        sim.view(tmp_path / "none" / "b.html")


@pytest.mark.compiled("contacts")
def test_view_without_files(opened_addresses):
    """One frame of the present state, and the rows of the ledger; also before the first step."""
    grains = sand.Grains([[0.0, 0.0, 0.0], [2.5e-8, 0.0, 0.0]], "10 nm", sand.SILICA, velocity=np.eye(2, 3))
    sim = sand.Simulation(grains, forces=[sand.Contact()])
    manifest, series, packets = blocks(sim.view())
    assert manifest["steps"] == [0] and len(series["time"]) == len(packets) == 1
    sim.run(steps=5)
    manifest, series, packets = blocks(sim.view())
    assert manifest["steps"] == [5] and len(series["time"]) == 2 and not manifest["running"]
    assert packets[0][1]["position"] * manifest["unit"] == pytest.approx(sim.grains.position, abs=1e-14)
    assert "has no run folder" in manifest["note"]


@pytest.mark.compiled("fields")
def test_large_runs_are_thinned(finished_run, opened_addresses, tmp_path, monkeypatch):
    """If all frames exceed the size limit, the page has fewer and says so."""
    monkeypatch.setattr(show, "MAX_BYTES", 5000.0)
    manifest, _, packets = blocks(sand.open(finished_run[0]).view(tmp_path / "a.html"))
    assert 1 <= len(packets) < 6 and "limit the size" in manifest["note"]


@pytest.mark.compiled("contacts")
def test_without_the_page_the_figure_is_returned(bundle, opened_addresses):
    """With one warning that gives the reason; nothing is written or opened."""
    from matplotlib.figure import Figure

    (bundle / "grainview.css").unlink()
    grains = sand.Grains([[0.0, 0.0, 0.0], [2.5e-8, 0.0, 0.0]], "10 nm", sand.SILICA)
    sim = sand.Simulation(grains, forces=[sand.Contact()])
    with pytest.warns(UserWarning, match="not part of this installation"):
        assert isinstance(sim.view(), Figure)
    assert not opened_addresses


def test_when_a_browser_is_opened(monkeypatch):
    """Not with SAND_NO_BROWSER or without a screen; otherwise the user's browser, whose errors are ignored."""
    import webbrowser

    calls = []
    monkeypatch.setattr(webbrowser, "open", lambda url: calls.append(url) or True)
    monkeypatch.setattr("sys.platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    assert not browser.open_page("a") and not calls
    monkeypatch.setenv("DISPLAY", ":0")
    assert not browser.open_page("a") and not calls
    monkeypatch.delenv(browser.NO_BROWSER)
    assert browser.open_page("a") and calls == ["a"]
    monkeypatch.setattr(webbrowser, "open", lambda url: 1 / 0)
    assert not browser.open_page("a")
    monkeypatch.delenv("DISPLAY")
    assert not browser.has_display()


def test_the_token_is_not_passed_on_the_command_line(tmp_path, monkeypatch):
    """The browser opens a page, readable by this user only, that redirects to the server; it is removed."""
    import tempfile
    import webbrowser

    calls = []
    monkeypatch.setattr(webbrowser, "open", lambda url: calls.append(url) or True)
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(browser, "has_display", lambda: True)
    address = "http://127.0.0.1:5000/a-token/"
    assert browser.open_page(address)
    (page,) = tmp_path.glob("*.html")
    assert calls == [page.as_uri()] and "a-token" not in calls[0]
    text = page.read_text()
    assert f'content="0; url={address}"' in text and f'href="{address}" rel="noreferrer"' in text
    if os.name == "posix":
        assert stat.S_IMODE(page.stat().st_mode) == 0o600
    browser.remove_redirects()
    assert not page.exists()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))  # no writable folder: the user types the address
    assert not browser.open_page(address) and len(calls) == 1
