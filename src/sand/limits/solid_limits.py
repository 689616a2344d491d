"""Limits of grains as elastic solids that keep their charge: impacts, overlaps, spins, and fields at the surface.

The model has no such limit: its grains neither yield nor burst nor discharge. Each limit is one that no solid exceeds,
so that a warning is never too early; real grains mostly fail before.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ..analysis.body_motion import rigid_motion
from ..analysis.clusters import cluster_labels
from ..basics.box import Box
from ..basics.constants import COULOMB
from ..basics.grains import Grains
from ..basics.ramps import forces_at_points
from ..basics.state import IMPACT_SPEED, LARGEST_IMPACT, LARGEST_OVERLAP
from ..basics.units import format_quantity, text_past
from ..contact.law import contact_periods, largest_pull
from ..contact.model import Contact
from ..forces.base import Force
from ..forces.electric_field import ElectricField

IDEAL_STRENGTH = 0.1
"""Stress that no solid holds, in units of Young's modulus (ideal strength, recalled: Orowan 1949)."""
FASTEST_IMPACT = 0.03
"""Speed of an impact in units of `contact.impact.impact_share`: the largest pressure is then 0.31 E*, near 0.16 Y, from
which on even a solid of the ideal strength yields (p₀ = 1.6 times the yield stress, Johnson 1985)."""
DEEPEST_OVERLAP = 0.1
"""Overlap in radii of the smaller grain: between equal spheres the contact radius is then 0.45 R, and the largest
pressure 0.28 E*. Theories of small contacts do not hold, and no solid stays elastic."""
ELECTRON_EMISSION, ION_EMISSION = 1e9, 1e10
"""Fields [V/m] at which a surface emits electrons, or ions (orders of magnitude, recalled, not read at the source)."""
SPINS, CHARGED = "grains spin too fast for a solid", "the electric field at the surface of grains is too strong"
"""Beginnings of warnings, which are shown once in a run."""


def extreme_warnings(clock: np.ndarray) -> dict[str, str]:
    """Warnings about the fastest impact and the largest overlap so far, by their beginning.

    Parameters
    ----------
    clock : ndarray
        `State.clock`.
    """
    found, share, overlap = {}, float(clock[LARGEST_IMPACT]), float(clock[LARGEST_OVERLAP])
    if share > FASTEST_IMPACT:
        about = "impacts are too fast for elastic grains"
        found[about] = (
            f"{about}: up to {format_quantity(float(clock[IMPACT_SPEED]), 'm/s')} along the normal, "
            f"{text_past(share, FASTEST_IMPACT)} of √(2E*/ρ) (limit {FASTEST_IMPACT:g}), at which every solid yields; "
            "the model rebounds, real grains deform: use slower grains"
        )
    if overlap > DEEPEST_OVERLAP:
        about = "grains overlap too deeply for a contact law"
        found[about] = (
            f"{about}: up to {text_past(overlap, DEEPEST_OVERLAP)} radii of the smaller grain (limit "
            f"{DEEPEST_OVERLAP:g}), at which solids yield; take forces as estimates, or use slower impacts, weaker "
            "loads or less adhesion"
        )
    return found


def grain_warnings(grains: Grains, forces: Sequence[Force]) -> dict[str, str]:
    """Warnings about grains that spin too fast and about their charges, by their beginning."""
    found = {SPINS: _spins(grains), CHARGED: _fields(grains, forces)}
    return {about: text for about, text in found.items() if text}


