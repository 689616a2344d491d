"""The page as one file, `sand view`, `Simulation.view`, the widget: what is in them is what the run holds."""

import base64
import gzip
import hashlib
import json
import re
import threading
import urllib.request
from pathlib import Path

import numpy as np
import pytest

import sand
from sand.cli import view as view_command
from sand.cli.main import main
from sand.files import page as page_files
from sand.view import browser, page, show
from sand.view.packets import decode
from sand.view.page import chosen_frames, fitting, write_page
from sand.view.story import story_of
from sand.view.widget import answered, widget

from .reels import reel

SCRIPT = "const a = '</script><!-- ${x}'; console.log(a)"


@pytest.fixture(autouse=True)
def bundle(tmp_path, monkeypatch):
    """A small page in place of the real one, whose script holds what would end its element."""
    home = tmp_path / "bundle"
    home.mkdir()
    (home / "grainview.js").write_text(SCRIPT)
    (home / "grainview.css").write_text("body::after { content: '</style>' }")
    monkeypatch.setattr(page_files, "BUNDLE", home)
    return home


def elements(path):
    """Type and content of each script element, by id, as a browser splits them; "" for the page's own."""
    text = Path(path).read_text(encoding="utf-8")
    found = re.findall(r'<script type="([^"]*)"(?: id="([^"]*)")?>(.*?)</script', text, re.DOTALL | re.IGNORECASE)
    assert len({key for _, key, _ in found}) == len(found)
    return {key: (kind, content) for kind, key, content in found}


def blocks(path):
    """Manifest, series and packets of a page."""
    found = elements(path)
    told = {key: json.loads(found[f"sand-{key}"][1]) for key in ("manifest", "series")}
    packets = [
        decode(gzip.decompress(base64.b64decode(content)))
        for key, (kind, content) in found.items()
        if kind == "application/octet-stream" and key.startswith("sand-frame-")
    ]
    return told["manifest"], told["series"], packets


def test_a_file_holds_the_run(looked_at, tmp_path):
    """Frames decode back: positions to the last bit of single precision, others within 2⁻¹¹; manifest and series."""
    story = story_of(looked_at[0])
    told = []
    size = write_page(story, tmp_path / "a.html", progress=lambda done, count: told.append((done, count)))
    assert size == (tmp_path / "a.html").stat().st_size and told == [(k, 6) for k in range(1, 7)]
    manifest, series, packets = blocks(tmp_path / "a.html")
    assert series == json.loads(json.dumps(story.series())) and len(packets) == 6
    assert manifest["dimensions"] == [{}] * 6 and not manifest["running"]
    for k, ((head, arrays), frame) in enumerate(zip(packets, sand.open(looked_at[0]).frames, strict=True)):
        assert (head["frame"], head["step"], head["time"]) == (k, frame.step, frame.time)
        assert (arrays["position"] == (frame.position / manifest["unit"]).astype(np.float32)).all()
        assert (arrays["pair"] == frame.pair).all()
        for name in ("velocity", "moment", "force", "share"):
            floor = float(1e-9 * np.abs(getattr(frame, name)).max(initial=0.0))
            assert arrays[name] == pytest.approx(getattr(frame, name), rel=2.0**-11, abs=floor)
    _, content = elements(tmp_path / "a.html")["sand-grains"]
    radius = decode(gzip.decompress(base64.b64decode(content)))[1]["radius"]
    assert radius == pytest.approx(1.0, rel=1e-6, abs=0)


