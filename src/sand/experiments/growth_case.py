"""Case files of `sand grow`: those of `sand run` with a list of seeds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..basics.errors import BadInput, ErrorCollector
from ..config.case import check_case, read_content
from ..config.key_errors import validate
from ..config.sections import Section, Seeds
from .dilute_case import METHOD, MethodSection, check_dilute, is_dilute

DEFAULT_SEEDS = list(range(1, 9))


class GrowSection(Section):
    """Section [grow]: one box for each seed."""

    seeds: Seeds
    """One box is run for each seed."""


def read_growth(path: str | Path) -> tuple[dict[str, Any], list[int] | None]:
    """Read and check a case file of `sand grow`, which may be one of `sand run`.

    Returns
    -------
    content : dict
        Case of a box, as for `growth_boxes.grow`.
    seeds : list of int or None
        Seeds of [grow]; None without this section.

    Raises
    ------
    BadInput
        All errors of the file, one line each, with their keys.
    """
    content = read_content(path, "grow")
    given, errors, section = content.pop("grow", None), ErrorCollector(), None
    if given is not None:
        section = errors.take(validate, GrowSection, given, str(path), table="grow")
    if is_dilute(content):
        errors.take(check_dilute, content, str(path))
        errors.done()
        return content, section and section.seeds
    if (method := content.pop(METHOD, None)) is not None:
        errors.take(validate, MethodSection, method, str(path), table=METHOD)
    case = errors.take(check_case, content, str(path))
    errors.done()
    if case.run.stop is not None:
        raise BadInput(f"{path}: run.stop is for sand run; sand grow takes all boxes to the same end, so remove it")
    return content, section and section.seeds
