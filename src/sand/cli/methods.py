"""`sand methods DIR`: a paragraph on the method of a run or job, with all numbers and references."""

from __future__ import annotations

import contextlib
import itertools
import warnings
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

import click

from ..basics.errors import BadInput
from ..config.commands import PACKINGS
from ..config.folders import job_in
from ..io import run_folder as files
from . import options, parsing, report
from .references import ARTICLES, bibtex, software

Sentences = Iterable[str]


def _one_form(values: parsing.OptionValues) -> Iterable[str]:
    if values["as_latex"] and values["as_bibtex"]:
        yield "--latex and --bibtex exclude each other: print one, then the other"


@parsing.command("methods", short_help="Describe the method of a run or job for a paper.", check=_one_form)
@click.argument("folder", metavar="DIR", type=options.RUN)
@click.option("--latex", "as_latex", is_flag=True, help="Print LaTeX; its citations are those of --bibtex.")
@click.option("--bibtex", "as_bibtex", is_flag=True, help="Print what the paragraph cites as a file of BibTeX.")
@options.imports
@options.as_json
@options.debug
def command(folder: str, as_latex: bool, as_bibtex: bool, as_json: bool) -> None:
    """Describe the method of a run, of collisions, of boxes of `sand grow`, of a job of `sand scatter` or of a sweep.

    Prints one paragraph with all numbers, made of what is stored in the folder DIR: materials, forces, integrator,
    steps, grains, seeds and version. References that are named in full are not in the file of --bibtex.

    \b
    sand methods run1 --latex > method.tex
    sand methods run1 --bibtex > method.bib
    """
    from .method_text import keys_in, latex, plain

    results, sentences = described(Path(folder))
    text, version = " ".join(sentences), results.get("sand")
    cited = [one for one in ARTICLES if one.key in keys_in(text)]
    if as_json:
        references = [{"reference": one.text(), "bibtex": one.bibtex()} for one in cited]
        content = {"text": plain(text), "latex": latex(text), "references": references}
        report.emit({"folder": folder, "version": version, **content, "bibtex": bibtex(cited, version)})
    elif as_bibtex:
        click.echo(bibtex(cited, version))
    else:
        report.write_line(latex(text) if as_latex else plain(text))
        if not as_latex:
            for one in cited:
                report.write_line(f"  {one.text()}")


def described(folder: Path) -> tuple[dict[str, Any], list[str]]:
    """Results in the folder of a run or job that name the version, and sentences on its method.

    Raises
    ------
    BadInput
        If it has neither run nor job.
    """
    if not folder.is_dir():
        raise BadInput(f"there is no folder {folder}")
    kind, case, begun = job_in(folder)
    if kind not in KINDS or not begun:
        known = ", ".join(map(str, KINDS))
        raise BadInput(f"{folder} holds nothing that was computed by sand {known}; give the folder of a run or job")
    names = (files.SUMMARY, files.COLLISION, files.SCATTERING, files.LABORATORY)
    places = [*(folder / name for name in names), *sorted(folder.glob(f"seed-*/{files.SUMMARY}"))]
    results = next((found for place in places if "sand" in (found := _content(place))), {})
    if (folder / files.SWEEP_CSV).exists():
        from ..io.sweep_files import read_sweep

        results = {"sand": " and ".join(sorted(set(read_sweep(folder)["version"].tolist())))}
    return results, [_software(results), *KINDS[kind](folder, case)]


def _content(path: Path) -> dict[str, Any]:
    """Content of a file of results; empty if there is none yet.  Raises BadInput if it is damaged."""
    return files.read_json(path) if path.exists() else {}


def _software(results: dict[str, Any]) -> str:
    """The version that computed, as the results in the folder say."""
    from .method_text import cite

    version = results.get("sand")
    name = software(version) if version else f"{software(None)}, of a version that the folder does not name"
    others = ", ".join(f"{package} {number}" for package, number in results.get("versions", {}).items())
    with_others = f", with {others}" if others else ""
    return f"The simulations were done with {name} {cite('SAND', 'DominikNuebold2002')}{with_others}."