def test_a_file_needs_nothing_else(looked_at, tmp_path):
    """Its script cannot end its own element, is the only one allowed to run, and no address is in the page."""
    write_page(story_of(looked_at[0]), tmp_path / "a.html")
    text = (tmp_path / "a.html").read_text(encoding="utf-8")
    kind, script = elements(tmp_path / "a.html")[""]
    assert kind == "module" and r"\x3c/script>\x3c!--" in script
    allowed = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode()
    (policy,) = re.findall(r'http-equiv="Content-Security-Policy" content="([^"]*)"', text)
    assert f"script-src 'sha256-{allowed}'" in policy and "default-src 'none'" in policy
    assert "connect-src" not in policy and "http" not in policy
    assert text.index("Content-Security-Policy") < text.index("<style>") < text.index("<script")
    assert not re.search(r"https?://|src=|<\\?/style>.*</style>", text.split("<body>")[0].replace("data:,", ""))
    assert '<html lang="en">' in text and "<noscript>" in text and 'name="viewport"' in text


def test_names_cannot_break_the_page(tmp_path):
    """A run whose name is markup is shown by that name and does nothing."""
    story = story_of(reel(tmp_path / "a.gsd", [[(0, 1)]], 3))
    story.name = "</script><script>alert(1)</script><b>"
    write_page(story, tmp_path / "a.html")
    assert blocks(tmp_path / "a.html")[0]["name"] == story.name
    assert "<script>alert" not in (tmp_path / "a.html").read_text() and "<b>" not in (tmp_path / "a.html").read_text()


def test_the_same_run_gives_the_same_file(looked_at, tmp_path):
    """Byte for byte."""
    for name in ("a.html", "b.html"):
        write_page(story_of(looked_at[0]), tmp_path / name)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


def test_a_file_that_fails_leaves_the_old_one(looked_at, tmp_path, monkeypatch):
    """A frame that cannot be read in the middle: what was there stays, and nothing lies beside it."""
    (tmp_path / "a.html").write_text("old")
    story = story_of(looked_at[0])
    real = story.read
    monkeypatch.setattr(story, "read", lambda k: real(k) if k < 3 else real(99))
    with pytest.raises(sand.BadInput):
        write_page(story, tmp_path / "a.html")
    assert (tmp_path / "a.html").read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.html", "bundle"]
    with pytest.raises(sand.FilesFailed, match="cannot write"):
        write_page(story_of(looked_at[0]), tmp_path / "none" / "a.html")


def test_thinned_files(tmp_path):
    """Every second frame of a slice: times are theirs, names are those that all frames give."""
    frames = [[(0, 1)], [(0, 1), (2, 3), (3, 4)], [(0, 1), (2, 3), (3, 4), (1, 2)], [(0, 1)], [], []]
    story = story_of(reel(tmp_path / "a.gsd", frames, 6))
    story.choose(chosen_frames(slice(0, 5), 2), "every other")
    write_page(story, tmp_path / "a.html")
    manifest, _, packets = blocks(tmp_path / "a.html")
    assert manifest["steps"] == [0, 20, 40] and manifest["note"] == "every other"
    assert packets[1][1]["cluster"][:5].tolist() == [2] * 5  # 2 3 4 were the larger part, in a frame left out
    assert fitting(story, story.size / 2.5) == 3 and fitting(story, 1e9) == 1
    for wrong in (slice(50, 60), slice(3, 3)):
        with pytest.raises(sand.BadInput, match="none of them was chosen"):
            story.choose(wrong)
    with pytest.raises(sand.BadInput, match="every"):
        chosen_frames(slice(None), 0)


def test_dimensions_in_a_file(tmp_path, monkeypatch):
    """D of clusters of at least 32 grains by name; where there are many frames, of some, and that is said."""
    chain = [(k, k + 1) for k in range(39)]
    path = reel(tmp_path / "a.gsd", [chain, [], chain], 42)
    write_page(story_of(path), tmp_path / "a.html")
    found = blocks(tmp_path / "a.html")[0]["dimensions"]
    assert list(found[0]) == ["0"] and found[0]["0"][0] == pytest.approx(1.0, abs=0.1) and found[1] == {}
    monkeypatch.setattr(page, "MEASURED", 42**1.5)
    write_page(story_of(path), tmp_path / "a.html")
    manifest = blocks(tmp_path / "a.html")[0]
    assert [bool(d) for d in manifest["dimensions"]] == [True, False, False]
    assert "one frame of 3" in manifest["note"]


