"""What the arrays and numbers of a checkpoint must be: checked before compiled code, which checks no index, sees them.

One table names every array, its type of number, its shape and what its numbers may be. A check sum only tells that a
file is as it was written, not that a program of ours wrote it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from ..errors import BadInput
from ..schema import FIELDS
from ..state.state import (
    BROKEN,
    CLOCK,
    CONTACTS,
    COUNT,
    GRAIN1,
    GRAIN2,
    LONG_RANGE_SUMS,
    LOST,
    MADE,
    PAIRS,
    STAGE,
    STEPS,
    TIME,
)


class Stored(NamedTuple):
    """One array of a checkpoint."""

    kind: str  # type of number
    shape: tuple[Any, ...]  # sizes: a number, N grains, C contacts, P pairs; a tuple: one of these; None: any
    rule: str = "finite"  # which numbers are allowed: a name in RULES
    needed: bool = True


def _grains() -> dict[str, Stored]:
    above = ("radius", "mass", "inertia")
    found = {
        f"grains/{f.name}": Stored(
            "f8", ("N",) if f.width == 1 else (f.width, "N"), "above 0" if f.name in above else "finite"
        )
        for f in FIELDS
    }
    return found | {"grains/material": Stored("u4", ("N",), "any"), "grains/id": Stored("u4", ("N",), "order")}


STORED = {
    "clock": Stored("f8", (len(CLOCK),), "no nan"),
    "count": Stored("i8", (len(COUNT),), "any"),
    "lost": Stored("f8", (len(LOST),)),
    "order": Stored("u4", ("N",), "order", needed=False),
    "ledger": Stored("f8", (None, None)),
    **_grains(),
    "contacts/pair": Stored("u4", (2, "C"), "grains"),
    "contacts/pointer1": Stored("f8", (3, "C")),
    "contacts/pointer2": Stored("f8", (3, "C")),
    "contacts/twist": Stored("f8", ("C",)),
    "contacts/formed": Stored("f8", ("C",)),
    "contacts/bond": Stored("f8", (None, (1, "C"))),
    "contacts/lost": Stored("f8", ((4, 6), "C")),
    "contacts/damped": Stored("f8", ((0, "C"),)),
    "contacts/push": Stored("f8", (3, "C")),
    "contacts/torque1": Stored("f8", (3, "C")),
    "contacts/torque2": Stored("f8", (3, "C")),
    "contacts/flag": Stored("u1", ("C",), "any"),
    "contacts/bonded": Stored("u1", ("C",), "yes or no"),
    "contacts/side": Stored("u4", ("2C",), "order"),
    "contacts/start": Stored("u4", ("N+1",), "starts"),
    "pair_list/pair": Stored("u4", (2, "P"), "grains"),
    "pair_list/touching": Stored("u1", ("P",), "yes or no"),
    "pair_list/step": Stored("f8", ((1, "P"),), "no nan"),
    "pair_list/length": Stored("f8", ((1, "P"),)),
    "pair_list/anchor": Stored("f8", (3, "N"), "no nan"),
    "long_range/anchor": Stored("f8", (3, (0, "N")), "no nan"),
    **{
        f"long_range/{name}": Stored("f8", (3, (0, "N")))
        for name in ("force", "torque", "slow_force", "slow_torque", "past_position", "past_moment", "path")
    },
}
"""Every array of a checkpoint."""
NUMBERS = {"steps": int, "time": float, "wall_seconds": float, "temperature": float}
"""What `meta.json` must say besides, and its type; a whole number does for any."""
GOALS = {"until": float, "last_step": int}
"""The same for numbers that may be missing, as null."""
TABLES = {"choices": dict, "case": dict, "ledger": list}
"""Tables of `meta.json`."""


def check_state(arrays: Mapping[str, np.ndarray], meta: Mapping[str, Any]) -> None:
    """See that a state can be gone on from: every array is there, of the right type and shape, every index in range.

    Parameters
    ----------
    arrays : Mapping[str, ndarray]
        of a checkpoint, by name.
    meta : Mapping[str, Any]
        what goes with it.

    Raises
    ------
    BadInput
        the first thing that is wrong, in one line.
    """
    _check_meta(meta)
    sizes = _sizes(arrays)
    for name, right in STORED.items():
        if name in arrays:
            _check_array(name, arrays[name], right, sizes)
        elif right.needed:
            raise BadInput(f"there is no array {name!r}")
    _check_counters(arrays, meta)
    _check_lists(arrays["contacts/pair"], arrays["contacts/side"], arrays["contacts/start"], sizes)
    if arrays["ledger"].shape[1] != len(meta.get("ledger", ())):
        raise BadInput(f"'ledger' has {arrays['ledger'].shape[1]} columns, but meta.json names another number of them")


def _check_meta(meta: Mapping[str, Any]) -> None:
    for name, kind in {**NUMBERS, **GOALS}.items():
        value: Any = meta.get(name)
        if value is None and name in GOALS and name in meta:
            continue
        right = isinstance(value, (int, kind)) and not isinstance(value, bool)
        if not (right and 0 <= value < 1e300):
            raise BadInput(
                f"its meta.json has {name} = {value!r}, which is no {'number of steps' if kind is int else 'number'}"
            )
    for name, table in TABLES.items():
        if not isinstance(meta.get(name), table):
            raise BadInput(f"its meta.json has {name} = {meta.get(name)!r}, which is not a {table.__name__}")


def _sizes(arrays: Mapping[str, np.ndarray]) -> dict[str, int]:
    """N, C and P as the arrays themselves say."""

    def columns(name: str) -> int:
        if name not in arrays or arrays[name].ndim == 0:
            raise BadInput(f"there is no array {name!r}")
        return int(arrays[name].shape[-1])

    n, c, p = columns("grains/radius"), columns("contacts/pair"), columns("pair_list/pair")
    if n == 0:
        raise BadInput("it holds no grain")
    return {"N": n, "N+1": n + 1, "C": c, "2C": 2 * c, "P": p}


def _check_array(name: str, array: np.ndarray, right: Stored, sizes: Mapping[str, int]) -> None:
    if array.dtype != np.dtype(right.kind):
        raise BadInput(f"{name!r} holds numbers of type {array.dtype}, not {np.dtype(right.kind)}")

    def allowed(size: Any) -> tuple[int, ...]:
        return tuple(sizes.get(one, one) for one in (size if isinstance(size, tuple) else (size,)))

    fits = len(array.shape) == len(right.shape) and all(
        size is None or there in allowed(size) for there, size in zip(array.shape, right.shape, strict=True)
    )
    if not fits:
        wanted = ", ".join(
            "any" if s is None else " or ".join(map(str, dict.fromkeys(allowed(s)))) for s in right.shape
        )
        raise BadInput(f"{name!r} has shape {array.shape}, not ({wanted})")
    if said := RULES[right.rule](array, sizes):
        raise BadInput(f"{name!r} {said}")


def _finite(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    return "" if np.isfinite(array).all() else "holds a number that is not finite"


def _no_nan(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    """Infinite are steps without a limit, and places of grains before the first list is made."""
    return "holds something that is not a number" if np.isnan(array).any() else ""


def _above_zero(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    good = np.isfinite(array) & (array > 0.0)
    return "" if good.all() else f"of grain {int(np.argmin(good))} is {array[np.argmin(good)]:g}: it must be above 0"


def _pairs(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    n = sizes["N"]
    if array.size and int(array.max()) >= n:
        return f"names grain {int(array.max())}, but the grains are 0 to {n - 1}"
    return "names a grain beside itself" if (array[0] == array[1]).any() else ""


def _order(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    seen = np.zeros(array.size, bool)
    seen[array[array < array.size]] = True
    return "" if seen.all() else f"does not hold each number from 0 to {array.size - 1} once"


def _starts(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    good = array[0] == 0 and array[-1] == sizes["2C"] and (array[1:] >= array[:-1]).all()
    return "" if good else f"does not grow from 0 to {sizes['2C']}"


def _yes_or_no(array: np.ndarray, sizes: Mapping[str, int]) -> str:
    return "" if (array <= 1).all() else f"holds {int(array.max())}: it must be 0 or 1"


RULES = {
    "any": lambda array, sizes: "",
    "finite": _finite,
    "no nan": _no_nan,
    "above 0": _above_zero,
    "grains": _pairs,
    "order": _order,
    "starts": _starts,
    "yes or no": _yes_or_no,
}
"""What is wrong with the numbers of an array; nothing if they are right."""


def _check_counters(arrays: Mapping[str, np.ndarray], meta: Mapping[str, Any]) -> None:
    """The numbers of contacts and pairs are those of the arrays, and time and step those of meta.json."""
    count, clock = arrays["count"], arrays["clock"]
    n = arrays["grains/radius"].size
    wanted = {
        STEPS: meta["steps"],
        STAGE: 0,
        CONTACTS: arrays["contacts/pair"].shape[1],
        PAIRS: arrays["pair_list/pair"].shape[1],
    }
    for place, value in wanted.items():
        if count[place] != value:
            raise BadInput(f"'count' says {COUNT[place]} = {count[place]}, but it must be {value}")
    for place in (MADE, BROKEN, LONG_RANGE_SUMS):
        if count[place] < 0:
            raise BadInput(f"'count' says {COUNT[place]} = {count[place]}: it must not be below 0")
    for place in (GRAIN1, GRAIN2):
        if not -1 <= count[place] < n:
            raise BadInput(f"'count' says {COUNT[place]} = {count[place]}, but the grains are 0 to {n - 1}")
    if clock[TIME] != meta["time"]:
        raise BadInput(f"'clock' says time = {float(clock[TIME])!r} s, but its meta.json {meta['time']!r} s")


def _check_lists(pair: np.ndarray, side: np.ndarray, start: np.ndarray, sizes: Mapping[str, int]) -> None:
    """The contacts of each grain, as the loops gather them, are those that name it."""
    owner = pair[side & 1, side >> 1]
    if not (owner == np.repeat(np.arange(sizes["N"], dtype=np.uint32), np.diff(start))).all():
        raise BadInput("'contacts/side' and 'contacts/start' do not list the contacts of each grain")
