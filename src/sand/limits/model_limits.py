"""Limits of the model for given grains and forces: vibration of fresh contacts, creep, and permanent moments."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np

from ..basics.box import Box
from ..basics.constants import BOLTZMANN
from ..basics.grains import Grains
from ..basics.material import Material
from ..basics.temperature import kinetic_temperature
from ..basics.units import MELTED, format_quantity, text_past
from ..contact.law import contact_constants, ringing_energy
from ..contact.model import DAMPED_SPEED_GAIN, Contact
from ..forces.base import Force
from ..forces.magnetic_field import Field
from ..forces.pair.dipoles import Dipoles
from ..theory.magnetic_limits import QUOTED_SIZES, MagneticLimits, contact_field, magnetic_limits
from .truncation import given_temperature

CREEP = 10.0
"""Elastic energy at the limit of a mode, in k_B T, below which thermal motion makes contacts creep."""
REMANENCE = 0.1
"""Largest share of the saturation moment that a grain with several domains keeps (recalled: below 0.05 to 0.1)."""
STRONGEST_FIELD = 5.0
"""Flux density [T] above which a field is more probably a mistake of unit than a superconducting magnet."""
COLD = 1e-6
"""Temperature [K] for limits that do not depend on it."""


def bath_temperature(grains: Grains, forces: Sequence[Force], box: Box) -> float:
    """Temperature [K] of a Brownian gas or of the bath of contacts, the higher one, else of the grains; 0 without any.

    Velocities are taken as thermal in a box that is periodic on all axes: in open space they are those of bodies that
    collide. Above `MELTED` they are no temperature of a solid either, but follow from forces.
    """
    if given := given_temperature(forces):
        return given
    thermal = kinetic_temperature(grains) if all(side is not None for side in box.lengths) else 0.0
    return thermal if thermal <= MELTED else 0.0


def limit_rows(grains: Grains, forces: Sequence[Force], box: Box) -> dict[str, str]:
    """What `sand info` says about fresh contacts and permanent moments, by label; empty without such forces."""
    kelvin = bath_temperature(grains, forces, box)
    rows = {
        "fresh contact": [_ringing(f, grains, k, kelvin) for f in _contacts(forces) for k in _kinds(grains)],
        "moments": [_moments(grains, k, kelvin) for k in _kinds(grains) if _has_dipoles(forces)],
    }
    return {label: "; ".join(texts) for label, own in rows.items() if (texts := [text for text in own if text])}


def limit_warnings(grains: Grains, forces: Sequence[Force], box: Box) -> list[str]:
    """Warnings where thermal motion makes contacts creep, and where moments are not fixed in the grains."""
    kelvin = bath_temperature(grains, forces, box)
    warnings = []
    if kelvin > 0.0:
        for contact in _contacts(forces):
            pairs = itertools.combinations_with_replacement(_kinds(grains), 2)
            warnings += [_creep(contact, grains, a, b, kelvin) for a, b in pairs]
    warnings += [_strong_field(force) for force in forces if isinstance(force, Field)]
    if _has_dipoles(forces):
        warnings += [text for k in _kinds(grains) for text in _moment_warnings(grains, k, kelvin)]
    return [text for text in warnings if text]


def _strong_field(field: Field) -> str:
    """Warning if a field is stronger than that of most magnets at any time, else ""."""
    largest = field.flux_density_size()
    if not largest > STRONGEST_FIELD:
        return ""
    return (
        f"field: a flux density of up to {format_quantity(largest, 'T', STRONGEST_FIELD)} is above {STRONGEST_FIELD:g} "
        "T, which only superconducting magnets reach; check its unit: a number without one is in T"
    )


def _contacts(forces: Sequence[Force]) -> list[Contact]:
    return [force for force in forces if isinstance(force, Contact)]


def _has_dipoles(forces: Sequence[Force]) -> bool:
    return any(isinstance(force, Dipoles) for force in forces)


def _kinds(grains: Grains) -> range:
    return range(len(grains.materials))


def _ringing(contact: Contact, grains: Grains, kind: int, kelvin: float) -> str:
    """Energy that a touch of two grains of this material leaves in vibration, for the mean radius."""
    material, radius = grains.materials[kind], float(grains.radius[grains.material == kind].mean())
    energy = ringing_energy(contact.contact_law, contact.pairing(material, material), radius, radius)
    if energy == 0.0:  # no adhesion
        return ""
    thermal = f", {energy / (BOLTZMANN * kelvin):.3g} kT at {kelvin:.4g} K" if kelvin > 0.0 else ""
    kept = f"damping: {contact.damping}"
    if contact.damping == "none":
        kept = (
            "nothing removes it: for growth choose a damping, 'critical' lets grains stick up to "
            f"{DAMPED_SPEED_GAIN:g} times the speed"
        )
        if contact.settling_time is not None:
            kept = f"settling time: {format_quantity(contact.settling_time, 's')}"
    hot = f"{energy / BOLTZMANN:.2g} K"
    return f"a touch of {material.name} grains leaves {energy:.3g} J ({hot}{thermal}) in vibration; {kept}"


def _creep(contact: Contact, grains: Grains, a: int, b: int, kelvin: float) -> str:
    """Warning if ½ k q_c² of a mode is below `CREEP` k_B T for the smallest grains of two materials, else ""."""
    first, second = grains.materials[a], grains.materials[b]
    r1, r2 = (float(grains.radius[grains.material == k].min()) for k in (a, b))
    c = contact_constants(contact.contact_law)(contact.pairing(first, second), r1, r2, 1.0, 1.0)
    if c.rest_radius == 0.0:  # no adhesion, no springs
        return ""
    modes = {
        "sliding": (c.slide_stiffness, c.slide_limit, "slide_factor"),
        "rolling": (c.roll_stiffness, c.roll_limit, "roll_factor or rolling_limit"),
        "twisting": (c.twist_stiffness, c.twist_limit, "twist_factor"),
    }
    stored = {mode: 0.5 * k * q * q / (BOLTZMANN * kelvin) for mode, (k, q, _) in modes.items()}
    weak = [mode for mode, energy in stored.items() if 0.0 < energy < CREEP]  # 0: switched off by its factor
    if not weak:
        return ""
    names = first.name if a == b else f"{first.name} and {second.name}"
    sizes = " and ".join(format_quantity(r, "m") for r in dict.fromkeys((r1, r2)))
    limits = ", ".join(f"{mode} {text_past(stored[mode], CREEP, 2)} kT" for mode in weak)
    return (
        f"contacts of {names} grains of radius {sizes} creep at {kelvin:.4g} K: up to their limits they store only "
        f"{limits} (below {CREEP:g}), and as friction has no noise they take heat from the motion of the grains; use "
        f"larger or colder grains, or a higher {', '.join(modes[mode][2] for mode in weak)}"
    )


def _magnetic(grains: Grains, kind: int, kelvin: float) -> tuple[np.ndarray, np.ndarray, MagneticLimits] | None:
    """Radii and magnetisations of the grains of a material that have a moment, and the limits of the smallest one."""
    material = grains.materials[kind]
    size = np.linalg.norm(grains.body_moment, axis=1)
    own = (grains.material == kind) & (size > 0.0)
    known = material.specific_moment > 0.0 and material.anisotropy and material.exchange_stiffness
    if not (own.any() and known):
        return None
    radius = grains.radius[own]
    limits = magnetic_limits(material, float(radius.min()), kelvin or COLD)
    return radius, size[own] / (4.0 / 3.0 * math.pi * radius**3), limits


def _moments(grains: Grains, kind: int, kelvin: float) -> str:
    """The limits of permanent moments of one material."""
    found = _magnetic(grains, kind, kelvin)
    if found is None:
        return ""
    _, magnetisation, limits = found
    field = contact_field(float(magnetisation.max()))
    strong = field > limits.anisotropy_field
    solid = limits.blocking_temperature < MELTED
    stable = f"below {limits.blocking_temperature:.3g} K" if solid else "at any temperature"
    small = f" (above a radius of {format_quantity(limits.blocking_radius, 'm')})" if kelvin > 0.0 else ""
    material = grains.materials[kind]
    return (
        f"{material.name}: one domain up to a radius of {format_quantity(limits.single_domain_radius, 'm')} "
        f"({_domain_note(material)}); fixed for 100 s {stable}{small}, with the energy barrier {_barrier(material)}; "
        f"the field of a touching grain, {format_quantity(field, 'T')}, is {'above' if strong else 'below'} the "
        f"anisotropy field, {format_quantity(limits.anisotropy_field, 'T')}"
        + (": moments would turn inside the grains" if strong else "")
    )


def _domain_note(material: Material) -> str:
    """How far the single-domain radius is to be trusted, and what the paper quotes."""
    quoted = QUOTED_SIZES.get(material.name, "")
    return f"an estimate for spheres, to a factor of about two{f'; {quoted}' if quoted else ''}"


def _barrier(material: Material) -> str:
    """Formula of the energy barrier, with the kind of anisotropy."""
    if material.anisotropy_kind == "uniaxial":
        return "K V (uniaxial)"
    return "K1 V/4 (cubic)" if material.anisotropy > 0.0 else "|K1| V/12 (cubic)"


def _moment_warnings(grains: Grains, kind: int, kelvin: float) -> list[str]:
    """Warnings if moments of one material flip by themselves, or are too large for grains with several domains."""
    found = _magnetic(grains, kind, kelvin)
    if found is None:
        return []
    radius, magnetisation, limits = found
    name, warnings = grains.materials[kind].name, []
    if kelvin > 0.0 and radius.min() < limits.blocking_radius:
        warnings.append(
            f"moments of {name} grains of radius {format_quantity(float(radius.min()), 'm')} are fixed in the model, "
            f"but would flip within {format_quantity(limits.relaxation_time, 's')} at {kelvin:.4g} K "
            f"(superparamagnetic below {format_quantity(limits.blocking_radius, 'm')}, with the energy barrier "
            f"{_barrier(grains.materials[kind])}); use larger or colder grains, or give the material its anisotropy"
        )
    several = radius > limits.single_domain_radius
    share = magnetisation / limits.magnetisation
    if (several & (share > REMANENCE)).any():
        worst = int(np.argmax(np.where(several, share, 0.0)))
        warnings.append(
            f"moments of {name} grains of radius {format_quantity(float(radius[worst]), 'm')} are "
            f"{text_past(100.0 * float(share[worst]), 100.0 * REMANENCE)}% of saturation, but grains above "
            f"{format_quantity(limits.single_domain_radius, 'm')} "
            f"({_domain_note(grains.materials[kind])}) have several domains and keep less than {REMANENCE:.0%}; use "
            "smaller grains or a smaller moment"
        )
    return warnings
