"""Contacts that are there before the first step."""

import math

from ..box import nearest_image
from ..compiler.jit import kernel
from ..numerics.quaternion import turned_back
from ..numerics.vec import dot, load, load4, put, scale, sub
from . import tangential
from .events import add_contact
from .gather import sort_contacts_by_grain
from .update import bond_at, write_loads


@kernel
def add_initial_contacts(grains, contacts, count, span, law, pair, slide, roll, twist):
    """Append contacts with given displacements; returns the first one stretched beyond its break, or −1.

    Parameters
    ----------
    pair
        (2, C) grains; the arrays of contacts must have room for them.
    slide, roll
        (3, C) ζ and ξ [m], laboratory frame; what is not perpendicular to n is left out.
    twist
        (C,) φ [rad].
    """
    wrong = -1
    for k in range(twist.size):
        i, j = pair[0, k], pair[1, k]
        c = add_contact(grains, contacts, count, span, law, i, j, 0.0)
        apart = nearest_image(sub(load(grains.position, i), load(grains.position, j)), span)
        distance = math.sqrt(dot(apart, apart))
        n = scale(1.0 / distance, apart)
        r1, r2 = grains.radius[i], grains.radius[j]
        zeta, xi = load(slide, k), load(roll, k)
        zeta, xi = sub(zeta, scale(dot(zeta, n), n)), sub(xi, scale(dot(xi, n), n))
        n1, n2 = tangential.pointers_for(zeta, xi, n, r1, r2)
        put(contacts.pointer1, c, turned_back(load4(grains.orientation, i), n1))
        put(contacts.pointer2, c, turned_back(load4(grains.orientation, j), n2))
        contacts.twist[c] = twist[k]
        write_loads(grains, contacts, span, law, c)
        if wrong < 0 and r1 + r2 - distance < -bond_at(contacts, c).break_overlap:
            wrong = k
    sort_contacts_by_grain(contacts, count, grains.mass.size)
    return wrong
