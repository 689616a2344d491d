"""`sand view DIR --movie FILE`: films that the page draws, frame by frame."""

from __future__ import annotations

import base64
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image, ImageSequence

from sand.basics.box import Box
from sand.viewer.external_field import read_field
from sand.viewer.film import find_ffmpeg

from .conftest import skip_or_fail
from .driving import Driven, image, served
from .small_runs import SmallRun, grains, positions, written

SIZE = 480, 270
CAPTION_WIDTH = 245 * 0.75
"""Pixels at the left and right that legend, bars and arrows may take: letters have at least 9 of 12 pixels."""
BEGIN = "app.film.begin({ settings: told[0], width: told[1], height: told[2], count: 5 })"
LIGHT = [251, 250, 247]
HEIGHT = 40.0
"""Of the view, in radii."""
LOOK = f"look=0,0,0,0,-1,0,0,0,1,{HEIGHT}&ortho=1&arrows=0&box=0&bonds=off&shade=0&whole=0"
"""Along y, parallel: x to the right, z upwards."""


@pytest.fixture(scope="module")
def run(browser, bundle, tmp_path_factory) -> Path:
    """A small run; without a browser or the bundle the tests are skipped."""
    return SmallRun(tmp_path_factory.mktemp("films") / "small").folder


@pytest.fixture
def shoot(run, tmp_path):
    """Write a film with these words; returns its answer, and its frames (K, H, W, 3) if it is a GIF.

    In a process of its own: the fixture `browser` runs Playwright in this thread, which allows that once.
    """

    def written_film(*words: str, name: str = "film.gif") -> tuple[dict[str, Any], np.ndarray]:
        told = sand(
            "view", str(run), "--movie", str(tmp_path / name), "--size", "{}x{}".format(*SIZE), "--json", *words
        )
        assert told.returncode == 0, told.stderr
        answer = json.loads(told.stdout)
        assert answer["renderer"] == "page" and answer["bytes"] == (tmp_path / name).stat().st_size
        return answer, gif_frames(tmp_path / name) if name.endswith("gif") else np.zeros(0)

    return written_film


