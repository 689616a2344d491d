"""What a contact that forms inside a step does to the closing speed."""

import math

from ..compiler.jit import formula
from . import jkr as adhesion
from . import law as contact


@formula
def speed_gained(overlap, closing, reduced, bond, dt):
    """w' − w [m/s]: closing speed that the contact adds between first touch and this overlap; 0 if not closing.

    ½ m̄ w'² + U(δ) + dt² (k w'²/12 − F²/(24 m̄)) = ½ m̄ w² + U(0), k = dF/dδ: on the left is what velocity Verlet
    keeps in the contact (Hairer, Lubich & Wanner 2006, IX.1).  Without the terms in dt² the mean energy of the ringing
    that follows is (ω dt)²/8 too low.  Where no speed is left (no adhesion, a graze) the pair has none.
    """
    if not closing > 0.0:
        return 0.0
    y = adhesion.root(adhesion.stretch(overlap, bond.pull_off_overlap))
    work = -contact.forming(bond) - contact.normal_energy(overlap, y, bond)
    force = contact.normal_force(overlap, y, bond) * dt / reduced
    stiffer = contact.normal_stiffness_at(overlap, y, bond) * dt * dt / reduced
    square = (closing * closing + 2.0 * work / reduced + force * force / 12.0) / (1.0 + stiffer / 6.0)
    return math.sqrt(max(square, 0.0)) - closing
