"""Every registered force: loads are gradients of the energy, momenta are kept, all loops agree; case files."""

import dataclasses
import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import sand
from sand.basics.arrays import empty_long_range_arrays
from sand.basics.constants import MAGNETIC
from sand.basics.errors import BadInput
from sand.config.case import ForcesSection
from sand.forces import BUILT_IN
from sand.forces.external_formulas import GrainState
from sand.forces.pair import dipole_loops, generic_loops
from sand.forces.pair import long_range_loops as loops
from sand.forces.pair.cutoff import UNCUT, cutoff_for
from sand.forces.pair.dipole_formulas import pair_load_cut
from sand.forces.pair.generic_loops import PairGrain, PairParameters, cut_pair
from sand.forces.pair.long_range_loops import ALL_PAIRS_BLOCKS, first_row, listed_blocks
from sand.forces.pair.pair_force import PairForce
from sand.forces.registry import FORCES, register
from sand.integrate.force_stages import SUM, WHOLE, pair_force_stages
from sand.neighbours.cell_list import build_verlet_list
from sand.numerics.vec import cross

from ..tables import table_of

ARGUMENTS = {"screened_charges": {"screening_length": 1.5e-7}, "gas": {"temperature": 300.0, "pressure": 100.0}}
ARGUMENTS |= {"gravity": {"acceleration": [1.0, -2.0, 9.0]}, "electric": {"strength": [1e3, 2e3, -3e3]}}
ARGUMENTS |= {"field": {"flux_density": [1e-3, -2e-3, 3e-3]}}
"""Arguments of the forces that need some."""
SIZE = 1e-7
"""Scale of separations [m]; moments, charges and masses below are those of grains of about this size."""
ROTATING = {"shape": "rotating", "amplitude": [1e-3, 2e-3, 0.0], "frequency": 1e6, "axis": [0.0, 0.0, 1.0]}
PAIR_FORCES = sorted(name for name, force in FORCES.items() if hasattr(force, "sums"))
EXTERNAL_FORCES = sorted(name for name, force in FORCES.items() if hasattr(force, "flux_density_size"))
NUMBER = st.floats(-1.0, 1.0)
TRIPLE = st.tuples(NUMBER, NUMBER, NUMBER)
GRAIN = st.tuples(TRIPLE, NUMBER, st.floats(0.1, 1.0))
DIRECTION = TRIPLE.filter(lambda v: np.linalg.norm(v) > 0.1)
CUTOFFS = {"none": UNCUT, "inside": cutoff_for(10 * SIZE, "smooth"), "in the shell": None}


def force_of(name):
    return FORCES[name](**ARGUMENTS.get(name, {}))


def grain(numbers):
    moment, charge, mass = numbers
    return PairGrain(tuple(1e-15 * m for m in moment), 1e-17 * charge, 1e-18 * mass, 0.1 * SIZE)


def pair_formula(name, cutoff):
    """`f(apart, a, b)` → force on a, torques on a and on b, energy, with a cut-off."""
    force = force_of(name)
    if isinstance(force, PairForce):
        of_pair = cut_pair(type(force).formula, force.torques)
        return lambda apart, a, b: of_pair(apart, a, b, PairParameters(force.constants(), cutoff))

    def dipoles(apart, a, b):
        f, field_a, field_b, energy = pair_load_cut(apart, a.moment, b.moment, MAGNETIC, cutoff)
        return f, cross(a.moment, field_a), cross(b.moment, field_b), energy

    assert name == "dipoles"
    return dipoles


def setting(name, cut, direction, ratio):
    """Formula with a cut-off, separation, and distance: in the shell it is 0.8 to 1 cut-off radii."""
    distance = SIZE * (1.0 + ratio)
    cutoff = CUTOFFS[cut] or cutoff_for(distance / (0.82 + 0.16 * ratio), "smooth")
    apart = np.array(direction) / np.linalg.norm(direction) * distance
    return pair_formula(name, cutoff), apart, distance


def slope(function, h):
    """df/dt at 0 by central differences with one Richardson step."""
    return (8 * (function(h / 2) - function(-h / 2)) - (function(h) - function(-h))) / (6 * h)


