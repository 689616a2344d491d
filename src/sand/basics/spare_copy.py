"""Memory for copies of a state that are made one after another."""

from __future__ import annotations

from operator import is_
from sys import getrefcount
from typing import Any

from .state import OTHERS, State


class SpareCopy:
    """Copies a state to the memory of the copy before, unless somebody holds that copy or an array of it.

    A snapshot that a user has kept must not change. Python counts references: if nobody has taken any, there are as
    many as when the copy was handed in by `keep`.
    """

    def __init__(self) -> None:
        self._copy: State | None = None
        self._alone = object()
        self._groups: list[Any] = []  # of the copy, handed in by `keep`
        self._parts: list[Any] = []  # of it
        self._references: list[int] = []  # to each of them
        self._sources: list[Any] = []  # groups of the state that was copied
        self._bytes: list[tuple[memoryview, memoryview]] = []  # of arrays of the copy, and of this state

    def of(self, state: State) -> tuple[State, bool]:
        """A copy of a state, and whether its arrays are those of the copy before."""
        if self._copy is None or not self._is_free() or not self._fits(state):
            self._copy, self._groups = state.copy(), []
            return self._copy, False
        for copy, source in self._bytes:
            copy[:] = source
        self._copy.take_settings(state)
        return self._copy, True

    def keep(self, copy: State) -> None:
        """Take the memory of a copy for the next one, if nobody takes a reference to it from now on."""
        groups = _groups_of(copy)
        if _are_same(groups, self._groups):
            return
        self._copy, self._groups, self._sources, self._bytes = copy, groups, [], []
        self._parts = _parts_of(copy)
        self._references = list(map(getrefcount, self._parts))

    def _fits(self, state: State) -> bool:
        """Whether a state has the shapes of the copy; finds the memory of its arrays."""
        groups = _groups_of(state)
        if not _are_same(groups, self._sources):
            found = _bytes_of(self._copy, state)
            if found is None:
                return False
            self._sources, self._bytes = groups, found
            self._references = list(map(getrefcount, self._parts))  # the bytes of the copy refer to it, too
        return True

    def _is_free(self) -> bool:
        # the copy itself is held by this object alone, as `_alone` is
        is_alone = getrefcount(self._copy) == getrefcount(self._alone)
        return is_alone and list(map(getrefcount, self._parts)) == self._references


def _bytes_of(copy: Any, state: State) -> list[tuple[memoryview, memoryview]] | None:
    """The bytes of each array of a copy and of a state, empty arrays left out; None if any shapes differ."""
    pairs: list[tuple[Any, Any]] = list(zip(copy.arrays(), state.arrays(), strict=True))
    if any(own.shape != array.shape for own, array in pairs):
        return None
    return [(memoryview(own).cast("B"), memoryview(array).cast("B")) for own, array in pairs if own.size]


def _groups_of(state: State) -> list[Any]:
    """Objects that hold the arrays of a state; if they are the same, so are the arrays."""
    return [state.grains, *state.in_groups(), *OTHERS(state)]


def _are_same(some: list[Any], others: list[Any]) -> bool:
    return len(some) == len(others) and all(map(is_, some, others))


def _parts_of(state: State) -> list[Any]:
    """What can be referred to: grains, groups, arrays, and the memory of arrays, to which views refer."""
    arrays = [array for array in state.arrays() if array.size]  # empty ones may be those of other states
    memory = [array.base for array in arrays if array.base is not None]
    return [state.grains, *state.in_groups(), *arrays, *memory]
