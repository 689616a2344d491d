"""Trajectories of two-body scattering: other integrators, conservation laws, limiting cases."""

import json
import math
import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import sand
from sand.basics.constants import MAGNETIC
from sand.cli.main import main
from sand.experiments.scattering import cross_sections as scattering
from sand.experiments.scattering.flights import BOUNCE, COLUMNS, fly
from sand.experiments.scattering.maps import probability_map
from sand.experiments.scattering.sampling import Task

from ..plugins import ForestRuth

END, HIT, MISS = COLUMNS.index("end"), 0, 1
IRON = {"radius": "10 nm", "material": sand.IRON, "moment": "200 A m^2/kg", "temperature": "100 K"}
THERMAL = IRON | {"speed": 1.0, "speed_unit": "thermal"}


def unequal_pair(**options):
    """Two different grains with a field and given spins."""
    given = {
        "projectile": sand.Grains([[0, 0, 0]], 8e-9, sand.IRON, moment=[[0.0, 2e-18, 1e-18]]),
        "target": sand.Grains([[0, 0, 0]], 1.3e-8, sand.IRON, moment=[[1e-17, 0.0, -4e-18]]),
        "speed": 0.6,
        "spin": ([1e6, -2e7, 3e6], [0.0, 1e6, 1e6]),
        "field": [0.0, 2e-4, -1e-4],
        "orientation": "given",
        "start": "0.6 um",
    }
    return scattering.flight(**(given | options))


def bodies_of(pair):
    """Mass, moment of inertia and magnetic moment of both bodies."""
    return [
        (float(g.mass[0]), float(g.inertia[0]), float(np.linalg.norm(g.moment[0])))
        for g in (pair.projectile, pair.target)
    ]


@pytest.mark.validates("other program", "Two spinning dipoles in a field follow the trajectory of SciPy's DOP853")
@pytest.mark.compiled("scattering")
def test_against_scipy(record_bound):
    """SciPy's DOP853 at 1e-12 with vectors in the laboratory frame: the same positions to 1e-6 of R.

    F = K(μi, r) μj and B = k (3 r̂r̂ᵀ − 1) μ/r³ as in physics.md.
    """
    pair = unequal_pair()
    ours = scattering.trajectory(pair, "150 nm")
    (m1, i1, s1), (m2, i2, s2) = bodies_of(pair)
    outer = np.array(pair.field)

    def field(moment, r):
        size = np.linalg.norm(r)
        return MAGNETIC * (3 * r * (moment @ r) / size**5 - moment / size**3)

    def matrix(a, r):
        size = np.linalg.norm(r)
        inner = np.outer(a, r) + np.outer(r, a) + (a @ r) * np.eye(3) - 5 * (a @ r) * np.outer(r, r) / size**2
        return 3 * MAGNETIC / size**5 * inner

    def rates(t, y):
        x1, x2, v1, v2, e1, e2, w1, w2 = y.reshape(8, 3)
        r = x2 - x1
        a, b = s1 * e1, s2 * e2
        force2 = matrix(a, r) @ b
        turn1, turn2 = np.cross(a, field(b, -r) + outer), np.cross(b, field(a, r) + outer)
        parts = (v1, v2, -force2 / m1, force2 / m2, np.cross(w1, e1), np.cross(w2, e2), turn1 / i1, turn2 / i2)
        return np.concatenate(parts)

    start = np.concatenate(
        [
            *(ours.projectile[0], ours.target[0], ours.velocity_projectile[0], ours.velocity_target[0]),
            *(ours.moment_projectile[0], ours.moment_target[0], ours.spin_projectile[0], ours.spin_target[0]),
        ]
    )
    scale = np.repeat([1e-8, 1e-8, 1.0, 1.0, 1.0, 1.0, 1e7, 1e7], 3)
    found = solve_ivp(rates, (0.0, ours.time[-1]), start, method="DOP853", rtol=1e-12, atol=1e-12 * scale)
    end = found.y[:, -1].reshape(8, 3)
    assert np.linalg.norm(ours.velocity_projectile[-1] - ours.velocity_projectile[0]) > 0.05  # deflection
    errors = [
        np.abs(mine - theirs).max() / size
        for mine, theirs, size in (
            (ours.projectile[-1], end[0], 1e-8),
            (ours.target[-1], end[1], 1e-8),
            (ours.velocity_projectile[-1], end[2], 0.6),
            (ours.moment_projectile[-1], end[4], 1.0),
            (ours.spin_target[-1], end[7], 1e7),
        )
    ]
    quantity = "largest difference of x, v, μ, ω over 10 nm, the speed, μ and 10⁷/s"
    record_bound(quantity, max(errors), most=1e-6)


