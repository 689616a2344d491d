"""`view()` of a simulation and of an opened run, and browsers that are opened or not."""

import os
import stat

import numpy as np
import pytest

import sand
from sand.viewer import browser, show

from .pages import blocks

pytestmark = pytest.mark.usefixtures("bundle")


@pytest.fixture
def opened(monkeypatch):
    """Addresses that a browser is sent to."""
    seen = []
    monkeypatch.setattr(show, "open_page", lambda url: seen.append(url) or True)
    return seen


@pytest.mark.compiled("fields")
def test_a_simulation_shows_its_run(finished_run, opened, tmp_path):
    """`view` writes view.html in the run's folder, or where it is told, opens it, and gives its path."""
    folder, sim = finished_run
    path = sim.view()
    assert path == folder / "view.html" and opened == [path.resolve().as_uri()]
    manifest, _, packets = blocks(path)
    assert len(packets) == 6 and "rotating" in manifest["field"]["text"]
    assert sim.view(tmp_path / "b.html") == tmp_path / "b.html"
    assert sand.open(folder).view(str(tmp_path / "c.html")) == tmp_path / "c.html"
    assert (tmp_path / "b.html").read_bytes() == (tmp_path / "c.html").read_bytes() == path.read_bytes()
    path.unlink()
    with pytest.raises(sand.BadInput, match="no folder"):
        sim.view(tmp_path / "none" / "b.html")


@pytest.mark.compiled("contacts")
def test_a_simulation_without_files_shows_its_state(opened):
    """One frame, that of now, and the ledger's rows; before the first step, too."""
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
def test_too_much_is_thinned(finished_run, opened, tmp_path, monkeypatch):
    """Where all frames would take too much room, fewer are in the page, and it says so."""
    monkeypatch.setattr(show, "MAX_BYTES", 5000.0)
    manifest, _, packets = blocks(sand.open(finished_run[0]).view(tmp_path / "a.html"))
    assert 1 <= len(packets) < 6 and "limit the size" in manifest["note"]


@pytest.mark.compiled("contacts")
def test_the_figure_where_there_is_no_page(bundle, opened):
    """With one warning that says why; nothing is written or opened."""
    from matplotlib.figure import Figure

    (bundle / "grainview.css").unlink()
    grains = sand.Grains([[0.0, 0.0, 0.0], [2.5e-8, 0.0, 0.0]], "10 nm", sand.SILICA)
    sim = sand.Simulation(grains, forces=[sand.Contact()])
    with pytest.warns(UserWarning, match="not part of this installation"):
        assert isinstance(sim.view(), Figure)
    assert not opened


def test_no_browser_is_opened_without_leave(monkeypatch):
    """SAND_NO_BROWSER, or no screen: none; otherwise the user's, and its errors are nobody's trouble."""
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


def test_a_token_is_not_on_a_command_line(tmp_path, monkeypatch):
    """The browser gets a page that only this user can read and that leads to the server; it goes at the end."""
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
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "none"))  # nowhere to write: the address is typed by hand
    assert not browser.open_page(address) and len(calls) == 1
