"""Pictures and movies that the page hands over: of the size asked for, not blank, and nothing is left behind."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from .driving import Driven, differ, image


def saved(view: Driven, kind: str = "png", *, clear: bool = False, **fields: int) -> tuple[str, bytes]:
    """Name and content of what the dialog gives."""
    view.press("s")
    view.tab.locator("#gv-cap-kind").select_option(kind)
    for name, value in fields.items():
        view.tab.locator(f"#gv-cap-{name}").fill(str(value))
    if kind != "webm":
        view.tab.locator("#gv-cap-clear").set_checked(clear)
    with view.tab.expect_download() as coming:
        view.tab.get_by_role("button", name="Save").click()
    view.tab.wait_for_selector(".gv-note", state="hidden")
    view.settle()
    return coming.value.suggested_filename, Path(coming.value.path()).read_bytes()


@pytest.fixture
def untouched(view) -> Iterator[Driven]:
    """The page, which must be as before afterwards: frame, camera, size, and every pixel."""
    view.put(frame=3, grain=2)
    before, look = view.picture(), view.look()
    yield view
    assert view.get("frame") == 3 and view.look() == look
    assert differ(view.picture(), before) == 0
    assert view.tab.locator("dialog").count() == 0


@pytest.mark.parametrize("size", [(320, 240), (301, 777), (2500, 1200)])
def test_a_picture_has_its_size(untouched, size):
    """And shows the grains: not blank, the background of the theme in its corners."""
    name, content = saved(untouched, width=size[0], height=size[1])
    assert name == "small-000003.png" and content[:8] == b"\x89PNG\r\n\x1a\n"
    picture = image(content)
    assert picture.shape == (size[1], size[0], 4)
    corners = picture[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert (corners == [251, 250, 247, 255]).all()
    assert (picture[..., 3] == 255).all()
    assert len({tuple(v) for v in picture[::3, ::3].reshape(-1, 4)}) > 30


def test_a_picture_shows_what_the_page_shows(untouched):
    """Drawn as large as the page has it, it differs at edges only: these are smoother."""
    shape = untouched.picture().shape
    picture = image(saved(untouched, width=shape[1], height=shape[0])[1]).astype(int)
    page = untouched.picture().astype(int)
    far = np.abs(picture - page).max(axis=-1) > 40
    assert far.mean() < 0.03
    assert np.abs(picture - page).mean() < 2.0


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_transparent_picture(view, theme):
    """Nothing where no grain is; the grains are opaque; edges carry no colour of the background."""
    view.put(theme=theme, box=False, shade=0)
    picture = image(saved(view, clear=True, width=400, height=300)[1])
    assert (picture[[0, 0, -1, -1], [0, -1, 0, -1], 3] == 0).all()
    opaque = (picture[..., 3] == 255).mean()
    assert 0.002 < opaque < 0.5
    solid = image(saved(view, width=400, height=300)[1])
    assert (np.abs(solid.astype(int) - picture)[picture[..., 3] == 255].max(axis=-1) <= 3).mean() > 0.98


def test_the_page_is_not_transparent_afterwards(untouched):
    """Only the picture was."""
    assert image(saved(untouched, clear=True, width=64, height=64)[1])[0, 0, 3] == 0
    untouched.tab.wait_for_timeout(50)
    assert untouched.picture()[0, -1].tolist() == [251, 250, 247, 255]


def test_a_picture_at_once(untouched):
    """By one key: twice as large as on the page."""
    with untouched.tab.expect_download() as coming:
        untouched.tab.keyboard.press("S")
    shape = untouched.picture().shape
    assert image(Path(coming.value.path()).read_bytes()).shape == (2 * shape[0], 2 * shape[1], 4)


def test_a_sequence_of_pictures(untouched):
    """A zip of the frames asked for, in order; each shows its own frame."""
    name, content = saved(untouched, "sequence", **{"from": 2, "to": 6}, width=200, height=150)
    assert name == "small-frames.zip"
    with zipfile.ZipFile(io.BytesIO(content)) as files:
        assert files.testzip() is None
        assert files.namelist() == [f"frame-{k:06d}.png" for k in range(2, 7)]
        pictures = [image(files.read(one)) for one in files.namelist()]
    assert all(one.shape == (150, 200, 4) for one in pictures)
    assert all(differ(a, b) > 20 for k, a in enumerate(pictures) for b in pictures[:k])
    for k in (2, 5):
        untouched.put(frame=k)
        _, alone = saved(untouched, width=200, height=150)
        assert differ(image(alone), pictures[k - 2]) == 0
    untouched.put(frame=3)


def test_saving_is_stopped(untouched):
    """Esc ends a long sequence: nothing is saved, and the page says so."""
    downloads = []
    untouched.tab.on("download", lambda one: downloads.append(one))
    untouched.run("void app.studio.make({ kind: 'sequence', width: 900, height: 600, from: 0, to: 7 })")
    untouched.press("Escape")
    note = untouched.tab.locator(".gv-note", has_text="Stopped")
    note.wait_for()
    untouched.settle()
    assert not downloads and not untouched.run("app.studio.busy")
    untouched.put(grain=2)
    untouched.run("app.tell('')")


def test_frames_given_the_wrong_way_round(untouched):
    """They are taken from the smaller to the larger."""
    _, content = saved(untouched, "sequence", **{"from": 4, "to": 3}, width=64, height=64)
    assert zipfile.ZipFile(io.BytesIO(content)).namelist() == ["frame-000003.png", "frame-000004.png"]


@pytest.mark.parametrize(("first", "last"), [(1, 4), (5, 5)])
def test_a_movie(untouched, first, last):
    """A WebM that the browser plays, as large as the picture on the page."""
    if not untouched.tab.evaluate("() => typeof MediaRecorder !== 'undefined'"):
        pytest.skip("this browser writes no movies")
    untouched.put(speed=10)
    name, content = saved(untouched, "webm", **{"from": first, "to": last})
    assert name == "small.webm" and content[:4] == b"\x1aE\xdf\xa3"
    shape = untouched.picture().shape
    told = untouched.tab.context.new_page()
    played = told.evaluate(
        """async (bytes) => {
          const film = document.createElement("video");
          film.muted = true;
          film.src = URL.createObjectURL(new Blob([Uint8Array.from(bytes)], { type: "video/webm" }));
          await new Promise((on, off) => { film.onloadeddata = on; film.onerror = () => off(film.error.message); });
          await film.play();
          const pen = new OffscreenCanvas(film.videoWidth, film.videoHeight).getContext("2d");
          let seen = 0;
          for (let k = 0; k < 200 && seen < 30; k++) { // a browser without a window shows a frame when it likes
            await new Promise((on) => setTimeout(on, 25));
            pen.drawImage(film, 0, 0);
            seen = new Set(pen.getImageData(0, 0, film.videoWidth, film.videoHeight).data).size;
          }
          return [film.videoWidth, film.videoHeight, seen];
        }""",
        list(content),
    )
    told.close()
    assert played[0] == pytest.approx(shape[1], abs=1) and played[1] == pytest.approx(shape[0], abs=1)
    assert played[2] > 30


def test_what_cannot_be_is_not_asked_for(view):
    """Fields that mean nothing are grey; a size beyond the largest is refused by the form."""
    view.press("s")
    tab = view.tab
    assert tab.locator("#gv-cap-from").is_disabled() and tab.locator("#gv-cap-width").is_enabled()
    tab.locator("#gv-cap-kind").select_option("webm")
    assert tab.locator("#gv-cap-from").is_enabled() and tab.locator("#gv-cap-width").is_disabled()
    tab.locator("#gv-cap-kind").select_option("sequence")
    for field, value in (("width", "9000"), ("height", "3"), ("to", "8"), ("from", "")):
        tab.locator(f"#gv-cap-{field}").fill(value)
        assert not tab.locator(f"#gv-cap-{field}").evaluate("(e) => e.checkValidity()")
    tab.get_by_role("button", name="Save").click()
    assert tab.locator("dialog").is_visible()
    view.press("Escape")
    assert tab.locator("dialog").count() == 0


def test_the_last_wish_is_remembered(view):
    """Sizes given once are there again."""
    saved(view, width=123, height=45)
    view.press("s")
    assert view.tab.locator("#gv-cap-width").input_value() == "123"
    view.press("Escape")
