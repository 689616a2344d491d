"""Moduli of a packing whose grains all move with the box (affine), in closed form: upper bounds of those at rest."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..basics.arguments import checked


class ContactSprings(NamedTuple):
    """The contacts of a packing, and their springs."""

    branch: np.ndarray  # (C, 3) l = x1 − x2 [m], nearest images
    radii: np.ndarray  # (C, 2) r1, r2 [m]
    slide: np.ndarray  # (C, 3) sliding displacements ζ [m]
    roll: np.ndarray  # (C, 3) rolling displacements ξ [m]
    normal_force: np.ndarray  # (C,) F_n [N], positive in compression
    normal_stiffness: np.ndarray  # (C,) k_n = dF_n/dδ [N/m] at the present overlaps
    slide_stiffness: np.ndarray  # (C,) k_s [N/m]


@checked
def contact_hessians(springs: ContactSprings) -> np.ndarray:
    """Second derivatives H (C, 3, 3) [N/m] of the energies of contacts by l, at fixed orientations of both grains.

    The energy is U_n(|l|) + ½ k_s (d² − (d·n)²) with n = l/D and d = r1 n1 − r2 n2, fixed with the contact pointers:

        H = k_n n n − (F_n/D) (1 − n n) + (k_s/D²) [(d·n)² (1 − 4 n n) + 2 d·n (d n + n d) − d d]

    Without displacements d = −(r1 + r2) n, and the last term is k_s ((r1 + r2)/D)² (1 − n n).
    """
    distance = np.linalg.norm(springs.branch, axis=1)
    n, r1, r2 = springs.branch / distance[:, None], *springs.radii.T
    shared = springs.slide / (r1 + r2)[:, None]
    tilts = springs.roll / r1[:, None] + shared, springs.roll / r2[:, None] - shared
    cosines = [np.sqrt(np.maximum(1.0 - (tilt**2).sum(axis=1), 0.0)) for tilt in tilts]
    along = -(r1 * cosines[0] + r2 * cosines[1])  # d·n
    d = springs.slide + along[:, None] * n
    unit, nn, dn = np.eye(3), _outer(n, n), _outer(d, n)
    normal = springs.normal_stiffness[:, None, None] * nn
    normal -= (springs.normal_force / distance)[:, None, None] * (unit - nn)
    a = along[:, None, None]
    sliding = a**2 * (unit - 4.0 * nn) + 2.0 * a * (dn + dn.transpose(0, 2, 1)) - _outer(d, d)
    return np.asarray(normal + (springs.slide_stiffness / distance**2)[:, None, None] * sliding)


@checked
def affine_moduli(springs: ContactSprings, pressure: np.ndarray, volume: float) -> np.ndarray:
    """Moduli −dP_aa/dε_b (3, 3) [Pa] for a strain ε_b of the box along b that all grains follow without turning.

        C_ab = (1/V) Σ l_a l_b H_ab + (1 − δ_ab) P_aa

    P_aa are forces per area of the strained box, so that ρ c² = C_aa for longitudinal waves, also under stress.

    Parameters
    ----------
    springs : ContactSprings
        The contacts.
    pressure : ndarray
        P_aa (3,) [Pa] of the contacts.
    volume : float
        V [m³].
    """
    hessian, l = contact_hessians(springs), springs.branch
    return np.asarray(np.einsum("ca,cb,cab->ab", l, l, hessian) / volume + (1.0 - np.eye(3)) * pressure[:, None])


@checked
def affine_shear_moduli(springs: ContactSprings, volume: float) -> np.ndarray:
    """Moduli (3, 3) [Pa] of shear that all grains follow without turning: displacements along b that vary along a.

    G_ab = (1/V) Σ l_a² H_bb, that of ρ c² of waves along a that are polarised along b; C_aa on the diagonal.
    """
    hessian = contact_hessians(springs)
    return np.asarray(np.einsum("ca,cbb->ab", springs.branch**2, hessian) / volume)


def _outer(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[:, :, None] * b[:, None, :]
