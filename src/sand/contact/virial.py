"""The virial of contacts, from which their part of the stress follows: W_ab = Σ l_a f_b [J] (Love 1927, Weber 1966).

l is the nearest image of x1 − x2, and f the force on grain 1, that of dashpots included.  With W = V P of a volume V
the pressure tensor P is positive in compression.  While grains and box are strained homogeneously, r → (1 + ε) r at
fixed orientations, the elastic energy of contacts changes by dU = −W_ab dε_ba.
"""

from ..compiler.jit import loop
from ..compiler.stage import stage
from ..numerics.vec import load, nearest_image, sub


@loop
def contact_virial(grains, pair, force, number, span):
    """W [J] of the first contacts of a table as nine numbers, rows a of W_ab: xx, xy, xz, yx, …, zz.

    Parameters
    ----------
    grains : GrainArrays
        The grains.
    pair : ndarray
        (2, C) grains 1 and 2 of the contacts.
    force : ndarray
        (3, C) forces on grain 1 [N].
    number : int
        Number of contacts that count.
    span : Span
        The box.
    """
    xx = xy = xz = yx = yy = yz = zx = zy = zz = 0.0
    for c in range(number):
        l = nearest_image(sub(load(grains.position, pair[0, c]), load(grains.position, pair[1, c])), span)
        f = load(force, c)
        xx += l[0] * f[0]
        xy += l[0] * f[1]
        xz += l[0] * f[2]
        yx += l[1] * f[0]
        yy += l[1] * f[1]
        yz += l[1] * f[2]
        zx += l[2] * f[0]
        zy += l[2] * f[1]
        zz += l[2] * f[2]
    return xx, xy, xz, yx, yy, yz, zx, zy, zz


@stage("the stress of contacts")
def measure_virial(grains, contacts, span, parameters):
    """Fill the array parameters[1] (9,) with the virial [J] of contacts with the forces parameters[0] (3, C) [N]."""
    found = contact_virial(grains, contacts.pair, parameters[0], parameters[0].shape[1], span)
    for k in range(9):
        parameters[1][k] = found[k]
    return 0
