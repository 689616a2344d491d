"""Dilute dust: groups of grains, the bound of encounters, draws of pairs, and bodies that join; nothing is compiled."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation
from scipy.special import eval_legendre
from scipy.stats import kstest

import sand
from sand.basics.constants import BOLTZMANN, COULOMB, MAGNETIC
from sand.basics.initial_pairs import StrainedContacts
from sand.experiments import dilute_body
from sand.experiments.dilute_body import NO_CONTACTS, body_of, in_space
from sand.experiments.dilute_charges import attraction_of, multipoles_of
from sand.experiments.dilute_conditions import check_gas, check_moments
from sand.experiments.dilute_flight import kepler_start, start_distance
from sand.experiments.dilute_growth import bodies_of
from sand.experiments.dilute_hits import Stick, moving_pair
from sand.experiments.dilute_majorant import Majorant, Sizes
from sand.experiments.dilute_population import Population, sizes_of
from sand.experiments.dilute_start import orientation_in_field, start_in_field
from sand.experiments.scattering.event_draws import event_uniforms
from sand.experiments.scattering.groups import GROUP
from sand.experiments.scattering.rigid_flight import CHARGE_GROUP_SIZE, GROUP_SIZE
from sand.forces.gas_drag import rotation_friction, translation_friction

RADIUS, MOMENT, T, ELEMENTARY = 1e-8, 6.6e-18, 100.0, 1.602176634e-19


def aggregate(places, directions, number=0):
    """Iron grains on lattice places in units of their diameter, with moments in these directions, in contact."""
    x = np.array(places, float) * 2.0 * RADIUS * (1.0 - 1e-4)
    grains = sand.Grains(x, RADIUS, "iron", moment=MOMENT * np.array(directions, float))
    pair = np.array([(i, j) for i in range(len(x)) for j in range(i) if np.linalg.norm(x[i] - x[j]) < 2.0 * RADIUS])
    zeros = np.zeros((len(pair), 3))
    contacts = StrainedContacts(pair.reshape(-1, 2)[:, ::-1], zeros, zeros, np.zeros(len(pair)))
    return body_of(grains.arrays, contacts, number)[0]


GRAIN = aggregate([[0, 0, 0]], [[0, 0, 1]])
DIMER = aggregate([[0, 0, 0], [0, 0, 1]], [[0, 0, 1]] * 2)
ANTIPARALLEL = aggregate([[0, 0, 0], [1, 0, 0]], [[0, 0, 1], [0, 0, -1]])


def tree(count, seed=0):
    """An aggregate of grains that stick to random ones of a lattice."""
    rng, places = np.random.default_rng(seed), [(0, 0, 0)]
    while len(places) < count:
        step = np.zeros(3, int)
        step[rng.integers(3)] = rng.choice((-1, 1))
        place = tuple((np.array(places[rng.integers(len(places))]) + step).tolist())
        if place not in places:
            places.append(place)
    axes = rng.normal(size=(count, 3))
    return aggregate(places, axes / np.linalg.norm(axes, axis=1)[:, None])


@pytest.mark.parametrize("most", [1, 20, 1000])
def test_the_closest_pair_is_that_of_all_gaps(monkeypatch, most):
    """Grains with radii between 0.5 and 1.5, few gaps in memory at a time: the least |x − x'| − r − r'."""
    monkeypatch.setattr(dilute_body, "MOST_GAPS", most)
    rng = np.random.default_rng(4)
    for first in (1, 3, 7, 12):
        x, radius = rng.normal(size=(13, 3)) + 9.0 * (np.arange(13) < first)[:, None], rng.uniform(0.5, 1.5, 13)
        grains = sand.Grains(x, radius, "iron").arrays
        gaps = {(i, j): math.dist(x[i], x[j]) - radius[i] - radius[j] for i in range(first) for j in range(first, 13)}
        i, j, gap = dilute_body.closest_pair(first, grains)
        assert (i, j) == min(gaps, key=gaps.get) and gap == pytest.approx(gaps[i, j], rel=1e-12, abs=0.0)


@pytest.mark.parametrize("count", [1, 2, 4, 5, 17, 70])
def test_groups_of_each_level_share_the_grains_and_their_moments(count):
    """Level l has ⌈n/4ˡ⌉ groups; Σμ and Σ|μ| are those of the body at each level, to rounding of n terms.

    The last level is one group.  `reach` bounds the distance of each grain from the nearest centre of its level, as
    Σ|μ| ≥ |Σμ|.
    """
    body = tree(count)
    grains, groups = body.grains, body.flying.groups
    levels = len(groups.reach)
    assert [*np.diff(groups.first)] == [-(-count // GROUP**level) for level in range(levels)]
    for level in range(levels):
        part = slice(groups.first[level], groups.first[level + 1])
        total = groups.moment[:, part].sum(axis=1)
        assert total == pytest.approx(grains.moment.sum(axis=1), abs=1e-14 * body.moment_sum)
        assert groups.moment_sum[part].sum() == pytest.approx(body.moment_sum, rel=1e-13, abs=0.0)
        apart = np.linalg.norm(grains.position[:, :, None] - groups.point[:, None, part], axis=0).min(axis=1)
        assert apart.max() <= groups.reach[level] + 1e-12 * RADIUS
    assert groups.first[-1] - groups.first[-2] == 1


def test_neighbours_are_in_one_group():
    """In a straight chain of 16 each group of 4 has neighbours: its reach is 3 radii, that of all 15."""
    chain = aggregate([[k, 0, 0] for k in range(16)], [[1, 0, 0]] * 16)
    assert chain.flying.groups.reach == pytest.approx([0.0, 3.0 * RADIUS, 15.0 * RADIUS], rel=1e-3, abs=1e-20)


def flux_density(x, moment, at):
    """Flux density over μ₀/4π of dipoles (3, n) at a place [A/m²]."""
    apart = at[:, None] - x
    d = np.linalg.norm(apart, axis=0)
    return (3.0 * apart * (apart * moment).sum(axis=0) / d**5 - moment / d**3).sum(axis=1)


BODIES = [ANTIPARALLEL, DIMER, *(tree(count, count) for count in (4, 7, 16, 17, 70))]


@pytest.mark.parametrize("body", BODIES, ids=len)
def test_groups_err_by_a_share_of_what_they_do(body):
    """The error of a level's flux density is bounded by its own dipoles, whether or not moments cancel.

    The derivative of a dipole's field along a unit vector is at most 6 k|μ|/d⁴, that on the axis.  Grains at a from the
    centre of their group, where the gap to the place is D, so change it by at most 6k Σ|μ| a/D⁴ ≤ 6k |Σμ| reach/D⁴, at
    a gap of reach/0.25 by 1.5 k|Σμ|/D³.  D is the distance from the sphere about the body, or from all grains.
    """
    groups, rng = body.flying.groups, np.random.default_rng(2)
    used = [level for level in range(1, len(groups.reach)) if groups.reach[level] < 1e3 * body.extent]
    assert bool(used) == (body is not ANTIPARALLEL)
    for level in used:
        part, gap = slice(groups.first[level], groups.first[level + 1]), groups.reach[level] / GROUP_SIZE
        for axis in rng.normal(size=(20, 3)):
            at = (body.extent + gap) * axis / np.linalg.norm(axis)
            exact = flux_density(body.grains.position, body.grains.moment, at)
            error = flux_density(groups.point[:, part], groups.moment[:, part], at) - exact
            net = np.linalg.norm(groups.moment[:, part], axis=0).sum()
            assert np.linalg.norm(error) <= 6.0 * GROUP_SIZE * net / gap**3


def charged(body, charges, scale=1.0):
    """A body whose grains have so many elementary charges, and moments in these units of theirs."""
    charge = ELEMENTARY * np.resize(np.array(charges, float), len(body))
    return body_of(body.grains._replace(charge=charge, moment=scale * body.grains.moment), body.contacts)[0]


def potential(x, charge, at):
    """Potential over 1/4πε₀ of charges at x (3, n) at a place [C/m]."""
    return float((charge / np.linalg.norm(at[:, None] - x, axis=0)).sum())


CHARGED_BODIES = [
    charged(GRAIN, [1]), charged(DIMER, [1, -1]), charged(tree(7, 7), [1, 0, -1, -1, 2]), charged(tree(17, 1), [1]),
    charged(tree(70, 2), np.random.default_rng(1).choice([-1, 1], 70)),
]  # fmt: skip


@pytest.mark.parametrize("body", CHARGED_BODIES, ids=len)
def test_groups_of_charges_are_those_of_one_sign(body):
    """Each level has all charge of either sign and its dipole moment, to rounding; the last one has a group of each.

    `reach` bounds the distance of each charge from the nearest centre of its sign.
    """
    groups, charge, x = body.flying.charges, body.grains.charge, body.grains.position
    for level, reach in enumerate(groups.reach):
        part = slice(groups.first[level], groups.first[level + 1])
        for sign in (1.0, -1.0):
            own, of_grains = sign * groups.charge[part] > 0.0, sign * charge > 0.0
            total = groups.charge[part][own].sum(), (groups.charge[part] * groups.point[:, part])[:, own].sum(axis=1)
            assert total[0] == pytest.approx(charge[of_grains].sum(), rel=1e-13, abs=0.0)
            dipole = (charge * x)[:, of_grains].sum(axis=1)
            assert total[1] == pytest.approx(dipole, abs=1e-13 * body.charges.charge_sum * body.extent)
            if of_grains.any():
                apart = np.linalg.norm(x[:, of_grains, None] - groups.point[:, part][:, None, own], axis=0).min(axis=1)
                assert apart.max() <= reach + 1e-12 * RADIUS
    last = groups.charge[groups.first[-2] :]
    assert len(last) == len(set(np.sign(last))) == len(set(np.sign(charge)) - {0.0})
    assert groups.first[1] == np.count_nonzero(charge) and groups.reach[0] == 0.0


@pytest.mark.parametrize("body", CHARGED_BODIES, ids=len)
def test_groups_of_charges_have_no_dipole_error(body):
    """1/|R − x| about the centre of charge, without its linear term, errs by (a/R)²/(R − a) at most.

    With the gap a/0.1 of the sphere about the body R ≥ 10 a, so that the potential errs by at most Σ|q|/90R.
    """
    groups, rng = body.flying.charges, np.random.default_rng(3)
    for level, reach in enumerate(groups.reach):
        part = slice(groups.first[level], groups.first[level + 1])
        for axis in rng.normal(size=(20, 3)):
            at = (body.extent + reach / CHARGE_GROUP_SIZE) * axis / np.linalg.norm(axis)
            exact = potential(body.grains.position, body.grains.charge, at)
            error = potential(groups.point[:, part], groups.charge[part], at) - exact
            nearest = np.linalg.norm(at[:, None] - groups.point[:, part], axis=0).min()
            most = body.charges.charge_sum * (reach / nearest) ** 2 / (nearest - reach)
            assert abs(error) <= most + 1e-13 * body.charges.charge_sum / nearest
            assert most <= body.charges.charge_sum / 90.0 / nearest * (1.0 + 1e-12)


def interaction(a, b, r, turn):
    """Energy [J] of two bodies with the centres r apart, b turned, by sums over all pairs of grains."""
    x, moment = turn @ b.grains.position, turn @ b.grains.moment
    energy = 0.0
    for k in range(len(a)):
        at = r + a.grains.position[:, k]
        energy += COULOMB * a.grains.charge[k] * potential(x, b.grains.charge, at)
        energy -= MAGNETIC * a.grains.moment[:, k] @ flux_density(x, moment, at)
    return energy


def series(a, b, r, factor, least):
    """k Σ C(n+m, n) WₙW′ₘ/rⁿ⁺ᵐ⁺¹ times factor(n, m) over n + m ≥ `least`, 80 × 80 terms; Wₙ = A₃ eⁿ⁻³ for n ≥ 3 [J]."""
    weights = []
    for each in map(sizes_of, (a, b)):
        low = [abs(each.charge), each.dipole / r, each.quadrupole / r**2]
        weights.append([*low, *(each.third / each.extent**3 * (each.extent / r) ** n for n in range(3, 80))])
    orders = [(n, m) for n in range(80) for m in range(80) if n + m >= least]
    return COULOMB / r * sum(factor(n, m) * math.comb(n + m, n) * weights[0][n] * weights[1][m] for n, m in orders)


@pytest.mark.parametrize("first", CHARGED_BODIES[:4], ids=len)
@pytest.mark.parametrize("second", [*CHARGED_BODIES[:3], charged(tree(4, 4), [-1, -1, 1])], ids=len)
def test_the_bound_of_the_attraction_of_charges_holds_in_all_poses(first, second):
    """−U ≤ C₁/r + C₂/r² + C₃/r³ at r from R to 100 R, and the inward force is at most the derivative of the series.

    U and its slope by all pairs, in 200 random poses; the slope by central differences, exact to 1e-6.
    """
    a, b = (charged(each, each.grains.charge / ELEMENTARY, 0.0) for each in (first, second))
    c1, c2, c3, nearest = attraction_of(sizes_of(a), sizes_of(b))
    rng, closest = np.random.default_rng(4), 0.0
    assert nearest == pytest.approx(2.0 * (a.extent + b.extent), rel=1e-14, abs=0.0)
    for turn in Rotation.random(200, random_state=5).as_matrix():
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        r = nearest * 10.0 ** rng.uniform(0.0, 2.0)
        inner, outer = (interaction(a, b, (r + sign * 1e-4 * r) * axis, turn) for sign in (-1.0, 1.0))
        terms = c1 / r, c2 / r**2, c3 / r**3
        attraction = -interaction(a, b, r * axis, turn)
        assert attraction <= sum(terms) * (1.0 + 1e-12)
        inward = (outer - inner) / (2e-4 * r)
        assert inward <= (terms[0] + series(a, b, r, lambda n, m: n + m + 1.0, 1)) / r * (1.0 + 1e-5)
        closest = max(closest, attraction / sum(terms) if sum(terms) > 0.0 else 0.0)
    assert closest > 0.3 or a.charge * b.charge > 0.0


def test_the_bound_of_the_attraction_is_nearly_reached_by_aligned_dipoles():
    """Two dimers + − in a line, at R: the bound is above −U, of which 2 W₁W′₁/R³ is most, by less than a fifth."""
    a = charged(DIMER, [1, -1], 0.0)
    c1, c2, c3, r = attraction_of(sizes_of(a), sizes_of(a))
    axis = a.grains.position[:, 0] / np.linalg.norm(a.grains.position[:, 0])
    exact = -interaction(a, a, r * axis, np.eye(3))
    assert c1 == c2 == 0.0 and exact <= c3 / r**3 < 1.2 * exact


@pytest.mark.parametrize("second", [0, 1, 4])
def test_the_bound_of_the_attraction_is_the_sum_of_its_series(second):
    """C₃/R³ is the sum of the terms of n + m ≥ 2 at R, C₂/R² that of n + m = 1; the bound is symmetric."""
    a, b = CHARGED_BODIES[2], CHARGED_BODIES[second]
    found, (_, c2, c3, r) = attraction_of(sizes_of(b), sizes_of(a)), attraction_of(sizes_of(a), sizes_of(b))
    assert c3 / r**3 == pytest.approx(series(a, b, r, lambda n, m: 1.0, 2), rel=1e-9, abs=0.0)
    assert c2 / r**2 == pytest.approx(series(a, b, r, lambda n, m: float(n + m == 1), 1), rel=1e-12, abs=0.0)
    assert found[1:] == pytest.approx((c2, c3, r), rel=1e-12, abs=0.0)


def test_multipoles_bound_the_potential_of_their_order():
    """|Σ q|x|ⁿPₙ(cos)| ≤ Wₙ for n = 1, 2, and A₃ aⁿ⁻³ for n = 3, 4, in 500 directions; of a line W₁, W₂ are reached."""
    rng = np.random.default_rng(6)
    x, charge = rng.normal(size=(3, 9)), rng.normal(size=9)
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    for where in (x, np.array([[0.6], [0.0], [0.8]]) * x[:1]):
        size = np.linalg.norm(where, axis=0)
        found = multipoles_of(where, charge, float(charge.sum()))
        most = {1: found.dipole, 2: found.quadrupole, 3: found.third, 4: found.third * size.max()}
        aligned = np.vstack([directions, where[:, :1].T / size[0]])
        cosine = aligned @ (where / size)
        for order, limit in most.items():
            terms = np.abs((charge * size**order * eval_legendre(order, cosine)).sum(axis=1))
            assert terms.max() <= limit * (1.0 + 1e-12)
            if where is not x and order < 3:
                assert terms.max() == pytest.approx(limit, rel=1e-12, abs=0.0)


def test_charges_start_where_only_their_net_charges_act():
    """C₂/r² and (C₃ + α)/r³ are at most m̄v²/(3^(3/2) start³); without charges, and in their limit, r = start b̂.

    A pair whose Kepler orbit stays beyond r has no flight, of net charges that repel or attract each other and of none;
    a body without charges has no part in this.
    """
    a, b, majorant = CHARGED_BODIES[2], CHARGED_BODIES[3], Majorant(T)
    reduced, (_, c2, c3, _) = a.mass * b.mass / (a.mass + b.mass), attraction_of(sizes_of(a), sizes_of(b))
    c3 += 2.0 * MAGNETIC * a.moment_sum * b.moment_sum
    extent = a.extent + b.extent
    for start in (2.0, 4.0):
        for speed in (0.01, 0.1, 1.0, 10.0):
            r, bound = start_distance(a, b, speed, 1.0, start), reduced * speed**2 / (3.0**1.5 * start**3)
            assert max(c2 / r**2, c3 / r**3) <= bound * (1.0 + 1e-12)
            near = (c3 / (reduced * speed**2)) ** (1.0 / 3.0)
            least = math.sqrt(c2 / bound), start * math.hypot(math.sqrt(3.0) * near, extent), extent + 4.0 * RADIUS
            assert r == pytest.approx(max(least), rel=1e-12, abs=0.0)
    plain, tiny = (charged(tree(7, 7), [size]) for size in (0.0, 1e-9))
    widest = majorant.bound(sizes_of(plain), sizes_of(plain), 1.0)
    assert start_distance(plain, plain, 1.0, widest) == 2.0 * widest
    assert start_distance(tiny, tiny, 1.0, widest) == pytest.approx(2.0 * widest, rel=1e-9, abs=0.0)
    repelling, neutral = charged(tree(7, 7), [1, 1, 0]), charged(tree(4, 4), [1, -1])
    assert a.charge > 0.0 > repelling.charge * charged(tree(4, 4), [-1]).charge and neutral.charge == 0.0
    for other in (repelling, neutral, charged(tree(4, 4), [-1])):
        product = COULOMB * a.charge * other.charge * (a.mass + other.mass) / (a.mass * other.mass)
        speed = math.sqrt(1.0 + 4.0 * abs(product) / a.extent)
        r = start_distance(a, other, speed, 1.0)
        grazing = r * math.sqrt(1.0 - 2.0 * product / (speed**2 * r))  # b v = r v′
        assert kepler_start(a, other, (speed, 1.001 * grazing), r) is None
        near, offset, plane = kepler_start(a, other, (speed, 0.999 * grazing), r)
        assert math.hypot(offset, plane) == pytest.approx(r, rel=1e-12, abs=0.0)
        assert near**2 == pytest.approx(speed**2 - 2.0 * product / r, rel=1e-12, abs=0.0)
    assert kepler_start(a, GRAIN, (1.0, 2.0), 3.0) == (1.0, 2.0, 3.0)


def test_charges_that_cancel_but_for_rounding_are_none():
    """3 e − e − e − e is 8e-36 C in floating point, and no net charge."""
    body = charged(tree(4), [3, -1, -1, -1])
    assert body.charge == 0.0 < body.charges.charge_sum
    assert charged(tree(4), [3, -1, -1, 0]).charge == pytest.approx(ELEMENTARY, rel=1e-12, abs=0.0)


def maxwell(v, spread):
    """Density of the speeds of Maxwell's distribution."""
    return math.sqrt(2.0 / math.pi) * v * v / spread**3 * math.exp(-0.5 * (v / spread) ** 2)


