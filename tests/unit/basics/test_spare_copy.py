"""Memory for copies of a state: used again, but never while somebody holds an array of the copy before."""

import numpy as np
import pytest

import sand
from sand.basics.spare_copy import SpareCopy


@pytest.fixture
def state():
    return sand.Simulation(sand.Grains([[0, 0, 0], [1e-6, 0, 0]], 1e-7, "silica")).regular_state


def copied(spare, state, time):
    """A copy of the state at a time."""
    state.clock[0] = time
    return spare.of(state)


def test_memory_is_used_again(state):
    """The third copy, too: the first use of the memory finds the bytes of all arrays."""
    spare = SpareCopy()
    for time in (1.0, 2.0, 3.0):
        copy, is_same = copied(spare, state, time)
        assert np.array_equal(copy.clock, state.clock) and copy.clock is not state.clock
        assert is_same == (time > 1.0)
        spare.keep(copy)
        del copy


HOLD = [
    lambda copy: copy,
    lambda copy: copy.grains,
    lambda copy: copy.contacts,
    lambda copy: copy.grains.arrays.position,
    lambda copy: copy.grains.position,
    lambda copy: copy.grains.position[1:, 0],
    lambda copy: memoryview(copy.clock),
]


@pytest.mark.parametrize("uses", [1, 2])
@pytest.mark.parametrize("hold", HOLD)
def test_what_a_user_has_taken_stays(state, hold, uses):
    """A copy, a group, an array, or a view of one; also of memory that was used before."""
    spare = SpareCopy()
    for _ in range(uses):
        copy, _ = copied(spare, state, 1.0)
        spare.keep(copy)
    held = hold(copy)
    del copy
    assert not copied(spare, state, 2.0)[1]
    del held


def test_after_an_error_a_copy_is_that_of_the_present_state(state):
    """A copy that replaced one that a user held, and that was never kept because its step failed."""
    spare = SpareCopy()
    for time in (1.0, 2.0):
        copy, _ = copied(spare, state, time)
        spare.keep(copy)
    copied(spare, state, 3.0)  # the user holds `copy`
    assert copied(spare, state, 4.0)[0].clock[0] == 4.0 and copy.clock[0] == 2.0
