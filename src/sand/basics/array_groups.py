"""Groups of arrays: what each array of a state holds, and everything that follows from it.

A group is a NamedTuple with fields annotated `Annotated[np.ndarray, Array(…)]`: the groups of `basics.arrays`, and
the groups that components declare (`engine.component.Component.groups`).  From these annotations follow the memory of a
new state, the content of a checkpoint and its check, the growth of tables, and what becomes of an array with a new
order of the grains, or after grains were removed or added.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from functools import cache
from typing import Any, NamedTuple, get_type_hints

import numpy as np

from .alignment import all_aligned, padded_size

GRAINS, USED, SIDES = "grains", "used", "sides"
"""Names of sizes: the number of grains, the columns in use of a table that grows, and twice as many.

A group of a component with such a table has an array `used`, (1,) int64, which is not saved: the columns in use.
"""
INNER = "inner"
"""A size in proportion to the memory of a table."""
GROWTH = 1.25
"""Growth factor of a table on overflow."""
FEWEST_COLUMNS = 16
"""Columns that a table has at least."""


class Array(NamedTuple):
    """Declaration of one array.

    Attributes
    ----------
    shape : tuple of int and str
        Numbers, and names of sizes: `GRAINS`, `USED`, or one that whoever makes the group gives.
    unit : str
        Unit of its numbers; empty if they have none.
    dtype : str
        Type of its numbers.
    rule : str
        What they may be in a checkpoint: a name in `io.state_arrays.RULES`.
    names : tuple of str
        Sizes of which its rows are indices: ("grains", "walls") for pairs of a grain and a wall. Where it is `GRAINS`
        they follow the grains, and a column of a table goes with its grain. Only saved arrays of a table have any.
    initial : float
        Number with which it begins.
    saved : bool
        Whether a checkpoint has it; what is only used within a step need not be saved.
    required : bool
        Whether a checkpoint must have it; False for what earlier versions did not have: it is then `initial`.
    fewer : int or None
        Number of columns that it may have instead, if it is not needed (0), or if all columns are equal (1).
    summed : bool
        Whether it is a sum over time since the start, such as a loss [J] or an impulse.
    earlier : int or None
        Number of columns in checkpoints of earlier versions, to which the others are added as `initial`.
    """

    shape: tuple[int | str, ...]
    unit: str = ""
    dtype: str = "f8"
    rule: str = "finite"
    names: tuple[str, ...] = ()
    initial: float = 0.0
    saved: bool = True
    required: bool = True
    fewer: int | None = None
    summed: bool = False
    earlier: int | None = None


@cache
def _declared(group: Any) -> tuple[dict[str, Array], dict[str, Array]]:
    hints = get_type_hints(group, include_extras=True)
    declared: dict[str, Array] = {name: hint.__metadata__[0] for name, hint in hints.items()}
    for name, each in declared.items():
        if each.saved and each.names and each.shape[-1] != USED:  # what would stand for a grain that was removed?
            raise TypeError(f"{group.__name__}.{name} names {each.names[0]}, but is no array of a table: use a table")
    return declared, {name: each for name, each in declared.items() if each.saved}


def arrays_of(group: Any) -> dict[str, Array]:
    """Declarations of the arrays of a group, or of a type of groups, by name."""
    return _declared(group if isinstance(group, type) else type(group))[0]


def saved_in(group: Any) -> dict[str, Array]:
    """Those of the arrays that a checkpoint has."""
    return _declared(group if isinstance(group, type) else type(group))[1]


def table_in(group: Any) -> str:
    """Name of the first array of the table of a group, which has all its columns; empty without a table."""
    return next((name for name, each in arrays_of(group).items() if each.shape[-1] == USED), "")


def new_group(group: Any, sizes: Mapping[str, int], columns: Mapping[str, int] | None = None) -> Any:
    """A group of new arrays.

    Parameters
    ----------
    group : type
        The NamedTuple.
    sizes : Mapping[str, int]
        Sizes that the shapes name; a table has `FEWEST_COLUMNS` unless it is given.
    columns : Mapping[str, int], optional
        Numbers of columns of arrays with fewer ones, by the name of the array.
    """
    sizes, found = {USED: FEWEST_COLUMNS} | dict(sizes), {}
    for name, each in arrays_of(group).items():
        *rows, last = (sizes[size] if isinstance(size, str) else size for size in each.shape)
        found[name] = np.zeros((*rows, (columns or {}).get(name, last)), each.dtype)
        if each.initial:
            found[name][...] = each.initial
    return group(**found)


def grown(group: Any, minimum: int = 0, unchanged: Collection[str] = ()) -> Any:
    """A group with more columns in its table, at least `minimum`; other arrays and the `unchanged` ones stay."""
    columns = getattr(group, table_in(group)).shape[-1]
    capacity, longer = padded_size(max(int(GROWTH * columns) + 1, minimum)), {}
    for name, each in arrays_of(group).items():
        old = getattr(group, name)
        if each.shape[-1] not in (USED, SIDES, INNER) or name in unchanged:
            longer[name] = old
            continue
        longer[name] = np.zeros((*old.shape[:-1], capacity * old.shape[-1] // columns), old.dtype)
        longer[name][..., : old.shape[-1]] = old
    return all_aligned(type(group)(**longer))


def resized(group: Any, grains: int) -> Any:
    """A group with memory as this one, for another number of grains."""
    made = []
    for array, each in zip(group, arrays_of(group).values(), strict=True):
        *rows, last = array.shape
        made.append(np.zeros((*rows, grains if each.shape[-1] == GRAINS else last), array.dtype))
    return all_aligned(type(group)(*made))


def copy_group(group: Any, other: Any, own: np.ndarray, theirs: np.ndarray) -> Any:
    """Copy what is saved of a group to that of other grains, in which grains `own` are `theirs`; returns the latter.

    A table names none but these grains. That of the other group grows as needed.
    """
    number, used = np.zeros(own.max(initial=-1) + 1, np.int64), None
    number[own] = theirs
    if table := table_in(group):
        used = int(group.used[0])
        other = grown(other, used) if getattr(other, table).shape[-1] < used else other
        other.used[0] = used
    for name, each in saved_in(group).items():
        array, copied = getattr(group, name), getattr(other, name)
        if each.shape[-1] == GRAINS:
            copied[..., theirs] = array[..., own]
        elif array.size:
            columns = slice(used if each.shape[-1] == USED else None)
            copied[..., columns] = array[..., columns]
            for row, of in zip(np.atleast_2d(copied), each.names, strict=False):
                if of == GRAINS:
                    row[columns] = number[row[columns]]
    return other


def reorder_group(group: Any, rows: np.ndarray, new_index: np.ndarray) -> None:
    """Follow a new order of the grains: grain k was `rows[k]`, and the former grain i is now `new_index[i]`."""
    for array, each in zip(group, arrays_of(group).values(), strict=True):
        if array.size and each.shape[-1] == GRAINS:
            array[...] = array[..., rows]
        for row, of in zip(np.atleast_2d(array), each.names, strict=False):
            if of == GRAINS:
                row[...] = new_index[row]


def kept_arrays(
    declared: Mapping[str, Array],
    saved: Mapping[str, np.ndarray],
    fresh: Mapping[str, np.ndarray],
    new_index: np.ndarray,
) -> dict[str, np.ndarray]:
    """Arrays of a group after grains were removed or added; a table loses the columns that name a removed grain.

    Parameters
    ----------
    declared : Mapping[str, Array]
        Declarations of the arrays, by name.
    saved, fresh : Mapping[str, ndarray]
        The arrays before, and those of a new state of the grains after the change.
    new_index : ndarray
        Index of each earlier grain after the change (int64), ascending; −1 if it was removed. Grains that were added
        follow these.
    """
    kept = np.flatnonzero(new_index >= 0)
    renumbered, stays = dict(saved), None
    for name, each in declared.items():
        if GRAINS in each.names:
            renumbered[name] = saved[name].astype(np.int64)
            for row, of in zip(np.atleast_2d(renumbered[name]), each.names, strict=True):
                if of == GRAINS:
                    row[...] = new_index[row]
                    stays = row >= 0 if stays is None else stays & (row >= 0)
    found = {}
    for name, each in declared.items():
        array = renumbered[name]
        if each.shape[-1] == GRAINS:
            array = fresh[name].copy()
            array[..., : len(kept)] = saved[name][..., kept]
        elif stays is not None and each.shape[-1] == USED and array.shape[-1] == stays.size:  # not `fewer`
            array = array[..., stays]
        found[name] = array.astype(each.dtype)
    return found
