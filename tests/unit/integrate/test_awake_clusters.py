"""When clusters come to rest: the vibration that is allowed, and the time for which it has to be low."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from sand.basics.state import CLOCK, TIME
from sand.integrate.rigid.awake_clusters import cluster_measures, find_resting_clusters, vibration_at_rest
from sand.integrate.rigid.body_touches import CLEAR, NEAR


def test_vibration_at_rest():
    """ε ½kq², or 3 (n − 1) k_B T if this is more, but at most ½kq²; a single grain has no limit."""
    assert vibration_at_rest((0.01, 0.0), 5.0, 200.0) == pytest.approx(2.0, rel=1e-15, abs=0.0)
    assert vibration_at_rest((0.01, 1.0), 5.0, 200.0) == pytest.approx(12.0, rel=1e-15, abs=0.0)
    assert vibration_at_rest((0.01, 1.0), 100.0, 200.0) == pytest.approx(200.0, rel=1e-15, abs=0.0)
    assert vibration_at_rest((0.01, 1.0), 1.0, math.inf) == math.inf


def found(size, quiet, near=CLEAR, vibrated=(), slipped=()):
    """What is found of one cluster, grains 10 … of all, with a period of 2 s, quiet for some time [s]."""
    bodies = SimpleNamespace(near=np.full(60, near), event=np.zeros(60), vibration=np.zeros(60))
    clock, measures = np.zeros(len(CLOCK)), cluster_measures(size)
    clock[TIME] = quiet
    measures.grain[:], measures.size[0], measures.period[0] = 10 + np.arange(size), size, 2.0
    measures.vibrated[list(vibrated)] = measures.slipped[list(slipped)] = 1.0
    number = find_resting_clusters.function(bodies, clock, measures)
    assert number == measures.rests.sum() and not measures.rests[1:].any()
    assert not np.delete(bodies.event, 10).any() and not np.delete(bodies.vibration, 10).any()
    return number, float(bodies.event[10]), float(bodies.vibration[10])


@pytest.mark.parametrize(("size", "wait"), [(2, 20.0), (10, 20.0), (20, 80.0)])
def test_a_cluster_rests_when_it_was_quiet_for_long_enough(size, wait):
    """After max(10, n²/10) of its longest period without vibration or slip, and with nothing near."""
    assert found(size, 1.001 * wait) == (1, 0.0, 0.0)
    assert found(size, 0.999 * wait) == (0, 0.0, 0.0)
    assert found(size, 1.001 * wait, near=NEAR) == (0, 0.0, 0.0)
    assert found(size, 2.0 * wait, vibrated=[1]) == (0, 0.0, 2.0 * wait)  # any of its grains, in this step
    assert found(size, 2.0 * wait, slipped=[1]) == (0, 2.0 * wait, 0.0)


def test_a_single_grain_rests_at_once():
    """A grain that has parted from a cluster is a body as soon as nothing is near, whatever it did before."""
    assert found(1, 1e-3, vibrated=[0], slipped=[0]) == (1, 0.0, 0.0)
    assert found(1, 1e-3, near=NEAR) == (0, 0.0, 0.0)