def _common(case: Any, materials: Iterable[Any], results: dict[str, Any], forces: Any) -> Sentences:
    """Materials, given or by name, forces and integrator of a case."""
    from .method_text import of_forces, of_materials, of_steps

    library = _library(case)
    used = [library[one] if isinstance(one, str) else one for one in materials]
    yield from of_materials({one.name: one for one in used}.values())
    yield from of_forces(forces)
    yield of_steps(case.stepping, results)


def _names(given: Any) -> list[str]:
    """Names of materials: one, several, or fractions."""
    return [given] if isinstance(given, str) else list(given or [])


def _library(case: Any) -> dict[str, Any]:
    """Presets and the materials of a case, by name."""
    from ..config.case import library_of

    return library_of(case.materials)


def _names_none(body: Any) -> bool:
    """Whether the materials of a body are those of its file, because the case names none."""
    return body.kind == "file" and "material" not in body.model_fields_set


def _of_body(body: Any, make: Callable[[], Any]) -> list[Any]:
    """Materials of a body, by name, or of what `make` reads from its file; none if that is gone."""
    if not _names_none(body):
        return [body.material]
    with contextlib.suppress(BadInput), warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of how the file is understood
        made = make()
        return list(getattr(made, "grains", made).materials)
    return []


def _section_of(body: Any) -> str:
    """What a case says of a body; no material that is a default in place of that of its file."""
    from .method_text import section

    if not _names_none(body):
        return section(body)
    return f"{section(body, 'material')}, with the materials of that file"


def _of_run(folder: Path, path: Path) -> Sentences:
    from ..config.case import read_case

    case, results = read_case(path), _content(folder / files.SUMMARY)
    yield from _of_case(case, results, "" if case.grains.kind == "gas" else _radii(folder))
    yield f"Random numbers have the seed {case.run.seed}."
    if results:
        yield f"The error of the energy balance was {results['drift']:.2g} of the dissipated and kinetic energy."
    else:
        yield "The run has not ended."


def _of_case(case: Any, results: dict[str, Any], radii: str = "") -> Sentences:
    """Sentences on a case of `sand run`: grains, box, materials, forces, components, integrator and end."""
    from .method_text import section, settings

    grains, number = case.grains, case.grains.number or results.get("grains")
    origin = {"gas": "a gas", "file": "of a file", "given": "placed by a script"}[grains.kind]
    count = f"{number} grains{radii}" if number else f"grains{radii}"
    unnamed = ("material",) if _names_none(grains) else ()
    yield f"The initial state was {count}, {origin}: {section(grains, 'kind', 'number', 'classes', *unnamed)}."
    for one in grains.classes:
        yield f"A class of its members had: {settings(one)}."
    where = "open space" if case.box.space is None else f"a box, {case.box.space.describe().replace(' um', ' µm')}"
    yield f"They moved in {where}."
    used = _names(None if unnamed else grains.material) + [
        name for one in grains.classes for name in _names(one.material)
    ]
    yield from _common(case, [*used, *case.materials], results, case.forces.build())
    for name, components in case.components().items():
        for one in components if isinstance(components, list) else [components] * (components is not None):
            yield f"A part of the simulation, {name}, had: {settings(one)}."
    yield f"The end was {section(case.run, 'out', 'seed', 'frame_every', 'row_every', 'checkpoint_every', 'stress')}."


def _radii(folder: Path) -> str:
    """Radii in the first frame of a run; nothing if it has none."""
    from ..basics.units import format_quantity
    from ..io.trajectory import Frames

    path = folder / files.TRAJECTORY
    if not path.exists() or not len(frames := Frames(path)):
        return ""
    ends = [format_quantity(float(one), "m") for one in (frames[0].radius.min(), frames[0].radius.max())]
    return f" of radius {' to '.join(dict.fromkeys(ends))}"


