"""Sweeps of real cases: rows have the numbers of the commands, runs continue, tasks of a cluster share a sweep."""

import json
import os
import re
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import sand
from sand.cli.main import main
from sand.experiments.collision_case import read_collision
from sand.experiments.sweep_cases import CASES
from sand.io.run_folder import SUMMARY, read_json, read_toml
from sand.io.sweep_files import flat

TOP = Path(__file__).parents[2]
COLLISION = """
[target]
kind = "bpca"
grains = 3
radius = "0.1 um"
[projectile]
kind = "grain"
radius = "0.1 um"
[impact]
speed = "4 m/s"
end = "rest"
[forces.contact]
"""
GAS = """
[run]
until = "20 ns"
frame_every = "1 ns"
[box]
periodic = "0.25 um"
[grains]
number = 10
radius = "10 nm"
material = "silica"
temperature = "300 K"
[forces.contact]
"""
SCATTERING = """
[projectile]
radius = "10 nm"
material = "iron"
moment = "200 A m^2/kg"
[flight]
temperature = "100 K"
speed = 1
speed_unit = "thermal"
start = "10 b_max"
[measure]
relative_error = 0.3
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in {"collision": COLLISION, "gas": GAS, "scattering": SCATTERING}.items():
        (tmp_path / f"{name}.toml").write_text(text)
    return tmp_path


@pytest.mark.compiled("contacts")
def test_collisions(place):
    """A row has the outcome that the case itself gives for its speed and seed, with files of the run and without."""
    for files in ("all", "none"):
        words = ["collision.toml", "--vary", "impact.speed=2,4", "--seeds", "2", "--files", files, "--out", files]
        assert main(["sweep", *words, "--quiet"]) == 0
        table = sand.open(files).table
        case = read_collision("collision.toml")
        for k, (speed, seed) in enumerate([(2.0, 1), (2.0, 2), (4.0, 1), (4.0, 2)]):
            case.impact.speed = speed
            expected = flat(case.run(seed)[0].to_dict())
            assert (table["impact.speed"][k], table["seed"][k]) == (speed, seed)
            for name in ("outcome", "made", "lost_rolling", "time", "steps", "gyration_after"):
                assert table[name][k] == expected[name]
    short = {**read_toml("collision.toml"), "impact": {"speed": "4 m/s", "end": "3 ns"}}
    assert CASES["collide"](short, "short").run(1, None)["time"] == pytest.approx(3e-9, rel=1e-12, abs=0.0)
    assert sand.open("all").run(1).frames[-1].time == sand.open("all").table["time"][1]


@pytest.mark.compiled("contacts")
def test_runs(place):
    """A row has the numbers of summary.json of the same case run by `sand run`."""
    assert main(["sweep", "gas.toml", "--vary", "grains.temperature=200,300", "--seeds", "4-5", "--quiet"]) == 0
    table = sand.open("gas-sweep").table
    (place / "one.toml").write_text(GAS.replace("300 K", "200 K").replace("[run]", "[run]\nseed = 5"))
    assert main(["run", "one.toml", "--quiet"]) == 0
    expected = flat(read_json(place / "one" / SUMMARY))
    assert (table["grains.temperature"][1], table["seed"][1]) == (200.0, 5)
    for name in ("outcome", "time", "steps", "mean_cluster_size", "dissipated", "drift", "largest_overlap"):
        assert table[name][1] == expected[name]
    assert not [name for name in table if name.startswith("wall")]


@pytest.mark.compiled("scattering")
def test_cross_sections(place):
    """A row has σ of `sand scatter`; the flights in the folder of a run are not computed again."""
    assert main(["sweep", "scattering.toml", "--vary", "flight.speed=1,2", "--quiet"]) == 0
    table = sand.open("scattering-sweep").table
    (place / "two.toml").write_text(SCATTERING.replace("speed = 1", "speed = 2"))
    assert main(["scatter", "two.toml", "--quiet"]) == 0
    expected = json.loads((place / "two/scattering.json").read_text())["cross_sections"][0]
    assert (table["sigma"][1], table["flights"][1]) == (expected["sigma"], expected["flights"])
    run = place / "scattering-sweep/runs" / str(table["run"][1])
    before = (run / "flights.csv").read_text()
    again = CASES["scatter"](read_toml("two.toml"), "two.toml").run(0, run)
    assert again["sigma"] == expected["sigma"] and (run / "flights.csv").read_text() == before


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize(("command", "name"), [("run", "gas"), ("collide", "collision")])
def test_a_run_continues_from_its_checkpoint(place, command, name):
    """Stopped in its middle, and again after its end but before its row: the results have the same bits."""

    class Stop(sand.Observer):
        def see(self, simulation, row):
            if row["time"] > 0.0 and simulation.steps > 20:
                raise KeyboardInterrupt

    made = lambda: CASES[command](read_toml(f"{name}.toml"), name)  # noqa: E731
    expected = made().run(1, None)
    with pytest.raises(KeyboardInterrupt):
        made().run(1, place / "stopped", [Stop()])
    assert list((place / "stopped").glob("checkpoint-*"))
    for _ in range(2):
        assert made().run(1, place / "stopped") == expected
    for path in (place / "stopped").glob("checkpoint-*"):
        path.write_bytes(b"damaged")
    with pytest.warns(UserWarning, match="the run begins again"):
        assert made().run(1, place / "stopped") == expected


STAND_INS = {
    "srun": 'for task in 1 2; do "$@" & tasks="$tasks $!"; done; worst=0\n'
    "for task in $tasks; do wait $task || worst=$?; done; exit $worst",
    "sbatch": 'echo "$@" >> submitted',
    "sand": f'exec {sys.executable} -m sand.cli.main "$@"',
}
"""Programs of a cluster, as shell scripts: `srun` starts two tasks of one job, `sbatch` notes what is submitted."""


@pytest.mark.validate
@pytest.mark.compiled("contacts")
@pytest.mark.skipif(os.name == "nt", reason="the script is one of a POSIX shell")
def test_the_script_for_slurm_arrays(place):
    """The script of the page, as two jobs of an array with two tasks each: each run has one row, the table is whole."""
    page = (TOP / "docs" / "campaigns.md").read_text("utf-8")
    script = next(text for text in re.findall(r"```sh\n(.*?)```", page, re.DOTALL) if "#SBATCH" in text)
    bin_folder = place / "bin"
    bin_folder.mkdir()
    for name, text in STAND_INS.items():
        (bin_folder / name).write_text(f"#!/bin/sh\n{text}\n")
        (bin_folder / name).chmod(stat.S_IRWXU)
    (place / "job.sh").write_text(script)
    values = "[sweep]\nseeds = 2\n[sweep.vary]\nimpact.speed = [2, 3, 4]\n"
    (place / "impact-speeds.toml").write_text(COLLISION + values)
    variables = {**os.environ, "PATH": f"{bin_folder}:{os.environ['PATH']}", "SLURM_CPUS_PER_TASK": "1"}
    jobs = [subprocess.Popen(["sh", "job.sh"], env=variables | {"SLURM_ARRAY_TASK_ID": str(k)}) for k in (1, 2)]
    assert [job.wait(timeout=300) for job in jobs] == [0, 0]
    found = sand.open(place / "speeds").table
    assert len(found["seed"]) == 6 and set(found["state"]) == {"done"} and not (place / "submitted").exists()
    assert main(["sweep", "impact-speeds.toml", "--out", "whole", "--quiet"]) == 0
    whole = sand.open(place / "whole").table
    assert all(found[name].tolist() == whole[name].tolist() for name in whole if "seconds" not in name)
