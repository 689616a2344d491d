"""Fuzzed files: refused in one line or read right; no traceback, hang or excessive memory."""

import _thread
import contextlib
import faulthandler
import random
import threading
import time
import tomllib
import tracemalloc

import numpy as np
import pytest
import tomli_w

import sand
from sand.config.build import simulation_of
from sand.config.case import read_case
from sand.experiments.collision_case import read_collision
from sand.experiments.scattering.scatter_case import read_scattering
from sand.io.checkpoint import read_checkpoint
from sand.io.trajectory import read_frames

from ...physics.test_full_disk import CASE

pytestmark = pytest.mark.filterwarnings("ignore")  # mutated cases warn of much

LONGEST = 20
"""Time limit per file [s]."""
MEMORY = 100 * 2**20
"""Memory limit per file [bytes]; the files have about 10 kB."""


@contextlib.contextmanager
def within_bounds(longest=LONGEST, memory=MEMORY):
    """Fails if a file takes too long or too much memory; the block calls the yielded function before each file.

    A file that takes too long is interrupted as by Ctrl-C; if compiled code ignores that, the process ends with a
    traceback after twice the time.
    """
    timers = []

    def next_one():
        settle()
        timers.append((threading.Timer(longest, _thread.interrupt_main), time.monotonic()))
        timers[-1][0].start()
        faulthandler.dump_traceback_later(2 * longest, exit=True)
        tracemalloc.reset_peak()

    def settle():
        faulthandler.cancel_dump_traceback_later()
        while timers:
            timer, begun = timers.pop()
            timer.cancel()
            taken, most = time.monotonic() - begun, tracemalloc.get_traced_memory()[1]
            assert taken < longest, f"a file takes {taken:.3g} s"
            assert most < memory, f"a file takes {most / 2**20:.0f} MiB"

    tracemalloc.start()
    try:
        try:
            yield next_one
        except KeyboardInterrupt:
            if not timers or time.monotonic() - timers[-1][1] < longest:  # a real Ctrl-C
                raise
        settle()
    finally:
        for timer, _ in timers:
            timer.cancel()
        faulthandler.cancel_dump_traceback_later()
        tracemalloc.stop()