def spin_stress(density: np.ndarray, radius: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Mean tensile stress ρω²r²/4 [Pa] in a section of a spinning sphere that contains the axis.

    The centrifugal force on half of the sphere, ω² ∫ρ x dV = ρω² πr⁴/4, over the section πr².

    Parameters
    ----------
    density, radius, spin : ndarray
        ρ [kg/m³], r [m] and |ω| [rad/s].
    """
    return 0.25 * density * (spin * radius) ** 2


def _spins(grains: Grains) -> str:
    arrays, moduli = grains.arrays, [material.young_modulus for material in grains.materials]
    spin = np.sqrt((arrays.spin**2).sum(axis=0))
    density = arrays.mass / (4.0 / 3.0 * np.pi * arrays.radius**3)
    stress = spin_stress(density, arrays.radius, spin)
    if not stress.max() > IDEAL_STRENGTH * min(moduli):
        return ""
    modulus = np.array(moduli)[arrays.material]
    worst = int(np.argmax(stress / modulus))
    strength = IDEAL_STRENGTH * float(modulus[worst])
    if not stress[worst] > strength:
        return ""
    return (
        f"{SPINS}: grain {worst} spins at {spin[worst]:.3g} rad/s, and its tensile stress ρω²r²/4 = "
        f"{format_quantity(float(stress[worst]), 'Pa', strength)} exceeds a tenth of Young's modulus, "
        f"{format_quantity(strength, 'Pa')}, which no solid holds; use slower spins"
    )


def _fields(grains: Grains, forces: Sequence[Force]) -> str:
    """Fields q/4πε₀r² of the charge and E of a field far away, added: the least where both have one direction.

    Polarisation adds to it, up to 2E on a conductor. Of a ramp the strongest field counts.
    """
    outer = max(
        (
            float(np.linalg.norm(at.strength))
            for f in forces
            if isinstance(f, ElectricField)
            for at in forces_at_points(f)
        ),
        default=0.0,
    )
    if not outer and not grains.arrays.charge.any():
        return ""
    own = COULOMB * grains.charge / grains.radius**2
    for field, limit, emitted in ((outer - own, ELECTRON_EMISSION, "electrons"), (outer + own, ION_EMISSION, "ions")):
        worst = int(np.argmax(field))
        if field[worst] > limit:
            return (
                f"{CHARGED}: {format_quantity(float(field[worst]), 'V/m', limit)} at grain {worst}, which emits "
                f"{emitted} above about {format_quantity(limit, 'V/m')} and so loses its charge, but keeps it in the "
                "model; use smaller charges, larger grains or a weaker field"
            )
    return ""


def torn_clusters(grains: Grains, contact: Contact | None, pairs: np.ndarray, box: Box) -> list[str]:
    """A warning if a cluster at the start spins too fast for its contacts to hold it.

    Of the planes that contain axis and centre of mass, the one across the largest extent is looked at: the mass on one
    side of it needs the force ω² Σ m x, and the contacts across it hold at most the sum of their pull-off forces.

    Parameters
    ----------
    pairs : ndarray
        Contacts at the start (C, 2).
    """
    if contact is None or not len(pairs):
        return []
    motion, mass = rigid_motion(grains, pairs, box, cluster_labels(len(grains), pairs)), grains.mass
    spin, offset = np.linalg.norm(motion.spin, axis=0), motion.offset.T
    sizes = np.bincount(motion.label)
    for k in np.flatnonzero((sizes > 1) & (spin > 0.0)).tolist():
        own, axis = np.flatnonzero(motion.label == k), motion.spin[:, k] / spin[k]
        s = offset[own] - np.outer(offset[own] @ axis, axis)
        x = offset @ np.linalg.eigh((mass[own, None] * s).T @ s)[1][:, -1]
        force = float(spin[k] ** 2 * (mass[own] * np.maximum(x[own], 0.0)).sum())
        across = [pair for pair in pairs[motion.label[pairs[:, 0]] == k] if (x[pair[0]] > 0.0) != (x[pair[1]] > 0.0)]
        held = sum(_pull(grains, contact, *pair.tolist()) for pair in across)
        if force > held:
            return [
                f"a cluster spins too fast for its contacts: {sizes[k]} grains around grain {own[0]} spin at "
                f"{spin[k]:.3g} rad/s; one half is pulled by {format_quantity(force, 'N', held)}, and contacts hold it "
                f"by {format_quantity(held, 'N')} (sum of pull-off forces): it tears at once; use a slower spin"
            ]
    return []


def _pull(grains: Grains, contact: Contact, i: int, j: int) -> float:
    pairing = contact.pairing(*(grains.materials[grains.material[g]] for g in (i, j)))
    return largest_pull(contact.contact_law, pairing, float(grains.radius[i]), float(grains.radius[j]))


def fast_settling(grains: Grains, contact: Contact) -> list[str]:
    """A warning if `settling_time` is below the longest period of the contact of two of the largest grains."""
    times = [one.settling_time for one in forces_at_points(contact) if one.settling_time is not None]
    if not times:
        return []
    largest = [_largest(grains, kind) for kind in range(len(grains.materials))]
    found = [
        (period, mode, i, j)
        for i, j in itertools.combinations_with_replacement(largest, 2)
        for mode, period in contact_periods(
            contact.contact_law,
            contact.pairing(*(grains.materials[grains.material[g]] for g in (i, j))),
            *(float(grains.radius[g]) for g in (i, j)),
            *(float(grains.mass[g]) for g in (i, j)),
        ).items()
        if period < np.inf
    ]
    period, mode, i, j = max(found, default=(0.0, "", 0, 0))
    if min(times) >= period:
        return []
    normal = max(period for period, mode, *_ in found if mode == "normal")
    rebound = " and grains hardly rebound" if min(times) < normal else ""
    return [
        f"contact: settling_time = {format_quantity(min(times), 's', period)} is below the period of {mode} of two "
        "grains of radius "
        f"{' and '.join(format_quantity(float(grains.radius[g]), 'm') for g in dict.fromkeys((i, j)))}, "
        f"{format_quantity(period, 's')}: grains in contact stop within one oscillation, so that aggregates hardly "
        f"restructure{rebound}; use {format_quantity(10.0 * period, 's')} or more"
    ]


def _largest(grains: Grains, kind: int) -> int:
    """Index of the largest grain of a material."""
    own = np.flatnonzero(grains.material == kind)
    return int(own[np.argmax(grains.radius[own])])
