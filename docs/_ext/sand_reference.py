"""Writes the reference pages from the source at every build, into reference/generated/ (not in git).

A list that a page needs and the source lacks (what a ledger column or a case key means) stands here, and the
build fails as soon as it no longer fits the source: nothing can be forgotten, nothing can be left over.
"""

from __future__ import annotations

import ast
import dataclasses
import importlib
import inspect
import itertools
import pkgutil
import re
import types
import typing
from pathlib import Path
from typing import Any

FOLDER = Path("reference") / "generated"


# --- docstrings to Markdown -------------------------------------------------------------------------
_HEADS = ("Args", "Raises", "Returns", "Attributes")


def escaped(text: str) -> str:
    """Plain text as Markdown; what stands in `backticks` stays code."""
    parts = re.split(r"(`[^`]+`)", text)
    return "".join(
        p if p.startswith("`") and p.endswith("`") else re.sub(r"([\\*_|<>$\[\]{}#~])", r"\\\1", p) for p in parts
    )


def cell(text: Any) -> str:
    """Text for a cell of a table."""
    return escaped(" ".join(str(text).split()))


def _blocks(lines: list[str]) -> list[str]:
    """Paragraphs, tables, lists and indented formulas of a docstring without its Args and Raises."""
    out: list[str] = []
    text: list[str] = []
    code: list[str] = []

    def flush() -> None:
        nonlocal text, code
        if text:
            table = text[0].lstrip().startswith("|") and text[-1].rstrip().endswith("|") and len(text) > 2
            out.append("\n".join(text) if table else escaped(" ".join(line.strip() for line in text)))
        if code:
            out.append("```text\n" + inspect.cleandoc("\n".join(code)) + "\n```")
        text, code = [], []

    for line in lines:
        if not line.strip():
            if code:
                code.append("")
            else:
                flush()
        elif line.startswith("    ") and (code or not text):
            code.append(line)
        elif re.match(r"`\w+`  ", line):  # a glossary: one entry per line
            flush()
            word, meaning = line.split("`  ", 1)
            out.append(f"* {word}`: {escaped(meaning.strip())}")
        else:
            if code:
                flush()
            text.append(line)
    flush()
    return out


def _section(lines: list[str]) -> list[str]:
    """The entries of an Args or Raises section as definitions."""
    entries: list[list[str]] = []
    depth = min(len(line) - len(line.lstrip()) for line in lines if line.strip())
    for line in lines:
        if not line.strip():
            continue
        if len(line) - len(line.lstrip()) == depth:
            entries.append([line.strip()])
        else:
            entries[-1].append(line.strip())
    out = []
    for entry in entries:
        name, colon, rest = " ".join(entry).partition(": ")
        if colon and re.fullmatch(r"[\w, .`]+", name):
            out.append(f"* `{name.strip('`')}`: {escaped(rest)}")
        else:
            out.append(f"* {escaped(' '.join(entry))}")
    return out


def markdown(docstring: str | None) -> str:
    """A docstring of ours (summary, text, indented formulas, Args:, Raises:) as Markdown."""
    lines = inspect.cleandoc(docstring or "").splitlines()
    parts: list[tuple[str, list[str]]] = [("", [])]
    for line in lines:
        inline = re.fullmatch(r"(Raises): +(.+)", line) or re.fullmatch(r"(Returns): +(.+)", line)
        if line.rstrip(":") in _HEADS and line.endswith(":"):
            parts.append((line[:-1], []))
        elif parts[-1][0] and line and not line.startswith(" "):
            parts.append(("", [line]))
        elif inline:
            parts.append((inline[1], ["    " + inline[2]]))
        else:
            parts[-1][1].append(line)
    out: list[str] = []
    for head, body in parts:
        if not any(line.strip() for line in body):
            continue
        if head == "":
            out += _blocks(body)
        else:
            out += [f"**{head}**", "\n".join(_section(body))]
    return "\n\n".join(out)


