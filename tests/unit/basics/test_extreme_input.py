"""Extreme and malformed input is refused in one line at once."""

import os
import subprocess
import sys

import pytest

from sand.basics.errors import BadInput
from sand.basics.units import in_unit, si
from sand.cli.main import main
from sand.config.case import read_case
from sand.io.run_folder import read_json, read_text, read_toml
from sand.simulation.cadence import Cadence, Schedule

CASE = """
[run]
until = "20 ns"
[box]
periodic = "400 nm"
[grains]
number = 8
radius = "10 nm"
"""


@pytest.fixture
def workdir(tmp_path, monkeypatch):
    """An empty folder to work in, with a case file."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.toml").write_text(CASE)
    return tmp_path


def refused(words, capsys):
    """The one line that a command ends with."""
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == "" and err.startswith("sand: ") and err.count("\n") == 1 and len(err) < 600
    return err


@pytest.mark.parametrize(
    ("old", "new", "part"),
    [
        ('"20 ns"', '"1e-59 s"', "until = '1e-59 s' must be at least 1e-21 s"),
        ('"20 ns"', '"20 ns"\nframe_every = 1e-59', "frame_every = 1e-59 must be at least 1e-21 s"),
        ('"20 ns"', '"20 ns"\nframe_every = "nan s"', "is not finite"),
        ('"20 ns"', '"20 ns"\nframe_every = "inf s"', "is not finite"),
        ('"20 ns"', '"20 ns"\nseed = 18446744073709551616', "seed is a whole number beyond 2^63"),
        ('"20 ns"', '"20 ns"\nseed = -1', "run.seed = -1"),
        ('"20 ns"', '"20 ns"\nsteps = 9223372036854775807', "run.steps = 9223372036854775807"),
        ('"20 ns"', '"20 ns"\nout = ""', "run.out = '' is not the name"),
        ('"20 ns"', '"20 ns"\nout = "a\\u0000b"', "is not the name of a file or folder"),
        ('"20 ns"', f'"20 ns"\nout = "{"x" * 300}"', "is too long for the name"),
        ("= 8", f"= {10**30}", "grains.number is a whole number beyond 2^63"),
        ("= 8", "= 1000000000", "grains.number = 1000000000 must be a whole number from 1 to 1e+08"),
        ("= 8", f"= {'9' * 5000}", "is not TOML: Exceeds the limit"),
        ("= 8", f"= 0x{'f' * 5000}", "grains.number is a whole number beyond 2^63"),
        ("= 8", "= 8\nmoment = " + 40 * "[" + 40 * "]", "nested more than 16 deep"),
        ("= 8", "= 8\nmoment = " + 3000 * "[" + 3000 * "]", "nested more than 16 deep"),
        ("= 8", "= 8\n[" + "a." * 3000 + "a]", "nested more than 16 deep"),
        ('"10 nm"', '"1 m' + 18 * "   m" + '!"', "is not a radius or a distribution"),
        ('"10 nm"', '"1 ' + 500 * "m" + '"', "is not a radius or a distribution"),
        ('"10 nm"', f'"{"x" * 5000}"', "grains.radius holds more than 4096 characters"),
        ('"10 nm"', '"1 Ym^9 Ym^9 Ym^9 m^-9 m^-9 m^-8"', "is not"),
    ],
)
def test_extreme_entries_of_a_case(workdir, capsys, old, new, part):
    """One line, and no file is written."""
    assert old in CASE
    (workdir / "small.toml").write_text(CASE.replace(old, new))
    assert part in refused(["run", "small.toml"], capsys)
    assert sorted(p.name for p in workdir.iterdir()) == ["small.toml"]


@pytest.mark.parametrize(
    ("words", "part"),
    [
        (["run", "small.toml", "--out", ""], "--out = '' is not the name of a file or folder"),
        (["run", "small.toml", "--out", "x" * 300], "--out"),
        (["run", "x" * 300], "CASE.toml"),
        (["run", "small.toml", "--until", "1e-59"], "--until = 1e-59 must be at least 1e-21 s"),
        (["run", "small.toml", "--seed", str(2**64)], "--seed"),
        (["run", "small.toml", "--from", ""], "--from = ''"),
        (["run", "--from", ".", "--frame", str(10**30)], "--frame"),
        (["run", "small.toml", "--threads", str(10**30)], "--threads"),
        (["collide", "small.toml", "--out", ""], "--out = ''"),
        (["collide", "small.toml", "--seeds", "9" * 5000], "--seeds"),
        (["collide", "small.toml", "--seeds", ""], "--seeds"),
        (["collide", "small.toml", "--workers", str(10**30)], "--workers"),
        (["scatter", "small.toml", "--out", ""], "--out = ''"),
        (["grow", "small.toml", "--out", ""], "--out = ''"),
        (["resume", ""], "DIR = ''"),
        (["resume", "small.toml"], "small.toml is a file; give the folder of a run"),
        (["resume", "small", "--until", "1e-59"], "--until"),
        (["info", ""], "DIR|FILE = ''"),
        (["info", "x" * 300], "DIR|FILE"),
        (["view", ""], "DIR = ''"),
        (["view", "small", "--html", ""], "--html = ''"),
        (["view", "small", "--frames", "9" * 5000], "--frames"),
        (["plot", ""], "DIR… = ''"),
        (["plot", "small", "--out", ""], "--out = ''"),
        (["plot", "small", "--size", "999999999x999999999"], "width and height"),
        (["plot", "small", "--size", "9" * 5000 + "x1"], "--size"),
        (["plot", "small", "--frame", str(10**30)], "--frame"),
        (["plot", "small", "--view", "nan,0,1"], "view 'nan,0,1'"),
        (["plot", "small", "--view", "0,0,0"], "view '0,0,0'"),
        (["export", "", "--to", "xyz"], "DIR = ''"),
        (["export", "small", "--to", "xyz", "--out", ""], "--out = ''"),
        (["analyse", ""], "DIR... = ''"),
        (["analyse", "small", "--window", "nan", "nan"], "--window"),
        (["build", "bpca", "--grains", str(10**30), "--out", "a.xyz"], "--grains"),
        (["build", "lattice", "--shape", "9" * 5000 + ",1,1", "--out", "a.xyz"], "--shape"),
        (["build", "lattice", "--shape", "99999999,99999999,99999999", "--out", "a.xyz"], "lattice"),
        (["build", "bpca", "--grains", "8", "--out", ""], "--out = ''"),
        (["build", "bpca", "--grains", "8", "--out", "a.xyz", "--seed", str(2**64)], "--seed"),
        pytest.param(
            ["build", "bpca", "--grains", "8", "--out", "a.xyz", "--magnetic", "nan"],
            "magnetic",
            marks=pytest.mark.compiled("small"),
        ),
        (["build", "fractal", "--grains", "8", "--out", "a.xyz", "--dimension", "nan"], "dimension"),
        (["build", "fractal", "--grains", "8", "--out", "a.xyz", "--prefactor", "inf"], "prefactor"),
        (["build", "bpca", "--grains", "8", "--out", "a.xyz", "--radius", "1e400 m"], "radius"),
        (["build", "bpca", "--grains", "8", "--out", "a.xyz", "--material", "silica:nan,iron:1"], "nan"),
    ],
)
def test_extreme_options(workdir, capsys, words, part):
    """Empty names, and numbers that are malformed, too large or too small."""
    assert part in refused(words, capsys)
    assert sorted(p.name for p in workdir.iterdir()) == ["small.toml"]


@pytest.mark.skipif(not os.path.exists("/dev/zero"), reason="a system without /dev/zero")
@pytest.mark.parametrize(
    ("name", "words"),
    [
        *[("case.toml", words) for words in (["run"], ["collide"], ["scatter"], ["grow"], ["info"], ["run", "--from"])],
        *[(name, ["info"]) for name in ("summary.json", "ledger.csv", "trajectory.gsd", "checkpoint-1.npz")],
    ],
)
def test_device_files_are_refused(workdir, capsys, name, words):
    """A device in place of a file is refused before it fills the memory."""
    (workdir / name).symlink_to("/dev/zero")
    refused([*words, name], capsys)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without pipes that have names")
def test_a_case_may_come_through_a_pipe(workdir):
    """`sand info /dev/stdin` has no file name ending; a pipe named .toml is read to its end."""
    os.mkfifo(workdir / "piped.toml")
    with subprocess.Popen([sys.executable, "-c", "open('piped.toml', 'w').write(open('small.toml').read())"]):
        assert read_case("piped.toml").grains.number == 8


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_files_with_a_byte_order_mark(workdir, encoding):
    """As Windows editors write them."""
    (workdir / "small.toml").write_bytes(CASE.replace("\n", "\r\n").encode(encoding))
    assert read_case("small.toml").grains.number == 8


def test_utf_16_is_refused(workdir):
    """One line with what to do."""
    (workdir / "small.toml").write_bytes(CASE.encode("utf-16"))
    with pytest.raises(BadInput, match="UTF-16; save it as UTF-8") as caught:
        read_toml("small.toml")
    assert len(caught.value.problems) == 1


@pytest.mark.parametrize("content", ["[" * 100_000, '{"a": ' + "9" * 5000 + "}", "[1]", "\ufeff{"])
def test_malformed_json(workdir, content):
    """Deeply nested lists and endless numbers."""
    (workdir / "summary.json").write_text(content, encoding="utf-8")
    with pytest.raises(BadInput):
        read_json(workdir / "summary.json")
    with pytest.raises(BadInput, match="there is no file"):
        read_json(workdir / "nothing.json")
    assert read_text(workdir / "summary.json") == content.removeprefix("\ufeff")


@pytest.mark.parametrize(("text", "unit"), [("1 dB", "1"), ("10 degC", "s"), ("10 delta°C/m", "K")])
def test_units_without_a_factor_are_refused(text, unit):
    """10 degrees Celsius are not ten times 1 degree."""
    assert in_unit(text, unit) is None


def test_zero_needs_no_unit():
    """0 is the same length in all units; 1 is not, and 0 kg is no length."""
    assert si("0", "m", "x") == 0.0 and si("0.0", "K", "x") == 0.0
    for text in ("1", "0 kg"):
        with pytest.raises(BadInput, match="not a quantity in m"):
            si(text, "m", "x")
    with pytest.raises(BadInput, match=r"x\[0\] = <int> is not a quantity in m"):
        si([10**5000], "m", "x")


@pytest.mark.parametrize("every", [1e-59, 1e-30])
def test_frame_intervals_below_the_resolution_of_the_clock(every):
    """The next frame is after the present time for any interval, and is found at once."""
    schedule = Schedule(Cadence("time", every), 1e-12)
    assert schedule.due > 1e-12
    schedule.advance(2e-12)
    assert schedule.due > 2e-12


def test_frames_are_due_at_multiples():
    """At the first multiple of the interval after the present time, to the last bit."""
    schedule = Schedule(Cadence("time", 0.1), 0.0)
    for number in range(1, 1000):
        assert schedule.due == number * 0.1
        schedule.advance(schedule.due)
