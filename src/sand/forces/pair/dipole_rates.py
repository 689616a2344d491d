"""Rates of change of dipole loads: the first-order terms of the Taylor series, Eqs. 51–56 of the paper, corrected.

Eq. 53 is printed with the moment of the wrong grain, Eq. 54 with the Jacobians of F (docs: misprints).  The chain rule
applied to Eqs. 35 and 39 with r = x1 − x2 (`apart`) and the rates ṙ, μ̇1, μ̇2 equals the product with the Jacobians,
dF = (∂F/∂r) ṙ + (∂F/∂μ1) μ̇1 + (∂F/∂μ2) μ̇2, without computing these.
"""

import math

from ...compiler.jit import formula
from ...numerics.vec import add, axpy, dot, scale, sub
from .dipole_formulas import cut_weight


@formula
def cut_curvature(square, cutoff):
    """d(slope)/d(r²) [1/m⁴] of the slope of `cut_weight`: −120 c² t(1−t)(1−2t), c = 1/(r_c² − r_s²)."""
    t = min(max((cutoff.square - square) * cutoff.inverse_shell, 0.0), 1.0)
    return -120.0 * cutoff.inverse_shell * cutoff.inverse_shell * t * (1.0 - t) * (1.0 - 2.0 * t)


@formula
def uncut_rates(apart, moment1, moment2, moving, turning1, turning2, k):
    """Force, flux densities and energy of `pair_load`, and the rates of force and flux densities.

    Parameters
    ----------
    apart : tuple
        r = x1 − x2 [m].
    moment1, moment2 : tuple
        μ1, μ2 [A m²].
    moving : tuple
        ṙ = v1 − v2 [m/s].
    turning1, turning2 : tuple
        μ̇1, μ̇2 [A m²/s].
    k : float
        μ₀/4π [T m/A].
    """
    inverse2 = 1.0 / dot(apart, apart)
    inverse3 = k * inverse2 * math.sqrt(inverse2)
    three = 3.0 * inverse3 * inverse2
    radial = dot(apart, moving) * inverse2
    inverse3_rate, three_rate = -3.0 * inverse3 * radial, -5.0 * three * radial
    along1, along2, both = dot(moment1, apart), dot(moment2, apart), dot(moment1, moment2)
    along1_rate = dot(turning1, apart) + dot(moment1, moving)
    along2_rate = dot(turning2, apart) + dot(moment2, moving)
    both_rate = dot(turning1, moment2) + dot(moment1, turning2)
    product = along1 * along2 * inverse2
    product_rate = (along1_rate * along2 + along1 * along2_rate) * inverse2 - 2.0 * product * radial
    middle, middle_rate = both - 5.0 * product, both_rate - 5.0 * product_rate
    bracket = axpy(middle, apart, add(scale(along1, moment2), scale(along2, moment1)))
    bracket_rate = axpy(middle_rate, apart, axpy(middle, moving, scale(along1_rate, moment2)))
    bracket_rate = add(bracket_rate, axpy(along1, turning2, axpy(along2, turning1, scale(along2_rate, moment1))))
    force_rate = axpy(three_rate, bracket, scale(three, bracket_rate))
    field1 = sub(scale(three * along2, apart), scale(inverse3, moment2))
    field2 = sub(scale(three * along1, apart), scale(inverse3, moment1))
    grow1, grow2 = three_rate * along1 + three * along1_rate, three_rate * along2 + three * along2_rate
    rate1 = axpy(grow2, apart, axpy(three * along2, moving, axpy(-inverse3_rate, moment2, scale(-inverse3, turning2))))
    rate2 = axpy(grow1, apart, axpy(three * along1, moving, axpy(-inverse3_rate, moment1, scale(-inverse3, turning1))))
    energy = inverse3 * (both - 3.0 * product)
    return scale(three, bracket), field1, field2, energy, force_rate, rate1, rate2


@formula
def pair_rates(apart, moment1, moment2, moving, turning1, turning2, k, cutoff):
    """Rates Ḟ on 1 [N/s] and Ḃ at 1 and 2 [T/s] of `pair_load_cut`; arguments as for `uncut_rates`.

    With the weight S(r²) and s = −2 dS/d(r²), F = S F_d + U s r and B = S B_d:

        Ḟ = S Ḟ_d + Ṡ F_d + (U̇ s + U ṡ) r + U s ṙ,  Ḃ = S Ḃ_d + Ṡ B_d
        U̇ = −F_d·ṙ − μ̇1·B1 − μ̇2·B2,  Ṡ = −s r·ṙ
    """
    force, field1, field2, energy, force_rate, rate1, rate2 = uncut_rates(
        apart, moment1, moment2, moving, turning1, turning2, k
    )
    square, radial = dot(apart, apart), dot(apart, moving)
    weight, slope = cut_weight(square, cutoff)
    weight_rate, slope_rate = -slope * radial, 2.0 * cut_curvature(square, cutoff) * radial
    energy_rate = -dot(force, moving) - dot(turning1, field1) - dot(turning2, field2)
    shell = axpy(energy_rate * slope + energy * slope_rate, apart, scale(energy * slope, moving))
    return (
        add(shell, axpy(weight, force_rate, scale(weight_rate, force))),
        axpy(weight, rate1, scale(weight_rate, field1)),
        axpy(weight, rate2, scale(weight_rate, field2)),
    )