def of_section(docstring: str | None) -> str:
    """The docstring of a section without the name of its table, which the heading has already."""
    text = re.sub(r"^\[[\w.*]+\]: ", "", inspect.cleandoc(docstring or ""))
    return markdown(text[:1].upper() + text[1:])


def first_sentence(docstring: str | None) -> str:
    """The summary line of a docstring, with its continuation."""
    return " ".join(inspect.cleandoc(docstring or "").split("\n\n")[0].split())


def argument_notes(docstring: str | None) -> dict[str, str]:
    """The entries of the Args section by name."""
    lines = inspect.cleandoc(docstring or "").splitlines()
    if "Args:" not in lines:
        return {}
    body: list[str] = []
    for line in lines[lines.index("Args:") + 1 :]:
        if line and not line.startswith(" "):
            break
        body.append(line)
    notes = {}
    for entry in _section(body):
        found = re.match(r"\* `([\w, ]+)`: (.*)", entry, re.S)
        if found:
            notes |= dict.fromkeys(found[1].split(", "), found[2])
    return notes


# --- the public names --------------------------------------------------------------------------------
def signature(thing: Any, name: str) -> str:
    """`name(arguments)` without annotations, which the text gives in words."""
    try:
        given = inspect.signature(thing)
    except (TypeError, ValueError):
        return name
    empty = inspect.Parameter.empty
    kept = [p.replace(annotation=empty) for key, p in given.parameters.items() if key not in ("self", "cls")]
    text = name + str(given.replace(parameters=kept, return_annotation=inspect.Signature.empty))
    return re.sub(r"<class '[\w.]*?(\w+)'>", r"\1", text)


def _members(kind: type) -> list[str]:
    out = []
    for name, thing in vars(kind).items():
        if name.startswith("_"):
            continue
        inner = thing.__func__ if isinstance(thing, (classmethod, staticmethod)) else thing
        if isinstance(inner, property):
            out += [f"### `.{name}`", markdown(inner.__doc__) or f"`{kind.__name__}.{name}`"]
        elif isinstance(inner, types.FunctionType) and not isinstance(thing, staticmethod) and inner.__doc__:
            out += [f"### `.{signature(inner, name)}`", markdown(inner.__doc__)]
    return out


def api_page() -> str:
    """Every name of `sand.__all__`."""
    import sand

    out = [
        "# Public names",
        "These names are what scripts may count on. Numbers are SI floats, text with a unit, or pint and "
        "astropy quantities; `import sand` loads a name when it is first used.",
    ]
    presets, kinds, rooms = [], [], []
    for name in sand.__all__:
        try:
            thing = getattr(sand, name)
        except ModuleNotFoundError as error:
            if error.name != f"sand.{name}":
                raise
            continue  # a room that is planned but not built yet
        if name.startswith("__"):
            continue
        if isinstance(thing, types.ModuleType):
            if thing.__doc__:
                rooms.append((name, thing))
        elif isinstance(thing, sand.Material):
            presets.append(name)
        else:
            kinds.append((name, thing))
    for name, thing in kinds:
        out += [f"## `sand.{name}`"]
        if isinstance(thing, type) and issubclass(thing, BaseException):
            out += [markdown(thing.__doc__)]
            continue
        if hasattr(thing, "__members__"):
            out += [markdown(thing.__doc__), "See [how a run can end](outcomes.md)."]
            continue
        own = "__init__" in vars(thing) if isinstance(thing, type) else True
        if own:
            out += [f"```python\n{wrapped(signature(thing, f'sand.{name}'))}\n```"]
        out += [markdown(thing.__doc__)]
        if isinstance(thing, type):
            out += _members(thing)
    out += ["## Preset materials", ", ".join(f"`sand.{n}`" for n in presets) + ": see [materials](materials.md)."]
    for name, room in rooms:
        out += [f"## `sand.{name}`", markdown(room.__doc__)]
        out += _room(f"sand.{name}", room)
    return "\n\n".join(out) + "\n"


