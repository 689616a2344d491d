"""Grains in an order of their own while steps are taken: nobody sees it, and it changes nothing but rounding."""

import numpy as np
import pytest

import sand
from sand.contact.events import inner_list_overflowed
from sand.integrate.step_parts import INNER_SKIN_FRACTION
from sand.neighbours.spatial_sort import inverse, reorder_grains, spatial_order
from sand.simulation import engine as engines
from sand.state.state import CONTACTS, INNER_COUNT, LISTED, ORDERED, PAIRS, REBUILT

from .test_sameness import state

BY_PLACE = ("order", "packed_position", "source", "packed_grain", "block_sums", "cell_of")
"""Far arrays that belong to the list, or are filled by each sum."""
EVERY = 700
"""Steps between two orders in these tests, so that some are made."""


@pytest.fixture(autouse=True)
def often(monkeypatch):
    """Orders are made anew more often, as runs are short."""
    monkeypatch.setattr(engines, "SORT_INTERVAL", EVERY)


def stirred(order="curve", **options):
    """A hot magnetic gas whose grains (all different) meet, with a list, cycles and gas drag."""
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


def shaken(order, far=()):
    """A loose aggregate of grains numbered at random, a little shaken; charged, magnetic, of many masses."""
    body = sand.setup.bpca(300, radius="0.1 um", material=sand.SILICA, seed=4)
    rng = np.random.default_rng(3)
    some, speed = rng.permutation(300), rng.uniform(-0.01, 0.01, (300, 3))
    grains = sand.Grains(
        body.position[some],
        body.radius[some],
        sand.SILICA,
        velocity=speed,
        charge=1e-16 * rng.normal(size=300),
        moment=1e-15 * rng.normal(size=(300, 3)) if far else 0.0,
        mass=1e-17 * rng.uniform(0.5, 1.5, 300),
    )
    return sand.Simulation(grains, [sand.Contact(), *far], neighbours=sand.Neighbours(order=order))


def listed(world):
    """The pairs in the rows of the far list, by grain."""
    far, place = world.long_range, np.repeat(np.arange(len(world.grains)), np.diff(world.long_range.start.astype(int)))
    return set(zip(far.order[place].tolist(), far.order[far.neighbour[: far.start[-1]]].tolist(), strict=True))


def sides(world):
    """The contacts of each grain, as the gathering finds them."""
    start, side = world.contacts.start.tolist(), (world.contacts.side >> 1).tolist()
    return [sorted(side[start[g] : start[g + 1]]) for g in range(len(world.grains))]


@pytest.mark.compiled("listed")
def test_there_and_back():
    """Grain k becomes grain rows[k], and the inverse order undoes it: every number, list and bit is as it was.

    In between, each contact, near pair, and entry of the far list names the same grains as before.
    """
    sim = stirred()
    sim.run(steps=2000)
    world = sim.state
    world.long_range.path[...] = np.random.default_rng(2).normal(size=(3, 80))  # nothing between two cycles
    before, pairs = state(sim), listed(world)
    assert world.count[CONTACTS] > 0
    used, some = world.count[CONTACTS], world.count[PAIRS]
    kept, near = world.contacts.pair[:, :used].copy(), world.pair_list.pair[:, :some].copy()
    order, arrays = spatial_order(world), world.grains.arrays._asdict()
    arrays |= {f"near {name}": array for name, array in world.pair_list._asdict().items()}
    arrays |= {f"far {name}": array for name, array in world.long_range._asdict().items() if name not in BY_PLACE}
    arrays = {name: array for name, array in arrays.items() if array.shape[-1] == 80}
    assert len(arrays) > 20
    old = {name: array.copy() for name, array in arrays.items()}
    reorder_grains(world, order)
    for name, array in arrays.items():
        assert (array == old[name][..., order]).all(), name
    assert (world.grains.radius != old["radius"]).any() and (world.long_range.path != old["far path"]).any()
    assert sides(world) == [
        np.flatnonzero((world.contacts.pair[:, :used] == g).any(axis=0)).tolist() for g in range(80)
    ]
    assert (order[world.contacts.pair[:, :used]] == kept).all() and (
        order[world.pair_list.pair[:, :some]] == near
    ).all()
    assert {(order[i], order[j]) for i, j in listed(world)} == pairs
    reorder_grains(world, inverse(order))
    assert state(sim) == before and listed(world) == pairs


