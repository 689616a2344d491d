"""The stress of a simulation: numbers that follow from the tensor, volumes, refusals."""

import numpy as np

from sand.analysis.quantities import measured
from sand.basics.box import Box
from sand.simulation.stress import PRESSURES, Stress


def test_numbers_of_a_tensor():
    """Pressure, asymmetry P_yz − P_zy, …, and the columns of the ledger of a known tensor."""
    p = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0], [7.0, 8.0, 9.0]])
    stress = Stress(p, {"contacts": p}, 2.0, np.zeros((3, 3)))
    assert stress.pressure == 5.0
    np.testing.assert_array_equal(stress.asymmetry, [-2.0, 4.0, -2.0])
    assert list(stress.row()) == list(PRESSURES)
    assert list(stress.row().values()) == [5.0, 1.0, 5.0, 9.0, 7.0, 5.0, 3.0, 24**0.5]
    assert repr(stress) == "<pressure 5 Pa (xx 1 Pa, yy 5 Pa, zz 9 Pa) in 2 m^3: contacts>"


class FrameOfTwo:
    """Two grains of radii 1 and 3 across the boundary of a box of 10, pressed by a force of 5."""

    radius, pair, box = np.array([1.0, 3.0]), np.array([[0, 1]]), Box((10.0, 10.0, 10.0))
    position, force = np.array([[-4.0, 0.0, 0.0], [2.0, 0.0, 0.0]]), np.array([[5.0, 0.0, 0.0]])


def test_pressure_of_grains_in_a_frame():
    """Mean pressure of a grain: its share r_i/(r1 + r2) of l·f = 4 × 5, over 3V."""
    volume = 4.0 / 3.0 * np.pi * FrameOfTwo.radius**3
    np.testing.assert_allclose(measured(FrameOfTwo(), "pressure"), [5.0, 15.0] / (3.0 * volume), rtol=1e-14)
