"""Sentences on the method of a simulation, made of its settings, as plain text or LaTeX with citations."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping
from typing import Any

from ..basics.descriptions import documented_unit
from ..basics.material import PAPERS, Material
from ..basics.units import exact_quantity, format_quantity
from ..config.template import keys_of, summary
from ..forces.registry import FORCES
from .references import ARTICLES, AUTHORS, LATEX

_CITED = re.compile("⟦(.*?)⟧")
_SHORT = {"SAND": AUTHORS} | {article.key: article.short() for article in ARTICLES}
LAWS = {"jkr": ("JKR", "JohnsonKendallRoberts1971"), "dmt": ("DMT", "DerjaguinMullerToporov1975")}
"""Names of contact laws, and the keys of their articles."""
SYMBOLS = LATEX | {
    "_": r"\_", "%": r"\%", "#": r"\#", "$": r"\$", "{": r"\{", "}": r"\}", "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}", "Å": r"\AA{}", "ß": r"\ss{}", "…": r"\dots{}", "’": "'", "é": r"\'e", "ö": r"\"o",
    "ä": r"\"a", "×": r"$\times$", "µ": r"$\mu$", "·": r"$\cdot$", "²": "$^2$", "³": "$^3$", "−": "$-$",
    "≥": r"$\geq$", "≤": r"$\leq$", "½": r"$\tfrac12$", "√": r"$\sqrt{}$", "°": r"$^\circ$",
}  # fmt: skip
"""Characters that LaTeX needs in another form; others beyond ASCII are written as a question mark."""
NAMES = {
    "young_modulus": "Young's modulus",
    "poisson_ratio": "Poisson's ratio",
    "rolling_limit": "critical rolling displacement",
    "specific_moment": "magnetic moment per mass",
}
"""Names of settings of which the key is not the usual one; of others it is the key with spaces."""


def cite(*keys: str) -> str:
    """A citation of articles of `sand cite`, by their keys."""
    return f"⟦{','.join(keys)}⟧"


def keys_in(text: str) -> list[str]:
    """Keys of the articles that a text cites, each once."""
    return list(dict.fromkeys(key for found in _CITED.findall(text) for key in found.split(",")))


def plain(text: str) -> str:
    """The text with names and years of what it cites."""
    return _CITED.sub(lambda found: f"({'; '.join(_SHORT[key] for key in found[1].split(','))})", text)


def latex(text: str) -> str:
    r"""The text for LaTeX, in ASCII, with `\citep` of the keys of `sand cite --bibtex`."""
    escaped = _CITED.sub(lambda found: f"\0{found[1]}\1", text)
    powers = re.sub(r"\^(-?\d+)", "\2\\1\3", re.sub(r"(\d)e([+-])0*(\d+)", r"\1×10^\2\3", escaped).replace("^+", "^"))
    ascii_only = "".join(SYMBOLS.get(one, one if one.isascii() else "?") for one in powers)
    for mark, command in {"\0": r"\citep{", "\1": "}", "\2": "$^{", "\3": "}$"}.items():
        ascii_only = ascii_only.replace(mark, command)
    return ascii_only


def value_text(value: Any, unit: str = "") -> str:
    """A value with its unit; text as it was given."""
    if isinstance(value, Mapping):  # a ramp, or fractions of materials
        return f"({named(value, {'values': unit, 'times': 's'})})"
    if isinstance(value, (list, tuple)):
        return f"({', '.join(value_text(one, unit) for one in value)})"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if not isinstance(value, (int, float)):
        return str(value)
    return exact_quantity(float(value), unit).replace(" u", " µ") if unit not in ("", "1") else f"{value:.12g}"


def named(values: Mapping[str, Any], units: Mapping[str, str], without: Collection[str] = ()) -> str:
    """Names and values of settings, separated by commas; those that are None or empty are left out."""
    kept = {key: one for key, one in values.items() if key not in without and one is not None and one not in ("", [])}
    texts = {NAMES.get(key, key.replace("_", " ")): value_text(one, units.get(key, "")) for key, one in kept.items()}
    return ", ".join(f"{name} = {text}" for name, text in texts.items())


def settings(thing: Any, *without: str) -> str:
    """All settings of a force, an integrator or a class of grains."""
    return named(thing.parameters(), thing.units, without)


def section(table: Any, *without: str) -> str:
    """All keys of a table of a case file that have a value and are used."""
    unused = {
        name for name, condition in table.conditions().items() if getattr(table, condition.word) not in condition.values
    }
    values = {name: getattr(table, name) for name in type(table).model_fields}
    values = {name: one.parameters() if hasattr(one, "parameters") else one for name, one in values.items()}
    units = {key.name: unit for key in keys_of(type(table)) if (unit := documented_unit(key.meaning))}
    return named(values, units, {*without, *unused})


def of_materials(materials: Iterable[Material]) -> Iterable[str]:
    """A sentence for each material, with the paper whose preset has the same numbers, if there is one."""
    for one in materials:
        unused = [key for key in ("specific_moment",) if not one.specific_moment]
        unused += [key for key in ("anisotropy_kind",) if one.anisotropy is None]
        found = [paper for paper in PAPERS if paper.material.but(name=one.name) == one]
        found = [paper for paper in found if paper.material.name == one.name] or found
        same = [f"; these are the numbers of the preset {paper.material.name} ({paper.source})" for paper in found]
        yield f"The material {one.name} has {settings(one, 'name', *unused)}{same[0] if len(same) == 1 else ''}."


def of_contacts(contact: Any) -> str:
    """Sentences on the contact model."""
    name, *keys = LAWS.get(contact.law, (contact.law,))
    slip = {"clamp": "stay at that limit", "reset": "return to zero"}[contact.slip]
    stiffness = {
        "frozen": "their stiffnesses are those at the equilibrium contact radius",
        "dt97": "their stiffnesses follow the contact radius",
    }[contact.stiffness]
    return (
        f"Normal forces between grains in contact follow the {name} law{f' {cite(*keys)}' if keys else ''}, "
        f"{'without' if contact.damping == 'none' else f'with {contact.damping}'} damping. Sliding, rolling and "
        f"twisting are resisted by springs up to a critical displacement {cite('DominikTielens1997')}, beyond which "
        f"displacements {slip}; {stiffness}. The settings of the contact model are: {settings(contact)}."
    )


def of_forces(forces: Iterable[Any] | None) -> Iterable[str]:
    """Sentences on all forces; None stands for contacts with the default settings."""
    contact: Any = FORCES["contact"]
    for force in [contact()] if forces is None else forces:
        if isinstance(force, contact):
            yield of_contacts(force)
            continue
        text = settings(force, "import")
        yield f"A further force is {force.name} ({force.references}){f': {text}' if text else ''}."


def of_steps(stepping: Any, taken: Mapping[str, Any]) -> str:
    """A sentence on the integrator, and on the steps taken, from the summary of a run."""
    about = summary(type(stepping)).rstrip(".").partition("; ")[0]
    text = f"The integrator is {stepping.name} ({about}): {settings(stepping, 'method')}"
    if taken.get("steps"):
        mean, whole = (format_quantity(one, "s") for one in (taken["time"] / taken["steps"], taken["time"]))
        text += f"; {taken['steps']} steps cover {whole}, {mean} each on average"
    return f"{text}."
