"""The page as one file: its content is that of the run, and no text can escape its element."""

import base64
import gzip
import hashlib
import json
import re

import numpy as np
import pytest

import sand
from sand.viewer import html as page
from sand.viewer.dataset import run_dataset
from sand.viewer.html import frame_slice, frame_stride, write_page

from ..pages import blocks, decode, elements
from ..synthetic_trajectories import write_trajectory

pytestmark = pytest.mark.usefixtures("bundle")


@pytest.mark.compiled("fields")
def test_a_file_holds_the_run(finished_run, tmp_path):
    """Frames decode to the positions in single precision, others within 2⁻¹¹; manifest and series."""
    dataset = run_dataset(finished_run[0])
    calls = []
    size = write_page(dataset, tmp_path / "a.html", progress=lambda: calls.append(1))
    assert size == (tmp_path / "a.html").stat().st_size and len(calls) == 6
    manifest, series, packets = blocks(tmp_path / "a.html")
    assert series == json.loads(json.dumps(dataset.series())) and len(packets) == 6
    assert manifest["dimensions"] == [{}] * 6 and not manifest["running"]
    for k, ((head, arrays), frame) in enumerate(zip(packets, sand.open(finished_run[0]).frames, strict=True)):
        assert (head["frame"], head["step"], head["time"]) == (k, frame.step, frame.time)
        assert (arrays["position"] == (frame.position / manifest["unit"]).astype(np.float32)).all()
        assert (arrays["pair"] == frame.pair).all()
        for name in ("velocity", "moment", "force", "share"):
            floor = float(1e-9 * np.abs(getattr(frame, name)).max(initial=0.0))
            assert arrays[name] == pytest.approx(getattr(frame, name), rel=2.0**-11, abs=floor)
    _, content = elements(tmp_path / "a.html")["sand-grains"]
    radius = decode(gzip.decompress(base64.b64decode(content)))[1]["radius"]
    assert radius == pytest.approx(1.0, rel=1e-6, abs=0)


@pytest.mark.compiled("fields")
def test_a_file_needs_nothing_else(finished_run, tmp_path):
    """The script cannot end its element, no other script may run, and no address is in the page."""
    write_page(run_dataset(finished_run[0]), tmp_path / "a.html")
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
    """A run whose name is markup is shown by that name; the markup is inert."""
    dataset = run_dataset(write_trajectory(tmp_path / "a.gsd", [[(0, 1)]], 3))
    dataset.name = "</script><script>alert(1)</script><b>"
    write_page(dataset, tmp_path / "a.html")
    assert blocks(tmp_path / "a.html")[0]["name"] == dataset.name
    assert "<script>alert" not in (tmp_path / "a.html").read_text() and "<b>" not in (tmp_path / "a.html").read_text()


@pytest.mark.compiled("fields")
def test_the_same_run_gives_the_same_file(finished_run, tmp_path):
    """Byte for byte."""
    for name in ("a.html", "b.html"):
        write_page(run_dataset(finished_run[0]), tmp_path / name)
    assert (tmp_path / "a.html").read_bytes() == (tmp_path / "b.html").read_bytes()


@pytest.mark.compiled("fields")
def test_a_file_that_fails_leaves_the_old_one(finished_run, tmp_path, monkeypatch):
    """An unreadable frame in the middle: the old file stays, and no temporary file."""
    (tmp_path / "a.html").write_text("old")
    dataset = run_dataset(finished_run[0])
    real = dataset.read
    monkeypatch.setattr(dataset, "read", lambda k: real(k) if k < 3 else real(99))
    with pytest.raises(sand.BadInput):
        write_page(dataset, tmp_path / "a.html")
    assert (tmp_path / "a.html").read_text() == "old"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.html", "bundle"]
    with pytest.raises(sand.FilesFailed, match="cannot write"):
        write_page(run_dataset(finished_run[0]), tmp_path / "none" / "a.html")


def test_thinned_files(tmp_path):
    """Every second frame of a slice: its times, and the cluster ids that all frames give."""
    frames = [[(0, 1)], [(0, 1), (2, 3), (3, 4)], [(0, 1), (2, 3), (3, 4), (1, 2)], [(0, 1)], [], []]
    dataset = run_dataset(write_trajectory(tmp_path / "a.gsd", frames, 6))
    dataset.select(frame_slice(slice(0, 5), 2), "every other")
    write_page(dataset, tmp_path / "a.html")
    manifest, _, packets = blocks(tmp_path / "a.html")
    assert manifest["steps"] == [0, 20, 40] and manifest["note"] == "every other"
    assert packets[1][1]["cluster"][:5].tolist() == [2] * 5  # 2 3 4 were the larger part in an omitted frame
    assert frame_stride(dataset, dataset.size / 2.5) == 3 and frame_stride(dataset, 1e9) == 1
    for wrong in (slice(50, 60), slice(3, 3)):
        with pytest.raises(sand.BadInput, match="contains none of them"):
            dataset.select(wrong)


def test_dimensions_in_a_file(tmp_path, monkeypatch):
    """D of clusters of at least 32 grains by id; with many frames for some of them, which is stated."""
    chain = [(k, k + 1) for k in range(39)]
    path = write_trajectory(tmp_path / "a.gsd", [chain, [], chain], 42)
    write_page(run_dataset(path), tmp_path / "a.html")
    found = blocks(tmp_path / "a.html")[0]["dimensions"]
    assert list(found[0]) == ["0"] and found[0]["0"][0] == pytest.approx(1.0, abs=0.1) and found[1] == {}
    monkeypatch.setattr(page, "DIMENSION_COST", 42**1.5)
    write_page(run_dataset(path), tmp_path / "a.html")
    manifest = blocks(tmp_path / "a.html")[0]
    assert [bool(d) for d in manifest["dimensions"]] == [True, False, False]
    assert "one frame of 3" in manifest["note"]
