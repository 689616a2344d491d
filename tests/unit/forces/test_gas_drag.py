"""Drag and Brownian motion in a thin gas: friction from molecular collisions, kicks from friction, settings."""

import math

import numpy as np
import pytest

import sand
from sand.basics.constants import BOLTZMANN
from sand.compiler.jit import kernel
from sand.forces import gas_drag as law
from sand.forces.base import ExternalForce, Force
from sand.forces.gas import Gas
from sand.forces.gas_loops import VACUUM, GasParameters, gas_kick, shortest_stopping_time

SPEED = math.sqrt(8.0 / math.pi)
"""v̄ for k_B T/m_g = 1."""


def gauss(low, high, count):
    """Nodes and weights of Gauss–Legendre quadrature on low … high."""
    x, w = np.polynomial.legendre.leggauss(count)
    return 0.5 * (high - low) * x + 0.5 * (high + low), 0.5 * (high - low) * w


def maxwell(c):
    return np.exp(-0.5 * c * c) / math.sqrt(2.0 * math.pi)


def molecular_momentum_transfer(velocity, spin, accommodation):
    """Momentum transfer of molecules to a sphere by quadrature: r = ρ_g = k_B T/m_g = 1.

    Integrals over surface normals n and velocities c of molecules that reach the surface element, drifting at
    −(v + ω×n) in its frame, weighted with −c·n.  A molecule leaves by specular reflection, or diffusely with the flux
    distribution of a Maxwellian at rest.  No expansion in v or ω.

    Returns:
        Force, torque, and the sums of Δp_x² and of (n×Δp)_x² per time, for molecules of mass 1.
    """
    force, torque, force_noise, torque_noise = np.zeros(3), np.zeros(3), 0.0, 0.0
    c, weight = gauss(-10.0, 0.0, 60)
    x, weight_x = np.polynomial.hermite_e.hermegauss(6)
    weight_x = weight_x / weight_x.sum()
    # diffuse reflection: mean of the normal speed and of its square, weighted with the flux
    leave = [(weight * abs(c) ** k * abs(c) * maxwell(c)).sum() for k in range(3)]
    mean_out, square_out = np.array([leave[1] / leave[0], 0.0, 0.0]), np.array([leave[2] / leave[0], 1.0, 1.0])
    for cosine, weight_n in zip(*gauss(-1.0, 1.0, 12), strict=True):
        for angle in 2.0 * math.pi * np.arange(16) / 16.0:
            sine = math.sqrt(1.0 - cosine**2)
            n = np.array([sine * math.cos(angle), sine * math.sin(angle), cosine])
            side = np.cross(n, [1.0, 0.0, 0.0] if abs(n[0]) < 0.6 else [0.0, 1.0, 0.0])
            frame = np.array([n, side / np.linalg.norm(side), np.cross(n, side / np.linalg.norm(side))])
            drift = frame @ -(velocity + np.cross(spin, n))
            grid = np.meshgrid(c, drift[1] + x, drift[2] + x, indexing="ij")
            here = np.stack(grid, axis=-1).reshape(-1, 3)
            rate = np.einsum("i,j,k->ijk", weight * -c * maxwell(c - drift[0]), weight_x, weight_x).ravel()
            rate *= weight_n * 2.0 * math.pi / 16.0
            mirrored = here * [2.0, 0.0, 0.0]
            momentum_change = (1.0 - accommodation) * mirrored + accommodation * (here - mean_out)
            push = frame.T @ (rate @ momentum_change)
            force += push
            torque += np.cross(n, push)
            # ⟨Δp Δpᵀ⟩ in the frame of the element: outgoing and incoming momenta are independent
            both = (1.0 - accommodation) * np.einsum("a,ai,aj->ij", rate, mirrored, mirrored)
            came = np.einsum("a,ai,aj->ij", rate, here - mean_out, here - mean_out)
            both += accommodation * (came + rate.sum() * np.diag(square_out - mean_out**2))
            force_noise += frame[:, 0] @ both @ frame[:, 0]
            lever = np.cross([1.0, 0.0, 0.0], n)  # (n×Δp)_x = Δp·(e_x×n)
            torque_noise += (frame @ lever) @ both @ (frame @ lever)
    return force, torque, force_noise, torque_noise


