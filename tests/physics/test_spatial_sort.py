"""Spatial sorting: the public API keeps the user's indices, and results change by rounding only."""

import numpy as np
import pytest

import sand
from sand.basics.state import CONTACTS, INNER_COUNT, LISTED, ORDERED, PAIRS, REBUILT
from sand.contact.events import inner_list_overflowed
from sand.engine import engine as engines
from sand.integrate.stages import INNER_SKIN_FRACTION
from sand.neighbours.spatial_sort import inverse, reorder_grains, spatial_order

from ..plugins import ForestRuth
from .test_reproducibility import state

pytestmark = pytest.mark.filterwarnings(
    "ignore:charges. the cut-off, .* ends an interaction",
    "ignore:dipoles. the cut-off, .* ends an interaction",
    "ignore:grains overlap too deeply",
)

LIST_ARRAYS = ("order", "packed_position", "packed_moment", "near", "packed_grain", "block_sums", "cell_of")
"""Long-range arrays that belong to the pair list or are filled by each sum."""
SORT_EVERY = 700
"""Steps between two sorts in these tests."""


@pytest.fixture(autouse=True)
def frequent_sorting(monkeypatch):
    """Sort after fewer steps than by default, because the runs are short."""
    monkeypatch.setattr(engines, "SORT_INTERVAL", SORT_EVERY)


def hot_gas(order="curve", **options):
    """A hot magnetic gas of unequal grains that collide, with a Verlet list, r-RESPA cycles and gas drag."""
    box = sand.Box.periodic("0.3 um")
    even = sand.setup.gas(
        80, box, radius="10 nm", material=sand.IRON, moment="200 A m^2/kg", temperature="2e5 K", seed=2
    )
    radius = np.random.default_rng(1).uniform(8e-9, 12e-9, 80)
    grains = sand.Grains(
        even.position, radius, sand.IRON, velocity=even.velocity, spin=even.spin, moment=even.moment, charge=1e-19
    )
    forces = [
        sand.Contact(),
        sand.Dipoles(cutoff="0.08 um"),
        sand.Charges(cutoff="0.08 um"),
        sand.Gas(pressure="1 mbar", temperature="300 K"),
    ]
    options |= {"neighbours": sand.Neighbours(margin="20 nm", order=order)}
    return sand.Simulation(grains, forces, box=box, seed=2, **options)


def vibrating_aggregate(order, far=()):
    """A vibrating aggregate with randomly numbered grains, random charges and masses, and moments if `far`."""
    body = sand.setup.bpca(300, radius="0.1 um", material=sand.SILICA, seed=4)
    rng = np.random.default_rng(3)
    permutation, speed = rng.permutation(300), rng.uniform(-0.01, 0.01, (300, 3))
    grains = sand.Grains(
        body.position[permutation],
        body.radius[permutation],
        sand.SILICA,
        velocity=speed,
        charge=1e-16 * rng.normal(size=300),
        moment=1e-15 * rng.normal(size=(300, 3)) if far else 0.0,
        mass=1e-17 * rng.uniform(0.5, 1.5, 300),
    )
    return sand.Simulation(grains, [sand.Contact(), *far], neighbours=sand.Neighbours(order=order))


def listed_pairs(system):
    """Pairs (grain, neighbour) of the long-range list."""
    far, row = (
        system.long_range,
        np.repeat(np.arange(len(system.grains)), np.diff(system.long_range.start.astype(int))),
    )
    return set(zip(far.order[row].tolist(), far.order[far.neighbour[: far.start[-1]]].tolist(), strict=True))


def contacts_per_grain(system):
    """Indices of the contacts of each grain, from the CSR arrays of the gather."""
    start, side = system.contacts.start.tolist(), (system.contacts.side >> 1).tolist()
    return [sorted(side[start[g] : start[g + 1]]) for g in range(len(system.grains))]