CHARGED, BOTH = (Sizes(3.3e-20, moment, 1e-8, 1.6e-19, 1.6e-19) for moment in (0.0, MOMENT))
OPPOSITE = BOTH._replace(charge=-1.6e-19)
NEUTRAL = Sizes(3.3e-19, MOMENT, 5e-8, 1.6e-18, 0.0, 1.6e-27, 3e-35, 1e-42)
PAIRS = [
    (GRAIN, GRAIN),
    (DIMER, tree(12)),
    (CHARGED, CHARGED),
    (CHARGED, OPPOSITE),
    (BOTH, OPPOSITE),
    (NEUTRAL, NEUTRAL),
]


@pytest.mark.parametrize("pair", PAIRS)
def test_the_bound_of_the_rate_is_the_mean_of_its_cross_section(pair):
    """K̂ = ∫ π b̂² v f(v) dv by quadrature, to its accuracy of 1e-8, with b̂² as in the module; the smaller one of two."""
    a, b = (each if isinstance(each, Sizes) else sizes_of(each) for each in pair)
    majorant = Majorant(T)
    reduced, extent = a.mass * b.mass / (a.mass + b.mass), a.extent + b.extent
    alpha = 2.0 * MAGNETIC * a.moment_sum * b.moment_sum
    first, second, third, nearest = attraction_of(a, b)
    spread = math.sqrt(BOLTZMANN * T / reduced)
    bounds = [(extent, COULOMB * a.charge_sum * b.charge_sum, 1.0)]
    bounds += [(nearest, first + second / nearest + third / nearest**2, 1.1)]

    def square(v, distance, product, wide):
        near = (alpha / (reduced * v * v)) ** (1.0 / 3.0)
        return wide**2 * (3.0 * near**2 + distance**2 + 2.0 * product / (reduced * v * v) * (distance + near))

    def integrand(y, *bound):  # v = s y³, as ⟨v^(−5/3)⟩ has a steep start
        v = spread * y**3
        return math.pi * square(v, *bound) * v * maxwell(v, spread) * 3.0 * spread * y**2

    means = [quad(integrand, 0.0, 12.0 ** (1.0 / 3.0), each, epsabs=0.0, epsrel=1e-10, limit=200)[0] for each in bounds]
    expected, least = min(zip(means, bounds, strict=True))
    if pair[0] is NEUTRAL:
        assert least == bounds[1] and expected < 0.2 * means[0]
    assert majorant.kernel(a, b) == pytest.approx(expected, rel=1e-7, abs=0.0)
    for v in (0.1 * spread, spread, 5.0 * spread):
        assert majorant.bound(a, b, v) == pytest.approx(math.sqrt(square(v, *least)), rel=1e-12, abs=0.0)