# --- the command -------------------------------------------------------------------------------------


def test_the_command_writes_a_file(looked_at, tmp_path, capsys):
    """Not over what is there, without leave; says how large it is; slices and thinning go in."""
    target = tmp_path / "out.html"
    words = ["view", str(looked_at[0]), "--html", str(target)]
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told == {"file": str(target), "bytes": target.stat().st_size}
    assert main(words) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main([*words, "--overwrite", "--every", "2", "--frames", "1:"]) == 0
    assert "MB" in capsys.readouterr().out
    manifest, _, packets = blocks(target)
    assert len(packets) == 3 and manifest["steps"] == [sand.open(looked_at[0]).frames[k].step for k in (1, 3, 5)]
    assert "one frame of 2" in manifest["note"] and manifest["field"]["directions"]


def test_a_large_file_is_warned_of(looked_at, tmp_path, capsys, monkeypatch):
    """Above 100 MB it says what to do."""
    monkeypatch.setattr(view_command, "LARGE", 1e3)
    assert main(["view", str(looked_at[0]), "--html", str(tmp_path / "a.html"), "--quiet"]) == 0
    told = capsys.readouterr()
    assert "--every" in told.err and told.out == ""


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["/nowhere/at/all"], "no such folder"),
        (["RUN", "--html", "/nowhere/at/all.html"], "no folder"),
        (["RUN", "--html", "/tmp"], "is a folder"),
        (["RUN", "--frames", "a"], "--frames"),
        (["RUN", "--frames", "70:"], "none of them was chosen"),
        (["RUN", "--every", "0"], "--every"),
        (["RUN", "--port", "70000"], "--port"),
        ([], "DIR"),
    ],
)
def test_mistakes(looked_at, capsys, words, said):
    """One line, exit 2."""
    assert main(["view", *(str(looked_at[0]) if word == "RUN" else word for word in words)]) == 2
    lines = capsys.readouterr().err.strip().splitlines()
    assert len(lines) == 1 and said in lines[0]


def test_without_the_page(looked_at, bundle, capsys):
    """An installation that lacks the bundle says so, in one line."""
    (bundle / "grainview.js").unlink()
    assert main(["view", str(looked_at[0])]) == 2
    assert "lacks the page" in capsys.readouterr().err


@pytest.mark.parametrize("form", [[], ["--json"], ["--quiet"]])
def test_the_command_serves(looked_at, capsys, monkeypatch, form):
    """It prints the address, answers there while it waits, and Ctrl-C ends it with 0."""
    got = {}

    def wait():
        got["out"], got["err"] = capsys.readouterr()
        (url,) = re.findall(r"http://127\.0\.0\.1:\d+/[\w-]+/", got["out"])
        with urllib.request.urlopen(url + "manifest", timeout=10) as reply:
            got["manifest"] = json.load(reply)
        raise KeyboardInterrupt

    monkeypatch.setattr(view_command, "_wait", wait)
    monkeypatch.setenv("SSH_CONNECTION", "a b c d")
    before = threading.active_count()
    assert main(["view", str(looked_at[0]), *form]) == 0
    assert got["manifest"]["grains"] == 6
    told = got["err"] + capsys.readouterr().err
    assert ("ssh -L" in told and "ended" in told) if not form else told == ""
    assert threading.active_count() <= before + 2
    if form == ["--json"]:
        assert list(json.loads(got["out"])) == ["url"]


# --- view() ------------------------------------------------------------------------------------------


@pytest.fixture
def opened(monkeypatch):
    """Addresses that a browser is sent to."""
    seen = []
    monkeypatch.setattr(show, "open_page", lambda url: seen.append(url) or True)
    return seen


