"""The choice of a cut-off for the two clusters with the largest moments."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import sand
from sand.basics.constants import BOLTZMANN, MAGNETIC
from sand.basics.state import CONTACTS, CUT_RADIUS
from sand.basics.temperature import kinetic_temperature
from sand.components.cluster_cutoff import ClusterCutoff
from sand.engine.component import Setup
from sand.engine.step_parameters import forces_by_type
from sand.forces.pair.dipoles import capturing_pair

BOX = sand.Box.periodic("20 um")


def gas(number=6, kelvin="100 K"):
    return sand.setup.gas(
        number, BOX, radius="10 nm", material="iron", moment="200 A m^2/kg", temperature=kelvin, seed=2
    )


def follow(grains, box=BOX, saved=None):
    """The cut-off that follows the clusters of grains without contacts, from a start or a checkpoint."""
    forces = [sand.Dipoles()]
    follower, by_type = ClusterCutoff.of(forces, grains, box), forces_by_type(forces, grains)
    arrays = {} if saved is None else {"cutoff": saved}
    setup = Setup(grains, by_type, box, sand.Verlet(), sand.Neighbours(), saved is None, arrays)
    (force,) = follower.at_start(by_type, setup).long_range
    assert force.cutoff == follower.values[CUT_RADIUS]
    return follower


def now(follower, state):
    """The text of the present cut-off."""
    return "".join(follower.present_choices(state).values())


def state_of(grains, pairs, cutoff, time=0.0):
    """What a choice reads of a state."""
    pairs = np.asarray(pairs, np.uint32).reshape(-1, 2)
    count = np.zeros(CONTACTS + 1, np.int64)
    count[CONTACTS] = len(pairs)
    contacts = SimpleNamespace(pair=np.ascontiguousarray(pairs.T))
    return SimpleNamespace(grains=grains, contacts=contacts, count=count, cutoff=cutoff, time=time)


def test_equal_single_grains():
    """b_max = √3 (2kμ²/(½m v²))^(1/3) at v = √(kT/m): the two moments and masses are those of any grain."""
    grains = gas()
    kelvin, mass, moment = kinetic_temperature(grains), grains.mass[0], np.linalg.norm(grains.moment[0])
    expected = math.sqrt(3.0) * (2.0 * MAGNETIC * moment**2 / (0.5 * mass * (BOLTZMANN * kelvin / mass))) ** (1.0 / 3.0)
    assert kelvin == pytest.approx(100.0, rel=1e-9, abs=0.0)
    assert capturing_pair(grains, None, kelvin) == (pytest.approx(expected, rel=1e-12, abs=0.0), 1, 1)
    assert sand.Dipoles().choose(grains, BOX).radius == pytest.approx(1.5 * expected, rel=1e-12, abs=0.0)


def test_clusters_count_with_their_net_moments():
    """Clusters {0,1,2}, {3,4}, {5} with net moments 1, 2 and 1.5: b_max ∝ (2·1.5)^(1/3), of clusters of 2 and 1."""
    moment = np.array([[1.0, 0, 0], [-1.0, 0, 0], [0, 0, 1.0], [0, 1.0, 0], [0, 1.0, 0], [0, 0, 1.5]]) * 6e-18
    grains = sand.Grains(1e-7 * np.arange(18.0).reshape(6, 3), "10 nm", "iron", moment=moment)
    found = capturing_pair(grains, np.array([0, 0, 0, 1, 1, 2]), 50.0)
    expected = math.sqrt(3.0) * (4.0 * MAGNETIC * 3.0 * 36e-36 / (BOLTZMANN * 50.0)) ** (1.0 / 3.0)
    assert found == (pytest.approx(expected, rel=1e-12, abs=0.0), 2, 1)
    assert str(found) == "a cluster of 2 grains and a single grain"
    assert capturing_pair(grains, np.zeros(6, int), 50.0).capture == 0.0  # one cluster
    assert capturing_pair(grains, None, 0.0).capture == math.inf


def test_the_temperature_is_that_of_the_clusters():
    """3(K − 1)/2 kT = Σ ½ M V² for K = 3 clusters in the centre-of-mass frame, without the motion within them."""
    grains, labels = gas(), np.array([0, 0, 1, 1, 2, 2])
    velocity = grains.velocity.reshape(3, 2, 3).mean(axis=1)  # equal masses
    velocity = velocity - velocity.mean(axis=0)
    energy = 0.5 * 2.0 * grains.mass[0] * (velocity**2).sum()
    assert kinetic_temperature(grains, labels) == pytest.approx(2.0 * energy / (6.0 * BOLTZMANN), rel=1e-12, abs=0.0)
    assert kinetic_temperature(grains, np.arange(6)) == pytest.approx(kinetic_temperature(grains), rel=1e-12, abs=0.0)


def test_a_new_choice_needs_growth_by_a_tenth_and_never_shortens():
    """Of two pairs: (2·1)^(1/3), then (2·2)^(1/3); the same contacts again and fewer contacts change nothing."""
    grains = gas()
    grains.arrays.moment[...] = grains.arrays.moment[:, :1]  # parallel
    follower = follow(grains)
    state, start = state_of(grains, [], follower.values.copy()), follower.values[CUT_RADIUS]
    assert follower.choose_anew(state) is None and now(follower, state) == ""
    state = state_of(grains, [(0, 1)], state.cutoff, 1e-9)
    assert follower.choose_anew(state) == pytest.approx(start * 2.0 ** (1.0 / 3.0), rel=1e-12, abs=0.0)
    state = state_of(grains, [(0, 1), (2, 4)], state.cutoff, 2e-9)
    assert follower.choose_anew(state) == pytest.approx(start * 4.0 ** (1.0 / 3.0), rel=1e-12, abs=0.0)
    assert follower.choose_anew(state) is None
    assert "since 2 ns" in now(follower, state) and "clusters of 2 and 2 grains" in now(follower, state)
    kept = state.cutoff.copy()
    grains.arrays.moment[:, 0] *= 1.3  # 2.3·2 in place of 2·2: b_max grows by 5 %
    assert follower.choose_anew(state) is None
    assert follower.choose_anew(state_of(grains, [], state.cutoff, 3e-9)) is None
    assert (state.cutoff == kept).all()


def test_half_the_box_limits_the_choice_and_the_note_is_kept():
    """1.5 b_max above (L/2)/1.35: that radius once, with a note of the time; later growth changes only b_max in it."""
    grains = gas()
    grains.arrays.moment[...] = grains.arrays.moment[:, :1]
    start = sand.Dipoles().choose(grains, BOX).radius
    box = sand.Box.periodic(2.7 * 1.1 * start)
    follower = follow(grains, box)
    state = state_of(grains, [(0, 1)], follower.values.copy(), 1e-9)
    assert follower.notes(state) == []
    assert follower.choose_anew(state) == pytest.approx(1.1 * start, rel=1e-12, abs=0.0)
    assert "from 1 ns on half the box / 1.35" in follower.message(state, start)
    assert follower.notes(state) == [follower.message(state, start)]
    state = state_of(grains, [(0, 1), (1, 2), (2, 3)], state.cutoff, 2e-9)
    assert follower.choose_anew(state) is None
    (note,) = follower.notes(state)
    assert "from 1 ns on" in note and "cluster of 4 grains and a single grain" in note


def test_which_cutoffs_follow():
    """Only the automatic one with nearest images in a periodic box."""
    grains = gas()
    for force in (sand.Dipoles("1 um"), sand.Dipoles(None), sand.Dipoles(periodic="ewald")):
        assert not ClusterCutoff.of([force], grains, BOX).items
    assert not ClusterCutoff.of([sand.Dipoles()], grains, sand.Box.open()).items


def test_a_checkpoint_whose_cutoff_does_not_fit_the_box_is_refused():
    """A radius of 0 or above (L/2)/1.35."""
    grains = gas()
    values = follow(grains).values
    for radius in (0.0, 8e-6):
        wrong = values.copy()
        wrong[CUT_RADIUS] = radius
        with pytest.raises(sand.BadInput, match=r"cut-off of the dipoles in the checkpoint is .* at most 7.407 um"):
            follow(grains, saved=wrong)
