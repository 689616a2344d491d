"""Stages that a program lacks are compiled side by side: recipes, helper processes, their end, and the progress."""

import json
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import sand
from sand.compiler import ahead
from sand.compiler.memory import free_memory
from sand.compiler.progress import compilation_notes, shown_line
from sand.compiler.recipes import NoRecipe, factory, made_from, recipe_of
from sand.compiler.stage import Stage
from sand.compiler.table import structure_of

from ...systems import KILL, stops_others

GRAINS = sand.Grains(
    np.array([[0.0, 0.0, 1e-7], [2e-7, 0.0, 1e-7], [0.0, 2e-7, 1.2e-7]]),
    [4e-8, 5e-8, 6e-8],
    sand.SILICA,
    moment=np.full((3, 3), 1e-18),
    charge=[1e-17, -2e-17, 1e-17],
)
CUBE = sand.Box.periodic(1e-6)
CONTACT = sand.Contact(damping="critical", damping_ratio=0.2, settling_time=1e-7)
DRIVEN = sand.Driven([0], velocity=[0.1, 0.0, 0.0])
FLOOR = sand.Wall([0, 0, 0], [0, 0, 1], "silica")
PROGRAMS = {
    "rigid clusters in an Ewald sum": (
        [CONTACT, sand.Dipoles(periodic="ewald")],
        {"stepping": sand.RigidClusters(), "box": CUBE},
    ),
    "a mesh": (
        [CONTACT, *(f(periodic="ewald", reciprocal="mesh") for f in (sand.Dipoles, sand.Charges))],
        {"box": CUBE},
    ),
    "Taylor series in a gas": (
        [sand.Contact(law="dmt"), sand.Dipoles(), sand.Gas(300.0, pressure=100.0)],
        {"stepping": sand.Verlet(far="taylor"), "box": CUBE},
    ),
    "walls and driven grains": (
        [sand.Contact(), sand.ScreenedCharges(1e-6), sand.Gravity([0.0, 0.0, -9.8])],
        {"walls": FLOOR, "driven": DRIVEN},
    ),
}


def stages_of(forces, settings):
    simulation = sand.Simulation(GRAINS, forces, seed=1, **settings)
    engine = simulation._engine
    found = engine.stages(engine.table_for_call())
    return [each for each in found if isinstance(each[1], Stage)]


@pytest.mark.parametrize("program", PROGRAMS)
def test_another_process_can_make_every_stage(program):
    """What is made from the recipe, as JSON, is the same kernel for the same types."""
    stages = stages_of(*PROGRAMS[program])
    assert len(stages) > 15
    for table, stage, parameters in stages:
        recipe = json.loads(json.dumps(ahead._recipe(stage, table, parameters)))
        assert recipe is not None, stage.purpose
        kernel, signature = ahead.kernel_from(recipe)
        expected = stage.to_compile(table.place, structure_of(parameters))
        assert kernel is expected[0] and signature == expected[1]


@pytest.mark.compiled("small")
def test_stages_with_formulas_of_the_user_have_no_recipe():
    """They alone are compiled by the process itself."""

    @sand.external_force(stiffness="N/m")
    def spring(grain, p):
        x, y, z = grain.position
        k = p.stiffness
        return (-k * x, -k * y, -k * z), 0.5 * k * (x * x + y * y + z * z)

    stages = stages_of([CONTACT, spring(stiffness="1 nN/m")], {})
    own = {stage.purpose for table, stage, given in stages if ahead._recipe(stage, table, given) is None}
    assert own == {"the external forces", "the energies of external forces"}


def test_a_factory_makes_things_once_and_again_from_their_recipe():
    pair = factory_of_test(2, "x")
    assert factory_of_test(2, "x") is pair
    with pytest.raises(NoRecipe):
        recipe_of(lambda: 0)
    value = (1, 2.5, None, "text", np.dtype("f8"), int, tuple)
    assert made_from(json.loads(json.dumps(recipe_of(value)))) == value


@factory
def factory_of_test(number, word):
    return (lambda: number), (lambda: word)


@pytest.mark.parametrize(
    ("files", "expected"),
    [
        ({}, None),
        ({"proc/meminfo": "MemTotal: 9 kB\nMemAvailable:  2000 kB\n"}, 2000.0 * 1024),
        (
            {
                "proc/meminfo": "MemAvailable: 2000 kB\n",
                "proc/self/cgroup": "0::/job/step\n",
                "sys/fs/cgroup/job/memory.max": "900000\n",
                "sys/fs/cgroup/job/memory.current": "500000\n",
                "sys/fs/cgroup/job/memory.stat": "anon 3\ninactive_file 100000\n",
                "sys/fs/cgroup/job/step/memory.max": "max\n",
                "sys/fs/cgroup/job/step/memory.current": "400000\n",
            },
            500000.0,
        ),
        (
            {
                "proc/self/cgroup": "9:name=systemd:/\n5:memory,cpu:/batch\n",
                "sys/fs/cgroup/memory/batch/memory.limit_in_bytes": "800\n",
                "sys/fs/cgroup/memory/batch/memory.usage_in_bytes": "900\n",
            },
            0.0,
        ),
    ],
    ids=["unknown", "machine", "version 2", "version 1"],
)
def test_free_memory_is_what_machine_and_batch_job_leave(tmp_path, files, expected):
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, "utf-8")
    assert free_memory(tmp_path) == expected


