"""The particle mesh of the Ewald sums: splines, influence function, accuracy, gradients, momentum, choice."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.interpolate import BSpline

import sand
from sand.basics.box import Span
from sand.basics.constants import COULOMB, MAGNETIC
from sand.compiler.program import Program
from sand.compiler.stage import PythonStage, stage
from sand.forces.pair import ewald
from sand.forces.pair.ewald_fit import CHARGES
from sand.forces.pair.long_range_loops import all_blocks
from sand.forces.pair.mesh import MeshSums, lattice_sum, mesh_errors, mesh_sums, new_mesh, nodes_for
from sand.forces.pair.mesh_loops import MESH_CHARGES, ORDERS, add_mesh_forces, fill_spline, mesh_rounds
from tests.tables import table_of
from tests.tiers import combinations

from .test_ewald import CUBE, MOMENT, SIDES, clusters, gas, loads
from .test_ewald_charges import CORNERS, Q, ions, simulation
from .test_ewald_charges import loads as charge_loads

pytestmark = pytest.mark.filterwarnings("ignore:the electric field at the surface of grains is too strong")


@pytest.mark.parametrize("order", ORDERS)
def test_splines_and_their_derivatives(order):
    """M, M′ and M″ of node j are those of the B-spline with knots 0 … p at t + p − 1 − j, as SciPy computes them."""
    t, stretch = 0.37, 2.5
    spline = np.full((1, 9, 8), 0.0)
    fill_spline(spline, 0, 1, order, t, stretch)
    exact = BSpline.basis_element(np.arange(order + 1.0), extrapolate=False)
    at = t + order - 1 - np.arange(order)
    for k in range(3):
        expected = stretch**k * exact.derivative(k)(at)
        assert spline[0, 3 + k, :order] == pytest.approx(expected, rel=1e-12, abs=1e-13)
        assert not spline[0, 3 + k, order:].any()
        assert not spline[0, [0, 1, 2, 6, 7, 8]].any()


SHIFTS = np.stack(np.meshgrid(*[np.arange(-3, 4)] * 3, indexing="ij"), -1).reshape(-1, 3)
"""Aliases m, in units of the mesh."""


def aliases(sides, nodes, order, alpha):
    """For each mode n of a mesh: n, wave vectors q_m of its aliases, q_m², W_m, and R(q_m) = 4π e^(−q²/4α²)/q²."""
    for n in np.ndindex(*nodes):
        signed = np.array([k if k <= size // 2 else k - size for k, size in zip(n, nodes, strict=True)])
        turns = signed / np.array(nodes) + SHIFTS
        q = 2 * math.pi * turns * np.array(nodes) / sides
        square = (q**2).sum(axis=1)
        w = np.sinc(turns).prod(axis=1) ** order
        real = np.zeros(len(q))
        real[square > 0] = 4 * math.pi * np.exp(-square[square > 0] / (4 * alpha**2)) / square[square > 0]
        yield n, q, square, w, real


def test_influence_function_and_errors_by_sums_over_aliases():
    """G and the mean square errors are Σ over q and all pairs of aliases m, m′, as in the docstring of `mesh`.

    Written out over 7³ aliases (here for the modes of a mesh of 4 × 4 × 6 nodes), W = Π sinc(q h/2)^p:
    field Σ (G W W′ − δR)² q² q′², force with a further q′²; own field (Σ G W² q² − Σ R q²)/3; and of neighbours along
    a G Σ W_m W_m′ q_b q_b′ (−1)^p.
    """
    sides, nodes, order, alpha = (1.0, 1.1, 1.3), (4, 4, 6), 5, 3.0
    found = mesh_sums(sides, nodes, order, alpha)
    field = force = own = 0.0
    wave = np.zeros((3, 3))
    pairs = [np.argwhere((SHIFTS[None] == SHIFTS[:, None] + step).all(axis=2)).T for step in np.eye(3)]
    for n, q, square, w, real in aliases(sides, nodes, order, alpha):
        g = (real * w**2 * square**2).sum() / (w**2 * square).sum() ** 2 if any(n) else 0.0
        if n[2] <= nodes[2] // 2:
            assert found.influence[n] == pytest.approx(g, rel=1e-10, abs=0.0)
        difference = g * np.outer(w, w) - np.diag(real)
        field += (difference**2 * np.outer(square, square)).sum()
        force += (difference**2 * np.outer(square, square**2)).sum()
        own += (np.diag(difference) * square).sum() / 3
        for a, (i, j) in enumerate(pairs):
            wave[a] += (-1) ** order * g * (w[i] * w[j]) @ (q[i] * q[j])
    assert found.field_square == pytest.approx(field, rel=1e-8, abs=0.0)
    assert found.force_square == pytest.approx(force, rel=1e-8, abs=0.0)
    assert found.self_mean == pytest.approx(own, rel=1e-6, abs=0.0)
    assert found.self_wave == pytest.approx(wave, rel=1e-8, abs=0.0)


def test_influence_function_and_errors_for_charges():
    """G and the mean square errors of charges: Σ (G W W′ − δR)² of the potential, with q′² of the force.

    Written out over 7³ aliases as in the test for dipoles, at the accuracy of a good mesh (α h = 0.5), where 1/q_m² of
    an alias and 1/q² of the vector differ in the errors by 2 per cent; G Σ W² − Σ R of the own potential, with Σ R over
    all vectors up to exp(−40).
    """
    sides, nodes, order, alpha = (1.0, 1.1, 1.3), (8, 8, 10), 5, 4.0
    found = mesh_sums(sides, nodes, order, alpha, CHARGES)
    first, second = np.argwhere((SHIFTS[None] == SHIFTS[:, None] + [0, 1, 0]).all(axis=2)).T
    field = force = own = wave = 0.0
    for n, _, square, w, real in aliases(sides, nodes, order, alpha):
        g = (real * w**2 * square).sum() / ((w**2).sum() * (w**2 * square).sum()) if any(n) else 0.0
        if n[2] <= nodes[2] // 2:
            assert found.influence[n] == pytest.approx(g, rel=1e-7, abs=0.0)
        difference = (g * np.outer(w, w) - np.diag(real)) ** 2
        field += difference.sum()
        force += difference.sum(axis=0) @ square
        own += (g * w**2).sum()
        wave += (-1) ** order * g * w[first] @ w[second]
    assert found.field_square == pytest.approx(field, rel=0.02, abs=0.0)
    assert found.force_square == pytest.approx(force, rel=0.02, abs=0.0)
    q = 2 * math.pi * ewald.half_of_vectors(sides, 2 * alpha * math.sqrt(40)) / sides
    square = (q**2).sum(axis=1)
    total = 8 * math.pi * (np.exp(-square / (4 * alpha**2)) / square).sum()
    assert lattice_sum(sides, alpha) == pytest.approx(total, rel=1e-12, abs=0.0)
    assert found.self_mean == pytest.approx(own - total, abs=1e-9 * total)
    assert found.self_wave[1, 0] == pytest.approx(wave, rel=1e-8, abs=0.0) and not found.self_wave[:, 1:].any()


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize(
    ("kind", "accuracy", "boundary"),
    combinations(
        ("gas", "clusters"),
        (1e-3, 1e-6, 1e-2, 1e-4, 1e-5),
        ("tin-foil", "vacuum"),
        default=(
            *[("gas", 1e-3, "tin-foil"), ("gas", 1e-6, "vacuum")],
            *[("clusters", 1e-3, "vacuum"), ("clusters", 1e-6, "tin-foil")],
        ),
    ),
)
def test_the_mesh_against_the_direct_sum(kind, accuracy, boundary):
    """Rms errors of forces and torques, relative to the median (gas) or rms (clusters) load, ≤ accuracy; three sides.

    Against a sum over wave vectors with an accuracy 20 times as high.  In a gas the error is the predicted one within
    a factor of 1.5, and the energy differs by less than the errors of single grains allow.
    """
    position, moment = gas(150, SIDES, gap=2e-8) if kind == "gas" else clusters()
    options = {"boundary": boundary}
    expected = loads(position, moment, SIDES, accuracy=0.05 * accuracy, reciprocal="direct", **options)
    found = loads(position, moment, SIDES, accuracy=accuracy, reciprocal="mesh", **options)
    errors = []
    for ours, right in ((found[0], expected[0]), (found[2], expected[2])):
        errors.append(np.sqrt(((ours - right) ** 2).sum(axis=1).mean()))
        sizes = np.linalg.norm(right, axis=1)
        assert errors[-1] < accuracy * (np.median(sizes) if kind == "gas" else np.sqrt((sizes**2).mean()))
    mean_square = (moment**2).sum(axis=1).mean()
    assert abs(found[3] - expected[3]) < 5 * len(position) ** 0.5 * errors[1] + 1e-9 * abs(expected[3])
    if kind == "gas":
        box, grains = sand.Box.periodic(*SIDES), sand.Grains(position, 1e-9, sand.IRON, moment=moment)
        chosen = sand.Dipoles(periodic="ewald", accuracy=accuracy, reciprocal="mesh").ewald(grains, box)
        assert chosen.order in ORDERS and max(chosen.force_error, chosen.field_error) <= accuracy
        typical = math.sqrt(6) * MAGNETIC * mean_square * (4 * math.pi * 150 / 3 / SIDES.prod()) ** (4 / 3)
        assert 0.5 < errors[0] / (chosen.force_error * typical) < 1.5


@pytest.mark.compiled("dipoles")
def test_loads_are_gradients_of_the_energy_of_the_mesh():
    """F_i − F_j = −∂U/∂x_i + ∂U/∂x_j and M = −∂U/∂θ for an accuracy of 1e-2: exact whatever the accuracy.

    The net force of the mesh is removed in proportion to the masses, here equal, and cancels in F_i − F_j: two grains
    are moved by opposite steps.  Central differences with one Richardson step, as in `test_ewald`: 1e-7 of U/L.
    """
    position, moment = gas(6, SIDES, seed=3)
    options = {"accuracy": 1e-2, "reciprocal": "mesh"}
    force, _, torque, energy = loads(position, moment, SIDES, **options)
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).max()
    h, size = 1e-4 * SIDES[0], abs(energy) / SIDES[0]

    def slope(change):
        steps = {t: loads(*change(t), SIDES, **options)[3] for t in (-1.0, -0.5, 0.5, 1.0)}
        return (8 * (steps[0.5] - steps[-0.5]) - (steps[1.0] - steps[-1.0])) / 6

    for i, j, axis in ((0, 1, 0), (3, 2, 1), (5, 4, 2)):
        unit = np.eye(3)[axis]

        def moved(t, i=i, j=j, unit=unit):
            signs = (np.arange(6) == i).astype(float) - (np.arange(6) == j)
            return position + t * h * unit * signs[:, None], moment

        def turned(t, i=i, unit=unit):
            other, angle = moment.copy(), 1e-4 * t
            v = moment[i]
            other[i] = v * math.cos(angle) + np.cross(unit, v) * math.sin(angle)
            other[i] += unit * (unit @ v) * (1 - math.cos(angle))
            return position, other

        assert -slope(moved) / h == pytest.approx(force[i, axis] - force[j, axis], abs=1e-7 * size)
        assert -slope(turned) / 1e-4 == pytest.approx(torque[i, axis], abs=1e-7 * size * SIDES[0])


@pytest.mark.compiled("small")
@pytest.mark.filterwarnings("ignore:charges. the net charge")
@pytest.mark.parametrize(
    ("net", "accuracy"), combinations((0, 30), (1e-3, 1e-6, 1e-2, 1e-4), default=((0, 1e-3), (30, 1e-6)))
)
def test_the_mesh_of_charges_against_the_direct_sum(net, accuracy):
    """Rms errors of forces and potentials of 150 charges are the predicted ones, at most the accuracy; three sides.

    Against a sum over wave vectors to 1e-8, also with a net charge and its background; there the error of the potential
    is not that of random signs, for which it is predicted.  Errors are relative to √3 kq²/a² and kq/a; 150 random
    positions scatter by 20 per cent.  The net force is 0 to rounding.
    """
    position, charge = ions(150, net, gap=2e-8)
    spacing = (3 * SIDES.prod() / (4 * math.pi * 150)) ** (1 / 3)
    found = []
    for options in ({"accuracy": 1e-8, "reciprocal": "direct"}, {"accuracy": accuracy, "reciprocal": "mesh"}):
        sim = simulation(position, charge, SIDES, **options)
        found.append((sim.loads()["force"], 2 * sim.at_grains()["coulomb"] / charge))
    chosen = sim.forces[0].ewald(sim.grains, sim.box)
    assert chosen.order in ORDERS and max(chosen.force_error, chosen.field_error) <= accuracy
    force, potential = ((ours - right) for right, ours in zip(*found, strict=True))
    force_error = np.sqrt((force**2).sum(axis=1).mean()) / (math.sqrt(3) * COULOMB * Q**2 / spacing**2)
    field_error = np.sqrt((potential**2).mean()) / (COULOMB * Q / spacing)
    assert 0.7 < force_error / chosen.force_error < 1.4
    assert field_error < accuracy
    assert net or 0.5 < field_error / chosen.field_error < 1.5
    assert np.abs(found[1][0].sum(axis=0)).max() < 1e-13 * np.abs(found[1][0]).max()


@pytest.mark.compiled("small")
@pytest.mark.parametrize(
    ("sites", "signs", "expected"),
    [
        (CORNERS, (-1.0) ** (2 * CORNERS).sum(axis=1), -2 * 4 * 1.747564594633),
        ([[0.0, 0.0, 0.0], [0.5, 0.5, 0.5]], [1, -1], -2 / math.sqrt(3) * 1.762674773),
    ],
    ids=["NaCl", "CsCl"],
)
def test_lattice_energies_with_a_mesh(sites, signs, expected):
    """Madelung constants as in `test_ewald_charges`, by a mesh with an accuracy of 1e-6 of a gas."""
    force, energy = charge_loads(
        (np.array(sites) - 0.4) * CUBE, Q * np.array(signs), CUBE, accuracy=1e-6, reciprocal="mesh"
    )
    assert energy / (COULOMB * Q**2 / CUBE[0]) == pytest.approx(expected, rel=4e-6, abs=0.0)
    assert np.abs(force).max() < 4e-6 * COULOMB * Q**2 / CUBE[0] ** 2


@pytest.mark.compiled("small")
@pytest.mark.filterwarnings("ignore:charges. the net charge")
@pytest.mark.parametrize("net", [0, 4])
def test_forces_of_charges_are_gradients_of_the_energy_of_the_mesh(net):
    """F_i − F_j = −∂U/∂x_i + ∂U/∂x_j for an accuracy of 1e-2, as for dipoles: exact whatever the accuracy."""
    position, charge = ions(6, net, seed=3)
    options = {"accuracy": 1e-2, "reciprocal": "mesh"}
    force, _ = charge_loads(position, charge, SIDES, **options)
    h, size = 1e-4 * SIDES[0], COULOMB * (charge**2).sum() / SIDES[0]
    for i, j, axis in ((0, 1, 0), (3, 2, 1), (5, 4, 2)):
        step = np.zeros((6, 3))
        step[i, axis], step[j, axis] = h, -h
        u = {t: charge_loads(position + t * step, charge, SIDES, **options)[1] for t in (-1.0, -0.5, 0.5, 1.0)}
        slope = (8 * (u[0.5] - u[-0.5]) - (u[1.0] - u[-1.0])) / (6 * h)
        assert -slope == pytest.approx(force[i, axis] - force[j, axis], abs=1e-7 * size / SIDES[0])


def test_the_net_force_is_removed_as_a_common_acceleration():
    """F_i − m_i ΣF/Σm: no net force, and differences of accelerations are those of the mesh."""
    rng = np.random.default_rng(1)
    raw, mass = rng.normal(size=(3, 5)), rng.random(5) + 0.5
    far = SimpleNamespace(force=np.zeros((3, 5)))
    add_mesh_forces(SimpleNamespace(mass=mass), far, SimpleNamespace(force=raw))
    assert np.abs(far.force.sum(axis=1)).max() < 1e-14
    common = (far.force - raw) / mass
    assert common == pytest.approx(np.repeat(-raw.sum(axis=1)[:, None] / mass.sum(), 5, axis=1), rel=1e-12, abs=0.0)


def test_charges_on_the_same_mesh():
    """With q in place of μ·∇: F and potential are those of the sum over wave vectors, U = (1/2V) Σ R |Σ q exp(iqx)|².

    R = 4π exp(−q²/4α²)/q²; G = R W²/(ΣW²)², which is optimal up to aliases of R.  α h = 0.25 and p = 8: 1e-5.
    """
    sides, nodes, order, count = np.array([1.0, 1.1, 0.9]), (16, 18, 16), 8, 4
    alpha, volume = 4.0, sides.prod()
    rng = np.random.default_rng(2)
    position, charge = (rng.random((count, 3)) - 0.5) * sides, rng.normal(size=count)
    turns = [np.fft.fftfreq(n)[:, None] + np.arange(-3, 4) for n in nodes]
    w = [np.sinc(each) ** (2 * order) for each in turns]
    n = np.stack(np.meshgrid(*(np.fft.fftfreq(k, 1 / k) for k in nodes), indexing="ij"), -1)
    q = 2 * math.pi * n / sides
    square = (q**2).sum(axis=-1)
    square[0, 0, 0] = 1.0
    real = 4 * math.pi * np.exp(-square / (4 * alpha**2)) / square
    real[0, 0, 0] = 0.0
    ratio = [each[:, 3] / each.sum(axis=1) ** 2 for each in w]
    influence = real * ratio[0][:, None, None] * ratio[1][:, None] * ratio[2]
    sums = MeshSums(influence[:, :, : nodes[2] // 2 + 1], 0, 0, 0, np.zeros((3, 3)))
    mesh = new_mesh(sums, nodes, tuple(sides), count, CHARGES)
    mesh.influence[...] /= COULOMB
    grains = SimpleNamespace(mass=np.ones(count), position=position.T.copy(), charge=charge)
    span = Span(*sides, *(1.0 / sides))
    parameters = SimpleNamespace(mesh=mesh)
    for each in mesh_rounds(order, MESH_CHARGES):
        if each.compiled:
            each.begin(grains, span, parameters)
        for b in range(3):
            each.block(*((grains, span) if each.compiled else ()), parameters, b, 3)
    waves, flat = q.reshape(-1, 3), real.ravel()
    phase = np.exp(1j * position @ waves.T)
    factor = flat * (charge @ phase).conj() / volume
    potential = (factor * phase).real.sum(axis=1)
    force = -charge[:, None] * ((1j * factor * phase) @ waves).real
    assert all_blocks(grains) == 1
    assert -mesh.field[0] == pytest.approx(potential, abs=1e-5 * np.abs(potential).max())
    assert pytest.approx(force, abs=1e-5 * np.abs(force).max()) == mesh.force.T


@pytest.mark.parametrize("kind", [sand.Dipoles, sand.Charges])
def test_the_cheaper_sum_is_chosen(kind):
    """Wave vectors for 100 grains, a mesh for 4000, with predicted errors below the accuracy, stated in the log."""
    for count, mesh in ((100, False), (4000, True)):
        side = 1.2e-6 * (count / 100) ** (1 / 3)
        position = (np.random.default_rng(1).random((count, 3)) - 0.5) * side
        grains = sand.Grains(position, 1e-9, sand.IRON, moment=[0, 0, MOMENT], charge=Q)
        force, box = kind(periodic="ewald"), sand.Box.periodic(side)
        chosen = force.ewald(grains, box)
        assert (chosen.order > 0) == mesh == (chosen.waves == 0)
        assert max(chosen.force_error, chosen.field_error) <= 1e-3
        assert bool(force.sums(box, True, grains).rounds) == mesh
        reason = force.choose(grains, box).reason
        assert ("nodes with splines of order" in reason) == mesh == ("wave vectors" not in reason)
    sums = mesh_sums((side,) * 3, chosen.nodes, chosen.order, chosen.alpha, kind.sources)
    spacing = (3 * side**3 / (4 * math.pi * count)) ** (1 / 3)
    assert max(mesh_errors(sums, side**3, spacing, kind.sources)) < 1e-3


def test_numbers_of_nodes():
    """Even, products of 2, 3 and 5, at most the spacing, at least 2p."""
    assert nodes_for((1.0, 1.0, 0.1), 1 / 31, 5) == (32, 32, 10)
    assert nodes_for((1.0, 1.05, 2.0), 0.05, 6) == (20, 24, 40)


def test_the_mesh_is_made_finer_until_the_accuracy_is_reached(monkeypatch):
    """Nodes are chosen by an estimate for cubic cells; where that is too coarse, the mesh is refined."""
    grains, box = sand.Grains(gas(50, SIDES)[0], 1e-9, sand.IRON, moment=[0, 0, MOMENT]), sand.Box.periodic(*SIDES)
    force = sand.Dipoles(periodic="ewald", accuracy=1.01e-3, reciprocal="mesh")
    fine = force.ewald(grains, box)
    ewald.choose_ewald.cache_clear()
    estimate = ewald.widest_cells
    monkeypatch.setattr(ewald, "widest_cells", lambda *given: 2.0 * estimate(*given))
    found = force.ewald(grains, box)
    ewald.choose_ewald.cache_clear()
    assert max(found.force_error, found.field_error) <= 1.01e-3
    assert found.nodes != fine.nodes


@pytest.mark.compiled("small")
def test_a_python_function_as_a_stage():
    """Compiled code calls it by address, with parts and parameters, and passes on its exceptions."""
    from sand.compiler.program import call_stage

    def in_python(clock, parameters, block):
        if block < 0:
            raise ValueError("negative block")
        clock[0] += parameters[0] * block
        return 7 * block

    @stage("a call", parts=("program", "count"))
    def calls(s):
        return call_stage(s, 0, s.count[0])

    table = table_of(clock=np.zeros(1), count=np.array([3]), program=None)
    program = Program(table, {0: (PythonStage(in_python), (2.0,))}, 1)
    table.set("program", program)
    assert program.run(calls, table) == 21 and table["clock"][0] == 6.0
    table["count"][0] = -1
    with pytest.raises(ValueError, match="negative block"):
        program.run(calls, table)