@pytest.mark.parametrize("charges", [0.0, 0.1, 1.0, 10.0])
@pytest.mark.parametrize("moments", [0.0, 0.1, 1.0])
def test_the_bound_is_above_all_paths_that_touch(charges, moments):
    """Spheres that attract each other by −Q/r − α/r³ touch at r = e if b² ≤ min over r ≥ e of r² (1 + (Q/r + α/r³)/E).

    b̂² is not below this minimum, found on a grid, E = ½m̄v², at any speed.  It is the minimum with charges alone; with
    moments alone it is at most 1.466 of it, the largest (1 + 3x²)/(1 + 2x³), where x = r_c/e < 1 solves x³ + x = 1.
    """
    size = Sizes(3.3e-20, moments * MOMENT, 1e-8, charges * 1.6e-19, charges * 1.6e-19)
    other = size._replace(charge=-size.charge)
    reduced, extent = 0.5 * size.mass, 2.0 * size.extent
    alpha, product = 2.0 * MAGNETIC * size.moment_sum**2, COULOMB * size.charge_sum**2
    r = extent * np.geomspace(1.0, 1e4, 20_000)
    for v in np.geomspace(0.01, 100.0, 30):
        exact = (r**2 * (1.0 + (product / r + alpha / r**3) / (0.5 * reduced * v * v))).min()
        ratio = float(Majorant(T).bound(size, other, v)) ** 2 / exact
        assert ratio >= 1.0 - 1e-12
        assert charges * moments > 0.0 or ratio <= (1.466 if moments else 1.0 + 1e-12)