@pytest.mark.compiled("scattering", "flights")
def test_against_the_simulation():
    """The same pair in `Simulation` with steps of fourth order and quaternions: the same positions to 1e-5 of R."""
    pair = unequal_pair(field=None)
    ours = scattering.trajectory(pair, "150 nm")
    grains = sand.Grains(
        [ours.projectile[0], ours.target[0]],
        [8e-9, 1.3e-8],
        sand.IRON,
        velocity=[ours.velocity_projectile[0], ours.velocity_target[0]],
        spin=[ours.spin_projectile[0], ours.spin_target[0]],
        moment=[pair.projectile.moment[0], pair.target.moment[0]],
    )
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles()], stepping=ForestRuth(accuracy=1e-12))
    sim.run(until=float(0.9 * ours.time[-1]))
    projectile, target = ours.at(np.array([sim.time]))
    assert np.abs(sim.grains.position[0] - projectile[0]).max() < 1e-5 * 1e-8
    assert np.abs(sim.grains.position[1] - target[0]).max() < 1e-5 * 1e-8


@pytest.mark.compiled("scattering")
def test_energy_and_angular_momentum():
    """E, and without a field L = m̄ r×u + I1ω1 + I2ω2, constant to 1e-7: about a hundred steps at the tolerance."""
    pair = unequal_pair(field=None, spin="kT/2", temperature="100 K", orientation="random")
    reduced = pair.scales.reduced
    (_, i1, _), (_, i2, _) = bodies_of(pair)
    for number in range(20):
        one = scattering.trajectory(pair, "60 nm", number=number)
        apart = one.projectile - one.target
        moving = one.velocity_projectile - one.velocity_target
        angular = reduced * np.cross(apart, moving) + i1 * one.spin_projectile + i2 * one.spin_target
        size = np.linalg.norm(angular[0]) + i1 * np.linalg.norm(one.spin_projectile, axis=1).max()
        assert np.abs(angular - angular[0]).max() < 1e-6 * size
        assert one.drift < 1e-6
        assert np.abs(np.linalg.norm(one.moment_target, axis=1) - 1.0).max() < 1e-12