def wrapped(text: str, width: int = 88) -> str:
    """A long signature over several lines."""
    if len(text) <= width:
        return text
    head, _, rest = text.partition("(")
    depth, parts, part = 0, [], ""
    for c in rest[:-1]:
        depth += c in "([{"
        depth -= c in ")]}"
        if c == "," and depth == 0:
            parts.append(part.strip())
            part = ""
        else:
            part += c
    parts.append(part.strip())
    return head + "(\n" + "".join(f"    {p},\n" for p in parts if p) + ")"


_WRITERS = r"write_|make_|replace_|read_text|\w+(Writer|File)$"
"""Of the room of files, a script needs what reads; a simulation does the writing."""


def _room(name: str, room: types.ModuleType) -> list[str]:
    """The documented functions and classes of a room and of its modules."""
    out: list[str] = []
    if getattr(room, "__all__", None):
        for member in room.__all__:
            thing = getattr(room, member)
            if isinstance(thing, types.ModuleType):
                out += _local(f"{name}.{member}", thing)
                continue
            out += [f"### `{name}.{member}`", f"```python\n{wrapped(signature(thing, f'{name}.{member}'))}\n```"]
            out += [markdown(thing.__doc__)]
        return out
    for info in pkgutil.iter_modules(room.__path__):
        out += _local(f"{name}.{info.name}", importlib.import_module(f"{room.__name__}.{info.name}"))
    return out


def _local(name: str, module: types.ModuleType) -> list[str]:
    """The documented functions and classes that a module of a room has itself."""
    out: list[str] = []
    for member, thing in vars(module).items():
        local = getattr(thing, "__module__", None) == module.__name__
        if member.startswith("_") or not local or not thing.__doc__ or not callable(thing):
            continue
        if re.match(_WRITERS, member):
            continue
        full = f"{name}.{member}"
        out += [f"### `{full}`", f"```python\n{wrapped(signature(thing, member))}\n```", markdown(thing.__doc__)]
    return out


# --- tables --------------------------------------------------------------------------------------------
def table(head: list[str], rows: list[list[str]]) -> str:
    """A Markdown table."""
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(row) + " |" for row in rows])


def fields_page() -> str:
    """sand.schema.FIELDS."""
    from sand import schema as fields

    rows = [
        [
            f"`{f.name}`",
            f.symbol.replace("_", r"\_"),
            "(N,)" if f.width == 1 else f"(N, {f.width})",
            cell(f.unit),
            f.kind,
            cell(f.meaning),
        ]
        for f in fields.FIELDS
    ]
    kinds = "`fixed` is set once, `moving` changes at each step, `load` is worked out from the others."
    return (
        "# Quantities of a grain\n\n" + markdown(fields.__doc__) + "\n\n"
        "`simulation.grains.NAME` gives each as a read-only view of the shape below; in the kernels the same "
        f"memory has shape (width, N). {kinds}\n\n"
        + table(["name", "symbol", "shape", "unit", "kind", "meaning"], rows)
        + "\n\nBesides these, `material` (N,) numbers the entries of `grains.materials`, and `id` (N,) is the "
        "number by which the user knows the grain.\n"
    )


