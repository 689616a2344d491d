"""Populations of dilute dust as a sweep varies them: cases of `sand grow` with [method] kind = "encounters"."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

from pydantic import create_model

from ..basics.arguments import MOST_GRAINS
from ..basics.errors import BadInput
from ..basics.settings import For, Whole
from ..config.case import Case, GrainsSection
from ..config.key_errors import validate
from .dilute_case import DensitySection, MethodSection, check_dilute, describe_population, population_of
from .dilute_results import results_of
from .growth_case import DEFAULT_SEEDS, GrowSection
from .sweep_case import Expected, SweptCase

FINISHED = "finished"
"""Outcome of a population that reached its end."""


class DiluteGrains(GrainsSection, DensitySection):
    """[grains] with a number density."""

    number: Annotated[int | None, Whole(1, MOST_GRAINS), For("kind", "gas", "given")] = None
    """Number of grains, at least 100: a population of fewer has no statistics; with `classes` of grains and
    aggregates."""


class SweptPopulation(SweptCase):
    """A case of `sand grow` with encounters, each population of which is a run; see `SweptCase`."""

    NAME, GIVEN = "populations of sand grow", ("run.seed", "run.out", "grow")

    def __init__(self, content: dict[str, Any], name: str):
        self.content = {key: table for key, table in content.items() if key != "grow"}
        found = check_dilute(self.content, name)
        grains = {**dict(found.case.grains), "number_density": found.density}
        self.case = {**dict(found.case), "method": found.method, "grains": grains}
        self.seeds = DEFAULT_SEEDS
        if "grow" in content:
            self.seeds = validate(GrowSection, content["grow"], name, table="grow").seeds

    @staticmethod
    def model(content: dict[str, Any]) -> type:
        """Model of the case file."""
        return create_model(Case.__name__, __base__=Case, grains=(DiluteGrains, ...), method=(MethodSection, ...))

    def expected(self, seed: int) -> Expected:
        """Set up the bodies, and estimate the cost of their growth."""
        cost = describe_population(self.content, seed)[1]["cost"]
        return Expected(cost if cost > 0.0 else None, 0.0, None)

    def run(self, seed: int, folder: Path | None, observers: Sequence[Any] = ()) -> dict[str, Any]:
        """Grow the population to its end, or continue it."""
        with tempfile.TemporaryDirectory() as place:
            grown = population_of(self.content, seed, folder or Path(place) / "population", observers)
            found = results_of(grown)
        if grown.outcome != FINISHED:
            raise BadInput(f"stopped at S = {found['mean_cluster_size']:.3g}: {grown.outcome}")
        return found
