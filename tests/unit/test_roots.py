"""1/√x of sums over pairs, by both roads, in vectors and alone."""

import numpy as np
import pytest

from sand.core import roots
from sand.core.jit import kernel


def filled_by(function):
    """Kernels that fill an array with its roots, as long as whole vectors or one by one."""

    def fill(x, out):
        for k in range(x.size):
            out[k] = function(x[k])

    fill.__qualname__ += function.__name__
    return kernel(fill, keep=False, wide=True)


@pytest.mark.parametrize("name", ["exact_inverse_root", "seeded_inverse_root"])
@pytest.mark.parametrize("together", [4096, 1])
def test_inverse_roots_are_right_to_rounding(name, together):
    """1/√x against extended precision: 3e-16, two roundings of at most 1.1e-16, and 5/16 e³ < 3e-18 for a seed to 1e-6.

    From 1e-37 to 1e37, and where single precision rounds x up or down; vectors of 4096 and numbers alone.
    """
    rng = np.random.default_rng(4)
    x = np.concatenate([10.0 ** rng.uniform(-37, 37, 4000), 1.0 + np.arange(-48, 48) * 2.0**-25])
    fill, found = filled_by(getattr(roots, name)), np.zeros(x.size)
    for first in range(0, x.size, together):
        fill(x[first : first + together], found[first : first + together])
    true = 1 / np.sqrt(x.astype(np.longdouble))
    np.testing.assert_array_less(np.abs(found / true - 1).astype(float), 3e-16)


def test_no_root_of_a_distance_that_is_none():
    """Grains on top of each other, x = 0, give no number, by either road: what stops a run sees it."""
    with np.errstate(all="ignore"):
        for function in (roots.exact_inverse_root, roots.seeded_inverse_root):
            fill, found = filled_by(function), np.zeros(16)
            try:
                fill(np.zeros(16), found)
            except ZeroDivisionError:  # the interpreter's way
                continue
            assert not np.isfinite(found).any()