@pytest.mark.compiled("listed")
def test_sorting_and_its_inverse_restore_every_array():
    """Sorting makes grain rows[k] grain k; the inverse order restores every array bit by bit.

    In the sorted state each contact, near pair and list entry refers to the same grains as before.
    """
    sim = hot_gas()
    sim.run(steps=2000)
    system = sim.state
    system.long_range.path[...] = np.random.default_rng(2).normal(size=(3, 80))  # zero between two r-RESPA cycles
    before, pairs = state(sim), listed_pairs(system)
    assert system.count[CONTACTS] > 0
    used, permutation = system.count[CONTACTS], system.count[PAIRS]
    kept, near = system.contacts.pair[:, :used].copy(), system.pair_list.pair[:, :permutation].copy()
    order, arrays = spatial_order(system), system.grains.arrays._asdict()
    arrays |= {f"near {name}": array for name, array in system.pair_list._asdict().items()}
    arrays |= {f"far {name}": array for name, array in system.long_range._asdict().items() if name not in LIST_ARRAYS}
    arrays = {name: array for name, array in arrays.items() if array.shape[-1] == 80}
    assert len(arrays) > 20
    old = {name: array.copy() for name, array in arrays.items()}
    reorder_grains(system, order)
    for name, array in arrays.items():
        assert (array == old[name][..., order]).all(), name
    assert (system.grains.radius != old["radius"]).any() and (system.long_range.path != old["far path"]).any()
    assert contacts_per_grain(system) == [
        np.flatnonzero((system.contacts.pair[:, :used] == g).any(axis=0)).tolist() for g in range(80)
    ]
    assert (order[system.contacts.pair[:, :used]] == kept).all() and (
        order[system.pair_list.pair[:, :permutation]] == near
    ).all()
    assert {(order[i], order[j]) for i, j in listed_pairs(system)} == pairs
    reorder_grains(system, inverse(order))
    assert state(sim) == before and listed_pairs(system) == pairs


@pytest.mark.compiled("listed")
def test_public_indices_do_not_change():
    """Radii, masses and ids keep their rows during a run; contacts join grains that overlap; the energy balance closes.

    `grains` taken from the simulation before the run keeps the same rows as well.
    """
    sim = hot_gas()
    grains, start = sim.grains, sim.start
    for _ in range(4):
        sim.run(steps=SORT_EVERY)
        assert sim.state.order.tolist() != list(range(80))
        for name in ("radius", "mass", "inertia", "charge", "id"):
            assert (getattr(grains, name) == getattr(start, name)).all(), name
        i, j = sim.contacts["pair"].T
        gap = np.linalg.norm(sim.box.nearest(grains.position[i] - grains.position[j]), axis=1)
        assert (gap < (grains.radius[i] + grains.radius[j]) * 1.01).all()
    assert sim.state.count[CONTACTS] > 0 and sim.state.count[ORDERED] == 3 * SORT_EVERY
    assert abs(sim.ledger.drift) < 1e-3


@pytest.mark.compiled("listed")
def test_observers_and_split_runs_change_no_bit():
    """Sorting depends on the step count alone: observed and split runs give the same bits as one run."""

    class Reader(sand.Observer):
        def see(self, simulation, row):
            simulation.loads()
            simulation.grains.position.sum()

    whole, pieces, observed = hot_gas(), hot_gas(), hot_gas(observers=[Reader()], frame_every="20 ps")
    for steps in (1, 2, SORT_EVERY - 50, 100, SORT_EVERY, 3 * SORT_EVERY):
        pieces.run(steps=steps)
    whole.run(steps=pieces.steps)
    observed.run(steps=pieces.steps)
    assert whole.state.count[ORDERED] >= 4 * SORT_EVERY
    assert state(whole) == state(pieces) == state(observed)


