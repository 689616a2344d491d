"""Quantities of grains and contacts."""

import numpy as np
import pytest

from sand.analysis.quantities import GRAIN_NAMES, cluster_rank, measured, quantity
from sand.basics.errors import BadInput

from ..synthetic_frames import R, frame_of


def test_quantities_follow_their_formulas():
    """Each of the table by its formula: cosines, speeds, energies with spin, ranks of clusters."""
    frame = frame_of(
        np.eye(3) * 3 * R,
        [(1, 2)],
        velocity=np.diag([1.0, 2.0, 3.0]),
        spin=np.diag([1e8, 0.0, 0.0]),
        moment=np.array([[0, 0, 2.0], [0, 1.0, 0], [0, 1.0, 1.0]]) * 1e-18,
    )
    inertia = 0.4 * 3e-20 * R**2
    energy = 0.5 * 3e-20 * np.array([1.0, 4.0, 9.0]) + 0.5 * inertia * np.array([1e16, 0, 0])
    np.testing.assert_allclose(measured(frame, "kinetic_energy"), energy)
    np.testing.assert_array_equal(measured(frame, "speed"), [1, 2, 3])
    np.testing.assert_array_equal(measured(frame, "coordination"), [0, 1, 1])
    np.testing.assert_array_equal(measured(frame, "cluster"), [1, 0, 0])
    np.testing.assert_array_equal(measured(frame, "size"), [1, 2, 2])
    np.testing.assert_allclose(measured(frame, "alignment"), [np.nan, 2 / 5**0.5, 3 / 10**0.5])
    np.testing.assert_allclose(measured(frame, "field_alignment", np.array([0, 0, 1e-3])), [1.0, 0.0, 0.5**0.5])
    np.testing.assert_allclose(measured(frame, "load"), 1e-9)
    np.testing.assert_array_equal(measured(frame, "mode"), [2])
    np.testing.assert_array_equal(cluster_rank(4, np.array([(2, 3)])), [1, 2, 0, 0])
    assert all(quantity(name).meaning for name in GRAIN_NAMES)
    with pytest.raises(
        BadInput, match="field_alignment is not known: no grain has a moment, or there is no external field"
    ):
        measured(frame, "field_alignment")
    with pytest.raises(BadInput, match="did you mean 'speed'"):
        quantity("sped")
