"""Dilute dust whose bodies keep their motion: smooth elastic bodies share their energy as in equilibrium."""

import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from sand.experiments.dilute_body import closest_pair, in_space, momenta_of, part_of
from sand.experiments.dilute_encounters import Encounters
from sand.experiments.dilute_flight import RigidFlights
from sand.experiments.dilute_hits import Hit
from sand.experiments.scattering.flight_driver import HIT, MISS
from sand.experiments.scattering.initial_conditions import R, U
from sand.experiments.scattering.rigid_flight import TOUCH
from sand.experiments.scattering.two_aggregates import ANGULAR1, ANGULAR2, TURN1, TURN2
from tests.physics.test_dilute import HEAT
from tests.physics.test_dilute_own import BENT_PLACES, left_out, momentum, population
from tests.unit.experiments.test_dilute import RADIUS, aggregate

pytestmark = pytest.mark.compiled("scattering", "dipoles")
SMOOTH = aggregate(BENT_PLACES, 0.02 * np.array([[0, 0, 1], [1, 0, 0], [0.6, 0.8, 0]]))
"""Three grains at a right angle, with three moments of inertia; two that touch attract each other with 0.3 k_BT."""
BODIES = 50
MOST_TOUCHES = 100
"""Touches of one encounter, after which it is left out."""


def rebound(a, b, state):
    """The state (20,) of two smooth, elastic bodies after their touch.

    The impulse is along the line n of the two closest grains.  With arms x from the centres of mass and the rate g =
    n·(u + ω × x − ω′ × x′) of the gap it is J = −2g/(1/m̄ + c·I⁻¹c + c′·I′⁻¹c′), c = x × n; J = 0 if they recede.
    """
    grains, count = in_space(a, b, state)[0], len(a)
    i, j, _ = closest_pair(count, grains)
    along = grains.position[:, i] - grains.position[:, j]
    normal = along / np.linalg.norm(along)
    touch, reduced = grains.position[:, i] - RADIUS * normal, a.mass * b.mass / (a.mass + b.mass)
    y = state.copy()
    angular, inverse, levers = (y[ANGULAR1 : ANGULAR1 + 3], y[ANGULAR2 : ANGULAR2 + 3]), [], []
    for body, share, turn in ((a, b.mass, TURN1), (b, -a.mass, TURN2)):
        pose = Rotation.from_quat(y[turn : turn + 4]).as_matrix()
        inverse.append(pose / body.flying.inertia @ pose.T)
        levers.append(np.cross(touch - share / (a.mass + b.mass) * y[R : R + 3], normal))
    rate = y[U : U + 3] @ normal + levers[0] @ inverse[0] @ angular[0] - levers[1] @ inverse[1] @ angular[1]
    weight = 1.0 / reduced + sum(lever @ tensor @ lever for lever, tensor in zip(levers, inverse, strict=True))
    impulse = max(-2.0 * rate / weight, 0.0)
    y[U : U + 3] += impulse / reduced * normal
    for own, lever, sign in zip(angular, levers, (1.0, -1.0), strict=True):
        own += sign * impulse * lever
    # free motion out of the reach of this touch, which comes again if it is not left then
    h = TOUCH * RADIUS / (abs(rate) + 0.1 * np.linalg.norm(y[U : U + 3]))
    y[R : R + 3] += h * y[U : U + 3]
    for tensor, own, turn in zip(inverse, angular, (TURN1, TURN2), strict=True):
        y[turn : turn + 4] = (
            Rotation.from_rotvec(h * (tensor @ own)) * Rotation.from_quat(y[turn : turn + 4])
        ).as_quat()
    return y


def touch_energy(a, b, state):
    """½m̄u² + ½Σ L·I⁻¹L of both [J], and the total angular momentum about their centre [J s], from their grains."""
    grains = in_space(a, b, state)[0]
    arm = (grains.mass * (grains.velocity**2).sum(axis=0)).sum() + (grains.inertia * grains.spin**2).sum()
    return 0.5 * arm, momenta_of(grains)[2]