@pytest.mark.compiled("scattering")
def test_flights_with_a_large_energy_error_are_counted(tmp_path, capsys):
    """Flights of spinning grains with a coarse tolerance: those whose |ΔE|/½m̄u²_max exceeds 1e-6, from their paths.

    E = ½m̄u² + ½I₁ω₁² + ½I₂ω₂² + U of the first and the last state of each repeated flight, with the closed form of U.
    Cross-section, map, trajectory, table on the terminal and scattering.json state the same number; at the usual
    tolerance there is none, and no warning.
    """
    coarse = scattering.flight(**THERMAL, spin="kT/2", tolerance=2e-6)
    (m1, i1, s1), (m2, i2, s2) = bodies_of(coarse)

    def energy(path, k):
        u = path.velocity_projectile[k] - path.velocity_target[k]
        moments = s1 * path.moment_projectile[k], s2 * path.moment_target[k]
        spins = i1 * (path.spin_projectile[k] ** 2).sum() + i2 * (path.spin_target[k] ** 2).sum()
        pair = sand.theory.dipole_energy(*moments, path.projectile[k] - path.target[k])
        return 0.5 * m1 * m2 / (m1 + m2) * u @ u + 0.5 * spins + pair

    rows = []
    with pytest.warns(UserWarning, match=r"\d+ of \d+ flights have an energy error above 1e-06 of the largest kinetic"):
        found = scattering.measure(coarse, relative_error=0.3, seed=2, keep=lambda new: rows.extend(new.tolist()))
    assert found.drift == max(row[COLUMNS.index("drift")] for row in rows)
    errors = []
    for row in rows[:40]:
        path = scattering.replay(coarse, int(row[0]), int(row[1]), found.profile[0, 1], seed=2)
        u = path.velocity_projectile - path.velocity_target
        largest = 0.5 * m1 * m2 / (m1 + m2) * (u**2).sum(axis=1).max()
        errors.append(abs(energy(path, -1) - energy(path, 0)) / largest)
        assert errors[-1] == pytest.approx(path.drift, rel=1e-3, abs=1e-10)
    above = [row[COLUMNS.index("drift")] > 1e-6 for row in rows]
    assert found.inaccurate == sum(above) and [error > 1e-6 for error in errors] == above[:40]
    assert 0 < sum(above) < len(rows)
    with pytest.warns(UserWarning, match="flights have an energy error above 1e-06"):
        cells = probability_map([coarse], cells=4, per_cell=10, seed=2)
    assert 0 < cells.inaccurate <= 40 and cells.drift > 1e-6
    fine = scattering.flight(**THERMAL, spin="kT/2")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert probability_map([fine], cells=4, per_cell=10, seed=2).inaccurate == 0
    case = tmp_path / "case.toml"
    case.write_text(
        "[projectile]\nradius = '10 nm'\nmaterial = 'iron'\nmoment = '200 A m^2/kg'\n"
        "[flight]\ntemperature = '100 K'\nspeed = 1\nspeed_unit = 'thermal'\nspin = 'kT/2'\ntolerance = 2e-6\n"
        "[measure]\njob = 'map'\ncells = 4\nper_cell = 10\nseed = 2\n",
        encoding="utf-8",
    )
    assert main(["scatter", str(case), "--out", str(tmp_path / "map")]) == 0
    assert f"; drift up to {cells.drift:.0e}, {cells.inaccurate} above 1e-06" in capsys.readouterr().out
    content = json.loads((tmp_path / "map" / "scattering.json").read_text(encoding="utf-8"))
    assert (content["drift"], content["inaccurate"]) == (cells.drift, cells.inaccurate)


@pytest.mark.compiled("scattering")
def test_grains_at_contact():
    """The grains at contact have the energy ½m̄v², the angular momentum m̄bv and the momentum 0 of the start.

    U of the two dipoles is Eq. 6, D = 2r.  At the start, |U| ≤ α/d³ with d = 10 b_max, 2/(3√3 10³) = 4e-4 of ½m̄v².
    """
    pair = scattering.flight(**THERMAL)
    end, grains = sand.experiments.scattering.grains_at_contact(pair, "0.4 b_max", seed=3)
    assert end == "hit" and len(grains) == 2
    apart, between = (v[0] - v[1] for v in (grains.position, grains.velocity))
    assert np.linalg.norm(apart) == pytest.approx(2e-8, rel=1e-6, abs=0.0)
    mass, inertia = float(grains.mass[0]), float(grains.inertia[0])
    start = 0.25 * mass * pair.speed**2
    energy = 0.5 * mass * (grains.velocity**2).sum() + 0.5 * inertia * (grains.spin**2).sum()
    energy += sand.theory.magnetic.dipole_energy(*grains.moment, apart)
    assert abs(energy - start) < 1e-3 * start
    angular = 0.5 * mass * np.cross(apart, between) + inertia * grains.spin.sum(axis=0)
    b = 0.4 * pair.scales.capture
    assert np.linalg.norm(angular) == pytest.approx(0.5 * mass * b * pair.speed, rel=1e-5, abs=0.0)
    assert np.abs(grains.velocity.sum(axis=0)).max() < 1e-12 * np.linalg.norm(between)
    assert sand.experiments.scattering.grains_at_contact(pair, "2 b_max", seed=3) == ("miss", None)


