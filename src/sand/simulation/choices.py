"""What a simulation has chosen automatically, with its reasons."""

from __future__ import annotations

from typing import Any


def choices_of(simulation: Any) -> dict[str, str]:
    """Automatic choices of a simulation, see `Simulation.choices`; those of the start as its checkpoint has them."""
    engine = simulation._engine
    present = {k: text for each in engine.components for k, text in each.present_choices(engine.state).items()}
    if simulation._origin.choices:
        return simulation._origin.choices | present
    choices = {"start": simulation.origin} if simulation.origin else {}
    choices["boundary"] = simulation._system.box.describe()
    for force in simulation.forces:
        if choose := getattr(force, "choose", None):
            choices[f"{force.name} cut-off"] = str(choose(simulation.start, simulation._system.box))
    choices |= {name: text for each in engine.components for name, text in each.choices().items()}
    return choices | {"neighbours": engine.search} | present
