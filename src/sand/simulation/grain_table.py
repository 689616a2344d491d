"""What each grain feels and holds: diagnostics one by one."""

from __future__ import annotations

import numpy as np

from .contact_table import ContactTable
from .engine import Engine

ELASTIC = ("energy_normal", "energy_sliding", "energy_rolling", "energy_twisting")


def at_grains(engine: Engine) -> dict[str, np.ndarray]:
    """Flux density and energies at each grain.

    Returns
    -------
    dict[str, ndarray]
        `flux_density` (N, 3) [T]: at the centre, from the other grains and from outside. The rest are energies (N,) [J]
        that sum to the columns of the ledger: `kinetic` (translation and rotation), `contacts` (half of each
        contact's elastic energy to each of its grains), and one for each long-range force (half of each pair's energy;
        −½ μ·B for dipoles) and each per-grain force, under the names of their columns.
    """
    state = engine.state
    grains = state.grains
    external = [at(state.time) for force in engine.external if (at := getattr(force, "flux_density_at", None))]
    moving = 0.5 * grains.mass * (grains.velocity**2).sum(axis=1)
    spinning = 0.5 * grains.arrays.inertia * (grains.spin**2).sum(axis=1)
    table = ContactTable(state, engine.parameters.contact.follow)
    half = 0.5 * np.sum([table[name] for name in ELASTIC], axis=0)
    contacts = np.zeros(len(grains))
    for side in range(2):
        np.add.at(contacts, table["pair"][:, side], half)
    flux = np.sum([grains.field, *(np.broadcast_to(b, grains.field.shape) for b in external)], axis=0)
    return {"flux_density": flux, "kinetic": moving + spinning, "contacts": contacts} | engine.energies_at_grains()