def materials_page() -> str:
    """sand.material.PRESETS, with what stands under each in the source."""
    from sand import material

    source = inspect.getsource(material)
    notes = dict(re.findall(r'^([A-Z]+) = Material\([^\n]*\)\n"""(.*?)"""', source, re.M | re.S))
    rows = []
    for name, m in material.PRESETS.items():
        note = notes.get(name.upper()) or f"the same as {_same(material, m)}"
        gamma = "give it" if m.surface_energy is None else f"{m.surface_energy:g}"
        code = f"`sand.{name.upper()}`" if name.upper() in notes else ""
        rows.append(
            [
                f"`{name}`",
                code,
                f"{m.density:g}",
                gamma,
                f"{m.young_modulus / 1e9:g}",
                f"{m.poisson_ratio:g}",
                f"{m.rolling_limit * 1e10:g}",
                f"{m.specific_moment:g}",
                cell(note),
            ]
        )
    head = [
        "name",
        "in scripts",
        "ρ [kg/m³]",
        "γ [J/m²]",
        "E [GPa]",
        "ν",
        "ξ_c [Å]".replace("_", r"\_"),
        "moment [A m²/kg]",
        "source",
    ]
    return (
        "# Materials\n\n"
        + markdown(material.Material.__doc__)
        + "\n\n## Presets\n\n"
        + table(head, rows)
        + '\n\nThe moment per mass is what `moment = "material"` gives to grains; without a `moment` they have none.\n'
    )


def _same(material: Any, m: Any) -> str:
    return next(n for n, other in material.PRESETS.items() if n != m.name and m.but(name=n) == other)


LEDGER = {
    "step": ("1", "steps taken since the start"),
    "time": ("s", "simulated time"),
    "translation": ("J", "kinetic energy of the centres, Σ ½ m v²"),
    "rotation": ("J", "kinetic energy of the spins, Σ ½ I ω²"),
    "normal": ("J", "stored in the contacts by the normal mode; negative when they hold together"),
    "sliding": ("J", "stored by the sliding springs"),
    "rolling": ("J", "stored by the rolling springs"),
    "twisting": ("J", "stored by the twisting springs"),
    "magnetic": ("J", "dipole–dipole energy of all pairs; 0 without dipoles"),
    "(one per force)": (
        "J",
        "energy of each other long-range force (`coulomb`, `gravitation`) and of each per-grain force under its name "
        "(`field`, `gravity`, `electric`)",
    ),
    "lost_forming": ("J", "dissipated when contacts formed"),
    "lost_breaking": ("J", "dissipated when contacts broke, what their springs held included"),
    "lost_sliding": ("J", "dissipated by sliding beyond the limit"),
    "lost_rolling": ("J", "dissipated by rolling beyond the limit"),
    "lost_twisting": ("J", "dissipated by twisting beyond the limit"),
    "lost_damping": ("J", "dissipated by the damping of the normal motion"),
    "lost_stiffness": ("J", "taken out of the springs by stiffnesses that follow the contact radius; may be negative"),
    "lost_gas": ("J", "given to the gas by drag and blows; negative where it heats the grains or its wind drives them"),
    "lost_outside": (
        "J",
        "work done on the sources of outside forces, where fields change or grains cross periodic boundaries; negative "
        "where they gave energy",
    ),
    "total": ("J", "sum of all energies and all losses; constant but for the error of the integrator"),
    "momentum_x": ("kg m/s", "momentum; also `_y`, `_z`"),
    "angular_momentum_x": ("J s", "angular momentum about the origin, spins included; also `_y`, `_z`"),
    "contacts": ("1", "contacts now"),
    "made": ("1", "contacts formed so far"),
    "moved": ("1", "times a contact slid, rolled or twisted beyond a limit in a step, so far"),
    "broken": ("1", "contacts broken so far"),
    "clusters": ("1", "groups of grains connected by contacts; a free grain is one"),
    "mean_cluster_size": ("1", "S = Σ s² n_s / Σ s n_s, the size of the cluster of a grain picked at random"),
    "largest_cluster": ("1", "grains in the largest cluster"),
}