@pytest.mark.compiled("listed")
@pytest.mark.parametrize("cut", (SORT_EVERY + 10, SORT_EVERY + 300))
def test_resume_with_sorted_arrays_is_bit_for_bit(tmp_path, cut):
    """A checkpoint stores the order, and lists are rebuilt from it: a resumed run gives the same bits as one run.

    The run is cut soon after a sort, when the list is still that of the previous order, and long after one.
    case.toml of the run contains the order.
    """
    whole, part = hot_gas(), hot_gas(out=tmp_path / "run")
    part.run(steps=cut)
    assert part.state.count[ORDERED] > 0
    assert 'order = "curve"' in (tmp_path / "run" / "case.toml").read_text()
    rest = sand.resume(tmp_path / "run")
    assert rest.state.order.tolist() == part.state.order.tolist()
    assert state(rest) == state(part)
    rest.run(steps=2 * SORT_EVERY)
    whole.run(steps=rest.steps)
    assert whole.state.count[LISTED] >= 3 and whole.state.count[REBUILT] > 3
    assert state(whole) == state(rest)


class StrongAttraction(sand.Attraction):
    """Newtonian attraction with G × 1e18: the force of the real masses would move nothing in 300 steps."""

    constant = 1e18 * sand.Attraction.constant


@pytest.mark.compiled("contacts", "small")
@pytest.mark.parametrize(
    "far",
    [
        pytest.param([], id="contacts"),
        *(
            pytest.param(forces, id=name, marks=pytest.mark.validate)
            for name, forces in {
                "charges": [sand.Charges()],
                "listed charges": [sand.Charges(cutoff="1 um")],
                "masses": [StrongAttraction()],
                "dipoles": [sand.Dipoles()],
                "listed dipoles": [sand.Dipoles(cutoff="1 um"), sand.Field("1 mT")],
            }.items()
        ),
    ],
)
def test_sorted_and_unsorted_runs_agree_to_rounding(far):
    """Positions after 300 steps of a vibrating aggregate, sorted and unsorted, agree to 1e-9 of a radius.

    Sums differ in the order of their terms: 1e-16 of the largest force per step.  Over 300 steps of a tenth of the
    contact period, most of them elastic, this grows to about 1e-13 of a radius.  Charges, moments and masses differ
    from grain to grain, and each force moves grains by a thousand times the bound, so a force on a wrong grain shows.
    """
    ends = []
    for order in ("curve", "as given", "without"):
        sim = vibrating_aggregate("as given" if order == "without" else order, [] if order == "without" else far)
        sim.run(steps=300)
        assert (sim.state.order.size > 0) == (order == "curve")
        pair = np.sort(sim.contacts["pair"], axis=1)
        ends.append((sim.grains.position.copy(), pair[np.lexsort(pair.T)]))
    assert np.abs(ends[0][0] - ends[1][0]).max() < 1e-9 * 1e-7
    assert (ends[0][1] == ends[1][1]).all()
    assert not far or np.abs(ends[1][0] - ends[2][0]).max() > 1e-6 * 1e-7


@pytest.mark.compiled("contacts", "small")
def test_inner_list_is_complete_after_sorting():
    """After sorting, the inner list holds every listed pair closer than INNER_SKIN_FRACTION of the list's reach.

    Entries of the inner list are columns of the pair list, which sorting permutes.
    """
    sim = vibrating_aggregate("curve")
    sim.run(steps=SORT_EVERY)
    builds = sim.state.count[REBUILT]
    sim._engine.advance(np.inf, 1)
    w, reach = sim._engine.stored_state, sim._engine.parameters.criteria.pair_gap
    assert w.count[ORDERED] == SORT_EVERY and w.count[REBUILT] == builds
    i, j = w.pair_list.pair[:, : w.count[PAIRS]].astype(int)
    apart = np.linalg.norm(w.grains.position[i] - w.grains.position[j], axis=1)
    close = (apart < w.grains.radius[i] + w.grains.radius[j] + INNER_SKIN_FRACTION * reach) & (
        w.pair_list.in_contact[: i.size] == 0
    )
    assert close.sum() > 5
    assert not inner_list_overflowed(w.pair_list, w.count)
    assert set(np.flatnonzero(close)) <= set(w.pair_list.inner[: int(w.pair_list.skin[INNER_COUNT])].tolist())