@pytest.mark.validate
def test_rigid_bodies_of_one_grain_move_as_spheres():
    """The rigid-body kernel with one grain per body and the kernel of spheres agree to 1e-6 of R at the end."""
    from sand.experiments.scattering.encounters import body_of
    from sand.experiments.scattering.flight_driver import Flights, allocate_workspace, flights_of
    from sand.experiments.scattering.two_aggregates import AGGREGATES, TWO_AGGREGATES, Aggregates

    pair = unequal_pair()
    one = scattering.trajectory(pair, "150 nm")
    rules = Aggregates(MAGNETIC, pair.scales.reduced, body_of(pair.projectile), body_of(pair.target), 8e-9, pair.field)
    results, ends = np.zeros((1, 8)), np.zeros((1, AGGREGATES))
    square = np.array([1.5e-7**2])
    nought = np.zeros(1, np.uint64)
    flights_of(TWO_AGGREGATES)(
        np.uint64(0), Flights(nought, nought, square, square, results, ends), allocate_workspace(AGGREGATES),
        pair.start(0.0), rules, pair.limits(),
    )  # fmt: skip
    apart = one.projectile[-1] - one.target[-1]
    # both end within a step of the starting distance: compare along the straight outgoing path
    late = results[0, 3] - one.time[-1]
    moved = apart + late * (one.velocity_projectile[-1] - one.velocity_target[-1])
    assert results[0, 0] == MISS == ("hit", "miss").index(one.end)
    assert np.abs(ends[0, :3] - moved).max() < 1e-4 * 1e-8


@pytest.mark.validate
def test_energy_and_first_contact_of_aggregates():
    """Tumbling chains of 3 and 2 grains: energy to 1e-6 of |U_min|; the first contact is between two grains."""
    distance = 2e-8
    chains = [
        sand.Grains(np.array([[k * distance, 0, 0] for k in range(n)]), 1e-8, sand.IRON, moment=[[6e-18, 0, 0]] * n)
        for n in (3, 2)
    ]
    pair = scattering.flight(
        projectile=chains[0], target=chains[1], speed=0.3, temperature="100 K", spin="equipartition", start="0.5 um"
    )
    rows = fly(pair, [Task(0, 0, 20)], 1e-7)
    assert rows[:, COLUMNS.index("drift")].max() < 1e-6
    hit = rows[:, END] == HIT
    assert hit.sum() > 10
    assert np.abs(rows[hit, COLUMNS.index("closest")]).max() < 1e-6 * pair.scales.touch


@pytest.mark.compiled("scattering")
def test_cross_section_without_moments_is_geometric():
    """σ = π(r1 + r2)²: all trajectories with b < r1 + r2 hit, none above; grazing ones are resolved to 1e-4."""
    pair = scattering.flight(
        projectile=sand.Grains([[0, 0, 0]], 1e-8, sand.IRON),
        target=sand.Grains([[0, 0, 0]], 3e-8, sand.IRON),
        speed=1.0,
    )
    inside = fly(pair, [Task(0, 0, 300)], 4e-8 * (1 - 2e-4))
    outside = fly(pair, [Task(1, 0, 300)], 4e-8 * (1 + 1e-9))
    assert (inside[:, END] == HIT).all()
    assert (outside[:, END] == MISS).all()
    found = scattering.measure(pair, relative_error=0.01)
    assert found.interval[0] < found.geometric < found.interval[1]
    assert np.isnan(found.c)


@pytest.mark.compiled("scattering")
def test_capture_of_cold_grains_ends_at_b_max():
    """No spin, v_th, from 10 b_max: 0 of 600 hits at b ≥ 1.03 b_max, all of 200 below 0.7; c = 0.990 ± 0.01."""
    pair = scattering.flight(**THERMAL)
    b_max = pair.scales.capture
    beyond = fly(pair, [Task(103, 0, 200), Task(110, 0, 200), Task(118, 0, 200)], 0.01 * b_max)
    assert (beyond[:, END] == MISS).all()
    within = fly(pair, [Task(0, 0, 200)], 0.7 * b_max)
    assert (within[:, END] == HIT).all()
    found = scattering.measure(pair, relative_error=0.004)
    assert found.c == pytest.approx(0.990, abs=0.01)
    assert found.drift < 1e-6


