"""Arrays that a component declares: in steps, checkpoints, another order, and after grains are removed.

The component of these tests sums the flux of velocity v_i v_j dt of each grain, as a stress would be, counts its calls,
keeps a time of its own, and has a table that grows: the fastest grain at every seventh call, with the time.
"""

from typing import Annotated, ClassVar, NamedTuple

import numpy as np
import pytest

import sand
from sand import components
from sand.basics.array_groups import GRAINS, USED, Array
from sand.basics.state import STEP, TIME
from sand.compiler.stage import stage
from sand.engine.component import Component
from sand.integrate.hooks import Hook
from sand.integrate.parts import Stop
from sand.io.checkpoint import newest_checkpoint, write_checkpoint
from sand.simulation import simulation

DT = 1e-10


class FluxArrays(NamedTuple):
    """A sum at each grain, a counter and a time."""

    flux: Annotated[np.ndarray, Array((9, GRAINS), "m^2/s", summed=True)]
    calls: Annotated[np.ndarray, Array((1,), dtype="i8", rule="any", summed=True)]
    until: Annotated[np.ndarray, Array((1,), "s", initial=-1.0)]
    speed: Annotated[np.ndarray, Array((GRAINS,), "m/s", saved=False)]


class MarkArrays(NamedTuple):
    """Grains and times, a table that grows."""

    used: Annotated[np.ndarray, Array((1,), dtype="i8", saved=False)]
    grain: Annotated[np.ndarray, Array((1, USED), dtype="u4", rule="any", names=(GRAINS,))]
    time: Annotated[np.ndarray, Array((USED,), "s", rule="not below 0")]


@stage("the flux of a test")
def measure(grains, flux, marks, clock):
    """Add v_i v_j dt, and a mark at every seventh call."""
    if flux.calls[0] % 7 == 0 and marks.used[0] == marks.time.size:
        return Stop.TABLES_FULL.value
    dt, fastest = clock[STEP], 0
    for g in range(grains.mass.size):
        flux.speed[g] = 0.0
        for i in range(3):
            flux.speed[g] += grains.velocity[i, g] ** 2
            for j in range(3):
                flux.flux[3 * i + j, g] += grains.velocity[i, g] * grains.velocity[j, g] * dt
        if flux.speed[g] > flux.speed[fastest]:
            fastest = g
    if flux.calls[0] % 7 == 0:
        marks.grain[0, marks.used[0]], marks.time[marks.used[0]] = fastest, clock[TIME]
        marks.used[0] += 1
    flux.calls[0] += 1
    flux.until[0] = clock[TIME] + dt
    return Stop.NONE.value


class Flux(Component):
    """The component."""

    name = "flux"
    noun = "a flux"
    groups: ClassVar = {"flux": FluxArrays, "marks": MarkArrays}

    def stages(self, setup, law, settings):
        """One, in each step."""
        return {Hook.CONTACTS: [(measure, ())]}

    def parameters(self):
        """No table of a case file."""
        return []


@pytest.fixture(autouse=True)
def with_flux(monkeypatch):
    """Simulations have the component."""
    read = components.read_components
    monkeypatch.setattr(simulation, "read_components", lambda **given: read(**given, flux=[1]))
    monkeypatch.setitem(components.GIVEN, "flux", tuple)
    monkeypatch.setattr(components, "COMPONENTS", (*components.COMPONENTS, Flux))