def turned(vector, axis, angle):
    """A vector turned about a unit axis."""
    v, n = np.array(vector), np.array(axis)
    return tuple(v * math.cos(angle) + np.cross(n, v) * math.sin(angle) + n * (n @ v) * (1.0 - math.cos(angle)))


ANY_PAIR = given(
    st.sampled_from(PAIR_FORCES), st.sampled_from(sorted(CUTOFFS)), DIRECTION, st.floats(0, 1), GRAIN, GRAIN
)


@settings(deadline=None)
@ANY_PAIR
@example("dipoles", "in the shell", (0.0, 1.0, 0.0), 0.5, ((0.0, 0.0, 3.3e-165), 0.0, 1.0), ((0.0, 1.0, 0.0), 0.0, 1.0))
def test_pair_forces_are_minus_the_gradient_of_the_energy(name, cut, direction, ratio, one, two):
    """F_a = −∂U/∂x_a and M = −∂U/∂θ, moments turning, of S U, without, inside and in the shell of a cut-off.

    The energy varies over 0.2 r in the shell: h = 1e-3 r with one Richardson step errs by (h/0.2 r)⁴ ~ 1e-9 of U/0.2 r,
    times some 10 for the fifth derivative of S; rounding by 1e-16 U/h = 1e-13 U/r.  1e-6 of the scale is far above.
    Squares of the components may be below the smallest number, which `math.hypot` avoids.
    """
    formula, apart, distance = setting(name, cut, direction, ratio)
    a, b = grain(one), grain(two)
    force, torque_a, torque_b, energy = formula(tuple(apart), a, b)
    largest = max(abs(energy) / distance, math.hypot(*force), *map(abs, torque_a + torque_b), 1e-300)
    scale = max(abs(formula(tuple(apart * 0.7), a, b)[3]), abs(energy), largest * distance) / distance
    for axis, e in enumerate(np.eye(3)):
        at = slope(lambda t, e=e: formula(tuple(apart + t * e), a, b)[3], 1e-3 * distance)
        assert -at == pytest.approx(force[axis], abs=1e-6 * scale)
        at = slope(lambda t, e=e: formula(tuple(apart), a._replace(moment=turned(a.moment, e, t)), b)[3], 1e-3)
        assert -at == pytest.approx(torque_a[axis], abs=1e-6 * scale * distance)
        at = slope(lambda t, e=e: formula(tuple(apart), a, b._replace(moment=turned(b.moment, e, t)))[3], 1e-3)
        assert -at == pytest.approx(torque_b[axis], abs=1e-6 * scale * distance)


@settings(deadline=None)
@ANY_PAIR
def test_pair_forces_keep_momenta(name, cut, direction, ratio, one, two):
    """Swapping the grains gives F → −F, M_a ↔ M_b and the same U; M_a + M_b + r×F = 0; rounding 1e-13 of the terms."""
    formula, apart, distance = setting(name, cut, direction, ratio)
    a, b = grain(one), grain(two)
    force, torque_a, torque_b, energy = formula(tuple(apart), a, b)
    back, other_b, other_a, same = formula(tuple(-apart), b, a)
    size = math.hypot(*force) + abs(energy) / distance
    bound = max(size, np.abs([torque_a, torque_b]).max() / distance, moments_scale(a, b, distance))
    assert np.add(force, back) == pytest.approx(np.zeros(3), abs=1e-13 * bound)
    assert same == pytest.approx(energy, abs=1e-13 * bound * distance)
    assert np.subtract((torque_a, torque_b), (other_a, other_b)) == pytest.approx(0, abs=1e-13 * bound * distance)
    total = np.add(torque_a, torque_b) + np.cross(apart, force)
    assert total == pytest.approx(np.zeros(3), abs=1e-13 * bound * distance)


def moments_scale(a, b, distance):
    """Force scale of two moments [N]; terms of it may cancel in a formula."""
    return 3.0 * MAGNETIC * math.hypot(*a.moment) * math.hypot(*b.moment) / distance**4