def _of_growth(folder: Path, path: Path) -> Sentences:
    from ..config.case import check_case
    from ..experiments.dilute_case import check_dilute, is_dilute
    from ..experiments.growth_case import DEFAULT_SEEDS, read_growth

    content, seeds = read_growth(path)
    if is_dilute(content):
        checked = check_dilute(content, str(path))
        motion = "with thermal speeds, spins and orientations"
        if checked.method.between == "own":
            motion = "that keep momentum and spin from one to the next"
        touch = "joined at the touch"
        if checked.method.hits == "resolve":
            touch = "were followed with contact steps of all grains until at rest"
        yield (
            f"Growth was followed by a Monte Carlo of encounters of two bodies {motion}, at {checked.density:.3g} "
            f"bodies per m³, in populations that differ by the seed alone: seeds {_seeds(seeds or DEFAULT_SEEDS)}. "
            f"Bodies flew as rigid ones with the forces of their grains, and those that touched {touch}."
        )
        checked.case.grains.extent = None  # positions do not matter
        yield from _of_case(checked.case, {})
        return
    boxes = [files.read_json(one) for one in sorted(folder.glob(f"seed-*/{files.SUMMARY}"))]
    yield f"Growth was followed in boxes that differ by the seed alone: seeds {_seeds(seeds or DEFAULT_SEEDS)}."
    yield from _of_case(check_case(content, str(path)), {})
    if boxes:
        drift = max(box["drift"] for box in boxes)
        yield (
            f"{len(boxes)} boxes have run; the largest error of the energy balance was {drift:.2g} of the dissipated "
            "and kinetic energy."
        )


def _seeds(seeds: list[int]) -> str:
    """Seeds as text; three or more in a row as a range."""
    in_a_row = len(seeds) > 2 and seeds == list(range(seeds[0], seeds[-1] + 1))
    return f"{seeds[0]} to {seeds[-1]}" if in_a_row else ", ".join(map(str, seeds))


def _of_collisions(folder: Path, path: Path) -> Sentences:
    from ..experiments.collision_case import read_collision

    case, outcomes = read_collision(path), _content(folder / files.COLLISION)
    yield (
        f"Collisions of two bodies were simulated for the seeds {_seeds(case.impact.seeds)} of aggregates and "
        f"orientations; {len(outcomes.get('collisions', []))} are finished."
    )
    yield from _collision(case, _content(folder / files.SUMMARY))


def _collision(case: Any, summary: dict[str, Any]) -> Sentences:
    """Sentences on a case of `sand collide`, or of sequential collisions."""
    from .method_text import section

    bodies = {name: body for name in ("target", "projectile") if (body := getattr(case, name)) is not None}
    for name, body in bodies.items():
        yield f"The {name} was: {_section_of(body)}."
    if len(bodies) == 1:
        yield f"It collided with a copy of itself, and so did what grew from it: {section(case.sequence)}."
    yield f"They collided with {section(case.impact, 'seeds', 'out')}; b, c: sums of outer, characteristic radii."
    library, seed = _library(case), case.impact.seeds[0]
    of_bodies = [_of_body(body, partial(body.build, library, seed)) for body in bodies.values()]
    used = [*itertools.chain(*of_bodies), *case.materials]
    yield from _common(case, used, summary, case.physics()[0])


def _of_loading(folder: Path, path: Path) -> Sentences:
    from ..experiments.laboratory_case import check_laboratory

    case = check_laboratory(files.read_toml(path), str(path))
    runs = _content(folder / files.LABORATORY).get("runs", [])
    seeds, done = case.section.seeds, "measured at rest" if case.section.kind == "elastic" else "loaded"
    yield (
        f"Packings that differ by the seed alone were {done}, seeds {_seeds(seeds)}; {len(runs)} of {len(seeds)} runs "
        "are finished."
    )
    yield from _loading(case)