@pytest.mark.validates("closed form", "Cross-section of aligned cold grains is Eq. 14 of Dominik & Nübold (2002)")
@pytest.mark.compiled("scattering")
def test_cross_section_of_aligned_cold_grains_is_eq_14(record_bound):
    """Moments along the line of centres: the central potential of Eqs. 7–14, c = 1.00 ± 0.01."""
    found = scattering.cross_section(**THERMAL, orientation="aligned", relative_error=0.004)
    record_bound("cross-section over that of Eq. 14", found.c, least=0.99, most=1.01)


@pytest.mark.compiled("scattering")
def test_trajectories_of_figure_2():
    """At v_th/16 from 10 b_max: 0.95 b_max hits, 1.0 transfers nearly all energy, 1.025 and 1.05 miss.

    With the thermal spin of the caption none of twenty trajectories at 0.95 b_max hits.
    """
    slow = IRON | {"speed": 1 / 16, "speed_unit": "thermal", "orientation": "aligned"}
    pair = scattering.flight(**slow)
    paths = [scattering.trajectory(pair, f"{b} b_max") for b in (0.95, 1.0, 1.025, 1.05)]
    assert [one.end for one in paths] == ["hit", "miss", "miss", "miss"]
    exchanged = [one.exchanged for one in paths[1:]]
    assert exchanged[0] > 0.9 > exchanged[1] > exchanged[2] > 0.3
    spinning = scattering.flight(**(slow | {"orientation": "random"}), spin="kT/2")
    width = 0.95 * spinning.scales.capture
    rows = fly(spinning, [Task(1, 0, 20)], width)  # b from 0.95 to 1.9 b_max
    assert (rows[:, END] == MISS).all()


@pytest.mark.filterwarnings("ignore:.* flights have an energy error")
@pytest.mark.compiled("scattering")
def test_cross_section_does_not_depend_on_the_tolerance():
    """1e-7, 1e-8, 1e-9: of 400 cold trajectories at most one in 200 near b_max differs; σ with spin agrees."""
    tasks = [Task(k, 0, 25) for k in range(16)]
    ends = [
        fly(f := scattering.flight(**THERMAL, tolerance=t), tasks, f.scales.capture / 15)[:, END] for t in (1e-7, 1e-9)
    ]
    assert (ends[0] != ends[1]).sum() <= 2
    found = [
        scattering.cross_section(**THERMAL, spin="kT/2", start="4 b_max", relative_error=0.05, tolerance=t)
        for t in (1e-7, 1e-9)
    ]
    assert abs(found[0].sigma - found[1].sigma) < 3.0 * math.hypot(found[0].sigma_error, found[1].sigma_error)


@pytest.mark.compiled("scattering")
def test_only_the_relative_velocity_matters():
    """A moving target gives the trajectories of a target at rest at the sum of the speeds."""
    at_rest = scattering.flight(**IRON, speed=0.3, start="2 um")
    coming = scattering.flight(**IRON, speed=0.1, start="2 um", target_velocity=[-0.2, 0, 0])
    tasks, width = [Task(0, 0, 50), Task(2, 0, 50)], 1e-7
    rows = [fly(f, tasks, width) for f in (at_rest, coming)]
    assert (rows[0][:, END] == rows[1][:, END]).all()
    assert rows[1][:, COLUMNS.index("speed")] == pytest.approx(0.3, rel=1e-12, abs=0.0)
    assert rows[0][:, COLUMNS.index("time")] == pytest.approx(rows[1][:, COLUMNS.index("time")], rel=1e-6, abs=0.0)


@pytest.mark.compiled("scattering")
def test_moving_target():
    """Given velocity: σ of the relative velocity.  Thermal: ⟨σ(u) u⟩/v∞, for Eq. 14 ⟨(u/v)^(−1/3)⟩ of it, 5 %.

    In the laboratory frame the projectile has v∞ and the target its drawn velocity.
    """
    options = IRON | {"orientation": "aligned", "start": "4 um"}
    at_rest = scattering.cross_section(**options, speed=0.3, relative_error=0.02)
    coming = scattering.cross_section(**options, speed=0.1, target_velocity=[-0.2, 0, 0], relative_error=0.02)
    assert coming.sigma == pytest.approx(at_rest.sigma, rel=1e-6, abs=0.0)
    assert coming.c == pytest.approx(1.0, abs=0.03)
    chance = scattering.cross_section(**options, speed=0.2, target_velocity="thermal", relative_error=0.02)
    assert chance.c == pytest.approx(1.0, abs=0.05)
    pair = scattering.flight(**options, speed=0.2, target_velocity="thermal")
    path = scattering.trajectory(pair, "2 um", number=3)
    assert np.linalg.norm(path.velocity_projectile[0] - [0.2, 0, 0]) < 1e-12
    assert 0.02 < np.linalg.norm(path.velocity_target[0]) < 1.0
    assert np.isnan(path.exchanged)


