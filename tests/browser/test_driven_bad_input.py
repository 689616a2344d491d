"""Damaged or missing input gives a sentence on the page; unusual input is shown."""

from __future__ import annotations

import base64
import contextlib
import json
import re
import socket
import zipfile
from pathlib import Path

import numpy as np
import pytest

from sand.basics.box import Box
from sand.basics.errors import BadInput
from sand.viewer.dataset import run_dataset
from sand.viewer.html import write_page
from sand.viewer.server import Server

from .driving import Driven, differ, served
from .small_runs import FIELD, FRAMES, SIDE, R, SmallRun, contacts, grains, pairs, positions, written

NO_WEBGL = """() => {
  const real = HTMLCanvasElement.prototype.getContext;
  HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    return kind.startsWith("webgl") ? null : real.call(this, kind, ...more);
  };
}"""


@pytest.fixture(scope="module")
def file(bundle, tmp_path_factory) -> str:
    """A complete page in one file."""
    folder = tmp_path_factory.mktemp("files")
    write_page(run_dataset(SmallRun(folder / "small").folder, FIELD), folder / "small.html")
    return (folder / "small.html").read_text("utf-8")


@pytest.fixture
def view(page) -> Driven:
    page.set_viewport_size({"width": 800, "height": 560})
    return Driven(page)


def opened(view: Driven, text: str, folder: Path, ready: str = "yes") -> None:
    (folder / "page.html").write_text(text, "utf-8")
    view.open((folder / "page.html").as_uri(), ready)


def is_shown(view: Driven) -> None:
    """Not blank, not only background; the time line is there."""
    assert len(np.unique(view.picture().reshape(-1, 4), axis=0)) > 4
    assert view.tab.locator(".gv-timeline").is_visible()


def is_refused(view: Driven, *words: str) -> None:
    """One sentence, visible and announced to screen readers; no internal error."""
    told = view.tab.get_by_role("alert")
    assert told.is_visible()
    for word in words:
        assert word in told.inner_text()
    assert not re.search(r"undefined|null|TypeError|Unexpected|\[object", told.inner_text())
    assert view.run("app") is None


def block(text: str, name: str) -> tuple[int, int]:
    """Where the content of a block of the file begins and ends."""
    start = text.index(">", text.index(f'id="sand-{name}"')) + 1
    return start, text.index("</script>", start)


def with_block(text: str, name: str, content: str) -> str:
    start, end = block(text, name)
    return text[:start] + content + text[end:]


def test_a_complete_file(view, file, tmp_path):
    opened(view, file, tmp_path)
    is_shown(view)
    view.press("End")
    assert view.run("app.picture.frame.frame") == FRAMES - 1
    view.put(grain=2)
    assert "32 grains and more" in view.text(".gv-inspector")


@pytest.mark.parametrize("where", ["frame", "manifest", "script"])
def test_a_file_that_was_cut_off(page, file, tmp_path, where):
    """The script comes last and is missing; the page reports the damage without it."""
    ends = {
        "frame": block(file, "frame-3")[0] + 100,
        "manifest": block(file, "manifest")[0] + 200,
        "script": len(file) - 1000,
    }
    (tmp_path / "cut.html").write_text(file[: ends[where]], "utf-8")
    page.goto((tmp_path / "cut.html").as_uri())
    assert "the file is incomplete" in page.locator("body").inner_text()


def test_a_file_that_lost_its_manifest(view, file, tmp_path):
    start, end = block(file, "manifest")
    whole = file[: file.rindex("<script", 0, start)] + file[end + len("</script>\n") :]
    opened(view, whole, tmp_path, "no")
    is_refused(view, "cut off", "manifest")


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("manifest", '{"format": 1, "na', ["damaged", "manifest"]),
        ("manifest", "", ["cut off", "manifest"]),
        ("series", "[", ["damaged", "series"]),
        ("grains", "!!!!", ["damaged", "grains"]),
        ("grains", base64.b64encode(b"no gzip at all").decode(), ["damaged", "grains"]),
    ],
)
def test_damaged_blocks(view, file, tmp_path, name, content, words):
    opened(view, with_block(file, name, content), tmp_path, "no")
    is_refused(view, *words)


