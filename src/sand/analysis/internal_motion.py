"""Motion of the grains of a cluster relative to its rigid motion."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..arguments import checked
from ..box import Box
from .body_motion import body_motion

__all__ = ["internal_kinetic_energy"]


@checked
def internal_kinetic_energy(grains: Any, pairs: np.ndarray, box: Box) -> tuple[np.ndarray, np.ndarray]:
    """Kinetic energy of each cluster beyond its rigid motion: the vibration of its contacts.

    K − P²/2M − ½ Ω·J Ω,  Ω = J⁻¹ L, with momentum P, angular momentum L about the centre of mass (spins included) and
    the inertia tensor J = Σ [m (s² 1 − s s) + I 1].  A cluster of n > 1 grains has 6n − 6 internal degrees of freedom,
    each with a mean kinetic energy of ½ k_B T in equilibrium; a single grain has none.

    Parameters
    ----------
    grains : Grains
        Grains of a simulation or a frame.
    pairs : ndarray
        Contacts (C, 2).
    box : Box
        Boundary conditions.

    Returns
    -------
    energy : ndarray
        Internal kinetic energy of each cluster [J], (K,).
    degrees : ndarray
        Internal degrees of freedom of each cluster, (K,).
    """
    motion = body_motion(grains, pairs, box)
    return motion.internal, np.where(motion.grains > 1, 6 * motion.grains - 6, 0)
