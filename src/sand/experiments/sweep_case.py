"""What a sweep needs of a case that it varies: how it is checked and run."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple


class Expected(NamedTuple):
    """Expected cost of a run; None where the case does not determine it."""

    seconds: float | None  # wall time [s]
    memory: float  # [bytes]
    disk: float | None  # of all its files but the row [bytes]


class SweptCase:
    """The case of a command, as a sweep uses it.

    Parameters
    ----------
    content : dict
        Content of a case file, without [sweep].
    name : str
        Name of the file, for messages.

    Raises
    ------
    BadInput
        All errors of the case.

    Attributes
    ----------
    case : Section
        The case, checked.
    seeds : list of int
        Its seeds.
    NAME : str
        What is varied, for people.
    GIVEN : tuple of str
        Keys of seeds and of the folder, which the sweep gives itself.
    """

    NAME: ClassVar[str]
    GIVEN: ClassVar[tuple[str, ...]]
    case: Any
    seeds: list[int]

    def __init__(self, content: dict[str, Any], name: str):
        raise NotImplementedError

    @staticmethod
    def model(content: dict[str, Any]) -> type:
        """Model of the case file."""
        raise NotImplementedError

    def expected(self, seed: int) -> Expected:
        """Set up a run in memory, which finds all further errors, and estimate its cost.  Raises BadInput."""
        raise NotImplementedError

    def run(self, seed: int, folder: Path | None, observers: Sequence[Any] = ()) -> dict[str, Any]:
        """Compute a run, or continue the one in the folder.

        Parameters
        ----------
        folder : Path or None
            Folder for its files; None for no files.

        Returns
        -------
        dict
            Results, which must not depend on the machine or on interruptions; with `TABLE` rows of the run's own.

        Raises
        ------
        BadInput
            If it failed, also for physical reasons.
        """
        raise NotImplementedError