def flying(count=40, order="as given", **options):
    """Grains that fly apart, each with its own speed; grain `count` // 2 is the fastest."""
    grid = np.array([(k % 4, k // 4 % 4, k // 16) for k in range(count)], float)
    place = np.random.default_rng(3).permutation(count)
    speed = 0.01 * np.roll(np.arange(1.0, count + 1.0), count // 2 + 1)
    direction = np.random.default_rng(4).normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    grains = sand.Grains(1e-5 * grid[place], "0.1 um", "silica", velocity=speed[:, None] * direction)
    how = {"stepping": sand.Verlet(step=DT), "neighbours": sand.Neighbours(order=order)}
    return sand.Simulation(grains, [sand.Contact()], **how, **options)


def arrays_of(sim):
    """All arrays of the regular state, as bits."""
    return {name: (array.shape, array.tobytes()) for name, array in sim.regular_state.to_arrays().items()}


@pytest.mark.compiled("contacts")
def test_arrays_are_parts_of_the_step_and_tables_grow():
    """v_i v_j t of free grains to rounding (200 sums); 16 columns at first; sums begin after the loads of the start."""
    sim = flying()
    sim.run(steps=200)
    v, saved = sim.grains.velocity, sim.regular_state.to_arrays()
    expected = (v[:, :, None] * v[:, None, :]).reshape(-1, 9).T * 200 * DT
    np.testing.assert_allclose(saved["flux/flux"], expected, rtol=200 * 2.0**-52, atol=0.0)
    assert saved["flux/calls"] == [200] and saved["flux/until"] == pytest.approx(200 * DT, rel=1e-12, abs=0.0)
    assert saved["marks/grain"].tolist() == [30 * [20]] and saved["marks/time"][-1] > saved["marks/time"][-2]
    assert "flux/speed" not in saved and "marks/used" not in saved
    np.testing.assert_allclose(np.diff(saved["marks/time"][1:]), 7 * DT, rtol=1e-9, atol=0.0)


@pytest.mark.compiled("contacts")
def test_output_and_restart_change_no_bit(tmp_path):
    """A run with frames between its steps, one without, and one that continues from a checkpoint."""
    one, often, first = flying(), flying(frame_every="0.37 ns"), flying(out=tmp_path / "run")
    for sim, steps in ((one, 300), (often, 300), (first, 130)):
        sim.run(steps=steps)
    before = arrays_of(first)
    first.regular_state.copy().of_components["flux"].flux[:] = 0.0  # a snapshot has memory of its own
    assert arrays_of(first) == before
    del first
    again = flying(restart=newest_checkpoint(tmp_path / "run", components.groups()))
    assert arrays_of(again)["marks/grain"][0] == (1, 20)
    again.run(steps=170)
    assert arrays_of(one) == arrays_of(often) == arrays_of(again)


@pytest.mark.compiled("contacts")
def test_arrays_follow_the_order_of_the_grains():
    """Sorted along a curve: each grain has its own sum, and the marks name the same grain."""
    plain, ordered = flying(), flying(order="curve")
    for sim in (plain, ordered):
        sim.run(steps=100)
        sim.run(steps=50)
    one, other = (sim.regular_state.to_arrays() for sim in (plain, ordered))
    assert not (other["order"] == np.arange(40)).all()
    for name in ("flux/flux", "flux/calls", "marks/grain", "marks/time"):
        np.testing.assert_array_equal(other[name], one[name])


@pytest.mark.compiled("contacts")
def test_arrays_after_grains_were_removed_and_added():
    """Sums stay with their grains, those of grains that were added begin at 0, and marks of removed grains go."""
    sim = flying()
    sim.run(steps=20)
    sim.regular_state.of_components["marks"].grain[0, 1] = 7
    before = {name: array.copy() for name, array in sim.regular_state.to_arrays().items()}
    with sim.change() as change:
        change.remove([3, 7])
        change.add(sand.Grains([[9e-5, 0, 0]], "0.1 um", "silica"))
    after = sim.regular_state.to_arrays()
    kept = np.delete(np.arange(40), [3, 7])
    np.testing.assert_array_equal(after["flux/flux"][:, :38], before["flux/flux"][:, kept])
    assert not after["flux/flux"][:, 38].any() and after["flux/calls"] == before["flux/calls"] + 1  # loads summed anew
    assert after["marks/grain"].tolist() == [[18, 18, 18]]
    np.testing.assert_array_equal(after["marks/time"], np.delete(before["marks/time"], 1))
    sim.run(steps=20)
    assert sim.regular_state.to_arrays()["marks/grain"][0, -1] == 18


WRONG = {
    "flux/flux": [
        (lambda array: array[:, :-1], r"'flux/flux' has shape \(9, 39\), not \(9, 40\)"),
        (lambda array: array.astype("f4"), "'flux/flux' holds numbers of type float32, not float64"),
        (lambda array: np.nan * array, "'flux/flux' holds nan: it must be finite"),
        (None, "there is no array 'flux/flux'"),
    ],
    "marks/grain": [
        (lambda array: array + np.uint32(20), "'marks/grain' names grain 40, but the grains are 0 to 39"),
        (lambda array: array[:, :1], r"'marks/time' has shape \(3,\), not \(1\)"),
    ],
    "marks/time": [(lambda array: array - 1.0, "'marks/time' holds -1.0: it must be a number of at least 0")],
}


@pytest.mark.compiled("contacts")
def test_a_wrong_array_of_a_component_is_named(tmp_path):
    """With a valid checksum: type, shape, range, an index, or an array that is missing."""
    sim = flying(out=tmp_path / "run")
    sim.run(steps=10)
    arrays, meta = newest_checkpoint(tmp_path / "run", components.groups())
    meta = {name: value for name, value in meta.items() if name not in ("format", "version", "sha256")}
    for name, changes in WRONG.items():
        for change, message in changes:
            (tmp_path / "wrong").mkdir(exist_ok=True)
            wrong = {key: array for key, array in arrays.items() if key != name}
            write_checkpoint(tmp_path / "wrong", wrong | ({} if change is None else {name: change(arrays[name])}), meta)
            with pytest.raises(sand.BadInput, match=f"cannot be resumed: {message}"):
                newest_checkpoint(tmp_path / "wrong", components.groups())