def test_the_time_and_memory_limits_work():
    """Too long or too much memory fails, however brief and whatever came before; everything else passes."""
    before = np.zeros(40 * 2**20)
    with within_bounds(memory=10 * 2**20) as next_one:
        for _ in range(3):
            next_one()
            np.zeros(2**20 // 8)
    for size, allowed in ((2**20, 2**20), (5 * 2**20, 10 * 2**20)):
        with pytest.raises(AssertionError, match="MiB"), within_bounds(memory=allowed) as next_one:
            next_one()
            np.zeros(size)
            next_one()
    with pytest.raises(AssertionError, match=r"a file takes .* s"), within_bounds(longest=0.3) as next_one:
        next_one()
        while True:
            time.sleep(0.01)
    assert before.size


def mutated(good, rng):
    """The bytes truncated, or with some changed, removed or inserted."""
    bad, kind, offset = bytearray(good), rng.randrange(5), rng.randrange(len(good))
    if kind == 0:
        del bad[offset:]
    elif kind == 1:
        for _ in range(rng.randrange(1, 8)):
            bad[rng.randrange(len(bad))] = rng.randrange(256)
    elif kind == 2:
        bad[offset : offset + 100] = rng.randbytes(min(100, len(bad) - offset))
    elif kind == 3:
        del bad[offset : offset + rng.randrange(1, 100)]
    else:
        bad[offset:offset] = rng.randbytes(rng.randrange(1, 50))
    return bytes(bad)


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """The folder of a run with contacts."""
    folder = tmp_path_factory.mktemp("mutated") / "run"
    position = [[(2e-8 - 1e-10) * k, 0, 0] for k in range(5)] + [[0, 2e-7, 0]]
    grains = sand.Grains(position, 1e-8, sand.IRON, moment="200 A m^2/kg", velocity=np.eye(6, 3) * 0.1)
    sand.Simulation(grains, [sand.Contact(), sand.Dipoles(cutoff="1 um")], out=folder, frame_every="10 ps").run(
        until="50 ps"
    )
    return folder


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize("count", [100, pytest.param(2000, marks=pytest.mark.validate)])
@pytest.mark.parametrize(("pattern", "read"), [("checkpoint-*.npz", read_checkpoint), ("trajectory.gsd", read_frames)])
def test_mutated_files_are_refused_or_read_right(run, tmp_path, pattern, read, count):
    """BadInput, or the content of the intact file if no relevant byte changed."""
    path = sorted(run.glob(pattern))[-1]
    good, rng, other = path.read_bytes(), random.Random(count), tmp_path / path.name
    whole = read(path)
    refused = 0
    with within_bounds() as next_one:
        for _ in range(count):
            other.write_bytes(mutated(good, rng))
            next_one()
            try:
                found = read(other)
            except sand.BadInput as error:
                assert len(error.problems) == 1
                refused += 1
                continue
            if read is read_frames:
                assert len(found) <= len(whole)
                for mine, theirs in zip(found, whole, strict=False):
                    assert (mine.position == theirs.position).all() and mine.time == theirs.time
                    assert mine.step == theirs.step and mine.materials == theirs.materials
            else:
                assert all((found[0][name] == whole[0][name]).all() for name in whole[0])
                assert found[1] == whole[1]
    assert refused > 0.8 * count  # the others hit unused bytes of the format


COLLISION = """
[target]
kind = "bpca"
grains = 4
radius = "0.3 um"
material = "silica"

[projectile]
kind = "chain"
grains = 3
radius = "0.3 um"
material = "silica"

[impact]
speed = "1 m/s"
impact_parameter = "0.3 b"
turn = true
seeds = [1, 2]

[forces.contact]
damping = "viscoelastic"
viscous_time = "1.25e-11 s"
"""
SCATTERING = """
[projectile]
radius = "10 nm"
material = "iron"
moment = "200 A m^2/kg"

[flight]
temperature = "100 K"
speed = 0.0625
speed_unit = "thermal"
start = "10 b_max"
orientation = "aligned"

[measure]
job = "trajectories"
impact_parameters = ["0.95 b_max", "1.0 b_max"]
spins = ["none", "kT/2"]
seed = 1
"""
RICH = (
    CASE
    + """
[forces.dipoles]
cutoff = "0.1 um"

[forces.field]
flux_density = "1 mT"

[forces.gas]
temperature = "100 K"
pressure = "1 mbar"

[materials.mine]
like = "silica"
surface_energy = "0.02 J/m^2"

[stepping]
method = "verlet"
steps_per_period = 30

[neighbours]
search = "all pairs"
"""
)
KINDS = {
    "run": (RICH, read_case),
    "collision": (COLLISION, read_collision),
    "scattering": (SCATTERING, read_scattering),
}
STRANGE = [
    None, True, 0, -1, 3, 10**30, 0.0, -1.5, 1e308, 1e-308, float("nan"), float("inf"), "", " ", "nm", "1", "-1 nm",
    "1e400 nm", "1 furlong", "10 nm", "5 us", "1 K", "nan K", "inf s", "iron", "öö", "a\nb", "\u0000", "[0]", [], [1],
    ["open", 1, 2], [[0, 0, 1]], {}, {"x": 1}, {"like": "iron"},
]  # fmt: skip


def mutated_case(content, rng):
    """The case with one to three entries changed, removed, renamed or moved."""
    tables = [content]
    for table in tables:
        tables += [value for value in table.values() if isinstance(value, dict)]
    for _ in range(rng.randrange(1, 4)):
        table = rng.choice([t for t in tables if t] or [content])
        if not table:
            break
        key, strange = rng.choice(list(table)), rng.choice(STRANGE)
        kind = rng.randrange(4)
        if kind == 0 or strange is None:
            del table[key]
        elif kind == 1:
            table[key[:-1] + rng.choice("aez_") if rng.random() < 0.5 else "new"] = table.pop(key)
        elif kind == 2:
            table[rng.choice(list(rng.choice(tables) or table))] = table[key]
        else:
            table[key] = strange
    return content


def read_and_build(name, path):
    """Read a case of a kind, and build the simulation if it is one."""
    found = KINDS[name][1](path)
    if name == "run" and found.grains.kind == "gas" and found.grains.number <= 200:
        simulation_of(found, None)


@pytest.mark.slow
@pytest.mark.parametrize("count", [30, pytest.param(3400, marks=pytest.mark.validate)])
@pytest.mark.parametrize("name", list(KINDS))
def test_mutated_cases_are_read_or_refused_in_lines(tmp_path, name, count):
    """Half changed as text, half as tables: a case, or lines that name the file."""
    text = KINDS[name][0]
    path, rng, refused = tmp_path / "case.toml", random.Random(count), 0
    path.write_text(text)
    read_and_build(name, path)  # the unchanged case is valid
    with within_bounds() as next_one:
        for number in range(count):
            if number % 2:
                path.write_bytes(mutated(text.encode(), rng))
            else:
                path.write_bytes(tomli_w.dumps(mutated_case(tomllib.loads(text), rng)).encode("utf-8", "replace"))
            next_one()
            try:
                read_and_build(name, path)
            except sand.BadInput as error:
                refused += 1
                assert all(line and "\n" not in line for line in error.problems), (path.read_text(), error.problems)
    assert refused > 0.4 * count
