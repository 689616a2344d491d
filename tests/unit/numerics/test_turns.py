"""Cosine and sine of angles in turns."""

import numpy as np
import pytest

from sand.numerics.turns import cosine_and_sine


def test_cosine_and_sine_of_turns():
    """cos(2πf) and sin(2πf) of NumPy for −½ ≤ f ≤ ½, to 4 rounding errors; the first omitted term is 4e-17."""
    turns = np.linspace(-0.5, 0.5, 1001)
    for ours, theirs in zip(cosine_and_sine(turns), (np.cos, np.sin), strict=True):
        assert ours == pytest.approx(theirs(2 * np.pi * turns), rel=0, abs=1e-15)
