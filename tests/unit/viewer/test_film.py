"""Films without a browser: pictures of `sand plot`'s renderer, GIF, ffmpeg, and what is left after a failure."""

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageSequence

import sand
from sand.basics.box import Box
from sand.basics.errors import BadInput
from sand.cli.main import main
from sand.io.trajectory import TrajectoryWriter
from sand.plotting.style import rgb
from sand.viewer import film
from sand.viewer.film import write_film

from ..synthetic_trajectories import contacts_of

SIZE = (240, 200)


def pictures(count=4, until=None):
    """Grey pictures, each lighter; before number `until` the error is raised."""
    for k in range(count):
        if k == until:
            raise BadInput("frame 2 is damaged")
        yield Image.new("RGB", SIZE, (60 * k,) * 3)


def apart(path, places):
    """A trajectory in open space: a large grain that stays, a small one at these places x [grain diameters]."""
    writer = TrajectoryWriter(path)
    for k, x in enumerate(places):
        body = sand.Grains([[0.0, 0.0, 0.0], [x * 2e-8, 0.0, 0.0]], [2e-8, 1e-8], sand.IRON)
        writer.write(k, 1e-9 * k, body, Box.open(), contacts_of([]))
    writer.close()
    return path


@pytest.mark.parametrize(("rate", "time"), [(10, 100), (20, 50), (30, 30), (60, 20)])
def test_a_gif(tmp_path, rate, time):
    """All pictures in order; each is shown for the hundredths of a second closest to 1/rate; it repeats for ever."""
    size = write_film(tmp_path / "a.gif", pictures(), SIZE, rate)
    made = Image.open(tmp_path / "a.gif")
    assert size == (tmp_path / "a.gif").stat().st_size and made.size == SIZE and made.info["loop"] == 0
    shown = [(frame.info["duration"], frame.convert("RGB").getpixel((7, 7))) for frame in ImageSequence.Iterator(made)]
    assert shown == [(time, (60 * k,) * 3) for k in range(4)]


@pytest.mark.parametrize("old", [None, b"old"])
def test_nothing_is_left_of_a_film_that_fails(tmp_path, old):
    """A damaged frame after two good ones: an older film stays, there is no new file."""
    target = tmp_path / "a.gif"
    if old is not None:
        target.write_bytes(old)
    with pytest.raises(BadInput, match="frame 2 is damaged"):
        write_film(target, pictures(until=2), SIZE, 10)
    assert [path.read_bytes() for path in tmp_path.iterdir()] == ([] if old is None else [old])


def program(path, text):
    """An executable Python program, in place of ffmpeg."""
    path.write_text(f"#!{sys.executable}\n{text}\n")
    path.chmod(0o755)
    return str(path)


@pytest.mark.skipif(os.name == "nt", reason="Windows starts no program by its first line")
@pytest.mark.slow
def test_what_ffmpeg_says(tmp_path, monkeypatch):
    """Its first line is in the message if it ends with an error, also before it has read all; no file is left."""
    text = "import sys; print('no such encoder', file=sys.stderr); sys.exit(3)"
    monkeypatch.setattr(film, "find_ffmpeg", lambda: program(tmp_path / "ffmpeg", text))
    with pytest.raises(BadInput, match=r"could not write \.mp4: no such encoder"):
        write_film(tmp_path / "a.mp4", pictures(200), SIZE, 10)
    assert [path.name for path in tmp_path.iterdir()] == ["ffmpeg"]