def cloud(count=60, seed=3):
    """Charged magnetic grains of unequal masses in a box of 1 µm, some of them interacting through its walls."""
    rng = np.random.default_rng(seed)
    grid = np.stack(np.meshgrid(*[np.arange(4)] * 3), -1).reshape(-1, 3)[:count]
    position = (grid - 1.5 + 0.3 * rng.random(grid.shape)) * 2.4e-7
    moment, charge = 6e-18 * rng.normal(size=grid.shape), 1e-18 * rng.normal(size=len(grid))
    return sand.Grains(position, 1e-8 * (1 + rng.random(len(grid))), sand.IRON, moment=moment, charge=charge)


def by_hand(force, grains, box):
    """Forces, torques and halves of the energies by a double loop over all pairs and the 27 nearest images."""
    cutoff = cutoff_for(force.choose(grains, box).radius, force.cut)
    formula = pair_formula(force.name, cutoff)
    every = [
        PairGrain(tuple(m), q, w, r)
        for m, q, w, r in zip(grains.moment, grains.charge, grains.mass, grains.radius, strict=True)
    ]
    shifts = [np.array(s) * 1e-6 for s in itertools.product((-1, 0, 1), repeat=3)]
    loads, energies = np.zeros((2, len(grains), 3)), np.zeros(len(grains))
    for i, j in itertools.combinations(range(len(grains)), 2):
        apart = min((grains.position[i] - grains.position[j] + s for s in shifts), key=lambda v: float(v @ v))
        f, torque_i, torque_j, energy = formula(tuple(apart), every[i], every[j])
        loads[:, i] += f, torque_i
        loads[:, j] += -np.array(f), torque_j
        energies[[i, j]] += 0.5 * energy
    return *loads, energies


@pytest.mark.filterwarnings(
    "ignore:attraction. the cut-off, .* ends an interaction",
    "ignore:charges. the cut-off, .* ends an interaction",
    "ignore:dipoles. the cut-off, .* ends an interaction",
)
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:screened_charges")
@pytest.mark.parametrize("name", PAIR_FORCES)
def test_all_loops_of_a_pair_force_agree(name, monkeypatch):
    """All pairs, list, one block and several of both, single pairs: the loads of a double loop over nearest images.

    The loops are ordinary Python here; sums of 60 terms differ by rounding, 1e-13 of the largest term.  The blocks of
    large simulations are made for these 60 grains, and taken in reverse order.
    """
    grains, box = cloud(), sand.Box.periodic("1 um")
    force = FORCES[name](**ARGUMENTS.get(name, {}), cutoff="0.45 um")
    sim = sand.Simulation(grains, [force], box=box, neighbours=sand.Neighbours("cells"))
    arrays, span = sim.state.grains.arrays, sim._engine.parameters.span
    expected = by_hand(force, grains, box)
    for listed in (False, True):
        sums, numbers = force.sums(box, listed), force.numbers(grains, box)
        for blocked in (False, True):
            monkeypatch.setattr(loops, "PARALLEL_FROM", 1 if blocked else 1000)
            for module in (loops, generic_loops, dipole_loops):
                monkeypatch.setattr(module, "ROWS_PER_BLOCK", 16 if blocked else 256)
            far = empty_long_range_arrays(len(grains), 64 * len(grains), ALL_PAIRS_BLOCKS)
            build_verlet_list(arrays, far, sim.state.count.copy(), span, sim._engine.parameters.search)
            number = sums.blocks(arrays)
            assert number == ((4 if listed else ALL_PAIRS_BLOCKS) if blocked else 1)
            sums.begin(arrays, far, span, numbers)
            for b in reversed(range(number)):
                sums.block(arrays, far, span, numbers, b)
            sums.end(arrays, far, span, numbers)
            shares = np.zeros(len(grains))
            sums.energies(arrays, far, span, numbers, shares)
            for ours, theirs in zip((far.force.T, far.torque.T, shares), expected, strict=True):
                assert np.abs(ours - theirs).max() <= 1e-12 * max(np.abs(theirs).max(), 1e-300), (listed, blocked)
    near = sum(np.array(sums.pair(arrays, span, numbers, 7, j)[0]) for j in range(len(grains)) if j != 7)
    assert np.abs(near - expected[0][7]).max() < 1e-12 * np.abs(expected[0]).max()