@pytest.mark.parametrize(("content", "word"), [("H4sI", "damaged"), ("", "cut off")])
def test_the_first_frame_is_damaged(view, file, tmp_path, content, word):
    """The next one is shown, and the sentence stays."""
    opened(view, with_block(file, "frame-0", content), tmp_path)
    note = view.tab.locator(".gv-note")
    assert word in note.inner_text() and "frame-0" in note.inner_text()
    assert view.run("app.picture.frame.frame") == 1


def edited(file: str, **keys: object) -> str:
    start, end = block(file, "manifest")
    return with_block(file, "manifest", json.dumps(json.loads(file[start:end]) | keys))


@pytest.mark.parametrize(
    ("keys", "words"),
    [({"format": 2}, ["another version of SAND"]), ({"times": [], "steps": []}, ["no frames yet"])],
)
def test_other_manifests(view, file, tmp_path, keys, words):
    opened(view, edited(file, **keys), tmp_path, "no")
    is_refused(view, *words)


@pytest.mark.parametrize("content", ["H4sI", "", base64.b64encode(b"x" * 50).decode()])
def test_one_unreadable_frame(view, file, tmp_path, content):
    """A sentence at that frame; neighbouring frames and trails are shown; playing stops there."""
    opened(view, with_block(file, "frame-3", content), tmp_path)
    view.put(frame=2)
    before = view.picture()
    view.press("ArrowRight")
    note = view.tab.locator(".gv-note")
    assert "frame-3" in note.inner_text() and note.get_attribute("role") == "alert"
    assert "frame 3 of" in view.text(".gv-time") and view.run("app.timeline.slider.value") == "3"
    view.press("ArrowRight")
    assert not note.is_visible() and view.run("app.picture.frame.frame") == 4
    view.put(trails=4)
    view.press("ArrowLeft", "ArrowLeft")
    view.put(trails=0)
    assert differ(view.picture(), before) == 0
    view.press("Space")
    view.tab.wait_for_selector("button[aria-label=Play]")
    assert view.get("frame") == 3 and note.is_visible()
    with view.tab.expect_download() as coming:
        view.run("app.exporter.save({ kind: 'sequence', width: 64, height: 64, from: 2, to: 4 })")
    with zipfile.ZipFile(coming.value.path()) as files:
        assert files.namelist() == ["frame-000002.png", "frame-000004.png"]
    view.tab.locator(".gv-note", has_text="could not be shown: frames 3.").wait_for()
    view.open(view.tab.url.split("#")[0] + "#frame=3")  # the address of that frame opens what is next to it
    assert view.run("app.picture.frame.frame") == 2 and "frame-3" in note.inner_text()


def test_no_webgl(view, file, tmp_path):
    view.tab.add_init_script(f"({NO_WEBGL})()")
    opened(view, file, tmp_path, "no")
    is_refused(view, "WebGL 2", "sand plot")


def test_webgl_context_is_lost_and_restored(view, file, tmp_path):
    """A sentence while it is lost; the same picture afterwards."""
    opened(view, file, tmp_path)
    before = view.picture()
    view.run("window.lose = app.stage.renderer.getContext().getExtension('WEBGL_lose_context'), lose.loseContext()")
    view.tab.locator(".gv-note", has_text="graphics card").wait_for()
    view.press("ArrowRight", "ArrowLeft")
    view.tab.evaluate("() => window.lose.restoreContext()")
    view.tab.locator(".gv-note").wait_for(state="hidden")
    view.tab.wait_for_timeout(100)
    assert differ(view.picture(), before, by=2) == 0