def test_the_bound_uses_all_moments_not_the_net_one():
    """Of two antiparallel dimers the net moments are 0, but β is that of two dimers with parallel moments."""
    majorant, (a, b) = Majorant(T), (sizes_of(ANTIPARALLEL), sizes_of(DIMER))
    assert np.linalg.norm(ANTIPARALLEL.grains.moment.sum(axis=1)) < 1e-12 * MOMENT
    assert majorant.squares(a, a)[1] == pytest.approx(majorant.squares(b, b)[1], rel=1e-12, abs=0.0)


def test_speeds_and_impact_parameters_are_those_of_the_bound():
    """b²/b̂² is uniform in (0, 1), and speeds have the density b̂² v f(v); Kolmogorov's test, p > 1e-3.

    With charges and moments, so that all four parts of K̂ are drawn.
    """
    majorant = Majorant(T)
    drawn = [majorant.draw(BOTH, OPPOSITE, event_uniforms(3, k)[:3]) for k in range(2000)]
    speed, b, bound = np.array(drawn).T
    assert bound == pytest.approx(majorant.bound(BOTH, OPPOSITE, speed), rel=1e-12, abs=0.0)
    assert kstest((b / bound) ** 2, "uniform").pvalue > 1e-3
    spread, grid = math.sqrt(BOLTZMANN * T / (0.5 * BOTH.mass)), np.geomspace(1e-9, 12.0, 20_001)
    density = majorant.bound(BOTH, OPPOSITE, grid * spread) ** 2 * grid**3 * np.exp(-0.5 * grid**2)
    total = np.cumsum(density * np.gradient(grid))
    assert kstest(np.interp(speed / spread, grid, total / total[-1]), "uniform").pvalue > 1e-3