class Elastic:
    """A hit rule: smooth bodies rebound from each other without loss until they part."""

    def __init__(self, rigid_flights):
        self.rigid_flights, self.touches = rigid_flights, 0

    def __call__(self, a, b, state):
        """Both bodies after their last touch; unchanged if they stay together."""
        for _ in range(MOST_TOUCHES):
            self.touches += 1
            flight = self.rigid_flights.onward(a, b, rebound(a, b, state), 20.0 * (a.extent + b.extent))
            state = flight.state
            if flight.end == MISS:
                grains, contacts = in_space(a, b, state)
                parts = np.arange(len(a)), np.arange(len(a), grains.mass.size)
                pieces = [part_of(grains, contacts, part) for part in parts]
                return Hit(pieces, 0, 0, 0, 0.0, 0, {}, [momenta_of(piece)[1:] for piece, _ in pieces])
            if flight.end != HIT:
                break
        return left_out(a, b, state)


def shares(number, widening, cold, seed):
    """Translation and rotation over their values in equilibrium, and the last total energy over the first one.

    The first tenth of the encounters is left out.  A state lasts 1/Λ on average, its weight in the mean over time.
    """
    bodies = population(BODIES, SMOOTH, seed, widening, cold)
    rigid_flights = RigidFlights(HEAT, step_fraction=0.05, group_size=0.0)
    now = Encounters(bodies, rigid_flights, Elastic(rigid_flights), seed)
    found = np.empty((number, 3))
    for k in range(number):
        now.step()
        found[k] = *bodies.temperatures, 1.0 / bodies.rate
    later = found[number // 10 :]
    mean = (later[:, 2] @ later[:, :2]) / later[:, 2].sum()
    total = momentum(bodies)
    drift = total @ total / (2.0 * BODIES**2 * SMOOTH.mass * HEAT)
    translation = drift + (mean.sum() - drift) * (BODIES - 1) / (2 * BODIES - 1)
    return (
        mean[0] / translation,
        mean[1] / (mean.sum() - translation),
        found[-1, :2].sum() / found[0, :2].sum(),
    )


def test_a_rebound_keeps_energy_and_angular_momentum():
    """T and r × m̄u + L + L′ of 40 states that touch stay, and the gap of the two bodies is not smaller.

    Free motion follows, with L kept and ω constant, by angles of some 1e-2: T changes by no more than their square.
    """
    rigid_flights, seen = RigidFlights(HEAT, group_size=0.0), []

    def rule(a, b, state):
        seen.append((a, b, state))
        return left_out(a, b, state)

    now = Encounters(population(BODIES, SMOOTH), rigid_flights, rule, 5)
    while len(seen) < 40:
        now.step()
    for a, b, state in seen:
        later = rebound(a, b, state)
        (before, angular), (after, turned) = touch_energy(a, b, state), touch_energy(a, b, later)
        assert after == pytest.approx(before, rel=1e-3, abs=0.0)
        assert turned == pytest.approx(angular, abs=1e-9 * np.linalg.norm(angular))
        gaps = [closest_pair(len(a), in_space(a, b, each)[0])[2] for each in (state, later)]
        assert gaps[1] > gaps[0] - 1e-4 * RADIUS


CASES = {
    "from equilibrium": (60_000, 1.0, False, 1),
    "from rest": (60_000, 1.0, True, 2),
    "from rest, bound twice as wide": (180_000, 2.0, True, 3),
}


@pytest.mark.validates("closed form", "Bodies that keep their motion share their energy equally between all degrees")
@pytest.mark.validate
@pytest.mark.parametrize("name", CASES)
def test_translation_and_rotation_share_the_energy(name, record_bound):
    """Fifty smooth elastic bodies have equal temperatures of translation and rotation, to 2 %, from 3/2 or 0 k_BT.

    In equilibrium all states of equal energy E and momentum P are equally likely: the mean translation is P²/2M + (E −
    P²/2M)(3N − 3)/(6N − 3).  With a variance of N·¾(k_BT)² of the translation and encounters that change it by δ, rms,
    its correlation lasts τ = 2N·¾(k_BT)²/⟨δ²⟩ encounters, so that a mean over n of them has the relative error
    √(2τ/n · ¾N)/1.5N: 0.6 %, with ⟨δ²⟩ = 0.5 (k_BT)² and a quarter of it where the bound is twice as wide.
    """
    translation, rotation, total = shares(*CASES[name])
    record_bound(f"{name}: translation over its share", translation, least=0.98, most=1.02)
    record_bound(f"{name}: rotation over its share", rotation, least=0.98, most=1.02)
    assert math.isclose(total, 1.0, abs_tol=0.05)
