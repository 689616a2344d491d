"""Energies and temperatures of bodies: clusters of grains in contact, and single grains."""

import math
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import gamma

import sand
from sand.analysis.body_motion import MEDIAN_ENERGY, BodyMotion, body_motion, body_temperatures, temperatures_of
from sand.analysis.ledger_columns import LedgerColumns
from sand.basics.arrays import cluster_arrays
from sand.basics.box import Box
from sand.basics.constants import BOLTZMANN
from sand.cli.main import main
from sand.contact.measure import BODY_ROWS, measure_bodies
from sand.io.ledger_table import TEMPERATURES
from sand.plotting.panels import has_temperatures
from sand.plotting.plots import history_figure
from sand.plotting.run_figure import run_figure
from sand.simulation.ledger import Ledger
from sand.viewer.series import series_from_ledger

BOX = Box.periodic(1e-6)
SIZES = (1, 4, 2, 1, 7)


def random_bodies(seed=3):
    """Branched clusters of SIZES unequal grains across the boundary, in mixed order; their contacts, whole places."""
    rng = np.random.default_rng(seed)
    whole, pairs = [], []
    for k, size in enumerate(SIZES):
        first = len(whole)
        whole.append(np.array([0.49e-6, 0.2e-6 * k - 0.4e-6, -0.5e-6]))
        for i in range(1, size):
            parent = int(rng.integers(0, i))
            way = rng.normal(size=3)
            whole.append(whole[first + parent] + 2e-8 * way / np.linalg.norm(way))
            pairs.append((first + parent, first + i))
    count = len(whole)
    order = rng.permutation(count)  # grain `order[i]` of the list above is grain i
    where = np.argsort(order)
    whole = np.array(whole)[order]
    grains = sand.Grains(
        BOX.wrap(whole),
        rng.uniform(0.8e-8, 1.2e-8, count),
        sand.IRON,
        velocity=rng.normal(size=(count, 3)),
        spin=1e8 * rng.normal(size=(count, 3)),
    )
    return grains, where[np.array(pairs)], whole


def members_of(count, pairs):
    """Sets of connected grains by repeated merging, in the order of their lowest grains."""
    sets = [{i} for i in range(count)]
    for a, b in pairs:
        one, other = (next(s for s in sets if i in s) for i in (a, b))
        if one is not other:
            one |= other
            sets.remove(other)
    return sorted(map(sorted, sets))


def test_energies_against_the_work_that_stops_the_rigid_motion():
    """½P²/M + ½L·J⁻¹L is the largest decrease of K by a rigid motion: max over V, Ω of K − K(v − V − Ω×x, ω − Ω).

    The largest decrease is that of a linear least-squares problem, ½|A y|² with y = A⁺ d and all velocities d weighted
    by √m and √I; with V alone it is the translation.  No tensor of inertia and no centre of mass occurs in it.  Both
    agree to the rounding of sums of a few dozen numbers times the condition of A, 1e-10.  Energies add up to K exactly
    but for rounding, 1e-14.
    """
    grains, pairs, whole = random_bodies()
    motion = body_motion(grains, pairs, BOX)
    sets = members_of(len(grains), pairs)
    assert motion.grains.tolist() == [len(s) for s in sets]
    for k, body in enumerate(sets):
        rows, values = [], []
        for i in body:
            x, m, inertia = whole[i] / 1e-8, grains.mass[i], grains.inertia[i] / 1e-16
            across = np.array([[0, x[2], -x[1]], [-x[2], 0, x[0]], [x[1], -x[0], 0]])  # Ω×x = across @ Ω
            rows += [*(math.sqrt(m) * np.hstack((np.eye(3), across)))]
            rows += [*(math.sqrt(inertia) * np.hstack((np.zeros((3, 3)), np.eye(3))))]
            values += [*(math.sqrt(m) * grains.velocity[i]), *(math.sqrt(inertia) * 1e-8 * grains.spin[i])]
        a, d = np.array(rows), np.array(values)
        both, alone = (0.5 * float(((m @ np.linalg.lstsq(m, d, rcond=None)[0]) ** 2).sum()) for m in (a, a[:, :3]))
        assert motion.mass[k] == pytest.approx(grains.mass[body].sum(), rel=1e-14, abs=0.0)
        assert motion.translation[k] == pytest.approx(alone, rel=1e-10, abs=0.0)
        assert motion.rotation[k] == pytest.approx(both - alone, rel=1e-10, abs=0.0)
        kinetic = 0.5 * float(d @ d)
        assert motion.translation[k] + motion.rotation[k] + motion.internal[k] == pytest.approx(
            kinetic, rel=1e-14, abs=0.0
        )