@pytest.mark.skipif(os.name == "nt", reason="Windows starts no program by its first line")
@pytest.mark.slow
def test_ffmpeg_gets_the_pictures_and_is_ended(tmp_path, monkeypatch):
    """Raw colours in order, size and rate; after an interruption it does not go on."""
    echo = (
        "import sys, os; open(sys.argv[-1], 'wb').write(' '.join(sys.argv).encode() + b'|' + sys.stdin.buffer.read())"
    )
    monkeypatch.setattr(film, "find_ffmpeg", lambda: program(tmp_path / "ffmpeg", echo))
    write_film(tmp_path / "a.webm", pictures(), SIZE, 12)
    words, _, pixels = (tmp_path / "a.webm").read_bytes().partition(b"|")
    assert pixels == b"".join(picture.tobytes() for picture in pictures())
    assert b"-s 240x200 -r 12" in words and b"libvpx-vp9" in words
    (tmp_path / "a.webm").unlink()
    number = tmp_path / "number"
    wait = f"import os, time; open({str(number)!r}, 'w').write(str(os.getpid())); time.sleep(60)"
    monkeypatch.setattr(film, "find_ffmpeg", lambda: program(tmp_path / "ffmpeg", wait))

    def interrupted():
        while not (number.exists() and number.read_text()):
            yield Image.new("RGB", (2, 2))
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_film(tmp_path / "a.webm", interrupted(), (2, 2), 12)
    with pytest.raises(ProcessLookupError):
        os.kill(int(number.read_text()), 0)
    assert not (tmp_path / "a.webm").exists()


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["mp4", "webm"])
def test_colours_of_a_film(tmp_path, ending):
    """Players that read colours by BT.709, as the label of the film says, get those of the figures: to 4 levels of 255.

    Luminance has 219 steps and colours 224, which red and blue take 1.57 and 1.86 times: half a step each costs
    0.5 (1.16 + 1.14 · 1.86) = 1.6 levels when it is written, and as much when it is read. Colours written by BT.601, as
    ffmpeg does unless it is told, are off by 10 and more. Patches of one colour are hardly changed by compression.
    """
    ffmpeg = film.find_ffmpeg()
    if ffmpeg is None:
        pytest.skip("no ffmpeg: apt install ffmpeg, or pip install imageio-ffmpeg")
    colours = np.array([rgb(colour) for colour in ("#d55e00", "#0072b2", "#009e73", "#fbfaf7")]) * 255
    patches = np.repeat(np.repeat(colours.round().astype(np.uint8)[None], 100, 0), 60, 1)
    target = tmp_path / f"a.{ending}"
    write_film(target, [Image.fromarray(patches)] * 3, (240, 100), 10)
    told = subprocess.run([ffmpeg, "-i", str(target)], capture_output=True, text=True, check=False).stderr
    assert "yuv420p(tv, bt709" in told
    words = ["-vf", "scale=in_color_matrix=bt709:in_range=tv", "-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    pixels = subprocess.run([ffmpeg, "-v", "error", "-i", str(target), *words], capture_output=True, check=True).stdout
    frames = np.frombuffer(pixels, np.uint8).reshape(-1, 100, 240, 3).astype(int)
    assert len(frames) == 3
    middle = frames[:, 20:80].reshape(3, 60, 4, 60, 3)[:, :, :, 20:40]
    assert np.abs(middle.mean((1, 3)) - colours).max() < 4.0


@pytest.mark.slow
def test_a_film_by_the_renderer_of_figures(tmp_path, capsys):
    """One window for all frames: the large yellow grain stays on its pixels while the small blue one flies away.

    The blue one covers a part of its left side at first; its right end and its top stay, to a pixel of the palette of
    256 colours. The blue one moves by 4 and 6 diameters of equal length on the screen: ratio 1.5.
    """
    path = apart(tmp_path / "run.gsd", [2.0, 6.0, 12.0])
    words = ["view", str(path), "--movie", str(tmp_path / "a.gif"), "--renderer", "plot", "--size", "480x300"]
    assert main([*words, "--settings", "colour=radius&theme=dark", "--json", "--fps", "5"]) == 0
    told, target = json.loads(capsys.readouterr().out), tmp_path / "a.gif"
    assert told.pop("file") == str(target) and told.pop("bytes") == target.stat().st_size
    assert told == {"frames": 3, "size": [480, 300], "fps": 5, "renderer": "plot"}
    made = Image.open(tmp_path / "a.gif")
    frames = [np.asarray(frame.convert("RGB")).astype(int) for frame in ImageSequence.Iterator(made)]
    assert len(frames) == 3
    ends, places = [], []
    for red, _, blue in (np.moveaxis(frame[:, :400], -1, 0) for frame in frames):  # the bar of colours is at the right
        rows, columns = np.nonzero((red > 80) & (red > 1.5 * blue))
        ends.append([columns.max(), rows.min()])
        places.append(np.nonzero((blue > 80) & (blue > 1.5 * red))[1].min())
    assert np.ptp(ends, axis=0).max() <= 1
    moved = -np.diff(places)
    assert moved[0] > 40 and moved[1] / moved[0] == pytest.approx(1.5, abs=0.06)


def test_ffmpeg_is_missing(tmp_path, monkeypatch, capsys):
    """One line before anything is drawn, with what to do; a GIF needs none."""
    monkeypatch.setattr(film, "find_ffmpeg", lambda: None)
    path = apart(tmp_path / "run.gsd", [2.0])
    assert main(["view", str(path), "--movie", str(tmp_path / "a.mp4")]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line == (
        "sand: a.mp4 needs ffmpeg, which is not there: install it, or pip install imageio-ffmpeg; a.gif needs none"
    )


def test_without_a_browser(tmp_path, monkeypatch, capsys):
    """The other renderer draws, and a note says why; `--renderer page` is refused."""
    monkeypatch.setattr(
        "sand.viewer.headless.why_no_page", lambda: "Playwright is not installed: pip install playwright"
    )
    monkeypatch.setattr(
        "sand.cli.plotted_film.still_picture",
        lambda frame, size, **_: type("S", (), {"image": lambda _: Image.new("RGB", size)})(),
    )
    path = apart(tmp_path / "run.gsd", [2.0, 3.0])
    words = ["view", str(path), "--movie", str(tmp_path / "a.gif")]
    assert main([*words, "--renderer", "page"]) == 2
    assert "pip install playwright; --renderer plot needs no browser" in capsys.readouterr().err
    assert main(words) == 0
    output = capsys.readouterr()
    assert "note: sand plot draws the frames, because Playwright is not installed" in output.err
    assert "drawn by  plot" in output.out and Path(tmp_path / "a.gif").exists()