def _loading(case: Any) -> Sentences:
    """Sentences on a case of `sand compress`, `stretch`, `shear` or `elastic`."""
    from .method_text import section

    body, library = case.aggregate, _library(case)
    yield f"The packing was: {_section_of(body)}."
    yield f"What was done, {case.section.kind}: {section(case.section, 'seeds', 'out')}; t_c is the time of a contact."
    used = _of_body(body, partial(body.packing, library, case.section.seeds[0]))
    yield from _common(case, [*used, *case.materials], {}, case.physics())


def _of_scattering(folder: Path, path: Path) -> Sentences:
    from ..experiments.scattering.scatter_case import read_scattering

    case, flights = read_scattering(path)
    return _scattering(case, flights)


def _scattering(case: Any, flights: list[Any]) -> Sentences:
    """Sentences on a case of `sand scatter`."""
    from ..basics.units import format_quantity
    from .method_text import of_materials, section

    yield f"The projectile was: {section(case.projectile)}."
    yield f"The target was: {section(case.target)}." if case.target else "The target was like the projectile."
    ends = [format_quantity(one, "m") for one in (f(each.distance for each in flights) for f in (min, max))]
    yield f"Flights of the projectile had: {section(case.flight)}; they began at {' to '.join(dict.fromkeys(ends))}."
    unused = {"cross-section": ("cells", "per_cell"), "trajectories": ("cells", "per_cell", "relative_error")}
    yield f"What was computed: {section(case.measure, 'out', *unused.get(case.measure.job, ('relative_error',)))}."
    yield "The integrator was the Runge-Kutta scheme 8(5,3) with a step chosen from its error (Hairer et al. 1993)."
    bodies = [body for one in flights[:1] for body in (one.projectile, one.target)]
    yield from of_materials({m.name: m for body in bodies for m in body.materials}.values())


MOST_VALUES = 12
"""Values of a key of a sweep that are listed."""


def _of_sweep(folder: Path, path: Path) -> Sentences:
    from ..experiments.sweep_job import SweepJob
    from ..io.sweep_files import DONE, FAILED, cell_of
    from .method_text import value_text

    job = SweepJob(path, folder, resume=True)
    command, swept, rows = job.command, job.kind(job.content, str(path)), job.all_rows()
    varied: dict[str, dict[Any, None]] = {}
    for values, seed, _ in rows.values():
        for key, value in (values | {"seed": seed}).items():
            if value == value and value != "":  # rows without the key have an empty cell
                varied.setdefault(key, {})[cell_of(value)] = None
    varied["seed"] = varied.pop("seed")
    texts = []
    for name, found in varied.items():
        ordered = list(found) if any(isinstance(value, str) for value in found) else sorted(found)
        several = f"{name} of {len(found)} values"
        texts.append(f"{name} = {value_text(ordered)}" if len(found) <= MOST_VALUES else several)
    states = [state for *_, state in rows.values()]
    counts = [
        f"{number} {what}" for what, state in (("failed", FAILED), ("left", "")) if (number := states.count(state))
    ]
    done = ", ".join([f"{states.count(DONE)} of {len(states)} runs are done", *counts])
    yield f"A sweep of {swept.NAME} varied {', '.join(texts)} (SI units); {done}."
    yield "All else, and values that are not varied, are those of this case:"
    if command in ("collide", "sequence"):
        yield from _collision(swept.case, {})
    elif command == "scatter":
        yield from _scattering(swept.case, swept.case.flights())
    elif hasattr(swept.case, "aggregate"):
        yield from _loading(swept.case)
    else:
        yield from _of_case(swept.case, {})


KINDS: dict[str | None, Callable[[Path, Path], Sentences]] = {
    "run": _of_run,
    "collide": _of_collisions,
    "grow": _of_growth,
    "scatter": _of_scattering,
    **dict.fromkeys(PACKINGS, _of_loading),
    "sweep": _of_sweep,
}
"""What describes the folder of each command; the arguments are the folder and its case file."""