def sand(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run([sys.executable, "-m", "sand", *words], capture_output=True, text=True, check=False)


def gif_frames(path: Path) -> np.ndarray:
    """(K, H, W, 3); equal frames, which a GIF has once, as often as they are shown."""
    with Image.open(path) as film:
        each = ImageSequence.Iterator(film)
        shown = [(np.asarray(frame.convert("RGB")), frame.info["duration"]) for frame in each]
    unit = min(time for _, time in shown)
    return np.concatenate([[picture] * round(time / unit) for picture, time in shown])


def test_grains_are_where_they_are(shoot):
    """Frames 2, 4 and 6: in parallel projection a grain is at (x, −z) times the height of the picture over the view's.

    Its own pixel is no background; a point in the view that is farther than two radii from all grains is.
    """
    answer, frames = shoot("--frames", "2:8:2", "--settings", LOOK, "--fps", "10")
    assert answer["frames"] == len(frames) == 3 and answer["fps"] == 10
    assert frames.shape[1:] == (SIZE[1], SIZE[0], 3)
    scale = SIZE[1] / HEIGHT / (12.5 / 12)  # lengths of the page are mean radii: eleven of R, one of 1.5 R
    for picture, k in zip(frames, (2, 4, 6), strict=True):
        at = positions(k)
        column = SIZE[0] / 2 + scale * at[:, 0]
        line = SIZE[1] / 2 - scale * at[:, 2]
        colour = picture[line.astype(int), column.astype(int)].astype(int)
        assert (np.abs(colour - LIGHT).max(1) > 20).all(), k
        rows, columns = np.mgrid[40 : SIZE[1] - 60, int(CAPTION_WIDTH) : int(SIZE[0] - CAPTION_WIDTH)]
        far = (np.hypot(rows[..., None] - line, columns[..., None] - column) > 2 * 1.5 * scale).all(-1)
        empty = picture[40 : SIZE[1] - 60, int(CAPTION_WIDTH) : int(SIZE[0] - CAPTION_WIDTH)][far].astype(int)
        assert len(empty) > 100 and np.abs(empty - LIGHT).max() <= 8, k


def test_the_view_contains_all_frames(tmp_path, browser, bundle):
    """Two grains fly apart, tenfold: without a look of its own the film shows both in all frames, and they come apart.

    Nothing but background is at the edges, where no caption is.
    """
    frames = [(grains(np.array([[-d, 0.0, 0.0], [d, 0.0, 0.0]])), np.zeros((0, 2), int)) for d in (2.0, 8.0, 20.0)]
    folder = written(tmp_path / "apart", frames, Box.open())
    told = sand(
        "view", str(folder), "--movie", str(tmp_path / "a.gif"), "--size", "480", "--settings", "arrows=0&field=0"
    )
    assert told.returncode == 0, told.stderr
    film, spans = gif_frames(tmp_path / "a.gif").astype(int), []
    for picture in film:
        off = np.abs(picture - LIGHT).max(-1) > 20
        off[:, : int(CAPTION_WIDTH) - 100], off[-50:], off[:60] = False, False, False
        rows, columns = np.nonzero(off)
        assert rows.min() > 60 and rows.max() < 218 and columns.max() < 478
        spans.append(np.ptp(columns))
    assert len(film) == 3 and spans == sorted(spans) and spans[2] > 3 * spans[0]


@pytest.mark.parametrize("ending", ["mp4", "webm"])
def test_films_by_ffmpeg(shoot, run, page, tmp_path, ending):
    """As many frames as asked for, at the rate asked for; each is closest to its own frame as the page draws it.

    Colours are checked with pictures of known colours, in tests/unit/viewer/test_film.py.
    """
    ffmpeg = find_ffmpeg()
    if ffmpeg is None:
        skip_or_fail("no ffmpeg: apt install ffmpeg, or pip install imageio-ffmpeg")
    settings, film = "theme=dark&colour=speed", tmp_path / f"film.{ending}"
    shoot("--frames", "1:6", "--fps", "12", "--settings", settings, name=film.name)
    told = subprocess.run([ffmpeg, "-i", film], capture_output=True, text=True, check=False).stderr
    assert f"{SIZE[0]}x{SIZE[1]}" in told and "12 fps" in told
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    pixels = subprocess.run([ffmpeg, "-v", "error", "-i", film, *raw], capture_output=True, check=True).stdout
    frames = np.frombuffer(pixels, np.uint8).reshape(-1, SIZE[1], SIZE[0], 3)
    assert len(frames) == 5
    with served(run, read_field(run), slice(1, 6)) as server:
        view = Driven(page, server.url)
        assert view.run(BEGIN, settings, *SIZE) == []
        drawn = [image(base64.b64decode(view.run("app.film.picture(told[0])", k)))[..., :3] for k in range(5)]
    off = np.abs(frames[:, None].astype(int) - np.array(drawn)[None]).mean((2, 3, 4))
    assert off.argmin(1).tolist() == list(range(5)) and off.diagonal().max() < 3.0


def test_wrong_settings(run, tmp_path):
    """Each has a line that says what is allowed; nothing is written."""
    words = "colr=1&theme=pink&trails=99&log=yes&grain=99"
    told = sand("view", str(run), "--movie", str(tmp_path / "a.gif"), "--settings", words, "--quiet")
    assert told.returncode == 2 and list(tmp_path.iterdir()) == []
    lines = [line.removeprefix("sand: ") for line in told.stderr.strip().splitlines()]
    assert [line.split(" is not")[0].split(":")[0] for line in lines] == [
        *(
            "--settings colr",
            "--settings theme=pink",
            "--settings trails=99",
            "--settings log=yes",
            "--settings grain=99",
        )
    ]
    assert lines[1].endswith("allowed: auto, light, dark") and lines[2].endswith("allowed: from 0 to 40")


def test_a_whole_address_is_read(shoot):
    """What `j` copies: the settings after #; the same film as by the settings alone."""
    words = ("--frames", "3", "--settings")
    _, plain = shoot(*words, LOOK)
    _, whole = shoot(*words, f"http://127.0.0.1:1/abc/#{LOOK}&frame=1", name="other.gif")
    assert (plain == whole).all()