@pytest.mark.validate
@pytest.mark.compiled("scattering", "contacts")
@pytest.mark.parametrize(("radius", "part"), [(1e-4, 0.98), (1e-4, 1.03), (1e-6, 1.5)])
def test_sticking_of_large_grains(radius, part):
    """Silica of 100 µm sticks at 0.98 v_s and bounces at 1.03 v_s; of 1 µm it bounces at 1.5 v_s.

    A grain of 20 nm is attached to the projectile of 1 µm, far from where the contact forms.
    """
    limit = sand.theory.contact(sand.SILICA, radius).sticking_speed
    ball = sand.Grains([[0, 0, 0]], radius, sand.SILICA)
    rider = sand.Grains([[0, 0, 0], [-radius - 2e-8 + 5e-11, 0, 0]], [radius, 2e-8], sand.SILICA)
    projectile = ball if radius > 1e-5 else rider
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pair = scattering.flight(
            projectile=projectile, target=ball, speed=part * limit, outcome="stick", orientation="given"
        )
        rows = fly(pair, [Task(0, 0, 1)], 1e-4 * radius)
    assert (rows[:, END] == (HIT if part < 1.0 else BOUNCE)).all()


@pytest.mark.compiled("scattering", "contacts")
@pytest.mark.parametrize(("speed", "outcome"), [(76.0, HIT), (82.0, BOUNCE)])
def test_sticking_with_simulated_contact(speed, outcome):
    """Head-on without moments: 10 nm iron sticks below v_s = 78.9 m/s (theory.contact) and bounces above."""
    assert sand.theory.contact(sand.IRON, 1e-8).sticking_speed == pytest.approx(78.9, abs=0.1)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pair = scattering.flight(radius="10 nm", material=sand.IRON, speed=speed, outcome="stick", start="0.2 um")
        rows = fly(pair, [Task(0, 0, 1)], 1e-11)
    assert (rows[:, END] == outcome).all()


@pytest.mark.validate
@pytest.mark.parametrize(
    ("options", "expected", "allowed"),
    [
        ({"start": "4 b_max"}, 0.958, 0.01),
        ({"start": "10 b_max"}, 0.990, 0.01),
        ({"start": "20 b_max"}, 1.000, 0.01),
        ({"start": "40 b_max"}, 1.000, 0.01),
        ({"start": "1 R_m"}, 0.72, 0.01),
        ({"orientation": "aligned"}, 1.0, 0.01),
    ],
)
def test_c_depends_on_the_starting_plane(options, expected, allowed):
    """c = σ/σ_Eq14 of cold grains at v_th, started on planes at several distances (standard errors 0.002)."""
    found = scattering.cross_section(**THERMAL, relative_error=0.002, seed=5, **options)
    assert found.c == pytest.approx(expected, abs=allowed)
    assert found.bound == found.failed == 0


@pytest.mark.validates(
    "published figure",
    "Cross-section with thermal spins is 130 geometric ones, Eq. 26 of Dominik & Nübold (2002)",
)
@pytest.mark.validate
@pytest.mark.parametrize("start", ["10 b_max", "20 b_max"])
def test_cross_section_of_eq_26(record_bound, start):
    """Thermal spin kT/2 per grain, v_th: σ/π(2R)² = 130 ± 10, with a standard error below 2."""
    found = scattering.cross_section(**THERMAL, spin="kT/2", start=start, relative_error=0.01, seed=5)
    assert found.enhancement_error < 2.0
    record_bound("cross-section over the geometric one", found.enhancement, least=120.0, most=140.0)
