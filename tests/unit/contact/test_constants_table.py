"""The table of constants of contacts: rows that checkpoints of earlier versions lack."""

import numpy as np
import pytest

from sand.basics.material import ICE, SILICA
from sand.contact.constants_table import column_loops, constant_names, with_derived
from sand.contact.law import LAWS, contact_constants
from sand.contact.model import Contact

RADII = np.array([1e-8, 3e-8, 2e-8])
PAIRS = np.array([[0, 2], [1, 1]], np.uint32)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("energy", [0.025, 0.0])
def test_derived_constants_of_an_earlier_checkpoint(law, energy):
    """R² k_r, ζ_c², ξ_c², 1/δ_c, r, 1/r follow bit by bit from the other rows and the radii, also without adhesion."""
    of_pair, own = contact_constants(LAWS[law]), LAWS[law]
    pairing = Contact(law=law).pairing(SILICA.but(name="own", surface_energy=energy), ICE)
    table = np.zeros((len(constant_names(own)), 2))
    for c, (i, j) in enumerate(PAIRS.T):
        column_loops(own).store(table, c, of_pair(pairing, RADII[i], RADII[j], 1e-18, 3e-18))
    earlier = table[:-10]
    saved = {"contacts/constants": earlier, "contacts/pair": PAIRS, "grains/radius": RADII}
    assert (with_derived(own, saved)["contacts/constants"] == table).all()
    # one column serves all contacts; columns that are complete stay as they are
    equal = with_derived(own, saved | {"contacts/constants": earlier[:, :1]})
    assert (equal["contacts/constants"] == table[:, :1]).all()
    assert with_derived(own, {"contacts/constants": table})["contacts/constants"] is table


def test_derived_constants_at_walls():
    """At a wall r1 is that of the grain, which is the first of the pair, and r2 is infinite."""
    own = LAWS["jkr"]
    names = constant_names(own)
    saved = {"wall_contacts/constants": np.ones((len(names) - 10, 1)), "grains/radius": RADII}
    saved["wall_contacts/pair"] = np.array([[1], [0]], np.uint32)
    table = with_derived(own, saved)["wall_contacts/constants"]
    found = [table[names.index(f"derived.{name}"), 0] for name in ("inverse_smaller_radius", "radius2", "inverse_sum")]
    assert found == [1.0 / RADII[1], np.inf, 0.0]