@pytest.mark.compiled("listed")
def test_everybody_sees_the_numbers_of_the_start():
    """Radii, masses and ids never change their row; contacts are between grains that overlap; losses add up.

    Whoever kept the grains from before a run finds them, too, where they were.
    """
    sim = stirred()
    grains, start = sim.grains, sim.start
    for _ in range(4):
        sim.run(steps=EVERY)
        assert sim.state.order.tolist() != list(range(80))
        for name in ("radius", "mass", "inertia", "charge", "id"):
            assert (getattr(grains, name) == getattr(start, name)).all(), name
        i, j = sim.contacts["pair"].T
        gap = np.linalg.norm(sim.box.nearest(grains.position[i] - grains.position[j]), axis=1)
        assert (gap < (grains.radius[i] + grains.radius[j]) * 1.01).all()
    assert sim.state.count[CONTACTS] > 0 and sim.state.count[ORDERED] == 3 * EVERY
    assert abs(sim.ledger.drift) < 1e-3


@pytest.mark.compiled("listed")
def test_watching_and_cutting_up_change_nothing():
    """Orders are made at steps that depend on the number of steps alone: the same bits however often grains go home."""

    class Curious(sand.Observer):
        def see(self, simulation, row):
            simulation.loads()
            simulation.grains.position.sum()

    whole, pieces, watched = stirred(), stirred(), stirred(observers=[Curious()], frame_every="20 ps")
    for steps in (1, 2, EVERY - 50, 100, EVERY, 3 * EVERY):
        pieces.run(steps=steps)
    whole.run(steps=pieces.steps)
    watched.run(steps=pieces.steps)
    assert whole.state.count[ORDERED] >= 4 * EVERY
    assert state(whole) == state(pieces) == state(watched)


@pytest.mark.compiled("listed")
@pytest.mark.parametrize("cut", (EVERY + 10, EVERY + 300))
def test_going_on_from_a_checkpoint_changes_nothing(tmp_path, cut):
    """The order is in the saved state, and the lists are made from it as they were: the same bits as in one run.

    Soon after an order was made the list is still that of the older one, in the new numbers.
    The run's own case.toml says that there is one.
    """
    whole, part = stirred(), stirred(out=tmp_path / "run")
    part.run(steps=cut)
    assert part.state.count[ORDERED] > 0
    assert 'order = "curve"' in (tmp_path / "run" / "case.toml").read_text()
    rest = sand.resume(tmp_path / "run")
    assert rest.state.order.tolist() == part.state.order.tolist()
    assert state(rest) == state(part)
    rest.run(steps=2 * EVERY)
    whole.run(steps=rest.steps)
    assert whole.state.count[LISTED] >= 3 and whole.state.count[REBUILT] > 3
    assert state(whole) == state(rest)


class Heavy(sand.Attraction):
    """Newton's law, as if grains were a thousand million times as heavy: their own mass moves nothing in 300 steps."""

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
                "masses": [Heavy()],
                "dipoles": [sand.Dipoles()],
                "listed dipoles": [sand.Dipoles(cutoff="1 um"), sand.Field("1 mT")],
            }.items()
        ),
    ],
)
def test_only_rounding_tells_the_orders_apart(far):
    """Steps of a loose, shaken aggregate in both orders: sums are the same but for the order of their terms.

    Each step adds rounding of some 1e-16 of the largest force; 300 steps of a tenth of a contact's period, most of them
    elastic, let differences of position grow to some 1e-13 of a radius; 1e-9 is far above, an error far below.  No two
    grains have the same charge or moment, and masses differ; each law is strong enough to move grains by a thousand
    times that bound, or it could not be seen whether it acts on the right ones.
    """
    ends = []
    for order in ("curve", "as given", "without"):
        sim = shaken("as given" if order == "without" else order, [] if order == "without" else far)
        sim.run(steps=300)
        assert (sim.state.order.size > 0) == (order == "curve")
        pair = np.sort(sim.contacts["pair"], axis=1)
        ends.append((sim.grains.position.copy(), pair[np.lexsort(pair.T)]))
    assert np.abs(ends[0][0] - ends[1][0]).max() < 1e-9 * 1e-7
    assert (ends[0][1] == ends[1][1]).all()
    assert not far or np.abs(ends[1][0] - ends[2][0]).max() > 1e-6 * 1e-7


@pytest.mark.compiled("contacts", "small")
def test_who_may_touch_soon_is_known_in_the_new_order():
    """After sorting, the inner list holds every listed pair that is closer than INNER_SKIN_FRACTION of the reach.

    What is picked are columns of the near list, which were sorted.
    """
    sim = shaken("curve")
    sim.run(steps=EVERY)
    listed = sim.state.count[REBUILT]
    sim._engine.advance(np.inf, 1)
    w, reach = sim._engine._state, sim._engine.parameters.criteria.pair_gap
    assert w.count[ORDERED] == EVERY and w.count[REBUILT] == listed
    i, j = w.pair_list.pair[:, : w.count[PAIRS]].astype(int)
    apart = np.linalg.norm(w.grains.position[i] - w.grains.position[j], axis=1)
    close = (apart < w.grains.radius[i] + w.grains.radius[j] + INNER_SKIN_FRACTION * reach) & (
        w.pair_list.in_contact[: i.size] == 0
    )
    assert close.sum() > 5
    assert not inner_list_overflowed(w.pair_list, w.count)
    assert set(np.flatnonzero(close)) <= set(w.pair_list.inner[: int(w.pair_list.skin[INNER_COUNT])].tolist())


