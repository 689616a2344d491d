"""LAMMPS' input for the worlds that are timed: the same grains, the same law as near as it has it.

Units are `micro`: µm, pg (1e-15 kg), µs, so that speeds are m/s, moduli kPa and surface energies mJ/m².
"""

from __future__ import annotations

import math

import numpy as np

import sand
from sand.contact.tangential import roll_stiffness

from . import worlds


def law(grains: sand.Grains, twisting: str = "marshall") -> str:
    """The contact law of equal grains: JKR, Mindlin sliding, sds rolling, marshall twisting.

    Rolling has the stiffness of SAND's and its limit ξ_c, as LAMMPS takes it: μ × (|F| + 2 F_c) at rest.
    """
    material, reduced = grains.materials[0], 0.5 * float(grains.radius[0])
    pull = 3.0 * math.pi * material.surface_energy * reduced
    roll = roll_stiffness(pull, reduced)
    friction = roll * material.rolling_limit / (2.0 * pull)
    energy = 1e3 * material.surface_energy
    normal = f"jkr {1e-3 * material.young_modulus:.10g} 6700.0 {material.poisson_ratio} {energy:.10g}"
    rolling = f"rolling sds {1e3 * roll:.8g} 0.0 {friction:.8g}"
    return f"{normal} tangential mindlin NULL 0.0 0.5 {rolling} twisting {twisting} damping viscoelastic"


def data(grains: sand.Grains, box: float | None = None, moments: bool = False, unit: float = 1e-6) -> str:
    """The file `grains.data` in µm, pg, µs; with `unit` = 1 in the user's own numbers.

    Args:
        box: side of a periodic cube [m]; None: open, around the grains.
        moments: as atoms of style `hybrid sphere dipole`, else `sphere`.
    """
    place = grains.position / unit
    half = 0.5 * box / unit if box else 1.2 * float(np.abs(place).max()) + 10.0
    density = float(grains.mass[0] / (4.0 / 3.0 * math.pi * grains.radius[0] ** 3)) * (1e-3 if unit < 1.0 else 1.0)
    size = f"{2.0 * float(grains.radius[0]) / unit:.10g} {density:.10g}"
    walls = "\n".join(f"{-half:.17g} {half:.17g} {axis}lo {axis}hi" for axis in "xyz")
    head = f"grains\n\n{len(grains)} atoms\n1 atom types\n\n{walls}\n\n"
    moving = [f"{k + 1} {x:.17g} {y:.17g} {z:.17g} 0 0 0" for k, (x, y, z) in enumerate(grains.velocity)]
    speeds = "\n\nVelocities\n\n" + "\n".join(moving) + "\n"
    if not moments:
        rows = [f"{k + 1} 1 {size} {x:.17g} {y:.17g} {z:.17g}" for k, (x, y, z) in enumerate(place)]
        return head + "Atoms # sphere\n\n" + "\n".join(rows) + speeds
    # too weak to move anything: what a pair costs does not depend on it
    arrow = 1e-5 * grains.moment / np.linalg.norm(grains.moment, axis=1)[:, None]
    rows = [
        f"{k + 1} 1 {x:.17g} {y:.17g} {z:.17g} {size} 0.0 {u:.9g} {v:.9g} {w:.9g}"
        for k, ((x, y, z), (u, v, w)) in enumerate(zip(place, arrow, strict=True))
    ]
    return head + "Atoms # hybrid\n\n" + "\n".join(rows) + speeds


def contact_steps(grains: sand.Grains, box: float | None = None) -> tuple[str, str]:
    """Contacts alone."""
    edge = "p" if box else "f"
    deck = f"""
units micro
atom_style sphere
boundary {edge} {edge} {edge}
newton off
comm_modify vel yes
read_data grains.data
pair_style granular
pair_coeff * * {law(grains)}
neighbor 0.1 bin
neigh_modify every 1 delay 0 check yes
timestep {1e6 * worlds.STEP}
fix 1 all nve/sphere
thermo 100000000
"""
    return deck, data(grains, box)


def _rooms(count: int) -> str:
    return f"neigh_modify every 1 delay 0 check yes one {max(2 * count, 2000)} page {max(40 * count, 100000)}"


def contacts_and_dipoles(grains: sand.Grains) -> tuple[str, str]:
    """Contacts and the dipoles of all pairs, summed in every step."""
    deck = f"""
units micro
atom_style hybrid sphere dipole
boundary f f f
newton off
comm_modify vel yes
read_data grains.data
pair_style hybrid/overlay granular lj/cut/dipole/cut 0.1 500.0
pair_coeff * * granular {law(grains)}
pair_coeff * * lj/cut/dipole/cut 0.0 0.1
neighbor 0.1 bin
{_rooms(len(grains))}
timestep {1e6 * worlds.STEP}
fix 1 all nve/sphere update dipole
thermo 100000000
"""
    return deck, data(grains, moments=True)


def dipoles(grains: sand.Grains) -> tuple[str, str]:
    """Dipoles of all pairs alone, by Newton's third law."""
    deck = f"""
units lj
atom_style hybrid sphere dipole
boundary f f f
newton on
read_data grains.data
pair_style lj/cut/dipole/cut 0.01 500.0
pair_coeff * * 0.0 0.01
neighbor 1.0 nsq
{_rooms(len(grains))}
timestep 1e-5
fix 1 all nve/sphere update dipole
thermo 100000000
"""
    return deck, data(grains, moments=True)


def lists(grains: sand.Grains, box: float, cutoff: float) -> tuple[str, str]:
    """A neighbour list made anew in every step."""
    deck = f"""
units lj
atom_style sphere
boundary p p p
newton on
read_data grains.data
pair_style zero {cutoff:.17g}
pair_coeff * *
neighbor 0.0 bin
neigh_modify every 1 delay 0 check no one 4000 page 400000
timestep 1e-6
fix 1 all nve/sphere
thermo 100000000
"""
    return deck, data(grains, box, unit=1.0)