def test_blocks_cover_every_row_once():
    """Blocks of the triangle of all pairs, and of list rows, are consecutive; the last one ends with the last grain."""

    class Grains:
        mass = np.zeros(1234)

    ends = [int(first_row(Grains, b, 8)) for b in range(9)]
    assert ends[0] == 0 and ends[-1] == 1234 and ends == sorted(ends)
    assert listed_blocks(Grains) == 5


@pytest.mark.parametrize("options", [{}, ROTATING], ids=["constant", "in time"])
@pytest.mark.parametrize("name", EXTERNAL_FORCES)
@settings(max_examples=20, deadline=None)
@given(TRIPLE, TRIPLE, NUMBER, st.floats(0.1, 1.0))
def test_external_forces_are_gradients_of_their_energy(name, options, position, moment, charge, mass):
    """F = −∂U/∂x and M = −∂U/∂θ at fixed time.  U is linear in x and a sine of θ: central differences err by 1e-12."""
    if options and name != "field":
        return
    force = FORCES[name](**ARGUMENTS[name], **options)
    one = GrainState(position, (0.0,) * 3, (0.0,) * 3, moment, 1.0, mass, charge)
    numbers, time = force.numbers(), 0.37e-6
    load, torque, energy = force.formula(time, one, numbers)
    size = abs(energy) + math.hypot(*load) + math.hypot(*torque) + 1e-300
    size = max(size, max(abs(x) for x in np.ravel(list(ARGUMENTS[name].values()))) * 2.0)
    for axis, e in enumerate(np.eye(3)):
        at = slope(lambda t, e=e: force.formula(time, one._replace(position=tuple(position + t * e)), numbers)[2], 1e-2)
        assert -at == pytest.approx(load[axis], abs=1e-9 * size)
        at = slope(lambda t, e=e: force.formula(time, one._replace(moment=turned(moment, e, t)), numbers)[2], 1e-2)
        assert -at == pytest.approx(torque[axis], abs=1e-9 * size)


@pytest.mark.parametrize("name", FORCES)
def test_forces_round_trip_through_case_files(name):
    """parameters() makes the same force again, from a script and from a [forces.*] table; it is in `sand`."""
    force = force_of(name)
    again = type(force)(**force.parameters())
    (built,) = ForcesSection.model_validate({name: force.parameters()}).build()
    assert force == again == built and force.name == name
    assert getattr(sand, type(force).__name__) is type(force) and type(force).__name__ in BUILT_IN
    assert force.references


def test_the_registry_refuses_what_would_not_work():
    """A name or a column that is taken, and missing members: one line that says what."""

    @dataclasses.dataclass(frozen=True)
    class Other(sand.Charges):
        pass

    with pytest.raises(BadInput, match=r"^force 'charges' exists already \(sand\.forces\.pair\.inverse_square\)"):
        register(Other)
    Other.name = "other"
    with pytest.raises(BadInput, match=r"^force 'other': the ledger column 'coulomb' is that of 'charges'"):
        register(Other)

    @dataclasses.dataclass(frozen=True)
    class Incomplete(PairForce):
        name = "incomplete"
        references = "none"
        column = "incomplete"

    with pytest.raises(BadInput, match=r"^force 'incomplete' \(.*\) lacks formula, no_effect, constants$"):
        register(Incomplete)
    assert set(FORCES) == {force.name for force in FORCES.values()} and "other" not in FORCES


@pytest.mark.compiled("small")
def test_compiled_loops_are_those_of_python():
    """Screened charges over all pairs, compiled, against the same loop in Python: rounding."""
    grains, box = cloud(), sand.Box.periodic("1 um")
    force = sand.ScreenedCharges("0.2 um", cutoff="0.45 um")
    sums, numbers = force.sums(box, False), force.numbers(grains, box)
    stage, found = pair_force_stages(sums, False)[SUM], []
    for run in (stage.in_python, stage.run):
        far = empty_long_range_arrays(len(grains), 16)
        run(table_of(grains=grains.arrays, long_range=far, span=box.span), numbers, WHOLE)
        assert far.force.any()
        found.append(far.force)
    assert np.abs(found[0] - found[1]).max() < 1e-13 * np.abs(found[0]).max()