@pytest.mark.parametrize("accommodation", [0.0, 0.3, 1.0])
def test_friction_from_molecular_collisions(accommodation):
    """F = −f_t v to O(s²), s² = v²/2: the next term is s²/5 for specular reflection (1.1e-4 here), less for diffuse."""
    velocity = np.array([0.02, -0.01, 0.025])
    force, torque, _, _ = molecular_momentum_transfer(velocity, np.zeros(3), accommodation)
    expected = -law.translation_friction(1.0, 1.0, SPEED, accommodation) * velocity
    excess = force / expected - 1.0
    square = 0.5 * velocity @ velocity
    assert (excess > 0.0).all() and (excess < 1.01 * square / 5.0).all()
    assert np.abs(torque).max() < 1e-12
    if accommodation == 0.0:
        assert excess == pytest.approx(square / 5.0, rel=1e-3, abs=0)


@pytest.mark.parametrize("accommodation", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("size", [0.01, 1.0])
def test_torque_from_molecular_collisions(accommodation, size):
    """M = −f_r ω for any ω, no force; quadrature and rounding 1e-11."""
    spin = size * np.array([0.5, 0.7, -0.4])
    force, torque, _, _ = molecular_momentum_transfer(np.zeros(3), spin, accommodation)
    expected = -law.rotation_friction(1.0, 1.0, SPEED, accommodation) * spin
    assert torque == pytest.approx(expected, rel=1e-11, abs=1e-12)
    assert np.abs(force).max() < 1e-12


@pytest.mark.parametrize("accommodation", [0.0, 0.3, 1.0])
def test_momentum_fluctuations_obey_fluctuation_dissipation(accommodation):
    """Σ Δp_x² per time = 2 f_t k_B T, Σ (r×Δp)_x² = 2 f_r k_B T (m_g = 1), relative 1e-10."""
    _, _, force_noise, torque_noise = molecular_momentum_transfer(np.zeros(3), np.zeros(3), accommodation)
    assert force_noise == pytest.approx(
        2.0 * law.translation_friction(1.0, 1.0, SPEED, accommodation), rel=1e-10, abs=0
    )
    expected = 2.0 * law.rotation_friction(1.0, 1.0, SPEED, accommodation)
    assert torque_noise == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_error_of_the_linear_law_at_half_the_molecular_speed():
    """At v = v̄/2 the drag exceeds f_t v by 6.2 % (specular) and 4.5 % (diffuse), see forces/gas.py."""
    velocity = np.array([0.0, 0.0, 0.5 * SPEED])
    for accommodation, excess in ((0.0, 0.062), (1.0, 0.045)):
        force = molecular_momentum_transfer(velocity, np.zeros(3), accommodation)[0]
        linear = -law.translation_friction(1.0, 1.0, SPEED, accommodation) * velocity
        assert force[2] / linear[2] - 1.0 == pytest.approx(excess, abs=1e-3)


def test_numbers_of_a_gas():
    """v̄ of N2 at 293.15 K is 470.7 m/s; air at 101325 Pa, 28.97 u, 288.15 K: 1.225 kg/m³, λ = m_g/(√2 ρ σ)."""
    energy = BOLTZMANN * 293.15
    assert law.mean_speed(energy, 28.0134 * law.ATOMIC_MASS) == pytest.approx(470.7, rel=1e-6, abs=0.05)
    mass = 28.97 * law.ATOMIC_MASS
    density = law.density_of(101325.0, BOLTZMANN * 288.15, mass)
    assert density == pytest.approx(1.225, abs=1e-3)
    assert law.mean_free_path(density, mass, 4.3e-19) == pytest.approx(6.5e-8, rel=0.02, abs=0)


@pytest.mark.interpreted
@pytest.mark.parametrize("parts", [2, 3, 7])
def test_many_short_updates_equal_a_long_one(parts):
    """The factors e^(−t/τ) multiply and the variances add up: exact, rounding 1e-14 × parts."""
    rate, time, energy, mass = 3.0, 0.4, 2.0, 5.0
    part = law.decayed_fraction(rate, time / parts)
    mean, variance = 1.0, 0.0
    for _ in range(parts):
        mean = law.ornstein_uhlenbeck((mean, 0.0, 0.0), (0.0, 0.0, 0.0), part, 0.0, (0.0, 0.0, 0.0))[0]
        variance = (1.0 - part) ** 2 * variance + law.thermal_spread(part, energy, mass) ** 2
    assert mean == pytest.approx(math.exp(-rate * time), rel=1e-13, abs=0)
    assert variance == pytest.approx((1.0 - math.exp(-2.0 * rate * time)) * energy / mass, rel=1e-13, abs=0)


@pytest.mark.interpreted
def test_short_and_long_times_lose_no_digits():
    """t ≪ τ: 1 − e^(−x) → x − x²/2, variance → 2 f k_B T t/m²; t ≫ τ: full decay, variance k_B T/m."""
    tiny = law.decayed_fraction(1e-3, 1e-12)
    assert tiny == pytest.approx(1e-15, rel=1e-14, abs=0)
    assert law.thermal_spread(tiny, 3.0, 2.0) ** 2 == pytest.approx(2.0 * 1e-15 * 3.0 / 2.0, rel=1e-14, abs=0)
    assert law.decayed_fraction(1.0, 1e4) == 1.0
    assert law.thermal_spread(1.0, 3.0, 2.0) == pytest.approx(math.sqrt(1.5), rel=1e-15, abs=0)
    wind, noise = (1.0, -2.0, 3.0), (0.5, 0.0, -1.0)
    assert law.ornstein_uhlenbeck((9.0, 9.0, 9.0), wind, 1.0, 2.0, noise) == pytest.approx(
        (2.0, -2.0, 1.0), rel=1e-14, abs=0
    )
    assert law.ornstein_uhlenbeck((9.0, 8.0, 7.0), wind, 0.0, 0.0, noise) == (9.0, 8.0, 7.0)


# ---- kicks --------------------------------------------------------------------------------------------


def many_kicks(grains, seed, first, count, elapsed, gas):
    given = 0.0
    for k in range(count):
        given += gas_kick(grains, seed, first + k, elapsed, gas)
    return given


kicks = kernel(many_kicks, cached=False)
PRESSURE, TEMPERATURE = 50.0, 300.0
compiled = pytest.mark.skipif(not hasattr(kicks, "_cache"), reason="too many grains with the compiler off")


def free_grains(count, velocity=0.0, spin=0.0, seed=0):
    """Grains of 10 … 40 nm; `velocity` and `spin` in units of √(k_B T/m) and √(k_B T/I)."""
    rng = np.random.default_rng(seed)
    radius = rng.uniform(1e-8, 4e-8, count)
    grains = sand.Grains(np.zeros((count, 3)), radius, sand.SILICA)
    energy = BOLTZMANN * TEMPERATURE
    grains.arrays.velocity[...] = velocity * rng.normal(size=(3, count)) * np.sqrt(energy / grains.mass)
    grains.arrays.spin[...] = spin * rng.normal(size=(3, count)) * np.sqrt(energy / grains.arrays.inertia)
    return grains


def times(grains, gas):
    """Stopping times [s] of translation and rotation, from the friction."""
    rules = gas.numbers()
    numbers = (grains.radius, rules.density, rules.mean_speed, rules.accommodation)
    with np.errstate(divide="ignore"):  # specular reflection exerts no torque
        spin_down = grains.arrays.inertia / law.rotation_friction(*numbers)
    return grains.mass / law.translation_friction(*numbers), spin_down


def reduced_squares(grains):
    """m v²/k_B T and I ω²/k_B T by component, (3, N) each."""
    a, energy = grains.arrays, BOLTZMANN * TEMPERATURE
    return a.mass * a.velocity**2 / energy, a.inertia * a.spin**2 / energy


def kinetic(grains):
    a = grains.arrays
    return 0.5 * (a.mass * a.velocity**2).sum() + 0.5 * (a.inertia * a.spin**2).sum()


def still_gas(**changes):
    return Gas(**({"temperature": TEMPERATURE, "pressure": PRESSURE} | changes))


@pytest.mark.compiled("small")
@pytest.mark.parametrize("accommodation", [0.0, 0.4, 1.0])
def test_drag_alone_is_an_exponential(accommodation):
    """v − u = (v0 − u) e^(−t/τ_t), ω = ω0 e^(−t/τ_r), separate τ; 10 kicks, rounding 1e-13."""
    gas = still_gas(brownian=False, accommodation=accommodation, wind=(3.0, -20.0, 1.0))
    grains = free_grains(50, 1.0, 1.0)
    before = grains.copy()
    fall, spin_down = times(grains, gas)
    step = 0.1 * float(fall.min())
    kicks(grains.arrays, 0, 0, 10, step, gas.numbers())
    wind = np.array(gas.wind)
    expected = wind + (before.velocity - wind) * np.exp(-10 * step / fall)[:, None]
    assert grains.velocity == pytest.approx(expected, rel=1e-13, abs=1e-13 * np.abs(expected).max())
    assert grains.spin == pytest.approx(before.spin * np.exp(-10 * step / spin_down)[:, None], rel=1e-13, abs=0)
    if accommodation == 0.0:
        assert (grains.spin == before.spin).all()


@pytest.mark.validates("closed form", "Grains in a gas have the temperature of the gas in all six degrees of freedom")
@pytest.mark.compiled("small")
@compiled
@pytest.mark.parametrize(
    ("accommodation", "count", "part", "start"),
    [
        *((0.2, 1, 20.0, 0.0), (1.0, 200, 0.1, 3.0)),
        *(
            pytest.param(*case, marks=pytest.mark.validate)
            for case in ((0.2, 200, 0.1, 0.0), (0.2, 200, 0.1, 3.0), (1.0, 1, 20.0, 0.0), (1.0, 200, 0.1, 0.0))
        ),
    ],
)
def test_equipartition(record_bound, accommodation, count, part, start):
    """⟨m v_k²⟩ = ⟨I ω_k²⟩ = k_B T after ≥ 20 relaxation times, in one kick or many, from rest or from 9 T.

    Each of the six is a mean of N squares of normal deviates, 1 ± √(2/N): 0.01 for N = 20,000; within 3 σ.
    """
    gas, n = still_gas(accommodation=accommodation), 20_000
    grains = free_grains(n, start, start)
    longest = max(float(t.max()) for t in times(grains, gas))
    kicks(grains.arrays, 1, 0, count, part * longest, gas.numbers())
    error = max(np.abs(squares.mean(axis=1) - 1.0).max() for squares in reduced_squares(grains))
    record_bound("largest deviation of a temperature, in standard errors", error / math.sqrt(2.0 / n), most=3.0)


@pytest.mark.compiled("small")
@compiled
def test_specular_reflection_does_not_heat_spins():
    """α = 0: translation reaches k_B T, spins stay exactly at rest; N = 20,000, within 3 σ = 3 √(2/N)."""
    gas, n = still_gas(accommodation=0.0), 20_000
    grains = free_grains(n)
    kicks(grains.arrays, 2, 0, 1, 20.0 * float(times(grains, gas)[0].max()), gas.numbers())
    assert np.abs(reduced_squares(grains)[0].mean(axis=1) - 1.0).max() < 3.0 * math.sqrt(2.0 / n)
    assert not grains.spin.any()


@pytest.mark.compiled("small")
@compiled
def test_kicks_of_velocities_and_spins_are_uncorrelated():
    """In equilibrium correlations of v_k and ω_l are 0 ± 1/√N, N = 20,000; 15 values, within 4 σ."""
    gas, n = still_gas(), 20_000
    grains = free_grains(n)
    kicks(grains.arrays, 10, 0, 1, 20.0 * max(float(t.max()) for t in times(grains, gas)), gas.numbers())
    a = grains.arrays
    both = np.corrcoef(a.velocity * np.sqrt(a.mass), a.spin * np.sqrt(a.inertia))
    assert np.abs(both - np.eye(6)).max() < 4.0 / math.sqrt(n)


@pytest.mark.compiled("small")
@compiled
def test_grains_follow_the_wind():
    """The mean of √(m/k_B T)(v − u) is 0 ± 1/√N, of its square 1 ± √(2/N), N = 20,000; within 3 σ."""
    gas, n = still_gas(wind=(5.0, 0.0, -7.0)), 20_000
    grains = free_grains(n)
    kicks(grains.arrays, 3, 0, 50, float(times(grains, gas)[0].max()), gas.numbers())
    slow = (grains.velocity - np.array(gas.wind)) * np.sqrt(grains.mass / (BOLTZMANN * TEMPERATURE))[:, None]
    assert np.abs(slow.mean(axis=0)).max() < 3.0 / math.sqrt(n)
    assert np.abs((slow**2).mean(axis=0) - 1.0).max() < 3.0 * math.sqrt(2.0 / n)


@pytest.mark.compiled("small")
@compiled
@pytest.mark.parametrize("pieces", [1, 2, 16])
def test_variance_does_not_depend_on_the_number_of_kicks(pieces):
    """After t = 0.3 τ from rest: m⟨v²⟩ = (1 − e^(−0.6)) k_B T, spins likewise with τ_r, for one or several kicks.

    Each grain's variance is known, so these are N squares of normal deviates: 1 ± √(2/N), N = 20,000; within 3 σ.
    """
    gas, n = still_gas(), 20_000
    grains = free_grains(n)
    time = 0.3 * float(times(grains, gas)[0].mean())
    kicks(grains.arrays, 4, 0, pieces, time / pieces, gas.numbers())
    for squares, tau in zip(reduced_squares(grains), times(grains, gas), strict=True):
        ratio = squares / (1.0 - np.exp(-2.0 * time / tau))
        assert np.abs(ratio.mean(axis=1) - 1.0).max() < 3.0 * math.sqrt(2.0 / n)


@pytest.mark.compiled("small")
@compiled
def test_velocity_autocorrelation():
    """⟨v(0)·v(t)⟩ = e^(−t/τ)⟨v²⟩, spins with τ_r, in equilibrium; the noise has variance 1 − e^(−2t/τ).

    With x0, x1 the reduced components: Σ x0 (x1 − x0 e^(−t/τ)) = 0 ± √(Σ x0² (1 − e^(−2t/τ))); within 3 σ.
    """
    gas, n = still_gas(), 20_000
    grains = free_grains(n, 1.0, 1.0)
    before = grains.copy()
    step = 0.05 * float(times(grains, gas)[0].mean())
    for round_ in range(4):
        kicks(grains.arrays, 5, 10 * round_, 10, step, gas.numbers())
        time = 10 * (round_ + 1) * step
        for name, tau in zip(("velocity", "spin"), times(grains, gas), strict=True):
            x0, x1 = getattr(before.arrays, name), getattr(grains.arrays, name)
            unit = np.sqrt((x0**2).mean(axis=0))
            x0, x1, kept = x0 / unit, x1 / unit, np.exp(-time / tau)
            noise = BOLTZMANN * TEMPERATURE / (before.mass if name == "velocity" else before.inertia) / unit**2
            spread = math.sqrt((x0**2 * (1.0 - kept**2) * noise).sum())
            assert abs((x0 * (x1 - kept * x0)).sum()) < 3.0 * spread


@pytest.mark.compiled("small")
@pytest.mark.parametrize("brownian", [True, False])
def test_energy_given_to_the_gas(brownian):
    """Sum over kicks of ½m(v² − v'²) + ½I(ω² − ω'²) = −ΔK, rounding 1e-12; pure drag only dissipates."""
    gas = still_gas(brownian=brownian, wind=(0.0, 0.0, 0.0))
    for start in (0.0, 1.0):
        grains = free_grains(200, start, start)
        before = kinetic(grains)
        step = 0.01 * float(times(grains, gas)[0].min())
        given = kicks(grains.arrays, 6, 0, 30, step, gas.numbers())
        assert given == pytest.approx(before - kinetic(grains), rel=1e-12, abs=1e-12 * before)
        if start == 0.0:
            assert (given < 0.0) if brownian else (given == 0.0)
        elif not brownian:
            assert 0.0 < given < before


@pytest.mark.compiled("small")
def test_kicks_are_reproducible():
    """Same seed and numbers: the same bits; another seed, number or id changes every component."""
    gas = still_gas().numbers()

    def after(seed=7, first=0, ids=None):
        grains = free_grains(100, 1.0, 1.0)
        if ids is not None:
            grains.arrays.id[:] = ids
        kicks(grains.arrays, seed, first, 5, 1e-9, gas)
        return np.concatenate([grains.velocity, grains.spin])

    assert after().tobytes() == after().tobytes()
    for other in (after(seed=8), after(first=5), after(seed=7 + 2**40), after(ids=np.arange(100) + 100)):
        assert (after() != other).all()


@pytest.mark.compiled("small")
def test_order_and_blocks_of_grains_change_no_bit():
    """Grains one by one, in sevens or backwards: the same bits, because deviates belong to ids."""
    gas, n = still_gas().numbers(), 101

    def part(index):
        grains = free_grains(n, 1.0, 1.0)
        arrays = type(grains.arrays)(*(np.ascontiguousarray(a[..., index]) for a in grains.arrays))
        kicks(arrays, 9, 3, 4, 1e-9, gas)
        return np.concatenate([arrays.velocity, arrays.spin])

    whole = part(np.arange(n))
    for size in (1, 7, 64):
        pieces = [part(np.arange(k, min(k + size, n))) for k in range(0, n, size)]
        assert np.concatenate(pieces, axis=1).tobytes() == whole.tobytes()
    assert np.ascontiguousarray(part(np.arange(n)[::-1])[:, ::-1]).tobytes() == whole.tobytes()


@pytest.mark.compiled("small")
@pytest.mark.interpreted
def test_zero_time_and_vacuum_change_nothing():
    """Kicks over 0 s or in vacuum change no bit and record nothing; positions are never changed."""
    gas = still_gas().numbers()
    for rules, elapsed in ((gas, 0.0), (VACUUM, 1.0), (gas._replace(on=False), 1e-9)):
        grains = free_grains(10, 1.0, 1.0)
        before = grains.copy()
        assert kicks(grains.arrays, 1, 0, 2, elapsed, rules) == 0.0
        assert all((a == b).all() for a, b in zip(grains.arrays, before.arrays, strict=True))
    kicks(grains.arrays, 1, 0, 2, 1e-9, gas)
    moved = {n for n, a, b in zip(before.arrays._fields, grains.arrays, before.arrays, strict=True) if (a != b).any()}
    assert moved == {"velocity", "spin"}


@pytest.mark.compiled("small")
@pytest.mark.interpreted
def test_compiled_and_interpreted_kicks_agree():
    """Three kicks of 20 grains in plain Python and compiled: 1e-13 of the largest component."""
    gas = still_gas(wind=(1.0, 2.0, 3.0)).numbers()
    fast, plain = free_grains(20, 1.0, 1.0), free_grains(20, 1.0, 1.0)
    given = kicks(fast.arrays, 2**62, 2**33, 3, 1e-8, gas)
    assert many_kicks(plain.arrays, 2**62, 2**33, 3, 1e-8, gas) == pytest.approx(given, rel=1e-11, abs=0)
    assert fast.velocity == pytest.approx(plain.velocity, rel=0, abs=1e-13 * np.abs(plain.velocity).max())
    assert fast.spin == pytest.approx(plain.spin, rel=0, abs=1e-13 * np.abs(plain.spin).max())


# ---- settings -----------------------------------------------------------------------------------------


def test_settings_of_a_gas():
    """Text, SI, defaults; pressure gives ρ_g = p m_g/k_B T; a gas is a Force but not an ExternalForce."""
    gas = Gas("280 K", density="1e-6 kg/m^3")
    assert gas.molecule_mass == pytest.approx(2.34 * 1.66053907e-27, rel=1e-8, abs=0)
    assert gas.molecule_mass == pytest.approx(Gas(280, 1e-6, molecule_mass="2.34 u").molecule_mass, rel=1e-8, abs=0)
    speed = math.sqrt(8 * BOLTZMANN * 280 / (math.pi * gas.molecule_mass))
    assert gas.numbers() == pytest.approx(
        GasParameters(True, 1e-6, speed, BOLTZMANN * 280, 1.0, 0.0, 0.0, 0.0), rel=1e-14, abs=0
    )
    pressed = Gas(280, pressure=1e-6 * BOLTZMANN * 280 / gas.molecule_mass, wind=["1 km/s", 0, -2], brownian=False)
    assert pressed.numbers() == pytest.approx(
        GasParameters(True, 1e-6, speed, 0.0, 1.0, 1e3, 0.0, -2.0), rel=1e-14, abs=0
    )
    assert isinstance(gas, Force) and not isinstance(gas, ExternalForce)
    assert gas.name == "gas" and "Epstein 1924" in gas.references


@pytest.mark.parametrize("given", [{"density": 1e-6}, {"pressure": "1 Pa", "cross_section": 2e-19}])
def test_parameters_build_the_same_gas(given):
    """Parameters as in a case file (plain numbers, no empty entries) rebuild an equal gas."""
    gas = Gas(100, wind=[1, 2, 3], brownian=False, accommodation=0.9, **given)
    message = gas.parameters()
    assert None not in message.values() and isinstance(message["wind"], list)
    assert Gas(**message) == gas


@pytest.mark.parametrize("accommodation", [0.0, 0.5, 1.0])
def test_shortest_relaxation_time(accommodation):
    """Minimum of m/f_t, and of I/f_r, which is 0.8 (1/α + π/8) times as long; infinite in vacuum."""
    gas, grains = still_gas(accommodation=accommodation), free_grains(30)
    rules, small = gas.numbers(), grains.radius.min()
    friction = 4 / 3 * math.pi * small**2 * rules.density * rules.mean_speed * (1 + math.pi / 8 * accommodation)
    expected = sand.SILICA.density * 4 / 3 * math.pi * small**3 / friction
    assert gas.shortest_time(grains) == pytest.approx(expected, rel=1e-13, abs=0)
    if accommodation:
        fall, spin_down = times(grains, gas)
        assert spin_down / fall == pytest.approx(0.8 * (1 / accommodation + math.pi / 8), rel=1e-13, abs=0)
        light = grains.arrays._replace(inertia=1e-3 * grains.arrays.inertia)
        assert shortest_stopping_time(light, rules) == pytest.approx(1e-3 * spin_down.min(), rel=1e-13, abs=0)
    assert shortest_stopping_time(grains.arrays, VACUUM) == math.inf
    assert shortest_stopping_time(grains.arrays, rules._replace(on=False)) == math.inf


def test_warnings():
    """Grains faster than half the molecules, and grains too large for a known mean free path."""
    grains, box = free_grains(5), sand.Box.open()
    assert still_gas(cross_section="2e-19 m^2").check(grains, box) == []
    grains.arrays.velocity[1, 3] = 0.51 * still_gas().numbers().mean_speed
    (warning,) = still_gas().check(grains, box)
    assert "grain 3 moves at" in warning and "underestimates the drag" in warning
    assert still_gas(wind=grains.velocity[3]).check(sand.Grains([[0, 0, 0]], 1e-8, "ice"), box) == [
        warning.replace("grain 3", "grain 0")
    ]
    dense = still_gas(pressure="1e5 Pa", cross_section="2e-19 m^2")
    (warning,) = dense.check(free_grains(5), box)
    assert "mean free path is" in warning and "overestimates the drag" in warning
    assert still_gas(pressure="1e5 Pa").check(free_grains(5), box) == []
