"""Simulations from case files, and resumed simulations from the folder of a run."""

from __future__ import annotations

import math
import shlex
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from .. import components
from ..basics.arguments import checked
from ..basics.box import Box
from ..basics.errors import BadInput, naming
from ..basics.grains import Grains
from ..basics.paths import user_path
from ..basics.state import grains_from_arrays
from ..forces.own import import_modules
from ..io.checkpoint import newest_checkpoint, read_checkpoint
from ..io.checkpoint_files import checkpoint_files
from ..io.lock import writing
from ..io.run_folder import CASE, TRAJECTORY, read_toml
from ..setup.from_file import from_trajectory, is_own_trajectory, start_from_file
from ..setup.from_frame import Start, from_frame
from ..setup.gas import gas_with_contacts
from ..simulation.condition import GIVEN
from ..simulation.simulation import Simulation
from .case import THERMAL, Case, check_case
from .key_errors import as_in_file


def read_state(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Read and check a checkpoint, as `io.checkpoint.read_checkpoint`, with the arrays of all components."""
    return read_checkpoint(path, components.groups())


def simulate(case: Case, grains: Grains, box: Box | None, **options: Any) -> Simulation:
    """Create a simulation of grains in a box with the forces, steps and seed of a case."""
    extra: dict[str, Any] = case.components()
    return Simulation(
        grains,
        case.forces.build(),
        box=box,
        stepping=case.stepping,
        neighbours=case.neighbours,
        seed=case.run.seed,
        frame_every=case.run.frame_every,
        row_every=case.run.row_every,
        checkpoint_every=case.run.checkpoint_every,
        stress=case.run.stress,
        **extra,
        **options,
    )


def simulation_from(frame: Any, case: Case) -> Simulation:
    """Create a simulation in memory from a frame of a run of this case.  Raises BadInput, as `setup.from_frame`."""
    start = from_frame(frame, case.materials_by_name())
    return simulate(case, start.grains, start.box, contacts=start.contacts)


def simulation_of(case: Case, out: str | Path | None, **options: Any) -> Simulation:
    """Build the simulation that a case describes.

    Parameters
    ----------
    out : str or Path or None
        Folder for its files; None for no files.
    options
        Further arguments of `Simulation` (observers, overwrite).

    Raises
    ------
    BadInput
        If grains, forces and box do not fit together.
    """
    if case.grains.kind == "given":
        raise BadInput("grains.kind = 'given': these grains came from a script; use `sand resume` on the folder")
    for file in (case.grains.file, *(one.file for one in case.grains.classes)):
        if file is not None and out is not None:
            _refuse_own_source(Path(file), Path(out))
    start = start_of(case)
    if case.run.stop == GIVEN:
        raise BadInput(
            "run.stop = 'given': this condition is a function of a script; use sand.resume(DIR).run(until=function)"
        )
    options |= {"out": out, "contacts": start.contacts}
    simulation = simulate(case, start.grains, start.box, **options)
    simulation.recipe, simulation.origin = case.grains.recipe(), start.note
    return simulation


def start_of(case: Case) -> Start:
    """Grains, contacts and box with which a case begins.  Raises BadInput."""
    return _of_gas(case) if case.grains.kind == "gas" else _of_file(case)


def _refuse_own_source(source: Path, out: Path) -> None:
    """Raise BadInput if a run would overwrite the files that it starts from."""
    own = source if source.is_dir() else source.parent
    if out.exists() and own.exists() and out.samefile(own):
        raise BadInput(f"{out} holds the run that the grains come from; give another folder for the new run")


def _of_gas(case: Case) -> Start:
    section = case.grains
    given = {
        name: getattr(section, name)
        for name in ("radius", "material", "moment", "charge", "classes", "extent", *THERMAL)
    }
    try:
        return gas_with_contacts(
            section.number, case.box.space, seed=case.run.seed, materials=case.materials_by_name(), **given
        )
    except BadInput as error:
        named = (f"grains.{line}" if line.startswith(("classes", "extent")) else line for line in error.problems)
        raise BadInput(map(as_in_file, named)) from None


def _of_file(case: Case) -> Start:
    section, path = case.grains, Path(case.grains.file or "")
    library = case.materials_by_name()
    with naming("grains"):
        if not is_own_trajectory(path):
            return _of_other(case, path)
        if extra := [name for name in ("radius", "length") if getattr(section, name) is not None]:
            raise BadInput(f"{extra[0]}: the trajectory {path} has it; leave {extra[0]} out")
        start = from_trajectory(path, section.frame, library)
    given = section.material if isinstance(section.material, list) else [section.material]
    there = [m.name for m in start.grains.materials]
    if "material" in section.model_fields_set and {library[name].name for name in given} != set(there):
        raise BadInput(f"grains.material: the file has {', '.join(there)}, not {', '.join(given)}; leave material out")
    if case.box.space is not None and not same_box(case.box.space, start.box):
        raise BadInput(
            f"box: it is {case.box.space.describe()} here, but {start.box.describe()} in {section.file}; "
            "leave [box] out to use the box of the file"
        )
    return start


def _of_other(case: Case, path: Path) -> Start:
    """Grains of a file that is no trajectory of SAND."""
    section, library = case.grains, case.materials_by_name()
    if not isinstance(section.material, str):
        raise BadInput("material of grains in a file must be one name; several materials are named in the file itself")
    own = library[section.material]
    one = own if "material" in section.model_fields_set else None
    given = section.radius, section.length, library, own, section.frame
    return start_from_file(path, case.box.space, one, *given)


def same_box(first: Box, second: Box) -> bool:
    """Whether two boxes have the same axes, equal to the precision of a trajectory."""
    pairs = list(zip(first.lengths, second.lengths, strict=True))
    if abs(first.tilt - second.tilt) > 1e-6 * first.shortest:
        return False
    return all((a is None) == (b is None) and (a is None or math.isclose(a, b, rel_tol=1e-6)) for a, b in pairs)  # type: ignore[arg-type]


def _case_of_checkpoint(folder: Path, meta: dict[str, Any]) -> Case:
    """The case of a run at its start; `meta` receives the end that its case.toml has now.

    Raises
    ------
    BadInput
        If case.toml has been changed in more than its end.
    """
    path = folder / CASE
    begun: dict[str, Any] = meta["case"]
    there = read_toml(path) if path.exists() else begun
    # a run that was changed may have been stopped before the changed case was written
    candidates = [begun, *([meta["case_written"]] if meta.get("case_written") else [])]
    changed = [_changed_section(each, there, str(path)) for each in candidates]
    if all(changed):
        raise BadInput(
            f"{path}: [{changed[0]}] is not what the run began with, and a run cannot change on its way; restore it, "
            f"or start a new run from the last frame: sand run CASE.toml --from {shlex.quote(str(folder))}"
        )
    case, ends = check_case(begun, str(path)), check_case(there, str(path)).run
    case.run.until, case.run.steps, case.run.stop = ends.until, ends.steps, ends.stop
    meta["until"], meta["last_step"], meta["stop"] = ends.until, ends.steps, ends.stop
    meta["case_in_file"] = there
    return case


def _changed_section(begun: dict[str, Any], there: dict[str, Any], path: str) -> str:
    """First section of a case that differs in more than the end of the run; "" if none does."""
    was, case = (check_case(content, path) for content in (begun, there))
    for name in ("until", "steps", "stop"):  # the end may be changed
        setattr(was.run, name, getattr(case.run, name))
    differ = (name for name in {**begun, **there} if begun.get(name) != there.get(name))
    return next((name for name in differ if getattr(was, name) != getattr(case, name)), "")


@checked
def resume(folder: str | Path, *, imports: Iterable[str] = (), **options: Any) -> Simulation:
    """Load the newest checkpoint of a run as a simulation; `run()` continues to the planned end.

    Parameters
    ----------
    folder : str or Path
        Folder of an earlier run; new frames and rows are appended to its files.
    imports : Iterable[str], optional
        Modules that define forces of your own, by name or file, to be imported first; SAND imports no others.
    options
        Further arguments of `Simulation` (observers, updaters).

    Returns
    -------
    Simulation
        The simulation at the checkpoint.

    Raises
    ------
    BadInput
        If there is no checkpoint, it is damaged, the case needs a force that SAND does not know, or another process
        writes to the folder.
    """
    place = user_path(folder)
    if not place.is_dir():
        raise BadInput(f"there is no folder {place}")
    import_modules(imports)
    if not checkpoint_files(place):
        advice = ""
        if (place / TRAJECTORY).exists():
            advice = f"; to start a new run from its last frame: sand run --from {shlex.quote(str(place))}"
        elif (place / CASE).exists():
            advice = f"; to start the run: sand run {shlex.quote(str(place / CASE))}"
        raise BadInput(f"{place} holds no checkpoint to resume from{advice}")
    with writing(place):
        arrays, meta = newest_checkpoint(place, components.groups())
    case = _case_of_checkpoint(place, meta)
    names = list(meta["case"]["materials"])  # in the order of the indices in the checkpoint
    library = dict(case.materials_by_name())  # exact names, of the checkpoint
    try:
        index = arrays["grains/material"]
        grains = grains_from_arrays(arrays, [library[names[i]] for i in index], meta.get("own", {}))
    except (KeyError, IndexError) as error:
        raise BadInput(f"the checkpoint in {place} does not fit its case.toml ({error})") from None
    if (grains.arrays.material != index).any():
        raise BadInput(f"the checkpoint in {place} does not fit its case.toml (materials that no grain has)")
    options |= {"out": place, "restart": (arrays, meta)}
    simulation = simulate(case, grains, case.box.space, **options)
    if case.grains.kind != "given":
        simulation.recipe = case.grains.recipe()
    end, last = (math.inf if planned is None else planned for planned in (meta["until"], meta["last_step"]))
    simulation.planned = (end, last, meta["stop"])
    return simulation