def ledger_page() -> str:
    """The columns of sand.simulation.ledger.Ledger."""
    from sand.simulation import ledger

    columns = [c for c in ledger.Ledger(["(one per force)"]).columns if c[-2:] not in ("_y", "_z")]
    if columns != list(LEDGER):
        raise ValueError(f"the ledger's columns have changed: {sorted(set(columns) ^ set(LEDGER)) or 'order'}")
    rows = [[f"`{c}`" if "(" not in c else "(name of the force)", LEDGER[c][0], cell(LEDGER[c][1])] for c in columns]
    drift = markdown(ledger.Ledger.drift.__doc__)
    per_kt = markdown(ledger.Ledger.drift_per_kT.__doc__)
    return (
        '# The ledger\n\n`simulation.ledger["total"]` is one column over time; `ledger.csv` in the run\'s folder '
        "has the same columns, with every number written so that it reads back to the last bit.\n\n"
        + table(["column", "unit", "meaning"], rows)
        + f"\n\n`ledger.drift`: {drift}\n\n`ledger.drift_per_kT(temperature, grains)`: {per_kt}\n"
    )


def trajectory_page() -> str:
    """The docstrings of sand.io.frame, and the table of a checkpoint's arrays."""
    from sand.io import checkpoint, frame

    return (
        "# The trajectory\n\n" + markdown(frame.__doc__) + "\n\n`sand.io.trajectory.read_frames(path)` "
        "gives the frames back in SI. "
        + markdown(frame.Frame.__doc__)
        + "\n\n## Checkpoints\n\n"
        + markdown(checkpoint.__doc__)
        + "\n"
    )


def outcomes_page() -> str:
    """sand.Outcome."""
    from sand.simulation.outcome import Outcome, Result

    rows = []
    for outcome in Outcome:
        code = 3 if outcome.is_physics else 130 if outcome is Outcome.INTERRUPTED else 0
        rows.append([f"`{outcome.name}`", cell(outcome.value), str(code)])
    return (
        "# How a run can end\n\n"
        + table(["outcome", "what the user reads", "exit code"], rows)
        + "\n\nAn outcome of the physics (exit code 3) returns a result and leaves a checkpoint; an interruption "
        "writes the checkpoint and raises `sand.Interrupted`. A mistake of the user is `sand.BadInput` "
        "(exit code 2), before anything is run.\n\n## `Result`\n\n" + markdown(Result.__doc__) + "\n"
    )


# --- case files ---------------------------------------------------------------------------------------
CASE_KEYS = {
    "run.until": "end of the run, simulated time; this or `steps` is needed",
    "run.steps": "end of the run, number of steps, and then to the end of the cycle; with both, whichever comes first",
    "run.frame_every": "time between frames and rows of the ledger; a two-hundredth of the run by default",
    "run.seed": "seed of everything random: the grains, and the blows of a gas",
    "run.out": "folder of the run",
    "box.periodic": '[m] one length for a cube, or three, with "open" for an open axis; without it, open space',
    "grains.kind": "`gas`: grains at random places; `file`: those of a frame or of a body; `given`: marks the case "
    "file of a run from a script",
    "grains.number": "number of grains",
    "grains.radius": "radius of each grain; in a body from a file only where the file has none",
    "grains.material": "a preset or a name from [materials]; in a body from a file it goes before the file's own",
    "grains.moment": '[A m^2] size of each, absolute or per mass ("200 A m^2/kg"), or "material"; none by default',
    "grains.charge": "[C] charge of each grain; none by default",
    "grains.temperature": "temperature of velocities and spins",
    "grains.file": "a trajectory or body (`.gsd`), the folder of a run, extended XYZ (`.xyz`), or columns x y z or "
    "x y z r (`.txt`, `.dat`)",
    "grains.frame": "which frame of a trajectory, −1 being the last",
    "grains.length": "what one unit of the file's lengths is, such as 1 nm; 1 Å in extended XYZ, 1 m in columns",
    "grains.spins": "mean rotational energy: `kT/2`, `equipartition` (3/2 kT) or `none`",
    "materials.NAME.like": "preset to start from; without it the first four numbers below are needed",
}
FORCE_PAGES = {
    "contact": "contacts",
    "dipoles": "dipoles",
    "field": "surroundings",
    "gravity": "surroundings",
    "electric": "surroundings",
    "charges": "long-range",
    "attraction": "long-range",
    "gas": "gas",
}
"""Where each force is described."""


