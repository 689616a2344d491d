"""Checks of the arrays and numbers of a checkpoint, before they reach compiled code, which checks no index.

One table has the name, data type, shape and allowed values of every array. A matching checksum does not suffice: it
shows that a file is unchanged, not that SAND wrote it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..basics.arrays import KEPT_ROWS, SAVED_BODIES, SAVED_LONG_RANGE, SAVED_WALLS, body_arrays
from ..basics.errors import BadInput
from ..basics.schema import FIELDS
from ..basics.state import (
    CLOCK,
    CONTACTS,
    COUNT,
    CUTOFF,
    GRAIN1,
    GRAIN2,
    LEAST_CLOCK,
    LOST,
    PAIRS,
    STAGE,
    STEPS,
    TIME,
    WALL_CONTACTS,
)


class ArraySpec(NamedTuple):
    """Data type, shape and allowed values of one array of a checkpoint."""

    dtype: str
    # sizes: an integer, N grains, C contacts, P pairs, W walls, K contacts with walls; a tuple: one of these; None: any
    shape: tuple[Any, ...]
    rule: str = "finite"  # allowed values: a name in RULES
    required: bool = True


STORED = {
    "clock": ArraySpec("f8", (tuple(range(LEAST_CLOCK, len(CLOCK) + 1)),), "no nan"),
    "count": ArraySpec("i8", (len(COUNT),), "any"),
    "lost": ArraySpec("f8", (len(LOST),)),
    "cutoff": ArraySpec("f8", (len(CUTOFF),), "not below 0"),
    "order": ArraySpec("u4", ("N",), "order", required=False),
    "ledger": ArraySpec("f8", (None, None)),
    **{f"grains/{field.name}": ArraySpec("f8", ("N",) if field.width == 1 else (field.width, "N")) for field in FIELDS},
    **{f"grains/{name}": ArraySpec("f8", ("N",), "above 0") for name in ("radius", "mass", "inertia")},
    "grains/own": ArraySpec("f8", (None, "N")),
    "grains/material": ArraySpec("u4", ("N",), "any"),
    "grains/id": ArraySpec("u4", ("N",), "ascending"),
    "grains/image": ArraySpec("i4", (3, "N"), "any", required=False),  # earlier versions did not count crossings
    "contacts/pair": ArraySpec("u4", (2, "C"), "grains"),
    **{
        f"contacts/{name}": ArraySpec("f8", (3, "C"))
        for name in ("pointer1", "pointer2", "force", "torque1", "torque2")
    },
    **{f"contacts/{name}": ArraySpec("f8", ("C",)) for name in ("twist", "formed")},
    "contacts/constants": ArraySpec("f8", (None, (1, "C"))),
    "contacts/lost": ArraySpec("f8", ((4, 6), "C")),
    "contacts/damping": ArraySpec("f8", (12, (0, "C"))),
    "contacts/kept": ArraySpec("f8", (KEPT_ROWS, "C"), required=False),  # earlier versions kept no displacements
    "contacts/flag": ArraySpec("u1", ("C",), "any"),
    "contacts/every_step": ArraySpec("u1", ("C",), "boolean"),
    "contacts/side": ArraySpec("u4", ("2C",), "order"),
    "contacts/start": ArraySpec("u4", ("N+1",), "starts"),
    "pair_list/pair": ArraySpec("u4", (2, "P"), "grains"),
    "pair_list/in_contact": ArraySpec("u1", ("P",), "boolean"),
    "pair_list/step": ArraySpec("f8", ((1, "P"),), "no nan"),
    "pair_list/break_overlap": ArraySpec("f8", ((1, "P"),)),
    "pair_list/anchor": ArraySpec("f8", (3, "N"), "no nan"),
    **{f"long_range/{name}": ArraySpec("f8", (3, (0, "N"))) for name in SAVED_LONG_RANGE},
    "long_range/anchor": ArraySpec("f8", (3, (0, "N")), "no nan"),
    **{f"walls/{name}": ArraySpec("f8", (3, "W"), required=False) for name in SAVED_WALLS},
    "walls/work": ArraySpec("f8", ("W",), required=False),
    "wall_contacts/pair": ArraySpec("u4", (2, "K"), "grain and wall", required=False),
    **{
        f"wall_contacts/{name}": ArraySpec("f8", (3, "K"), required=False)
        for name in ("pointer1", "pointer2", "force", "torque1")
    },
    **{f"wall_contacts/{name}": ArraySpec("f8", ("K",), required=False) for name in ("twist", "formed")},
    "wall_contacts/constants": ArraySpec("f8", (None, "K"), "no nan", required=False),  # a wall has an infinite radius
    "wall_contacts/lost": ArraySpec("f8", ((4, 6), "K"), required=False),
    "wall_contacts/damping": ArraySpec("f8", (12, (0, "K")), required=False),
    "wall_contacts/flag": ArraySpec("u1", ("K",), "any", required=False),
    **{
        f"bodies/{name}": ArraySpec("f8", ("N",) if array.ndim == 1 else (len(array), "N"), "no nan", required=False)
        for name, array in body_arrays(1)._asdict().items()
        if name in SAVED_BODIES
    },
    "bodies/first": ArraySpec("u4", ("N",), "bodies", required=False),
    "bodies/asleep": ArraySpec("u1", ("N",), "boolean", required=False),
}
"""All arrays of a checkpoint."""
NUMBERS = {"steps": int, "time": float, "output_time": float, "wall_seconds": float, "temperature": float}
"""Required numbers of `meta.json` with their types; an integer is accepted for either."""
PLANNED_END = {"until": float, "last_step": int}
"""Numbers of `meta.json` that may be null."""
TABLES = {"choices": dict, "case": dict, "ledger": list}
"""Tables of `meta.json`."""
CHANGES = {"case_written": dict, "updaters": list, "own": dict, "wall_times": dict}
"""Entries of `meta.json` that a run may lack: the case in case.toml, names of updaters, units of own quantities, and
parts of the wall time in older files."""


def check_state(arrays: Mapping[str, np.ndarray], meta: Mapping[str, Any]) -> None:
    """Check that a state can be resumed: every array exists with the right type and shape, every index is in range.

    Parameters
    ----------
    arrays : Mapping[str, ndarray]
        Arrays of a checkpoint, by name.
    meta : Mapping[str, Any]
        Its metadata.

    Raises
    ------
    BadInput
        For the first error found, in one line.
    """
    _check_meta(meta)
    sizes = _sizes(arrays)
    for name, spec in STORED.items():
        if name in arrays:
            _check_array(name, arrays[name], spec, sizes)
        elif (
            spec.required
            or ("walls/work" in arrays and name.startswith(("walls/", "wall_contacts/")))
            or ("bodies/first" in arrays and name.startswith("bodies/"))
        ):
            raise BadInput(f"there is no array {name!r}")
    if len(meta.get("own", {})) != len(arrays["grains/own"]):
        raise BadInput(f"'grains/own' has {len(arrays['grains/own'])} rows, but meta.json names a different number")
    _check_counters(arrays, meta)
    _check_lists(arrays["contacts/pair"], arrays["contacts/side"], arrays["contacts/start"], sizes)
    if arrays["ledger"].shape[1] != len(meta.get("ledger", ())):
        raise BadInput(f"'ledger' has {arrays['ledger'].shape[1]} columns, but meta.json names a different number")


def _check_meta(meta: Mapping[str, Any]) -> None:
    for name, kind in {**NUMBERS, **PLANNED_END}.items():
        value: Any = meta.get(name)
        if value is None and name in PLANNED_END and name in meta:
            continue
        is_number = isinstance(value, (int, kind)) and not isinstance(value, bool)
        if not (is_number and 0 <= value < 1e300):
            raise BadInput(
                f"its meta.json has {name} = {value!r}, which is no {'number of steps' if kind is int else 'number'}"
            )
    for name, kind in CHANGES.items():
        if name in meta and not isinstance(meta[name], kind):
            raise BadInput(f"its meta.json has {name} = {meta[name]!r}, which is not a {kind.__name__}")
    chosen = meta.get("chosen_cadence")
    if chosen is not None and not (
        isinstance(chosen, list)
        and len(chosen) == 2
        and all(isinstance(each, (int, float)) and 0.0 < each < 1e300 for each in chosen)
    ):
        raise BadInput(f"its meta.json has chosen_cadence = {chosen!r}, which is not two times above 0")
    for name, table in TABLES.items():
        if not isinstance(meta.get(name), table):
            raise BadInput(f"its meta.json has {name} = {meta.get(name)!r}, which is not a {table.__name__}")


def _sizes(arrays: Mapping[str, np.ndarray]) -> dict[str, int]:
    """Values of N, C and P according to the arrays themselves."""

    def columns(name: str) -> int:
        if name not in arrays or arrays[name].ndim == 0:
            raise BadInput(f"there is no array {name!r}")
        return int(arrays[name].shape[-1])

    n, c, p = columns("grains/radius"), columns("contacts/pair"), columns("pair_list/pair")
    w, k = (columns(name) if name in arrays else 0 for name in ("walls/work", "wall_contacts/pair"))
    if n == 0:
        raise BadInput("it holds no grain")
    return {"N": n, "N+1": n + 1, "C": c, "2C": 2 * c, "P": p, "W": w, "K": k}


def _check_array(name: str, array: np.ndarray, spec: ArraySpec, sizes: Mapping[str, int]) -> None:
    if array.dtype != np.dtype(spec.dtype):
        raise BadInput(f"{name!r} holds numbers of type {array.dtype}, not {np.dtype(spec.dtype)}")

    def allowed(size: Any) -> tuple[int, ...]:
        return tuple(sizes.get(one, one) for one in (size if isinstance(size, tuple) else (size,)))

    fits = len(array.shape) == len(spec.shape) and all(
        size is None or actual in allowed(size) for actual, size in zip(array.shape, spec.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join("any" if s is None else " or ".join(map(str, dict.fromkeys(allowed(s)))) for s in spec.shape)
        raise BadInput(f"{name!r} has shape {array.shape}, not ({wanted})")
    if message := RULES[spec.rule](array, sizes):
        raise BadInput(f"{name!r} {message}")


def _each(is_allowed: Callable[[np.ndarray], np.ndarray], allowed: str) -> Callable[[np.ndarray, Any], str]:
    """Rule that each number of an array has to fulfil."""

    def rule(array: np.ndarray, sizes: Mapping[str, int]) -> str:
        good = is_allowed(array)
        return "" if good.all() else f"holds {array[~good][0]}: it must be {allowed}"

    return rule


def _pairs(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    n = sizes["N"]
    if array.size and int(array.max()) >= n:
        return f"names grain {int(array.max())}, but the grains are 0 to {n - 1}"
    return "names the same grain twice" if (array[0] == array[1]).any() else ""


def _at_walls(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    for row, what, n in zip(array, ("grain", "wall"), (sizes["N"], sizes["W"]), strict=True):
        if row.size and int(row.max()) >= n:
            return f"names {what} {int(row.max())}, but the {what}s are 0 to {n - 1}"
    return ""


def _order(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    seen = np.zeros(array.size, bool)
    seen[array[array < array.size]] = True
    return "" if seen.all() else f"does not hold each number from 0 to {array.size - 1} once"


def _ascending(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    return "" if (array[1:] > array[:-1]).all() else "does not hold ascending numbers, each once"


def _bodies(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    good = (array <= np.arange(array.size)).all() and (array[np.minimum(array, array.size - 1)] == array).all()
    return "" if good else "does not name the first grain of each body"


def _starts(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    good = array[0] == 0 and array[-1] == sizes["2C"] and (array[1:] >= array[:-1]).all()
    return "" if good else f"does not grow from 0 to {sizes['2C']}"


RULES: dict[str, Callable[[np.ndarray, Any], str]] = {
    "any": lambda array, sizes: "",
    "finite": _each(np.isfinite, "finite"),
    # infinities are steps without a limit, and reference positions before the first list
    "no nan": _each(lambda array: ~np.isnan(array), "a number"),
    "not below 0": _each(lambda array: array >= 0.0, "a number of at least 0"),
    "above 0": _each(lambda array: np.isfinite(array) & (array > 0.0), "finite and above 0"),
    "boolean": _each(lambda array: array <= 1, "0 or 1"),
    "grains": _pairs,
    "grain and wall": _at_walls,
    "order": _order,
    "ascending": _ascending,
    "starts": _starts,
    "bodies": _bodies,
}
"""Functions that return what is wrong with the values of an array, or an empty string."""


def _check_counters(arrays: Mapping[str, np.ndarray], meta: Mapping[str, Any]) -> None:
    """Check counts of contacts and pairs against the arrays, time and step against meta.json."""
    count, clock = arrays["count"], arrays["clock"]
    n = arrays["grains/radius"].size
    wanted = {
        STEPS: meta["steps"],
        STAGE: 0,
        CONTACTS: arrays["contacts/pair"].shape[1],
        PAIRS: arrays["pair_list/pair"].shape[1],
        WALL_CONTACTS: arrays["wall_contacts/pair"].shape[1] if "wall_contacts/pair" in arrays else 0,
    }
    for index, value in wanted.items():
        if count[index] != value:
            raise BadInput(f"'count' says {COUNT[index]} = {count[index]}, but it must be {value}")
    for index in (GRAIN1, GRAIN2):
        if not -1 <= count[index] < n:
            raise BadInput(f"'count' says {COUNT[index]} = {count[index]}, but the grains are 0 to {n - 1}")
    following = meta.get("next_id", n)
    if type(following) is not int or not arrays["grains/id"][-1] < following < 2**32:
        raise BadInput(f"'grains/id' ends with {arrays['grains/id'][-1]}, and meta.json says next_id = {following!r}")
    if not 0.999999 * meta["time"] <= meta["output_time"] < np.inf:
        raise BadInput(f"meta.json says output_time = {meta['output_time']!r} s, less than time = {meta['time']!r} s")
    if clock[TIME] != meta["time"]:
        raise BadInput(f"'clock' says time = {float(clock[TIME])!r} s, but its meta.json {meta['time']!r} s")


def _check_lists(pair: np.ndarray, side: np.ndarray, start: np.ndarray, sizes: Mapping[str, int]) -> None:
    """Check that the list of contacts of each grain names exactly the contacts in which the grain takes part."""
    owner = pair[side & 1, side >> 1]
    if not (owner == np.repeat(np.arange(sizes["N"], dtype=np.uint32), np.diff(start))).all():
        raise BadInput("'contacts/side' and 'contacts/start' do not list the contacts of each grain")