class StoppableServer(Server):
    """A server whose open connections end with it, as for a process."""

    def process_request(self, request: socket.socket, client_address: object) -> None:
        self.__dict__.setdefault("open", []).append(request)
        super().process_request(request, client_address)

    def stop(self) -> None:
        super().stop()
        for one in self.open:
            with contextlib.suppress(OSError):
                one.shutdown(socket.SHUT_RDWR)


def test_the_server_is_gone(view, tmp_path, bundle):
    """During playing: it stops and says so; loaded frames can still be shown."""
    folder = SmallRun(tmp_path / "small").folder
    server = StoppableServer(run_dataset(folder, FIELD))
    server.start()
    view.open(server.url)
    view.press("ArrowRight")
    server.stop()
    view.tab.expected_errors = ["request: http://127.0.0.1", "console: Failed to load"]
    view.press("Space")
    view.tab.locator(".gv-note", has_text="sand view").wait_for()
    assert not view.run("app.player.playing")
    view.press("Home")
    assert view.run("app.picture.frame.frame") == 0 == view.get("frame")
    is_shown(view)


def test_an_empty_run(tmp_path):
    """The server reports that there is nothing to show yet."""
    SmallRun(tmp_path / "small", 0, ended=False)
    with pytest.raises(BadInput, match="no frame yet"):
        run_dataset(tmp_path / "small")


ONE = np.zeros((1, 3))
UNUSUAL = {
    "one-grain": ([(grains(ONE), [])], None),
    "no-contacts": ([(grains(positions(k), k), []) for k in range(2)], Box.periodic(SIDE * R)),
    "open-box": ([(grains(positions(k), k), pairs(k)) for k in range(2)], None),
    "half-open-box": ([(grains(positions(k), k), pairs(k)) for k in range(2)], Box.periodic(SIDE * R, None, SIDE * R)),
    "no-moments": ([(grains(positions(k), k, moments=False), pairs(k)) for k in range(2)], None),
    "far-away": ([(grains(positions(k) + 1e5, k), pairs(k)) for k in range(2)], None),
    "wide": ([(grains(positions(k) * 1e6, k), pairs(k)) for k in range(2)], None),
}


def use_everything(view: Driven) -> None:
    """Use all colours, kinds of contacts and plots, and the keys for grains and clusters."""
    for setting in ("colour", "bonds", "plot"):
        for value, _ in view.run(f"app.state.setting({setting!r}).options"):
            view.run("app.state.set(told[0], told[1])", setting, value)
    view.settle()
    view.press(*"nNy.kezigwotq", "ArrowRight", "ArrowLeft", "Escape", "r")


@pytest.mark.parametrize("name", UNUSUAL)
def test_unusual_runs_are_shown(view, tmp_path, bundle, name):
    """The picture has grains; every control works without an error."""
    frames, box = UNUSUAL[name]
    with served(written(tmp_path / name, frames, box)) as server:
        view.open(server.url)
        is_shown(view)
        use_everything(view)
        assert not view.tab.locator(".gv-note").is_visible()
        is_shown(view)
        assert not re.search("NaN|Infinity|undefined", view.text("body"))


def test_nan_positions(view, tmp_path, bundle):
    """Of one grain, as after numerical failure: the others are visible."""
    frames = [(grains(positions(k), k), pairs(k)) for k in range(3)]
    for some, _ in frames[1:]:
        some.position[5] = some.velocity[5] = np.nan
    with served(written(tmp_path / "nan", frames, Box.periodic(SIDE * R))) as server:
        view.open(server.url + "#frame=1")
        is_shown(view)
        assert view.look()["height"] > 10
        use_everything(view)
        view.put(grain=5)
        assert "not known" in view.text(".gv-inspector")
        is_shown(view)


def test_synthetic_contacts_have_the_columns_of_a_frame():
    """The fixture's table has the stored columns of contacts."""
    assert {"pair", "overlap", "formed", "force", "slide_vector", "roll_vector", "twist"} <= set(contacts(pairs(0)))
