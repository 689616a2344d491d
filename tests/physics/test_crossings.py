"""Crossings of periodic boundaries: unwrapped positions move as if there were no boundary."""

import numpy as np
import pytest

import sand
from sand.basics.state import State
from sand.io.checkpoint import newest_checkpoint

from ..plugins import ForestRuth

L = 1e-6
BOX = sand.Box.periodic(L, L, None)
STEPPINGS = {
    "verlet": (None, {}),
    "forest-ruth": (ForestRuth, {}),
    "rigid": (lambda: sand.RigidClusters(), {"damping": "critical", "settling_time": "0.1 ns"}),
}


def gas_of(count=6, chain=2):
    """Fast grains in a small box, and a slower chain across its boundary, which spins."""
    rng = np.random.default_rng(5)
    free = np.array(np.meshgrid([-0.25, 0.25], [-0.25, 0.25], [-0.2, 0.2])).reshape(3, -1).T[:count] * L
    rod = sand.setup.chain(chain, radius="20 nm", material="silica")
    velocity = np.vstack([rng.normal(size=(count, 3)) * 150.0, np.tile([40.0, -30.0, 20.0], (chain, 1))])
    spin = np.array([0.0, 0.0, 3e8])
    position = BOX.wrap(np.vstack([free, rod.position + np.array([0.5, 0.0, 0.0]) * L]))
    velocity[count:] += np.cross(spin, rod.position)
    spins = np.vstack([np.zeros((count, 3)), np.tile(spin, (chain, 1))])
    return sand.Grains(position, 2e-8, "silica", velocity=velocity, spin=spins)


def unwrapped_of(grains):
    return grains.position + grains.image * np.array([L, L, 0.0])


@pytest.mark.filterwarnings(
    "ignore:contact. settling_time = .* is below the period",
    "ignore:grains overlap too deeply",
    "ignore:impacts are too fast for elastic grains",
)
@pytest.mark.compiled("contacts", "fields", "flights")
@pytest.mark.parametrize("name", STEPPINGS)
def test_the_centre_of_mass_moves_on(name):
    """Σ m x/Σ m = x₀ + (Σ m v/Σ m) t with unwrapped x, whatever collides, because all forces are internal.

    The box is periodic along x and y; grains cross it several times. A crossing missed or counted twice is an error of
    L/8, rounding one of 1e-12 L.
    """
    make, options = STEPPINGS[name]
    grains = gas_of()
    more = {} if make is None else {"stepping": make()}
    sim = sand.Simulation(grains, [sand.Contact(**options)], box=BOX, **more)
    start = unwrapped_of(sim.grains)
    for until in (2e-9, 2e-8):
        sim.run(until=until)
        mass = grains.mass[:, None]
        moved = (mass * (unwrapped_of(sim.grains) - start)).sum(axis=0) / mass.sum()
        drift = (mass * grains.velocity).sum(axis=0) / mass.sum() * sim.time
        assert moved == pytest.approx(drift, abs=1e-9 * L)
    image = np.abs(sim.grains.image)
    assert image[:6].max() >= 2 and image[6:].max() >= 1 and not image[:, 2].any()


@pytest.mark.filterwarnings("ignore:grains overlap too deeply", "ignore:impacts are too fast for elastic grains")
@pytest.mark.compiled("contacts", "fields", "flights")
def test_crossings_are_kept(tmp_path):
    """A checkpoint, a snapshot, the removal of a grain and a scaled box keep them; a start from a frame begins at 0."""
    sim = sand.Simulation(gas_of(), [sand.Contact()], box=BOX, out=tmp_path / "run")
    sim.run(until="20 ns")
    image = sim.grains.image.copy()
    assert np.abs(image).max() >= 2
    assert (sand.open(tmp_path / "run").frames[-1].image == image).all()
    assert (sand.open(tmp_path / "run").at(-1).grains.image == 0).all()
    arrays, _ = newest_checkpoint(tmp_path / "run")
    assert (sand.resume(tmp_path / "run").grains.image == image).all()
    assert (sim.copy().grains.image == image).all()
    with sim.change() as change:
        change.remove([0])
    assert (sim.grains.image == image[1:]).all()
    state: State = sim.state.copy()
    assert "grains/image" in arrays
    # of a checkpoint of an earlier version
    state.from_arrays({name: array for name, array in state.to_arrays().items() if name != "grains/image"})
    assert (state.grains.image == 0).all()
    # single grains move with the box: what is unwrapped grows by its factor
    single = np.bincount(sim.contacts["pair"].ravel(), minlength=len(sim.grains)) == 0
    old = unwrapped_of(sim.grains)[single]
    with sim.change() as change:
        change.scale_box(1.5)
    new = sim.grains.position + sim.grains.image * np.array([1.5 * L, 1.5 * L, 0.0])
    assert new[single] == pytest.approx(old * np.array([1.5, 1.5, 1.0]), abs=1e-12 * L)


@pytest.mark.compiled("small")
def test_a_cluster_across_the_boundary_of_a_scaled_box():
    """Its grains stay together: separations of unwrapped positions are those before."""
    rod = sand.setup.chain(3, radius="20 nm", material="silica")
    place = BOX.wrap(rod.position + np.array([0.485, 0.0, 0.0]) * L)
    sim = sand.Simulation(sand.Grains(place, 2e-8, "silica"), [sand.Contact()], box=BOX)
    for factor in (4.0, 0.25):
        length = sim.box.lengths[0]
        before = BOX.nearest(np.diff(place, axis=0))
        with sim.change() as change:
            change.scale_box(factor)
        assert sim.box.lengths[0] == pytest.approx(factor * length, abs=1e-20)
        jumps = sim.grains.image * np.array([1.0, 1.0, 0.0])
        # the image counts from the start, where the rod was in two pieces
        start = BOX.image(rod.position + np.array([0.485, 0.0, 0.0]) * L)
        unwrapped = sim.grains.position + (jumps + start) * sim.box.lengths[0]
        assert np.diff(unwrapped, axis=0) == pytest.approx(before, abs=1e-12 * L)