@pytest.mark.parametrize(
    ("processes", "total", "longest", "memory", "expected"),
    [(1, 30.0, 8.0, None, 0), (2, 30.0, 8.0, None, 1), (16, 30.0, 8.0, None, 3), (16, 30.0, 8.0, 1e9, 2)],
)
def test_there_are_as_many_helpers_as_cores_work_and_memory_allow(
    monkeypatch, processes, total, longest, memory, expected
):
    monkeypatch.setattr(ahead, "free_memory", lambda: memory)
    assert ahead.number_of_helpers(processes, total, longest) == expected


def test_progress_is_one_note_that_is_repeated_where_there_is_no_terminal(monkeypatch):
    noted = []
    monkeypatch.setattr("sand.compiler.progress.REPEAT", 0.01)
    counted = iter(range(10**6))
    with compilation_notes(noted.append), shown_line(lambda: f"{next(counted)} of 9"):
        while len(noted) < 3:
            time.sleep(0.01)
    assert noted[:3] == ["0 of 9", "1 of 9", "2 of 9"]
    with compilation_notes(None), shown_line(noted.clear):
        assert noted


SCRIPT = """
import json, pathlib, sys
with open(pathlib.Path(__file__).with_suffix(".log"), "a") as log:
    print("imported", file=log)
import numpy as np
import sand
from sand.compiler import ahead
from sand.compiler.jit import in_cache
from sand.integrate.stages import gather_stage, remove_broken, set_contact_limit
simulation = sand.Simulation(
    sand.Grains(np.array([[0.0, 0.0, 0.0], [1e-6, 0.0, 0.0]]), 1e-8, sand.IRON), [sand.Contact()]
)
engine = simulation._engine
table = engine.table_for_call()
stages = [(table, each, ()) for each in (remove_broken, gather_stage(False), set_contact_limit)]
ahead.WORTH_HELPERS, ahead.LONGEST_WAIT = 0.0, 60.0
if "alone" in sys.argv:
    ahead._start = None  # no helper may start
else:
    ahead.compile_if_free = in_cache  # this process compiles nothing
ahead.compile_ahead(stages, 1 if "alone" in sys.argv else 2)
print(json.dumps([each.is_compiled(table) for _, each, _ in stages]))
"""
"""Has no main guard, and writes a line into a file whenever it is imported."""


def run_script(folder, *words, **environment):
    script = folder / "script.py"
    script.write_text(SCRIPT, "utf-8")
    env = os.environ | {"SAND_CACHE": str(folder / "cache")} | environment
    command = [sys.executable, "-W", "ignore", script, *words]
    return subprocess.run(command, cwd=folder, env=env, capture_output=True, text=True)


@pytest.mark.compiled("small")
def test_helpers_compile_what_is_missing_and_import_nothing_of_the_user(tmp_path):
    """A file of the user with the name of a library is in the folder of the script, and in the current one."""
    (tmp_path / "filelock.py").write_text("raise SystemExit('a file of the user was imported')")
    done = run_script(tmp_path, PYTHONSAFEPATH="1")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [True] * 3
    assert (tmp_path / "script.log").read_text() == "imported\n"


def test_one_process_compiles_stages_when_they_are_called(tmp_path):
    done = run_script(tmp_path, "alone")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout) == [False] * 3


WAITS = """
import sys, time
import sand
from sand.compiler import ahead
recipe = {"stage": {"factory": "time:sleep", "arguments": [60], "named": {}, "path": []}, "places": {}, "parameters": 0}
with ahead._helpers([recipe], 2):
    time.sleep(0.5)
    time.sleep(60)
"""
"""Has two helpers that take a minute for what they make."""


def helpers_of(process):
    """Numbers of the children of a process that live."""
    listed = subprocess.run(["ps", "-o", "pid=", "--ppid", str(process)], capture_output=True, text=True)
    return [int(word) for word in listed.stdout.split()]


def lives(process):
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(process)], capture_output=True, text=True).stdout.strip()
    return bool(state) and not state.startswith("Z")


@stops_others
@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="lists the children of a process")
@pytest.mark.parametrize("number", [signal.SIGINT, KILL], ids=["Ctrl-C", "killed"])
def test_helpers_end_with_their_parent(tmp_path, number):
    """Ctrl-C is sent to the group of processes of the terminal."""
    program = subprocess.Popen([sys.executable, "-c", WAITS], start_new_session=True, stderr=subprocess.DEVNULL)
    try:
        while len(found := helpers_of(program.pid)) < 2:
            assert program.poll() is None
            time.sleep(0.05)
        time.sleep(0.2)
        os.killpg(program.pid, number)
        program.wait(10)
        deadline = time.monotonic() + 20.0  # an interpreter that has just begun reads its input first
        while any(map(lives, found)) and time.monotonic() < deadline:
            time.sleep(0.05)
        assert not any(map(lives, found))
    finally:
        program.kill()
