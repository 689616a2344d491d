"""Loads, flux densities, virials and energies of the grains of a simulation at its present time."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..basics.virial import shares_of_virial
from ..engine.measures import energies_at_grains, force_columns
from .ledger import kinetic_energies

ELASTIC = ("normal", "sliding", "rolling", "twisting")
"""Parts of the elastic energy of contacts."""


def loads_of(simulation: Any) -> dict[str, Any]:
    """Loads of all grains and energies by name, see `Simulation.loads`."""
    row = simulation._log_row()
    names = dict.fromkeys((*ELASTIC, "magnetic", *force_columns(simulation._engine)))
    force, torque = simulation._engine.stepper.loads(simulation._engine)
    return {
        "force": force,
        "torque": torque,
        "field": simulation.grains.field.copy(),
        "energy": {name: row[name] for name in names},
    }


def quantities_at_grains(simulation: Any) -> dict[str, np.ndarray]:
    """Flux density, virial and energies of each grain, see `Simulation.at_grains`."""
    time, grains, contacts = simulation.state.time, simulation.grains, simulation.contacts
    external = [at(time) for force in simulation._engine.external if (at := getattr(force, "flux_density_at", None))]
    flux = np.sum([grains.field, *(np.broadcast_to(b, grains.field.shape) for b in external)], axis=0)
    half = 0.5 * np.sum([contacts[f"energy_{name}"] for name in ELASTIC], axis=0)
    elastic = np.zeros(len(grains))
    for side in range(2):
        np.add.at(elastic, contacts["pair"][:, side], half)
    energies = {"kinetic": np.add(*kinetic_energies(grains)), "contacts": elastic}
    shares = {name: share.copy() for name, share in energies_at_grains(simulation._engine).items()}
    return {"flux_density": flux, "virial": virials_of(simulation, contacts)} | energies | shares


def virials_of(simulation: Any, contacts: Mapping[str, np.ndarray]) -> np.ndarray:
    """Share (N, 3, 3) [J] of each grain in the virial of contacts, with their columns `pair` and `force`, and walls."""
    grains, pair = simulation.grains, contacts["pair"].astype(np.int64)
    separation = simulation.state.box.nearest(grains.position[pair[:, 0]] - grains.position[pair[:, 1]])
    found = shares_of_virial(grains.radius, pair, separation, contacts["force"])
    others = (each.virials(simulation.state) for each in simulation._engine.components)
    return found + sum(virials for virials in others if virials is not None)