def _unit_in(annotation: Any, metadata: tuple = ()) -> str:
    """The unit of a key made by `sand.config.case.quantity`."""
    for note in (*metadata, *getattr(annotation, "__metadata__", ())):
        if hasattr(note, "func"):
            return inspect.getclosurevars(note.func).nonlocals.get("unit", "")
    for inner in typing.get_args(annotation):
        if unit := _unit_in(inner):
            return unit
    return ""


def _bracketed(note: str) -> str:
    found = re.search(r"\\\[([^\]\\]+)\\\]", note)
    return found[1] if found else ""


def _default(value: Any) -> str:
    if value is dataclasses.MISSING:  # made anew for each
        return "see text"
    if value is None:
        return "none"
    if isinstance(value, bool):
        return f"`{str(value).lower()}`"
    if isinstance(value, (str, int, float)):
        return f"`{value!r}`".replace("'", '"')
    return "see text"


def _model_rows(section: str, model: Any, notes: dict[str, str]) -> list[list[str]]:
    rows = []
    for key, field in model.model_fields.items():
        place = f"{section}.{key}"
        note, unit = notes.get(key), _unit_in(field.annotation, tuple(field.metadata))
        if place in CASE_KEYS:
            own = re.fullmatch(r"(?:\[(.*?)\] )?(.*)", CASE_KEYS.pop(place), re.S)
            note, unit = cell(own[2]), unit or own[1] or ""
        if note is None:
            raise ValueError(f"the case key {place} is not described in docs/_ext/sand_reference.py")
        needed = field.is_required()
        unit = unit or (_bracketed(note) if key in notes else "")
        rows.append([f"`{key}`", "**required**" if needed else _default(field.default), cell(unit), note])
    return rows


def case_page() -> str:
    """The model of sand.config.case: sections, keys, defaults, units."""
    from sand.config import case, sections
    from sand.material import Material

    head = ["key", "default", "unit", "meaning"]
    out = [
        "# Case files",
        "A case file is TOML. Numbers are SI, or text with a unit. Every key that is not listed here is a "
        "mistake, and all mistakes of a file are reported at once. In a run's folder `case.toml` is the case "
        "as it was understood, all defaults filled in, SI.",
    ]
    CASE_KEYS_LEFT = dict(CASE_KEYS)
    try:
        for name, field in case.Case.model_fields.items():
            kind = field.annotation
            if name == "materials":
                kind = typing.get_args(kind)[1]
                notes = argument_notes(Material.__doc__)
                defaults = {f.name: f.default for f in dataclasses.fields(Material)}
                out += ["## `[materials.NAME]`", of_section(kind.__doc__)]
                rows = _model_rows("materials.NAME", kind, notes)
                for row in rows[1:]:
                    default = defaults[row[0].strip("`")]
                    row[1] = "needed" if default is dataclasses.MISSING else _default(default)
                out += [table(head, rows)]
            elif name == "forces":
                out += ["## `[forces.*]`", of_section(kind.__doc__)]
                if sorted(kind.model_fields) != sorted(FORCE_PAGES):
                    raise ValueError("FORCE_PAGES does not name the forces of a case file")
                for key, inner in kind.model_fields.items():
                    law = next(t for t in typing.get_args(inner.annotation) if t is not type(None))
                    page = f"[More](../../physics/{FORCE_PAGES[key]}.md)."
                    out += [f"### `[forces.{key}]`", f"{escaped(first_sentence(law.__doc__))} {page}"]
                    out += [_settings(law, head)]
            elif name == "stepping":
                words = ", ".join(f'`"{m}"`' for m in sections.INTEGRATORS)
                out += [f"## `[{name}]`", "The integrator, by `method`; each has keys of its own."]
                for word, law in sections.INTEGRATORS.items():
                    first = [["`method`", '`"verlet"`', "", f'`"{word}"`, one of {words}']]
                    out += [
                        f'### `method = "{word}"`',
                        escaped(first_sentence(law.__doc__)),
                        _settings(law, head, first),
                    ]
            elif dataclasses.is_dataclass(kind):
                out += [f"## `[{name}]`", escaped(first_sentence(kind.__doc__)), _settings(kind, head)]
            else:
                note = "" if not field.is_required() else " This section is required."
                out += [f"## `[{name}]`", of_section(kind.__doc__) + note]
                out += [table(head, _model_rows(name, kind, {}))]
        if CASE_KEYS:
            raise ValueError(f"these case keys do not exist any more: {', '.join(CASE_KEYS)}")
    finally:
        CASE_KEYS.clear()
        CASE_KEYS.update(CASE_KEYS_LEFT)
    return "\n\n".join(out) + "\n"


