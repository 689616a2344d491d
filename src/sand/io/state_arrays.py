"""Checks of the arrays and numbers of a checkpoint, before they reach compiled code, which checks no index.

The declarations of arrays (`basics.array_groups`) have the data type, shape and allowed values of every array. A
matching checksum does not suffice: it shows that a file is unchanged, not that SAND wrote it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np

from ..basics.array_groups import GRAINS, SIDES, USED, Array, saved_in
from ..basics.arrays import BodyArrays, ContactArrays, LongRangeArrays, PairList
from ..basics.errors import BadInput
from ..basics.grains import GrainArrays
from ..basics.state import CLOCK, CONTACTS, COUNT, CUTOFF, GRAIN1, GRAIN2, LEAST_CLOCK, LOST, PAIRS, PHASE, STEPS, TIME

Groups = Mapping[str, type]
"""Groups of arrays by name; if a file has an array of one of them, it has those of all."""
SINGLE = {
    "clock": Array(("clock",), rule="no nan"),
    "count": Array((len(COUNT),), dtype="i8", rule="any"),
    "lost": Array((len(LOST),), "J"),
    "cutoff": Array((len(CUTOFF),), rule="not below 0"),
    "order": Array((GRAINS,), dtype="u4", rule="order", required=False),
    "ledger": Array(("rows", "columns")),
}
"""Arrays of a checkpoint besides those of groups."""
ALWAYS: Groups = {
    "grains": GrainArrays,
    "contacts": ContactArrays,
    "pair_list": PairList,
    "long_range": LongRangeArrays,
}
"""Groups that every checkpoint has."""
OPTIONAL: Groups = {"bodies": BodyArrays}
"""Groups of rigid clusters."""
SIZES = {"clock": tuple(range(LEAST_CLOCK, len(CLOCK) + 1)), "channels": (4, 6)}
"""Sizes of which there are several; others are those of the first array that has them."""
NUMBERS = {"steps": int, "time": float, "output_time": float, "wall_seconds": float, "temperature": float}
"""Required numbers of `meta.json` with their types; an integer is accepted for either."""
PLANNED_END = {"until": float, "last_step": int}
"""Numbers of `meta.json` that may be null."""
TABLES = {"choices": dict, "case": dict, "ledger": list}
"""Tables of `meta.json`."""
CHANGES = {"case_written": dict, "updaters": list, "own": dict, "wall_times": dict}
"""Entries of `meta.json` that a run may lack: the case in case.toml, names of updaters, units of own quantities, and
parts of the wall time in older files."""


def check_state(arrays: Mapping[str, np.ndarray], meta: Mapping[str, Any], components: Iterable[Groups] = ()) -> None:
    """Check that a state can be resumed: every array exists with the right type and shape, every index is in range.

    Parameters
    ----------
    arrays : Mapping[str, ndarray]
        Arrays of a checkpoint, by name.
    meta : Mapping[str, Any]
        Its metadata.
    components : Iterable[Mapping[str, type]], optional
        Groups of arrays of each component, as `engine.component.Component.groups`.

    Raises
    ------
    BadInput
        For the first error found, in one line.
    """
    _check_meta(meta)
    sizes = _sizes(arrays)
    _check_arrays(arrays, SINGLE, dict(sizes))
    for groups in (ALWAYS, OPTIONAL, *components):
        of_component = dict(sizes)
        if groups is not ALWAYS and not any(name.split("/")[0] in groups for name in arrays):
            continue
        for group, kind in groups.items():
            of_component = {name: size for name, size in of_component.items() if name not in (USED, SIDES)}
            _check_arrays(arrays, {f"{group}/{name}": each for name, each in saved_in(kind).items()}, of_component)
    if len(meta.get("own", {})) != len(arrays["grains/own"]):
        raise BadInput(f"'grains/own' has {len(arrays['grains/own'])} rows, but meta.json names a different number")
    _check_counters(arrays, meta)
    _check_lists(arrays["contacts/pair"], arrays["contacts/side"], arrays["contacts/start"], sizes)
    if arrays["ledger"].shape[1] != len(meta.get("ledger", ())):
        raise BadInput(f"'ledger' has {arrays['ledger'].shape[1]} columns, but meta.json names a different number")


def _check_arrays(arrays: Mapping[str, np.ndarray], declared: Mapping[str, Array], sizes: dict[str, Any]) -> None:
    """Check arrays by their declarations; adds the sizes that it meets to those that are known."""
    for name, each in declared.items():
        if name in arrays:
            _check_array(name, arrays[name], each, sizes)
        elif each.required:
            raise BadInput(f"there is no array {name!r}")


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


def _sizes(arrays: Mapping[str, np.ndarray]) -> dict[str, Any]:
    """Sizes that several groups name."""
    if "grains/radius" not in arrays or arrays["grains/radius"].ndim == 0:
        raise BadInput("there is no array 'grains/radius'")
    n = arrays["grains/radius"].shape[-1]
    if n == 0:
        raise BadInput("it holds no grain")
    return {GRAINS: n, "grains + 1": n + 1, **SIZES}


def _check_array(name: str, array: np.ndarray, each: Array, sizes: dict[str, Any]) -> None:
    if array.dtype != np.dtype(each.dtype):
        raise BadInput(f"{name!r} holds numbers of type {array.dtype}, not {np.dtype(each.dtype)}")
    shape = each.shape
    if len(array.shape) == len(shape):
        for size, number in zip(shape, array.shape, strict=True):
            if size not in sizes and isinstance(size, str):
                sizes |= {USED: number, SIDES: 2 * number} if size == USED else {size: number}
    wanted = [sizes.get(size, "any") if isinstance(size, str) else size for size in shape]
    allowed = [size if isinstance(size, tuple) else (size,) for size in wanted]
    for other in (each.fewer, each.earlier):
        allowed[-1] = allowed[-1] if other is None else (other, *allowed[-1])
    if len(array.shape) != len(shape) or any(n not in one for n, one in zip(array.shape, allowed, strict=True)):
        text = ", ".join(" or ".join(map(str, dict.fromkeys(one))) for one in allowed)
        raise BadInput(f"{name!r} has shape {array.shape}, not ({text})")
    for row, of in zip(np.atleast_2d(array), each.names, strict=False):
        if row.size and int(row.max()) >= sizes[of]:
            raise BadInput(f"{name!r} names {of[:-1]} {int(row.max())}, but the {of} are 0 to {sizes[of] - 1}")
    if message := RULES[each.rule](array, sizes):
        raise BadInput(f"{name!r} {message}")


def _each(is_allowed: Callable[[np.ndarray], np.ndarray], allowed: str) -> Callable[[np.ndarray, Any], str]:
    """Rule that each number of an array has to fulfil."""

    def rule(array: np.ndarray, sizes: Mapping[str, Any]) -> str:
        good = is_allowed(array)
        return "" if good.all() else f"holds {array[~good][0]}: it must be {allowed}"

    return rule


def _two_grains(array: np.ndarray, sizes: Mapping[str, Any]) -> str:
    return "names the same grain twice" if (array[0] == array[1]).any() else ""


def _order(array: np.ndarray, sizes: Mapping[str, Any]) -> str:
    seen = np.zeros(array.size, bool)
    seen[array[array < array.size]] = True
    return "" if seen.all() else f"does not hold each number from 0 to {array.size - 1} once"


def _ascending(array: np.ndarray, sizes: Mapping[str, Any]) -> str:
    return "" if (array[1:] > array[:-1]).all() else "does not hold ascending numbers, each once"


def _bodies(array: np.ndarray, sizes: Mapping[str, Any]) -> str:
    good = (array <= np.arange(array.size)).all() and (array[np.minimum(array, array.size - 1)] == array).all()
    return "" if good else "does not name the first grain of each body"


def _starts(array: np.ndarray, sizes: Mapping[str, Any]) -> str:
    good = array[0] == 0 and array[-1] == sizes[SIDES] and (array[1:] >= array[:-1]).all()
    return "" if good else f"does not grow from 0 to {sizes[SIDES]}"


RULES: dict[str, Callable[[np.ndarray, Any], str]] = {
    "any": lambda array, sizes: "",
    "finite": _each(np.isfinite, "finite"),
    # infinities are steps without a limit, and reference positions before the first list
    "no nan": _each(lambda array: ~np.isnan(array), "a number"),
    "not below 0": _each(lambda array: array >= 0.0, "a number of at least 0"),
    "above 0": _each(lambda array: np.isfinite(array) & (array > 0.0), "finite and above 0"),
    "boolean": _each(lambda array: array <= 1, "0 or 1"),
    "two grains": _two_grains,
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
        PHASE: 0,
        CONTACTS: arrays["contacts/pair"].shape[1],
        PAIRS: arrays["pair_list/pair"].shape[1],
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


def _check_lists(pair: np.ndarray, side: np.ndarray, start: np.ndarray, sizes: Mapping[str, Any]) -> None:
    """Check that the list of contacts of each grain names exactly the contacts in which the grain takes part."""
    owner = pair[side & 1, side >> 1]
    if not (owner == np.repeat(np.arange(sizes[GRAINS], dtype=np.uint32), np.diff(start))).all():
        raise BadInput("'contacts/side' and 'contacts/start' do not list the contacts of each grain")