@pytest.mark.validate
def test_gas_noise_belongs_to_the_grain_id():
    """Random numbers are addressed by the grain's id: without other forces velocities do not depend on the order."""
    ends = []
    for order in ("curve", "as given"):
        grains = sand.setup.gas(60, "3 um", radius="50 nm", material=sand.SILICA, temperature="300 K", seed=5)
        gas = sand.Gas(pressure="10 mbar", temperature="300 K")
        sim = sand.Simulation(grains, [gas], box="3 um", seed=7, neighbours=sand.Neighbours(order=order))
        sim.run(steps=2 * SORT_EVERY)
        ends.append(sim.grains.velocity.copy())
    assert np.abs(ends[0] - ends[1]).max() < 1e-12 * np.abs(ends[0]).max()


@pytest.mark.compiled("listed")
def test_an_outcome_names_the_users_grain_index():
    """A grain too fast for the step ends the run, and the outcome names its index in the user's order."""
    sim = hot_gas(stepping=sand.Verlet(step="0.2 ps"))
    sim.run(steps=10)
    too_fast = int(sim.state.order[5])
    assert too_fast != 5
    sim.state.grains.arrays.velocity[:, too_fast] = 1e5
    result = sim.run(steps=10)
    assert result.outcome is sand.Outcome.TOO_FAST and result.grains == (too_fast,)


@pytest.mark.validate
def test_an_integrator_of_the_user_with_sorting():
    """Steps of fourth order with contacts: a split run gives the same bits, and public indices do not change."""
    whole, pieces = hot_gas(stepping=ForestRuth()), hot_gas(stepping=ForestRuth())
    for steps in (100, SORT_EVERY, SORT_EVERY - 100, SORT_EVERY):
        pieces.run(steps=steps)
        assert (pieces.grains.radius == pieces.start.radius).all()
    whole.run(steps=pieces.steps)
    assert whole.state.count[ORDERED] >= 2 * SORT_EVERY
    assert state(whole) == state(pieces)


@pytest.mark.compiled("listed")
def test_grains_kept_by_an_observer_are_in_the_users_order():
    """An observer keeps `grains` from one frame and reads it in every tick, also after an exception ends the run."""

    class Keeper(sand.Observer):
        calls, kept = 0, None

        def see(self, simulation, row):
            self.kept = simulation.grains

        def tick(self, simulation):
            self.calls += 1
            assert (self.kept.radius == simulation.start.radius).all()
            if self.calls == 3:
                raise RuntimeError("stumbled")

    keeper = Keeper()
    sim = hot_gas(observers=[keeper], frame_every="1 s")
    with pytest.raises(RuntimeError, match="stumbled"):
        sim.run(steps=1000)
    assert (keeper.kept.radius == sim.start.radius).all()
    assert 0 < sim.steps < 1000 and sim.state.order.size == 80


@pytest.mark.compiled("listed")
def test_an_exception_restores_the_users_order():
    """Also if no observer reads grains (the progress bar declares `tick_reads_grains = False`)."""

    class FailingObserver(sand.Observer):
        tick_reads_grains = False

        def tick(self, simulation):
            assert simulation._engine._is_sorted
            raise RuntimeError("stumbled")

    sim = hot_gas(observers=[FailingObserver()], frame_every="1 s")
    grains = sim.grains
    with pytest.raises(RuntimeError, match="stumbled"):
        sim.run(steps=1000)
    assert (grains.radius == sim.start.radius).all()


def test_choice_of_spatial_sorting():
    """ "auto" sorts from 4000 grains on; `choices` states the decision; an unknown order is refused."""
    assert sand.Neighbours().uses_spatial_sort(4000) and not sand.Neighbours().uses_spatial_sort(3999)
    assert not sand.Neighbours(order="as given").uses_spatial_sort(10**6)
    assert hot_gas().neighbours.order == "curve" and "space-filling curve" in hot_gas().choices["neighbours"]
    assert hot_gas("auto").neighbours.order == "as given" and "curve" not in hot_gas("auto").choices["neighbours"]
    with pytest.raises(sand.BadInput, match=r"order = 'curves'.*curve"):
        sand.Neighbours(order="curves")
