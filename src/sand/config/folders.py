"""What a folder holds: a run, a job, a sweep or something else, and what can be done with it."""

from __future__ import annotations

import shlex
from pathlib import Path

from ..basics.errors import BadInput
from ..io import run_folder as files
from .commands import PACKINGS, command_for

CONTENTS = {"run": "a run", "scatter": "a job", "collide": "collisions", "grow": "boxes", "sweep": "a sweep"}
CONTENTS |= dict.fromkeys(PACKINGS, "packings")
"""What commands leave in a folder."""


def job_in(folder: Path) -> tuple[str | None, Path, bool]:
    """Command and case file of the run or job in a folder, and whether it has begun.  Raises BadInput."""
    one = folder / files.ONE_COLLISION  # then case.toml is the case of the simulation
    case = one if one.exists() else folder / files.CASE
    command = command_for(files.read_toml(case)) if case.exists() else None
    return command, case, command is not None and files.is_job(folder, case)


def content_of(folder: Path) -> str:
    """What a folder holds, in words, such as 'a collision of `sand collide`'."""
    if files.holds_sweep(folder):
        return "a sweep of `sand sweep`"
    try:
        command, case, begun = job_in(folder)
    except BadInput:
        return f"a damaged {files.CASE}"
    if command not in CONTENTS:
        return "other files"
    if not begun:
        return f"a case of `sand {command}` that has not been run"
    return f"{'a collision' if case.name == files.ONE_COLLISION else CONTENTS[command]} of `sand {command}`"


def without_run(folder: Path) -> str:
    """What to say of a folder without a trajectory where that of a run was expected."""
    if files.holds_sweep(folder):
        if (folder / files.SWEEP_CSV).exists():
            return f"{folder} holds a sweep; give the folder of one of its runs, {folder / files.RUNS}/NAME"
        resume = f"sand resume {shlex.quote(str(folder))}"
        return f"{folder} holds a sweep, whose table is not written yet; to continue it: {resume}"
    if (folder / files.RESULTS / files.SWEEP_CSV).exists():
        return f"{folder} holds results of sand reproduce; their table is in {folder / files.RESULTS}"
    if any((folder / name).exists() for name in (files.COLLISION, files.OUTCOMES)):
        return (
            f"{folder} holds many collisions, which keep no trajectories; for the frames of one give its seed "
            "and a folder: sand collide CASE.toml --seeds SEED --out DIR"
        )
    if any((folder / name).exists() for name in (files.SCATTERING, files.FLIGHTS)):
        return f"{folder} holds a job of sand scatter, which keeps no trajectories of grains"
    if seeds := sorted(one.name for one in folder.glob("seed-*")):
        table = f"; the table of all is {files.RESULTS_CSV}" * (folder / files.RESULTS_CSV).exists()
        return f"{folder} holds a run for each seed; give the folder of one of them, such as {seeds[0]}{table}"
    if (folder / files.LABORATORY).exists():
        return f"{folder} holds a job of sand elastic, which keeps no trajectories; its table is {files.RESULTS_CSV}"
    if (folder / files.CASE).exists():
        if (content := content_of(folder)).endswith("not been run"):
            return f"{folder} holds {content}"
        return f"{folder} has no {files.TRAJECTORY} yet; wait until its run has written a frame"
    others = "" if files.is_used(folder) else "; it is empty"
    if any(folder.glob(f"*/{files.TRAJECTORY}")):
        others = f"; its folders hold runs: sand.open('{folder}/*')"
    return f"{folder} is not the folder of a run: there is no {files.TRAJECTORY} in it{others}"