def _settings(kind: Any, head: list[str], rows: list[list[str]] | None = None) -> str:
    """The keys of a settings class, from its own docstring."""
    notes = argument_notes(kind.__doc__)
    rows = list(rows or [])
    for field in dataclasses.fields(kind):
        needed = field.default is dataclasses.MISSING and field.default_factory is dataclasses.MISSING
        note = notes[field.name]
        rows.append(
            [f"`{field.name}`", "**required**" if needed else _default(field.default), cell(_bracketed(note)), note]
        )
    return table(head, rows)


# --- formulas ------------------------------------------------------------------------------------------
def constants(module: types.ModuleType) -> list[tuple[str, str]]:
    """Names in capitals that have a docstring below, with it."""
    found = []
    for node, below in itertools.pairwise(ast.parse(inspect.getsource(module)).body):
        named = isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name) and node.targets[0].id.isupper()
        if named and isinstance(below, ast.Expr) and isinstance(below.value, ast.Constant):
            found.append((node.targets[0].id, str(below.value.value)))
    return found


def formulas_page() -> str:
    """Every formula of sand.physics, module by module."""
    import sand.physics

    out = [
        "# Formulas",
        markdown(sand.physics.__doc__),
        "Each is an ordinary Python function of floats and 3-tuples, and is also what the compiled loops call.",
    ]
    for info in pkgutil.iter_modules(sand.physics.__path__):
        module = importlib.import_module(f"sand.physics.{info.name}")
        out += [f"## `sand.physics.{info.name}`", markdown(module.__doc__)]
        for name, note in constants(module):
            value = getattr(module, name)
            if isinstance(value, (int, float)):
                out += [f"* `{name}` = {value:.12g}: {escaped(' '.join(note.split()))}"]
        for name, thing in vars(module).items():
            if name.startswith("_") or getattr(thing, "__module__", None) != module.__name__:
                continue
            if isinstance(thing, type) and hasattr(thing, "_fields"):
                notes = dict(re.findall(r"^    (\w+): [^\n#]*# (.*)$", inspect.getsource(thing), re.M))
                rows = [[f"`{f}`", cell(notes.get(f, ""))] for f in thing._fields]
                out += [f"### `{name}`", markdown(thing.__doc__), table(["field", "meaning"], rows)]
            elif callable(thing) and thing.__doc__:
                out += [f"### `{signature(thing, name)}`", markdown(thing.__doc__)]
    return "\n\n".join(out) + "\n"


PAGES = {
    "api": api_page,
    "case": case_page,
    "fields": fields_page,
    "materials": materials_page,
    "ledger": ledger_page,
    "trajectory": trajectory_page,
    "outcomes": outcomes_page,
    "formulas": formulas_page,
}


def write_pages(app: Any) -> None:
    """Write what has changed, remove what is no longer made."""
    folder = Path(app.srcdir) / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.glob("*.md"):
        if old.stem not in PAGES:
            old.unlink()
    for name, page in PAGES.items():
        path, text = folder / f"{name}.md", page()
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def setup(app: Any) -> dict[str, Any]:
    """Called by Sphinx."""
    app.connect("builder-inited", write_pages)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
