"""1/√x of sums over pairs, by both methods, vectorised and scalar."""

import numpy as np
import pytest

import sand
from sand.compiler.jit import COMPILED
from sand.compiler.processor import FAST_512_BIT
from sand.compiler.stage import stage
from sand.constants import MAGNETIC
from sand.forces.pair import dipole_loops as dipoles
from sand.forces.pair.cutoff import UNCUT
from sand.integrate.force_stages import SUM, WHOLE, pair_force_stages
from sand.numerics import roots
from sand.simulation.assemble import WIDE_FROM
from sand.state.arrays import empty_long_range_arrays

from ..tables import table_of


def filled_by(function):
    """Stages that fill an array with its roots, as long as whole vectors or one by one."""

    def fill(x, out):
        for k in range(x.size):
            out[k] = function(x[k])
        return 0

    fill.__module__ = "sand.of_a_test"  # compiled, with the longest vectors, as functions of SAND are
    return stage("inverse roots", long_vectors=True, cached=False)(fill)


@pytest.mark.compiled("small")
@pytest.mark.parametrize("name", ["exact_inverse_root", "seeded_inverse_root"])
@pytest.mark.parametrize("together", [4096, 1])
def test_inverse_roots_are_right_to_rounding(name, together):
    """1/√x against extended precision: 3e-16 = two roundings of 1.1e-16, and 5/16 e³ < 3e-18 for a seed to 1e-6.

    From 1e-37 to 1e37, and where single precision rounds x up or down; arrays of 4096 and scalars.
    """
    rng = np.random.default_rng(4)
    x = np.concatenate([10.0 ** rng.uniform(-37, 37, 4000), 1.0 + np.arange(-48, 48) * 2.0**-25])
    fill, found = filled_by(getattr(roots, name)), np.zeros(x.size)
    for first in range(0, x.size, together):
        fill(x[first : first + together], found[first : first + together])
    true = 1 / np.sqrt(x.astype(np.longdouble))
    np.testing.assert_array_less(np.abs(found / true - 1).astype(float), 3e-16)


@pytest.mark.compiled("small")
def test_inverse_root_of_zero_is_not_finite():
    """Coincident grains, x = 0, give inf or NaN by either method, which the driver detects."""
    with np.errstate(all="ignore"):
        for function in (roots.exact_inverse_root, roots.seeded_inverse_root):
            fill, found = filled_by(function), np.zeros(16)
            try:
                fill(np.zeros(16), found)
            except ZeroDivisionError:  # as the interpreter does
                assert not COMPILED
                continue
            assert not np.isfinite(found).any()


@pytest.mark.compiled("small")
@pytest.mark.parametrize("count", [77, *(pytest.param(n, marks=pytest.mark.validate) for n in (2, 1001))])
def test_sums_with_seeded_roots_agree(count):
    """Forces and fields of all pairs with either root: ten roundings in 1000 terms, 1e-13 of the largest.

    Rows that fill whole vectors and rows that do not; from 1000 grains on in blocks.
    """
    rng = np.random.default_rng(3)
    positions = rng.permutation(11**3)[:count, None] // [1, 11, 121] % 11
    grains = sand.Grains(positions * 1e-7, 1e-8, sand.IRON, moment=6e-18 * rng.normal(size=(count, 3)))
    span, found = sand.Box.open().span, []
    for pair in (dipoles.uncut_pair, dipoles.uncut_pair_seeded):
        loads, far, own = (
            pair_force_stages(dipoles.all_pairs(pair), True)[SUM],
            empty_long_range_arrays(count, 0, 8),
            grains.copy(),
        )
        numbers = dipoles.DipoleParameters(MAGNETIC, UNCUT)
        loads.run(table_of(grains=own.arrays, long_range=far, span=span), numbers, WHOLE)
        found.append((far.force, far.torque, own.arrays.field))
    for exact, seeded in zip(*found, strict=True):
        assert np.abs(exact - seeded).max() < 1e-13 * np.abs(exact).max()
        assert np.abs(exact - seeded).max() > 0.0 or count == 2  # the two methods differ


def test_when_seeded_roots_are_used():
    """Fewer grains than WIDE_FROM, cut-offs, and other processors use the processor's square root."""
    for count in (WIDE_FROM - 1, WIDE_FROM):
        grains = sand.Grains(
            1e-6 * np.arange(3 * count).reshape(count, 3), 1e-8, sand.IRON, moment=[[6e-18, 0, 0]] * count
        )
        (_, sums, _), *_ = sand.Simulation(grains, [sand.Dipoles()])._engine.long_range
        assert (sums is dipoles.ALL_PAIRS) == (count < WIDE_FROM or not FAST_512_BIT)
        (_, sums, _), *_ = sand.Simulation(grains, [sand.Dipoles(cutoff="1 um")])._engine.long_range
        assert sums in (dipoles.ALL_PAIRS_CUT, dipoles.LISTED_PAIRS)
