"""Rows of the table, how they are judged, printed and told with the machine they were measured on."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib import metadata
from pathlib import Path
from typing import Any

import numpy as np

import sand
from sand.simulation.run_writer import versions

from . import lammps, machine
from .timing import Pair

KEYS = (
    *("name", "ours", "unit", "target", "peer", "peer_name", "ratio", "ratio_asked"),
    *("share", "share_asked", "limit", "note", "met"),
)
"""Of every row."""


def row(
    name: str,
    ours: float | Pair,
    unit: str,
    target: float | None = None,
    *,
    scale: float = 1.0,
    of: str = "",
    ratio_asked: float | None = None,
    share: float | None = None,
    share_asked: float | None = None,
    limit: str = "",
    note: str = "",
) -> dict[str, Any]:
    """One line of the table.

    Args:
        ours: what it costs, or a pair of it and the peer's, less is better.
        target: the most that ours should be, in `unit`.
        scale: what times `ours` is in `unit`.
        of: the peer.
        ratio_asked: how many times less than the peer's ours should be, at least.
        share: of the limit of this machine, `limit`.
        share_asked: the least that it should be.
        note: what else there is to say.

    `met` is None where nothing is asked, or what is asked needs a peer that is not there.
    """
    pair = ours if isinstance(ours, Pair) else Pair(ours, np.nan, np.nan)
    mine = scale * pair.ours
    asked = [(target, lambda t: mine <= t), (share_asked, lambda s: share is not None and share >= s)]
    if np.isfinite(pair.ratio):
        asked.append((ratio_asked, lambda r: pair.ratio >= r))
    judged = [bool(fits(wish)) for wish, fits in asked if wish is not None]
    other = (scale * pair.peer, of, pair.ratio) if np.isfinite(pair.ratio) else (None, "", None)
    told = (name, mine, unit, target, *other, ratio_asked, share, share_asked, limit, note)
    return dict(zip(KEYS, (*told, all(judged) if judged else None), strict=True))


def _number(value: float | None, width: int, form: str = ".3g") -> str:
    return f"{'-' if value is None else format(value, form):>{width}}"


def line(one: dict[str, Any]) -> str:
    """One row as text."""
    asked = f"{_number(one['ratio'], 7)} {_number(one['ratio_asked'], 6)}"
    share = "-" if one["share"] is None else f"{one['share']:.0%}"
    wished = "" if one["share_asked"] is None else f" (≥ {one['share_asked']:.0%})"
    mark = "  MISSED" if one["met"] is False else ""
    cost = f"{_number(one['ours'], 9)} {_number(one['target'], 8)}  {one['unit']:16} {_number(one['peer'], 9)} {asked}"
    words = f"{one['limit'] + wished:18} {one['peer_name']:24} {one['note']}{mark}"
    return f"{one['name']:44} {cost}  {share:>5} {words}".rstrip()


HEAD = (
    f"{'what':44} {'ours':>9} {'target':>8}  {'unit':16} {'peer':>9} {'ratio':>7} {'asked':>6}"
    f"  {'share':>5} {'of limit':18} peer"
)


def about() -> dict[str, Any]:
    """The machine, its limits and load, versions and commit."""
    packages = versions() | {"scipy": metadata.version("scipy"), "sand": sand.__version__}
    if lammps.version():
        packages["lammps"] = lammps.version()
    return {
        "machine": f"{machine.processor()}, {os.cpu_count()} cores, {platform.system()}",
        "load": os.getloadavg()[0],
        "limits": machine.limits(),
        "versions": packages,
        "commit": commit(),
    }


def commit() -> str:
    """The commit that is measured, with a + where files differ from it; "" outside of a repository."""
    top = Path(__file__).parents[1]

    def git(*words: str) -> str:
        try:
            done = subprocess.run(["git", "-C", str(top), *words], capture_output=True, text=True)
        except FileNotFoundError:
            return ""
        return done.stdout.strip()

    return git("rev-parse", "--short", "HEAD") + ("+" if git("status", "--porcelain", "-uno") else "")


def tell_about(told: dict[str, Any]) -> None:
    """Print what `about` found."""
    print(f"{told['machine']}; load {told['load']:.2f} at the start; commit {told['commit']}")
    print(", ".join(f"{name} {version}" for name, version in told["versions"].items()))
    print("one core: " + ", ".join(f"{value:.3g} {name}" for name, value in told["limits"].items()))