def test_a_rigid_rotor():
    """A dimer that turns with Ω about an axis at the angle θ to its own: ½Ω²(J∥cos²θ + J⊥sin²θ).

    J∥ = 2·⅖mr², J⊥ = J∥ + 2mr². It drifts with V: ½·2m·V². Nothing is internal. All to 1e-13, the rounding of a dozen
    operations.
    """
    r, angle, speed, drift = 1e-8, 0.7, 3e7, np.array([0.2, -0.4, 0.1])
    axis = np.array([math.cos(angle), math.sin(angle), 0.0])
    place = np.array([[-r, 0.0, 0.0], [r, 0.0, 0.0]])
    grains = sand.Grains(
        place, r, sand.IRON, velocity=drift + np.cross(speed * axis, place), spin=np.tile(speed * axis, (2, 1))
    )
    motion = body_motion(grains, np.array([[1, 0]]), Box.open())
    m = float(grains.mass[0])
    along, across = 0.8 * m * r**2, 0.8 * m * r**2 + 2.0 * m * r**2
    expected = 0.5 * speed**2 * (along * math.cos(angle) ** 2 + across * math.sin(angle) ** 2)
    assert motion.rotation == pytest.approx([expected], rel=1e-13, abs=0.0)
    assert motion.translation == pytest.approx([m * drift @ drift], rel=1e-13, abs=0.0)
    assert motion.internal[0] < 1e-25 * expected


