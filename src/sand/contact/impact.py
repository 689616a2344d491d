"""Speed of an impact in the unit in which stresses of elastic bodies depend on it alone, and the fastest one of a run.

Two elastic spheres that hit each other at the relative speed v along the normal, without adhesion, reach the overlap
(Hertz; Johnson 1985) at which ½ m̄ v² = (8/15) E* R^(1/2) δ^(5/2), with the reduced mass m̄ and radius R.  With
the density ρ̄ = 3 m̄/(16π R³), which is ρ for equal spheres, and

    s = v/√(2 E*/ρ̄)

the overlap is δ/R = (10π s²)^(2/5) and the largest pressure p₀ = (2/π) E* (δ/R)^(1/2).  For equal spheres √(2 E*/ρ̄)
is √(Y/(1 − ν²)ρ), with Young's modulus Y.
"""

import math

from ..basics.state import IMPACT_SPEED, LARGEST_IMPACT
from ..compiler.jit import formula, loop


@formula
def impact_share(speed, mass, radius, modulus):
    """Speed of an impact over √(2 E*/ρ̄): s of the module's docstring.

    Parameters
    ----------
    speed : float
        Relative speed v along the normal [m/s].
    mass, radius : float
        Reduced mass m̄ [kg] and radius R [m]; those of the grain at a wall that is fixed.
    modulus : float
        E* [Pa].
    """
    return speed * math.sqrt(3.0 * mass / (32.0 * math.pi * radius**3 * modulus))


@loop
def note_impact(clock, speed, mass, radius, modulus):
    """Keep share and speed of an impact in `State.clock` if it is the fastest so far; arguments as `impact_share`."""
    share = impact_share(speed, mass, radius, modulus)
    if share > clock[LARGEST_IMPACT]:
        clock[LARGEST_IMPACT] = share
        clock[IMPACT_SPEED] = speed