@pytest.mark.validate
def test_kicks_of_a_gas_go_to_the_grain_not_to_the_place():
    """Random numbers have the grain's id for an address: without other forces, each goes the same way in any order."""
    ends = []
    for order in ("curve", "as given"):
        grains = sand.setup.gas(60, "3 um", radius="50 nm", material=sand.SILICA, temperature="300 K", seed=5)
        gas = sand.Gas(pressure="10 mbar", temperature="300 K")
        sim = sand.Simulation(grains, [gas], box="3 um", seed=7, neighbours=sand.Neighbours(order=order))
        sim.run(steps=2 * EVERY)
        ends.append(sim.grains.velocity.copy())
    assert np.abs(ends[0] - ends[1]).max() < 1e-12 * np.abs(ends[0]).max()


@pytest.mark.compiled("listed")
def test_the_grain_that_stops_a_run_is_named_by_its_own_number():
    """Faster than a step of this length bears: the culprit is the grain that was pushed, wherever it stood."""
    sim = stirred(stepping=sand.Verlet(step="0.2 ps"))
    sim.run(steps=10)
    guilty = int(sim.state.order[5])
    assert guilty != 5
    sim.state.grains.arrays.velocity[:, guilty] = 1e5
    result = sim.run(steps=10)
    assert result.outcome is sand.Outcome.TOO_FAST and result.grains == (guilty,)


@pytest.mark.validate
def test_runge_kutta_steps_in_an_order_of_their_own():
    """Adaptive steps, with contacts on the way: cut up, the same bits; seen by their numbers."""
    whole, pieces = stirred(stepping=sand.Adaptive()), stirred(stepping=sand.Adaptive())
    for steps in (100, EVERY, EVERY - 100, EVERY):
        pieces.run(steps=steps)
        assert (pieces.grains.radius == pieces.start.radius).all()
    whole.run(steps=pieces.steps)
    assert whole.state.count[ORDERED] >= 2 * EVERY
    assert state(whole) == state(pieces)


@pytest.mark.compiled("listed")
def test_whoever_kept_the_grains_finds_them_at_their_rows():
    """An observer that asks for them once and reads them ten times a second; and after an error in a run."""

    class Keeper(sand.Observer):
        looks, kept = 0, None

        def see(self, simulation, row):
            self.kept = simulation.grains

        def tick(self, simulation):
            self.looks += 1
            assert (self.kept.radius == simulation.start.radius).all()
            if self.looks == 3:
                raise RuntimeError("stumbled")

    keeper = Keeper()
    sim = stirred(observers=[keeper], frame_every="1 s")
    with pytest.raises(RuntimeError, match="stumbled"):
        sim.run(steps=1000)
    assert (keeper.kept.radius == sim.start.radius).all()
    assert 0 < sim.steps < 1000 and sim.state.order.size == 80


@pytest.mark.compiled("listed")
def test_a_run_that_is_broken_off_leaves_grains_at_home():
    """Also where nobody looked: the progress bar says that it does not."""

    class Clumsy(sand.Observer):
        tick_reads_grains = False

        def tick(self, simulation):
            assert simulation._engine._is_sorted
            raise RuntimeError("stumbled")

    sim = stirred(observers=[Clumsy()], frame_every="1 s")
    grains = sim.grains
    with pytest.raises(RuntimeError, match="stumbled"):
        sim.run(steps=1000)
    assert (grains.radius == sim.start.radius).all()


def test_who_gets_an_order_of_its_own():
    """ "auto" means ten thousand grains or more; the settled word stands in the choices; a wrong word is refused."""
    assert sand.Neighbours().uses_spatial_sort(4000) and not sand.Neighbours().uses_spatial_sort(3999)
    assert not sand.Neighbours(order="as given").uses_spatial_sort(10**6)
    assert stirred().neighbours.order == "curve" and "space-filling curve" in stirred().choices["neighbours"]
    assert stirred("auto").neighbours.order == "as given" and "curve" not in stirred("auto").choices["neighbours"]
    with pytest.raises(sand.BadInput, match=r"order = 'curves'.*curve"):
        sand.Neighbours(order="curves")
