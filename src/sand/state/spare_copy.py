"""Memory for copies of a state that are made one after another."""

from __future__ import annotations

from operator import is_
from sys import getrefcount
from typing import Any

from .state import IN_GROUPS, OTHERS, State


class SpareCopy:
    """Copies a state to the memory of the copy before, unless somebody holds that copy or an array of it.

    A snapshot that a user has kept must not change. Python counts references: if nobody has taken any, there are as
    many as when the copy was handed in by `keep`.
    """

    def __init__(self) -> None:
        self._copy: State | None = None
        self._groups: list[Any] = []  # of the copy, handed in by `keep`
        self._parts: list[Any] = []  # of it
        self._references: list[int] = []  # to each of them
        self._alone = object()

    def of(self, state: State) -> tuple[State, bool]:
        """A copy of a state, and whether its arrays are those of the copy before."""
        if self._copy is not None and self._is_free() and state.copy_to(self._copy):
            return self._copy, True
        self._copy = state.copy()
        return self._copy, False

    def keep(self, copy: State) -> None:
        """Take the memory of a copy for the next one, if nobody takes a reference to it from now on."""
        groups = [copy.grains, copy.grains.arrays, *IN_GROUPS(copy), *OTHERS(copy)]
        if len(groups) == len(self._groups) and all(map(is_, groups, self._groups)):
            return
        self._copy, self._groups, self._parts = copy, groups, _parts_of(copy)
        self._references = list(map(getrefcount, self._parts))

    def _is_free(self) -> bool:
        # the copy itself is held by this object alone, as `_alone` is
        is_alone = getrefcount(self._copy) == getrefcount(self._alone)
        return is_alone and list(map(getrefcount, self._parts)) == self._references


def _parts_of(state: State) -> list[Any]:
    """What can be referred to: grains, groups, arrays, and the memory of arrays, to which views refer."""
    arrays = [array for array in state.arrays() if array.size]  # empty ones may be those of other states
    memory = [array.base for array in arrays if array.base is not None]
    return [state.grains, state.grains.arrays, *IN_GROUPS(state), *arrays, *memory]