def test_random_numbers_are_functions_of_seed_and_event():
    """Different events and seeds have different numbers, the same ones the same; 16,000 are uniform, p > 1e-3."""
    assert event_uniforms(1, 5) == event_uniforms(1, 5) != event_uniforms(2, 5)
    assert kstest(np.ravel([event_uniforms(1, k) for k in range(2000)]), "uniform").pvalue > 1e-3


def test_sums_of_the_bound_follow_encounters():
    """Sums that are changed in O(n) by joining, bouncing and doubling equal those of all pairs, to rounding."""
    rng = np.random.default_rng(1)
    bodies = [tree(count, k) for k, count in enumerate([1, 1, 1, 2, 3, 5, 8, 1, 1, 2])]
    population = Population(bodies, 1.0, Majorant(T))
    for k in range(6):
        i, j = rng.choice(len(population.bodies), 2, replace=False)
        population.replace(int(i), int(j), [tree(int(rng.integers(1, 9)), 20 + k)][: 2 - k % 2] * (1 + k // 5))
        if k == 3:
            rate = population.rate
            population.double()
            # rates per volume stay, but for the pairs of bodies with their copies
            assert population.rate > 2.0 * rate
    fresh = Population(population.bodies, population.volume, Majorant(T))
    assert population.sums == pytest.approx(fresh.sums, rel=1e-12, abs=0.0)
    assert population.rate == pytest.approx(fresh.rate, rel=1e-12, abs=0.0)
    assert [*population.grains] == [len(body) for body in population.bodies]
    sizes = population.grains
    assert population.mean_size == pytest.approx((sizes**2).sum() / sizes.sum(), rel=1e-14, abs=0.0)


def test_pairs_are_drawn_in_proportion_to_the_bound():
    """Of 600 pairs of four bodies each of the six has its share within 4 standard deviations; none is a body itself."""
    population = Population([tree(n, n) for n in (1, 2, 4, 9)], 1.0, Majorant(T))
    count, number = np.zeros((4, 4)), 600
    for event in range(number):
        i, j, kernel = population.draw(*event_uniforms(5, event)[1:3])
        count[min(i, j), max(i, j)] += 1
        assert kernel == pytest.approx(float(population.row(i)[j]), rel=1e-13, abs=0.0)
    rows = np.array([population.row(i) for i in range(4)])
    share = 2.0 * np.triu(rows) / rows.sum()
    off = np.abs(count - number * share) / np.sqrt(number * share * (1.0 - share) + 1e-9)
    assert off.max() < 4.0 and not count.diagonal().any()


class ConstantBound:
    """A bound 1.5 K with K = 1 m³/s, whatever the sizes."""

    def kernel(self, a, b):
        """1.5 of each pair."""
        return 1.5 + 0.0 * (a.mass + b.mass)


def constant_growth(bodies, times, seed):
    """S at given times of a population of equal bodies with the kernel 1 m³/s, by thinning of the bound."""
    count = len(bodies)
    population, time, sizes, found, event = (
        Population(bodies, float(count), ConstantBound()),
        0.0,
        np.ones(count),
        [],
        0,
    )
    while len(found) < len(times):
        uniforms = event_uniforms(seed, event)
        event += 1
        later = time - math.log(uniforms[0]) / population.rate if len(population.bodies) > 1 else math.inf
        while len(found) < len(times) and times[len(found)] < later:
            found.append(float((sizes**2).sum() / count))
        time = later
        if len(found) < len(times) and uniforms[3] < 1.0 / 1.5:
            i, j, _ = population.draw(*uniforms[1:3])
            joined = sizes[i] + sizes[j]
            for k in sorted((i, j), reverse=True):  # as `Population.replace` moves them
                sizes[k] = sizes[-1]
                sizes = sizes[:-1]
            sizes = np.append(sizes, joined)
            population.replace(i, j, [bodies[0]])
    return found


def exact_constant_size(count, times):
    """⟨S⟩ = n − (n − 1) e^(−K n₀ t/n) of n bodies with a constant kernel (Marcus 1968), with K n₀ = 1/s here."""
    return count - (count - 1.0) * np.exp(-np.asarray(times) / count)


def check_constant_kernel(count, runs, limit):
    """The mean of S over runs lies within `limit` standard errors of the exact one at each of 5 times."""
    times = np.geomspace(0.3, 20.0, 5)
    found = np.array([constant_growth([GRAIN] * count, times, seed) for seed in range(runs)])
    off = (found.mean(axis=0) - exact_constant_size(count, times)) / (found.std(axis=0, ddof=1) / math.sqrt(runs))
    assert np.abs(off).max() < limit
    return off


def test_a_constant_kernel_gives_the_exact_mean_size():
    """Thinning, waiting times and pairs together: 20 populations of 40 bodies; 4 standard errors."""
    check_constant_kernel(40, 20, 4.0)


@pytest.mark.validates("closed form", "Populations with a constant kernel have the exact mean size")
@pytest.mark.validate
def test_a_constant_kernel_gives_the_exact_mean_size_of_many(record_bound):
    """As above with 200 populations of 200 bodies; 3 standard errors at each time."""
    record_bound(
        "constant kernel: largest deviation of S [standard errors]",
        np.abs(check_constant_kernel(200, 200, 4.0)).max(),
        most=3.0,
    )


def state_of(distance, angle=0.3):
    """A state of a pair: apart along x, the second body turned about y, both with spins."""
    turn = [0.0, math.sin(0.5 * angle), 0.0, math.cos(0.5 * angle)]
    return np.array(
        [distance, 1e-9, 0.0, -3.0, 0.5, 0.1, 0.0, 0.0, 0.0, 1.0, *turn, 1e-27, 2e-27, 0.0, 0.0, 1e-27, -2e-27]
    )


def test_grains_in_space_have_the_momenta_of_their_bodies():
    """P = 0, L = r × m̄u + L₁ + L₂, and the pieces of `moving_pair` have the state again, to rounding.

    Orientations may differ by the choice of principal axes: positions of the grains are compared.
    """
    a, b, y = tree(7, 1), tree(12, 2), state_of(3e-7)
    grains, contacts = in_space(a, b, y)
    mass, arm = grains.mass, grains.position
    assert grains.velocity @ mass == pytest.approx(np.zeros(3), abs=1e-13 * 3.0 * mass.sum())
    angular = (mass * np.cross(arm, grains.velocity, axis=0)).sum(axis=1) + grains.spin @ grains.inertia
    reduced = a.mass * b.mass / (a.mass + b.mass)
    expected = reduced * np.cross(y[0:3], y[3:6]) + y[14:17] + y[17:20]
    assert angular == pytest.approx(expected, abs=1e-12 * np.linalg.norm(expected))
    own = np.arange(19)
    pieces = [(type(grains)(*(each[..., part] for each in grains)), NO_CONTACTS) for part in (own[:7], own[7:])]
    again = in_space(*moving_pair(pieces))[0]
    assert again.position == pytest.approx(grains.position, abs=1e-12 * 3e-7)
    assert again.velocity == pytest.approx(grains.velocity, abs=1e-11 * 3.0)
    assert len(contacts.pair) == len(a.contacts.pair) + len(b.contacts.pair)


def test_bodies_that_stick_touch_as_at_rest():
    """The joined body has one more contact, at the equilibrium overlap, and the mass of both exactly."""
    contact = sand.Contact()
    rule = Stick(contact, (sand.IRON,))
    a, b = tree(5, 3), tree(9, 4)
    hit = rule(a, b, state_of(a.extent + b.extent + 1e-9))
    ((grains, contacts),) = hit.pieces
    body, _ = body_of(grains, contacts)
    assert body.mass == pytest.approx(a.mass + b.mass, rel=1e-15, abs=0.0)
    i, j = contacts.pair[-1]
    overlap = 2.0 * RADIUS - np.linalg.norm(grains.position[:, i] - grains.position[:, j])
    rest = (
        sand.Contact()
        .contact_law.normal_mode(*sand.Contact().pairing(sand.IRON, sand.IRON)[:2], 0.5 * RADIUS)
        .rest_overlap
    )
    assert overlap == pytest.approx(rest, rel=1e-6, abs=0.0)
    assert len(contacts.pair) == len(a.contacts.pair) + len(b.contacts.pair) + 1


@pytest.mark.parametrize("ratio", [0.0, 0.5, 20.0])
def test_moments_in_a_field_have_langevins_mean(ratio):
    """⟨cos θ⟩ = coth x − 1/x of moments about the field, x = μB/k_BT, within 4 standard errors of 300 bodies.

    Rotations are proper; about the moment the body is at a random angle, so that a direction across it averages to 0.
    """
    rng, heat, field = np.random.default_rng(1), BOLTZMANN * T, np.array([0.0, 3e-4, 4e-4])
    moment = ratio * heat / 5e-4 * np.array([0.6, 0.0, 0.8])
    turns = [orientation_in_field(moment, field, heat, tuple(rng.random(3))) for _ in range(300)]
    assert all(abs(np.linalg.det(turn) - 1.0) < 1e-12 for turn in turns[:20])
    cosine = np.array([turn @ [0.6, 0.0, 0.8] @ field for turn in turns]) / 5e-4
    mean = 1.0 / math.tanh(ratio) - 1.0 / ratio if ratio else 0.0
    if ratio:
        assert abs(cosine.mean() - mean) < 4.0 * cosine.std() / math.sqrt(300)
    across = np.array([turn @ [0.0, 1.0, 0.0] for turn in turns])
    assert np.abs(across.mean(axis=0)).max() < 4.0 / math.sqrt(300)


def test_flights_in_a_field_come_from_all_sides_with_thermal_spins():
    """b and the distance are those given, directions of flight average to 0, and ½L²/I to ½ k_BT per axis; 4 σ."""
    heat, states = BOLTZMANN * T, []
    for event in range(100):
        states.append(start_in_field((DIMER, GRAIN), (2.0, 3e-8, 4e-7), heat, 1.5 * heat, (0.0, 0.0, 5e-5), (1, event)))
    y = np.array(states)
    flight = y[:, 3:6] / 2.0
    along = (y[:, :3] * flight).sum(axis=1)
    assert along == pytest.approx(np.full(100, -4e-7), rel=1e-12, abs=0.0)
    assert np.linalg.norm(y[:, :3] - along[:, None] * flight, axis=1) == pytest.approx(
        np.full(100, 3e-8), rel=1e-9, abs=0.0
    )
    assert np.abs(flight.mean(axis=0)).max() < 4.0 / math.sqrt(3.0 * 100)
    energy = (y[:, 17:20] ** 2).sum(axis=1) / (2.0 * GRAIN.flying.inertia[0]) / heat
    assert abs(energy.mean() - 1.5) < 4.0 * math.sqrt(1.5 / 100)


def gas_of(density):
    """Hydrogen and helium at 100 K."""
    return sand.Gas(temperature="100 K", density=density, molecule_mass="2.34 u")


def mixture(*radii):
    """Ten plain grains of each radius [m], as grains and as a population at 3e8 /m³."""
    every = np.repeat(radii, 10)
    grains = sand.Grains(np.zeros((len(every), 3)), every, "iron")
    return grains, Population(bodies_of(grains, NO_CONTACTS), len(every) / 3e8, Majorant(T))


def free_time(population):
    """Mean time between two encounters of a body [s]."""
    return len(population.bodies) / (2.0 * population.rate)


def stopping_times(grains, gas):
    """Epstein's law of free molecules: stopping times ∝ ρ_solid r/(ρ_gas v̄) of velocity and spin, at 1e-9 kg/m³."""
    law = gas.numbers()
    velocity = grains.mass / translation_friction(grains.radius, law.density, law.mean_speed, law.accommodation)
    spin = grains.inertia / rotation_friction(grains.radius, law.density, law.mean_speed, law.accommodation)
    return np.sort([velocity.min(), velocity.max(), spin.min(), spin.max()])[[0, -1]]


@pytest.mark.parametrize(("between", "factor", "own"), [("thermal", 3.0, -1), ("own", 1.0 / 3.0, 0)])
def test_the_gas_acts_as_on_the_slowest_or_the_fastest_grain(between, factor, own):
    """Stopping times ∝ r/ρ: of 5 and 20 nm, all grains must be thermalised between encounters, or none.

    The longest time counts for "thermal", the shortest for "own": densities 1 % on both sides of the limit.
    """
    grains, population = mixture(5e-9, 20e-9)
    unit = stopping_times(grains, gas_of(1e-9))[own] * 1e-9
    limit = factor * unit / free_time(population)  # of the density, where the time between encounters is factor × t
    good, bad = (limit * 1.01, limit * 0.99) if between == "thermal" else (limit * 0.99, limit * 1.01)
    check_gas(gas_of(good), grains, population, between)
    with pytest.raises(sand.BadInput, match="bodies meet after"):
        check_gas(gas_of(bad), grains, population, between)


def test_the_gas_must_leave_flights_of_every_body_alone():
    """Stopping lengths √(3k_BT/m) t ∝ r^(−1/2), over 10 (b̂ + 2r) ∝ r: a gas may be too dense for large bodies alone."""
    small, large = mixture(5e-9), mixture(20e-9)
    both = mixture(5e-9, 20e-9)
    limits = []
    for grains, _ in (small, large):
        radius, mass = float(grains.radius[0]), float(grains.mass[0])
        length = math.sqrt(3.0 * BOLTZMANN * T / mass) * stopping_times(grains, gas_of(1e-9))[0]
        limits.append(1e-9 * length / (10.0 * 4.0 * radius))  # b̂ = 2r of grains that do not attract each other
    assert limits[1] < 0.3 * limits[0]
    between = math.sqrt(limits[0] * limits[1])
    check_gas(gas_of(between), *small, "thermal")
    for grains, population in (large, both):
        with pytest.raises(sand.BadInput, match="stopping length"):
            check_gas(gas_of(between), grains, population, "thermal")
        check_gas(gas_of(0.99 * limits[1]), grains, population, "thermal")


def test_flips_of_moments_count_in_every_magnetic_body():
    """One magnetic grain after plain ones: at 1000 K its moment flips within a flight; without it none does."""
    moments = np.zeros((20, 3))
    moments[-1, 2] = MOMENT
    for moment, fails in ((moments, True), (np.zeros((20, 3)), False)):
        grains = sand.Grains(np.zeros((20, 3)), RADIUS, "iron", moment=moment)
        population = Population(bodies_of(grains, NO_CONTACTS), 20 / 1e8, Majorant(1000.0))
        if fails:
            with pytest.raises(sand.BadInput, match="superparamagnetic"):
                check_moments(grains, 1000.0, population)
        else:
            check_moments(grains, 1000.0, population)