def test_temperatures_of_a_maxwell_sample():
    """Grains with ⟨m v_k²⟩ = ⟨I ω_k²⟩ = k_B T of each component: all three temperatures are T within 4 standard errors.

    E/k_BT of three components has a gamma distribution of shape 3/2: mean 3/2, variance 3/2, so that a mean of n has
    the relative error √(2/3n).  The median has the error 1/(2 f(μ½) √n), with the density f at the median μ½. Grains
    in fixed pairs have the same distribution, by equipartition: the rigid motion of a body is a linear function of
    Maxwellian velocities, orthogonal in the kinetic energy, and has three + three of its degrees of freedom.
    """
    n, temperature = 20_000, 250.0
    rng = np.random.default_rng(5)
    cubes = np.arange(n)
    place = 1e-7 * np.column_stack([cubes % 30, cubes // 30 % 30, cubes // 900])
    place[1::2] = place[::2] + np.array([2e-8, 0.0, 0.0])
    still = sand.Grains(place, 1e-8, sand.IRON)
    kicks = np.sqrt(BOLTZMANN * temperature / still.mass[0]), np.sqrt(BOLTZMANN * temperature / still.inertia[0])
    velocity, spin = (kick * rng.normal(size=(n, 3)) for kick in kicks)
    grains = sand.Grains(place, 1e-8, sand.IRON, velocity=velocity, spin=spin)
    for pairs in (np.zeros((0, 2), int), cubes.reshape(-1, 2)):
        motion = body_motion(grains, pairs, Box.open())
        count = len(motion.grains)
        found = body_temperatures(motion)
        mean_error = math.sqrt(2.0 / (3.0 * count))
        median_error = 1.0 / (2.0 * gamma(1.5).pdf(MEDIAN_ENERGY) * math.sqrt(count) * MEDIAN_ENERGY)
        assert found.translation == pytest.approx(temperature, rel=4.0 * mean_error, abs=0.0)
        assert found.rotation == pytest.approx(temperature, rel=4.0 * mean_error, abs=0.0)
        assert found.rotation_median == pytest.approx(temperature, rel=4.0 * median_error, abs=0.0)


def test_the_median_energy_of_three_degrees_of_freedom():
    """P(3/2, x) = ½ with the regularised incomplete gamma function, to rounding."""
    assert gamma(1.5).cdf(MEDIAN_ENERGY) == pytest.approx(0.5, rel=1e-14, abs=0.0)


def test_temperatures_of_chosen_bodies():
    """Means and median of the chosen bodies alone; NaN where none is chosen."""
    energy = BOLTZMANN * np.array([3.0, 6.0, 9.0, 300.0])
    motion = BodyMotion(np.array([1, 1, 1, 5]), np.ones(4), energy, energy[::-1].copy(), np.zeros(4))
    single = body_temperatures(motion, motion.grains == 1)
    assert single.translation == pytest.approx(4.0, rel=1e-14, abs=0.0)
    assert single.rotation == pytest.approx(2.0 / 3.0 * 315.0 / 3.0, rel=1e-14, abs=0.0)
    assert single.rotation_median == pytest.approx(9.0 / MEDIAN_ENERGY, rel=1e-14, abs=0.0)
    assert all(math.isnan(value) for value in body_temperatures(motion, motion.grains > 5))


def test_a_frame_has_the_temperatures_of_its_state():
    """Velocities in float32, ±6e-8, and no column of inertia in a frame: the same to 1e-5."""
    grains, pairs, _ = random_bodies()
    exact = body_motion(grains, pairs, BOX)

    class Stored:
        position, radius, spin = grains.position, grains.radius, grains.spin
        velocity, mass = grains.velocity.astype(np.float32), grains.mass.astype(np.float32)

    found = body_motion(Stored(), pairs, BOX)
    for name in ("translation", "rotation", "internal"):
        assert getattr(found, name) == pytest.approx(getattr(exact, name), rel=1e-5, abs=1e-30)


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("stepping", [sand.Verlet(), sand.RigidClusters()], ids=["grains", "rigid"])
def test_ledger_and_summary(tmp_path, stepping):
    """The columns of a row are the temperatures of the bodies of its frame, to float32 of the frame; so is the summary.

    A chain of three, a pair across the boundary and twelve single grains; rigid clusters have the same numbers as
    single grains, because only velocities enter.
    """
    rng = np.random.default_rng(2)
    line, across = [[-2e-8, 0, 0], [0, 0, 0], [2e-8, 0, 0]], [[4.95e-7, 1e-7, 0], [-4.85e-7, 1e-7, 0]]
    place = np.array([*line, *across, *([3e-7, -4e-7 + 6e-8 * k, 2e-7] for k in range(12))])
    kicks = {"velocity": 0.2 * rng.normal(size=(17, 3)), "spin": 3e7 * rng.normal(size=(17, 3))}
    grains = sand.Grains(place, 1.005e-8, sand.IRON, **kicks)
    contact = sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns")
    sim = sand.Simulation(grains, [contact], box="1 um", stepping=stepping, out=tmp_path / "run", frame_every="1 ns")
    sim.run(until="3 ns")
    run = sand.open(tmp_path / "run")
    assert run.frames[0].pair.shape[0] == 3
    for frame, row in zip(run.frames, sim.ledger.rows, strict=True):
        found = body_temperatures(body_motion(frame, frame.pair, frame.box))
        assert [row[name] for name in TEMPERATURES] == pytest.approx(list(found), rel=1e-5, abs=0.0)
    assert [run.summary[name] for name in TEMPERATURES] == [sim.ledger.rows[-1][name] for name in TEMPERATURES]
    assert has_temperatures(sim.ledger) and len(run_figure(sim).axes) == 7


def ledger_rows(bodies=12):
    """Rows of a ledger with temperatures of 100, 200 and 150 K, growing."""
    blank = dict.fromkeys(Ledger().columns, 0.0) | {"clusters": bodies, "mean_cluster_size": 1.0, "largest_cluster": 1}
    told = dict(zip(TEMPERATURES, (100.0, 200.0, 150.0), strict=True))
    return [blank | {"step": k, "time": 1e-9 * k} | {name: v * (k + 1) for name, v in told.items()} for k in range(4)]


def test_curves_are_the_columns():
    """The figure and the page draw the three columns; with nine bodies they are not in the overview."""
    ledger = LedgerColumns.from_rows(ledger_rows())
    lines = history_figure(ledger, "temperatures", 12, 100.0).axes[0].get_lines()
    (plot,) = (plot for plot in series_from_ledger(ledger)["plots"] if plot["id"] == "temperatures")
    for line, drawn, name in zip(lines, plot["lines"], TEMPERATURES, strict=True):
        assert line.get_ydata().tolist() == drawn["values"] == ledger[name].tolist()
        assert line.get_label() == drawn["label"]
    assert has_temperatures(ledger) and not has_temperatures(LedgerColumns.from_rows(ledger_rows(9)))


def test_ledgers_of_earlier_versions():
    """Without the columns: no panel, a figure that says so, and a ledger that goes on without them."""
    earlier = LedgerColumns.from_rows(
        [{k: v for k, v in row.items() if k not in TEMPERATURES} for row in ledger_rows()]
    )
    assert not has_temperatures(earlier)
    assert "temperatures" not in {plot["id"] for plot in series_from_ledger(earlier)["plots"]}
    (text,) = history_figure(earlier, "temperatures", 12, 100.0).axes[0].texts
    assert "earlier version" in text.get_text()
    ledger = Ledger()
    ledger.from_array(np.array([[row[name] for name in earlier.columns] for row in earlier.rows]), earlier.columns)
    assert ledger.columns == earlier.columns and ledger.add(ledger_rows()[-1] | {"time": 1.0})
    assert ledger.to_array().shape == (5, len(earlier.columns))


@pytest.mark.compiled("dipoles")
def test_a_run_of_an_earlier_version_goes_on(tmp_path, capsys):
    """Its checkpoint has no such columns; it runs on, and `sand info` and `sand plot` work with it."""
    folder = tmp_path / "run"
    shutil.copytree(Path(__file__).parents[2] / "reference" / "run-v10", folder)
    sand.resume(folder).run(steps=20)
    assert not set(TEMPERATURES) & set(sand.open(folder).ledger)
    assert set(TEMPERATURES) <= set(sand.open(folder).summary)
    for words in (["info", str(folder)], ["plot", str(folder), "--what", "temperatures"]):
        assert main(words) == 0
    assert "None" not in capsys.readouterr().out


def test_the_stage_finds_the_same_motion():
    """The stage of a run against `body_motion`, body by body, to 1e-12: both sum a dozen numbers, in another order.

    Bodies lie across the boundary. A single grain has no internal energy at all.
    """
    grains, pairs, _ = random_bodies()
    sides = np.concatenate([pairs[:, 0], pairs[:, 1]])
    order = np.argsort(sides, kind="stable")
    contacts = SimpleNamespace(
        pair=pairs.T,
        formed=np.zeros(len(pairs)),
        side=np.concatenate([2 * np.arange(len(pairs)), 2 * np.arange(len(pairs)) + 1])[order].astype(np.uint32),
        start=np.searchsorted(sides[order], np.arange(len(grains) + 1)),
    )
    found, expected = np.zeros((BODY_ROWS, len(grains))), body_motion(grains, pairs, BOX)
    parts = {"grains": grains.arrays, "contacts": contacts, "span": BOX.span}
    count = measure_bodies.function(
        *(parts[name] for name in measure_bodies.needs[:-1]), (found, cluster_arrays(len(grains)))
    )
    assert count == len(SIZES)
    for values, exact in zip(found[:, :count], expected, strict=True):
        assert values == pytest.approx(exact, rel=1e-12, abs=0.0)
    assert (found[4, :count][expected.grains == 1] == 0.0).all()


def test_temperatures_of_one_two_and_no_number():
    """The median of an even number of energies is the mean of the middle two; NaN among them is NaN."""
    energies = np.array([4.0, 1.0, 2.0, 8.0]) * BOLTZMANN
    for count in (1, 2, 3, 4):
        found = temperatures_of(energies[:count], energies[:count])
        assert found.translation == pytest.approx(2.0 / 3.0 * energies[:count].mean() / BOLTZMANN, rel=1e-15, abs=0.0)
        median = float(np.median(energies[:count])) / (MEDIAN_ENERGY * BOLTZMANN)
        assert found.rotation_median == pytest.approx(median, rel=1e-15, abs=0.0)
    assert math.isnan(temperatures_of(energies, np.full(2, np.nan)).rotation_median)