@pytest.mark.validate
@pytest.mark.parametrize("cutoff", ["none", "0.2 um"])
@pytest.mark.parametrize("name", PAIR_FORCES)
def test_threads_change_no_bit_of_a_pair_force(name, cutoff):
    """20 steps of 1100 grains with 1 and 3 threads, all and listed pairs, together with charges: the same bits."""
    rng = np.random.default_rng(2)
    grid = np.stack(np.meshgrid(*[np.arange(11)] * 3), -1).reshape(-1, 3)[:1100]
    grains = sand.Grains(
        grid * 5e-8,
        1e-8,
        sand.IRON,
        moment=1e-17 * rng.normal(size=grid.shape),
        charge=1e-18 * rng.normal(size=len(grid)),
    )
    ends = []
    for threads in (1, 3):
        sand.set_threads(threads)
        others = [sand.Dipoles(cutoff="0.15 um") if "charges" in name else sand.Charges(cutoff="0.15 um")]
        sim = sand.Simulation(grains, [FORCES[name](**ARGUMENTS.get(name, {}), cutoff=cutoff), *others])
        sim.run(steps=20)
        ends.append(sim.grains.velocity.tobytes())
    sand.set_threads(None)
    assert ends[0] == ends[1] and np.frombuffer(ends[0]).any()


@pytest.mark.validate
def test_two_screened_charges():
    """U = q1 q2 exp(−r/λ)/(4πε₀ r), F = U (1/r + 1/λ), in the ledger and in the loads; a flight keeps the total."""
    q, r, length = 1.6e-19, 1.2e-7, 1e-7
    grains = sand.Grains([[0, 0, 0], [r, 0, 0]], 1e-9, sand.SILICA, charge=[q, 2 * q])
    sim = sand.Simulation(grains, [sand.ScreenedCharges(length)])
    energy = 8.9875517923e9 * 2 * q * q * math.exp(-r / length) / r
    loads = sim.loads()
    assert loads["energy"]["yukawa"] == pytest.approx(energy, rel=1e-9, abs=0.0)
    assert loads["force"][1, 0] == pytest.approx(energy * (1 / r + 1 / length), rel=1e-9, abs=0.0)
    sim.run(until="1 us")
    assert sim.ledger["yukawa"][-1] < 0.5 * energy
    assert abs(np.ptp(sim.ledger["total"])) < 1e-4 * energy


def test_cut_off_of_screened_charges():
    """Ten screening lengths where the box allows it, two grain diameters at least; the reasons say why."""
    grains = sand.Grains([[0, 0, 0], [1e-7, 0, 0]], 1e-8, sand.SILICA, charge=1e-19)
    open_box, small = sand.Box.open(), sand.Box.periodic("1 um")
    force = sand.ScreenedCharges("20 nm")
    for box in (open_box, small):
        assert force.choose(grains, box) == (pytest.approx(2e-7, rel=1e-6, abs=0.0), "smooth, 10 screening lengths")
    radius, reason = sand.ScreenedCharges("0.1 um").choose(grains, small)
    assert (
        radius == pytest.approx(0.5e-6 / 1.35, rel=1e-6, abs=0.0) and "less than 10 screening lengths, 1 um" in reason
    )
    radius, reason = sand.ScreenedCharges("2 nm").choose(grains, open_box)
    assert radius == pytest.approx(4e-8, rel=1e-6, abs=0.0) and "two grain diameters" in reason
    (text,) = force.check(grains, open_box)
    assert "the largest radius, 10 nm, is not small compared with screening_length = 20 nm" in text
    assert sand.ScreenedCharges("1 um").check(grains, open_box) == []


def test_the_taylor_scheme_needs_rates():
    """Forces without a rate of change are refused with far = "taylor", by name."""
    grains = sand.Grains([[0, 0, 0], [1e-7, 0, 0]], 1e-9, sand.SILICA, charge=1e-19)
    taylor, contact = sand.Verlet(far="taylor"), sand.Contact()
    with pytest.raises(BadInput, match=r"^stepping: far = 'taylor' needs the rate .* which screened_charges lacks"):
        sand.Simulation(grains, [contact, sand.ScreenedCharges("1 um")], stepping=taylor)
    sand.Simulation(grains, [contact, sand.Charges()], stepping=taylor)