def test_a_simulation_shows_its_run(looked_at, opened, tmp_path):
    """`view` writes view.html in the run's folder, or where it is told, opens it, and gives its path."""
    folder, sim = looked_at
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
    assert "keeps no files" in manifest["note"]


def test_too_much_is_thinned(looked_at, opened, tmp_path, monkeypatch):
    """Where all frames would take too much room, fewer are in the page, and it says so."""
    monkeypatch.setattr(show, "LARGEST", 5000.0)
    manifest, _, packets = blocks(sand.open(looked_at[0]).view(tmp_path / "a.html"))
    assert 1 <= len(packets) < 6 and "too much room" in manifest["note"]


def test_the_figure_where_there_is_no_page(bundle, opened):
    """With one warning that says why; nothing is written or opened."""
    from matplotlib.figure import Figure

    (bundle / "grainview.css").unlink()
    grains = sand.Grains([[0.0, 0.0, 0.0], [2.5e-8, 0.0, 0.0]], "10 nm", sand.SILICA)
    sim = sand.Simulation(grains, forces=[sand.Contact()])
    with pytest.warns(UserWarning, match="lacks the page"):
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
    monkeypatch.delenv(browser.NONE)
    assert browser.open_page("a") and calls == ["a"]
    monkeypatch.setattr(webbrowser, "open", lambda url: 1 / 0)
    assert not browser.open_page("a")
    monkeypatch.delenv("DISPLAY")
    assert not browser.has_window()


# --- the widget --------------------------------------------------------------------------------------


def test_messages_of_the_widget(looked_at):
    """Each kind is answered with what the story tells, echoed so that the page knows what it asked for."""
    story = story_of(looked_at[0])
    assert answered(story, {"kind": "grains", "id": 7}) == ({"kind": "grains", "id": 7}, [story.grains()])
    assert answered(story, {"kind": "frame", "k": 2}) == ({"kind": "frame", "k": 2}, [story.frame(2)])
    told, none = answered(story, {"kind": "manifest", "since": 4})
    assert len(told["manifest"]["times"]) == 2 and none == []
    assert answered(story, {"kind": "series"})[0]["series"] == json.loads(json.dumps(story.series()))
    assert "reason" in answered(story, {"kind": "dimension", "k": 5, "grain": 0})[0]


@pytest.mark.parametrize(
    "content",
    [
        None,
        {},
        {"kind": "file"},
        {"kind": "frame"},
        {"kind": "frame", "k": -1},
        {"kind": "frame", "k": 6},
        {"kind": "frame", "k": "0"},
        {"kind": "frame", "k": True},
        {"kind": "dimension", "k": 0, "grain": 6},
        {"kind": "manifest", "since": None},
    ],
)
def test_wrong_messages(looked_at, content):
    """A sentence, whatever comes; nothing is raised in the kernel."""
    told, buffers = answered(story_of(looked_at[0]), content)
    assert isinstance(told["error"], str) and buffers == []


def test_the_widget(looked_at, monkeypatch):
    """It holds manifest and series, runs the bundle, and answers through its own channel."""
    pytest.importorskip("anywidget", reason="anywidget is in the test extra")
    one = widget(story_of(looked_at[0]))
    assert one.manifest["grains"] == 6 and one.series["plots"] and SCRIPT in str(one._esm)
    sent = []
    monkeypatch.setattr(one, "send", lambda content, buffers=None: sent.append((content, buffers)))
    one._handle_custom_msg({"kind": "frame", "k": 1}, [])
    assert sent[0][0] == {"kind": "frame", "k": 1} and decode(sent[0][1][0])[0]["frame"] == 1
    monkeypatch.setattr(show, "in_notebook", lambda: True)
    assert type(sand.open(looked_at[0]).view()).__name__ == "GrainWidget"


def test_without_anywidget(looked_at, monkeypatch):
    """It says what to install."""
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(sand.BadInput, match="pip install anywidget"):
        widget(story_of(looked_at[0]))
