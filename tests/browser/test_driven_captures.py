"""Pictures and movies saved by the page: requested size, not blank, and the page is unchanged afterwards."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from .driving import Driven, differ, image


def saved(
    view: Driven, kind: str = "png", *, clear: bool = False, words: bool = True, **fields: int
) -> tuple[str, bytes]:
    """Name and content of what the dialog gives."""
    view.press("s")
    view.tab.locator("#gv-cap-kind").select_option(kind)
    for name, value in fields.items():
        view.tab.locator(f"#gv-cap-{name}").fill(str(value))
    if kind != "webm":
        view.tab.locator("#gv-cap-clear").set_checked(clear)
    view.tab.locator("#gv-cap-words").set_checked(words)
    with view.tab.expect_download() as coming:
        view.tab.get_by_role("button", name="Save").click()
    view.tab.wait_for_selector(".gv-note", state="hidden")
    view.settle()
    return coming.value.suggested_filename, Path(coming.value.path()).read_bytes()


@pytest.fixture
def restored_view(view) -> Iterator[Driven]:
    """The page, which must be unchanged after the test: frame, camera, size, and every pixel."""
    view.put(frame=3, grain=2)
    before, look = view.picture(), view.look()
    yield view
    assert view.get("frame") == 3 and view.look() == look
    assert differ(view.picture(), before) == 0
    assert view.tab.locator("dialog").count() == 0


@pytest.mark.parametrize("size", [(320, 240), (301, 777), (2500, 1200)])
def test_a_picture_has_its_size(restored_view, size):
    """It shows the grains: not blank, the theme's background in its corners."""
    name, content = saved(restored_view, width=size[0], height=size[1])
    assert name == "small-000003.png" and content[:8] == b"\x89PNG\r\n\x1a\n"
    picture = image(content)
    assert picture.shape == (size[1], size[0], 4)
    corners = picture[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert (corners == [251, 250, 247, 255]).all()
    assert (picture[..., 3] == 255).all()
    assert len({tuple(v) for v in picture[::3, ::3].reshape(-1, 4)}) > 30


def test_a_picture_shows_what_the_page_shows(restored_view):
    """Drawn as large as the page has it, it differs at edges only: these are smoother."""
    shape = restored_view.picture().shape
    picture = image(saved(restored_view, words=False, width=shape[1], height=shape[0])[1]).astype(int)
    page = restored_view.picture().astype(int)
    far = np.abs(picture - page).max(axis=-1) > 40
    assert far.mean() < 0.03
    assert np.abs(picture - page).mean() < 2.0


@pytest.mark.parametrize("theme", ["light", "dark"])
def test_a_transparent_picture(view, theme):
    """Background pixels are empty, grains opaque; edges have no background colour."""
    view.put(theme=theme, box=False, shade=0)
    picture = image(saved(view, clear=True, width=400, height=300)[1])
    assert (picture[[0, 0, -1, -1], [0, -1, 0, -1], 3] == 0).all()
    opaque = (picture[..., 3] == 255).mean()
    assert 0.002 < opaque < 0.5
    solid = image(saved(view, width=400, height=300)[1])
    assert (np.abs(solid.astype(int) - picture)[picture[..., 3] == 255].max(axis=-1) <= 3).mean() > 0.98


def written(view: Driven, **fields: int) -> tuple[np.ndarray, np.ndarray]:
    """A picture with words (H, W, 3), and where it differs from the one without (H, W)."""
    _, plain = saved(view, words=False, **fields)
    _, told = saved(view, **fields)
    both = image(told)[..., :3].astype(int)
    return both, (np.abs(both - image(plain)[..., :3]) > 8).any(-1)


@pytest.mark.parametrize(("width", "height"), [(800, 500), (1600, 1000)])
def test_the_legend_on_a_picture(view, width, height):
    """A bar of the palette's 64 colours, as wide as 200 pixels in a picture 800 wide; nothing where nothing belongs."""
    view.put(colour="speed", bonds="plain")
    grow = width // 800
    both, words = written(view, width=width, height=height)
    palette = np.array(view.run("Object.values(app.manifest.palettes)[0]"))
    columns = np.round((14 + 200 * np.arange(1, 63) / 63) * grow).astype(int)
    off = np.abs(both[:, columns] - palette[1:63]).max(axis=(1, 2))
    assert (off < 9).sum() >= 8 * grow, "no row of pixels has the colours of the palette"
    rows, columns = np.nonzero(words)
    left, right = columns < 240 * grow, columns > width - 200 * grow
    assert (left & (rows < 110 * grow) | right & (rows > height - 50 * grow)).all()
    assert not words[: 6 * grow].any() and not words[-6 * grow :].any()


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("height", [500, 900])
def test_scale_bar_of_a_picture(view, theme, height):
    """Its length is a round number of metres at the target: picture height over height of the look, in pixels.

    Its line is 1.6 pixels thick, so it has four fifths of its colour in each of two rows; ends are off by a pixel.
    """
    view.put(theme=theme, ortho=True)
    both, words = written(view, width=800, height=height)
    ink = (np.abs(both - ([34, 38, 43] if theme == "light" else [232, 230, 223])).max(-1) < 80) & words
    ends = [np.flatnonzero(row) for row in ink[-30:]]
    long = max((1 + end[-1] - end[0] for end in ends if len(end) and len(end) == 1 + end[-1] - end[0]), default=0)
    assert 40 < long <= 200
    metres = (long - 1.6) * view.look()["height"] / height * view.run("app.manifest.unit")
    round_ones = np.outer(10.0 ** np.arange(-12, 0), [1, 2, 5]).ravel()
    assert np.abs(round_ones / metres - 1).min() < 2.5 / long


def test_the_time_on_a_picture(view):
    """The line at the top is another one at another time, and the same again at the same time; opaque letters, too,
    where the background is transparent.
    """
    view.put(box=False)
    tops = []
    for frame in (2, 5, 2):
        view.put(frame=frame)
        both, words = written(view, width=800, height=500)
        assert words[10:30, 14:100].sum() > 40
        tops.append(both[10:30, 14:100])
    assert (tops[0] == tops[2]).all() and (tops[0] != tops[1]).any()
    clear = image(saved(view, clear=True, width=800, height=500)[1])
    assert (clear[10:30, 14:100, 3] == 255).sum() > 20 and (clear[:8, :, 3] == 0).all()


def test_the_page_is_not_transparent_afterwards(restored_view):
    """Only the picture was."""
    assert image(saved(restored_view, clear=True, width=64, height=64)[1])[0, 0, 3] == 0
    restored_view.tab.wait_for_timeout(50)
    assert restored_view.picture()[0, -1].tolist() == [251, 250, 247, 255]


def test_a_picture_at_once(restored_view):
    """By one key: twice as large as on the page."""
    with restored_view.tab.expect_download() as coming:
        restored_view.tab.keyboard.press("S")
    shape = restored_view.picture().shape
    assert image(Path(coming.value.path()).read_bytes()).shape == (2 * shape[0], 2 * shape[1], 4)


def test_a_sequence_of_pictures(restored_view):
    """A zip of the frames asked for, in order; each shows its own frame."""
    name, content = saved(restored_view, "sequence", **{"from": 2, "to": 6}, width=200, height=150)
    assert name == "small-frames.zip"
    with zipfile.ZipFile(io.BytesIO(content)) as files:
        assert files.testzip() is None
        assert files.namelist() == [f"frame-{k:06d}.png" for k in range(2, 7)]
        pictures = [image(files.read(one)) for one in files.namelist()]
    assert all(one.shape == (150, 200, 4) for one in pictures)
    assert all(differ(a, b) > 20 for k, a in enumerate(pictures) for b in pictures[:k])
    for k in (2, 5):
        restored_view.put(frame=k)
        _, alone = saved(restored_view, width=200, height=150)
        assert differ(image(alone), pictures[k - 2]) == 0
    restored_view.put(frame=3)


def test_saving_is_stopped(restored_view):
    """Esc ends a long sequence: nothing is saved, and the page says so."""
    downloads = []
    restored_view.tab.on("download", lambda one: downloads.append(one))
    restored_view.run("void app.exporter.save({ kind: 'sequence', width: 900, height: 600, from: 0, to: 7 })")
    restored_view.press("Escape")
    note = restored_view.tab.locator(".gv-note", has_text="Stopped")
    note.wait_for()
    restored_view.settle()
    assert not downloads and not restored_view.run("app.exporter.busy")
    restored_view.put(grain=2)
    restored_view.run("app.notify('')")


def test_frames_given_the_wrong_way_round(restored_view):
    """They are taken from the smaller to the larger."""
    _, content = saved(restored_view, "sequence", **{"from": 4, "to": 3}, width=64, height=64)
    assert zipfile.ZipFile(io.BytesIO(content)).namelist() == ["frame-000003.png", "frame-000004.png"]


@pytest.mark.parametrize(("first", "last", "words"), [(1, 4, True), (5, 5, False)])
def test_a_movie(restored_view, first, last, words):
    """A WebM that the browser plays, as large as the picture on the page; dark letters at its upper left, or none."""
    if not restored_view.tab.evaluate("() => typeof MediaRecorder !== 'undefined'"):
        pytest.skip("this browser writes no movies")
    restored_view.put(speed=10)
    name, content = saved(restored_view, "webm", words=words, **{"from": first, "to": last})
    assert name == "small.webm" and content[:4] == b"\x1aE\xdf\xa3"
    shape = restored_view.picture().shape
    told = restored_view.tab.context.new_page()
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
          const top = pen.getImageData(8, 5, 70, 20).data;
          const dark = top.filter((level, i) => i % 4 === 0 && level < 128).length;
          return [film.videoWidth, film.videoHeight, seen, dark];
        }""",
        list(content),
    )
    told.close()
    assert played[0] == pytest.approx(shape[1], abs=1) and played[1] == pytest.approx(shape[0], abs=1)
    assert played[2] > 30 and (played[3] > 20) == words


def test_meaningless_fields_are_disabled(view):
    """Fields without effect are grey; a size above the limit is refused by the form."""
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


def test_the_last_size_is_remembered(view):
    """The form shows the sizes that were entered last."""
    saved(view, width=123, height=45)
    view.press("s")
    assert view.tab.locator("#gv-cap-width").input_value() == "123"
    view.press("Escape")
