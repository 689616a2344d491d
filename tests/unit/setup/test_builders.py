"""Random aggregates: equilibrium contacts, no overlaps, reproducible; size laws; files."""

import json

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

import sand
from sand.cli.main import main
from sand.contact.jkr import rest_overlap, rest_radius
from sand.contact.mixing import pairing_between
from sand.io.bodies import read_body, write_body
from sand.setup import KINDS, bcca, bpca, chain, dla, dlca, fractal, hexagonal, magnetic_energy, rbd, relaxed
from sand.setup._kernels.aggregation import return_to_sphere
from sand.setup._kernels.hash_grid import gap_to_nearest, insert_grain
from sand.setup.aggregates import rest_distance
from sand.setup.deposit import cut_sphere
from sand.setup.from_file import body_from_file
from sand.setup.growing import empty_hash_grid
from sand.setup.population import Lognormal, PowerLaw, grain_set_of

R, M = 3e-7, sand.SILICA
GROWN = {"bpca": bpca, "bcca": bcca, "dla": dla, "dlca": dlca, "fractal": fractal, "rbd": rbd}
MIXED = {"radius": "lognormal(0.1 um, 0.4)", "material": {"silica": 0.6, "ice": 0.4}}


def pairs_in_contact(body):
    """Brute force over all pairs: those in contact (C, 2), their distances, and equilibrium distances."""
    i, j = np.triu_indices(len(body), 1)
    d = np.linalg.norm(body.position[i] - body.position[j], axis=1)
    near = d <= body.radius[i] + body.radius[j]
    i, j, d = i[near], j[near], d[near]
    rest = []
    for a, b in zip(i, j, strict=True):
        both = pairing_between(*(body.materials[body.material[k]] for k in (a, b)))
        r1, r2 = body.radius[a], body.radius[b]
        reduced = r1 * r2 / (r1 + r2)
        rest.append(r1 + r2 - rest_overlap(rest_radius(both.surface_energy, reduced, both.modulus), reduced))
    return np.column_stack([i, j]), d, np.array(rest)


def number_of_clusters(body, pairs):
    graph = csr_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(len(body), len(body)))
    return connected_components(graph, directed=False)[0]


def size_of(body):
    return float(np.sqrt(np.average((body.position**2).sum(axis=1), weights=body.mass)))


@pytest.mark.compiled("small")
@pytest.mark.parametrize("what", [{"radius": R, "material": M}, {"radius": "12 nm", "material": "iron"}, MIXED])
@pytest.mark.parametrize("kind", list(GROWN))
def test_contacts_are_in_equilibrium_without_overlaps(kind, what):
    """Every pair in contact is at r1 + r2 − δ0, to 1e-13: the rounding of coordinates of ten diameters.

    One cluster; trees except for rbd; centre of mass at the origin; the same seed gives the same bits.
    """
    body = GROWN[kind](150, seed=7, **what)
    pairs, distance, rest = pairs_in_contact(body)
    assert np.abs(distance / rest - 1.0).max() < 1e-13
    assert number_of_clusters(body, pairs) == 1
    assert len(pairs) == 149 if kind != "rbd" else len(pairs) > 200
    assert np.abs(np.average(body.position, axis=0, weights=body.mass)).max() < 1e-12 * size_of(body)
    again, other = (GROWN[kind](150, seed=s, **what) for s in (7, 8))
    assert (again.position == body.position).all() and (again.radius == body.radius).all()
    assert (other.position != body.position).any()


@pytest.mark.compiled("contacts", "small")
def test_a_simulation_finds_the_contacts_that_were_made():
    """N − 1 contacts in a simulation, forces below 1e-9 of the pull-off force."""
    sim = sand.Simulation(bcca(80, radius=R, material=M, seed=2), [sand.Contact()])
    assert len(sim.contacts["pair"]) == 79
    assert np.abs(sim.loads()["force"]).max() < 1e-9 * 3 * np.pi * M.surface_energy * R / 2


@pytest.mark.compiled("small")
@pytest.mark.parametrize("make", [bpca, rbd])
def test_spheres_cut_from_a_heap_are_one_cluster(make):
    """Any number of grains from a heap of 400: one cluster, r_g at most twice that of a ball of filling factor 0.1.

    From trees (bpca) and networks (rbd).
    """
    heap = make(400, radius=R, material=M, seed=3)
    for count in range(20, 400, 13):
        kept = cut_sphere(heap.position, heap.radius, count)
        body = sand.Grains(heap.position[kept] - heap.position[kept].mean(axis=0), R, M)
        assert len(body) == count and number_of_clusters(body, pairs_in_contact(body)[0]) == 1
        assert size_of(body) < 2.0 * np.sqrt(0.6) * R * (count / 0.1) ** (1 / 3)


@pytest.mark.compiled("small")
@pytest.mark.parametrize("count", [1, 2, 3, 5])
@pytest.mark.parametrize("kind", list(GROWN))
def test_few_grains(kind, count):
    """One, two and three grains make an aggregate, too."""
    body = GROWN[kind](count, radius=R, material=M)
    pairs, _, _ = pairs_in_contact(body)
    assert len(body) == count and number_of_clusters(body, pairs) == 1


def test_hexagonal_packing():
    """Each inner grain has twelve contacts, all in equilibrium; the number for 5³ grains by brute force."""
    body = hexagonal(5, radius=R, material=M)
    pairs, distance, rest = pairs_in_contact(body)
    contacts = np.bincount(pairs.ravel())
    inside = (np.abs(body.position) < 1.4 * R).all(axis=1)
    assert inside.any() and (contacts[inside] == 12).all() and contacts.max() == 12
    assert distance == pytest.approx(rest, rel=1e-12, abs=0.0)
    layer = hexagonal(5, 5, 1, radius=R, material=M)
    assert np.bincount(pairs_in_contact(layer)[0].ravel()).max() == 6


def test_a_chain_of_unequal_grains():
    """N − 1 contacts in equilibrium, straight."""
    body = chain(40, seed=3, **MIXED)
    pairs, distance, rest = pairs_in_contact(body)
    assert (np.diff(pairs, axis=1) == 1).all() and len(pairs) == 39
    assert distance == pytest.approx(rest, rel=1e-12, abs=0.0)


def dimension(make, few, many, count):
    """D = ln(N2/N1) / (mean ln r_g2 − mean ln r_g1) over seeds, and its standard error."""
    logs = [np.log([size_of(make(n, radius=R, material=M, seed=s)) for s in range(count)]) for n in (few, many)]
    step = logs[1].mean() - logs[0].mean()
    wrong = np.sqrt(sum(one.var(ddof=1) / count for one in logs)) / step
    return np.log(many / few) / step, np.log(many / few) / step * wrong


@pytest.mark.validate
@pytest.mark.parametrize(
    ("make", "count", "expected", "bound"), [(bpca, 60, 2.95, 0.2), (bcca, 150, 1.9, 0.15), (dla, 20, 2.5, 0.2)]
)
def test_fractal_dimensions(make, count, expected, bound):
    """N ∝ r_g^D from 64 to 512 grains.  Known dimensions: 3 (2.9 at finite size), 1.9 and 2.5.

    The tolerance is the finite-size error, about 0.1, plus three standard errors of this many seeds.
    """
    found, wrong = dimension(make, 64, 512, count)
    assert 3.0 * wrong < bound
    assert found == pytest.approx(expected, abs=bound)


@pytest.mark.compiled("small")
@pytest.mark.parametrize("asked", [1.6, 2.0, 2.4])
def test_requested_fractal_dimension(asked):
    """N = k_f (r_g/a)^D_f: r_g within 5 % at the end as documented, D_f between 100 and 800 grains.

    Tolerance D² · 0.02/ln 8 · √2 < 0.05 for the usual 2 % in r_g; the internal structure has D_f within 0.3.
    """
    sizes = []
    for n in (100, 800):
        some = [size_of(fractal(n, dimension=asked, radius=R, material=M, seed=s)) for s in range(6)]
        sizes.append(np.exp(np.mean(np.log(some))))
        assert np.abs(np.array(some) / R / (n / 1.3) ** (1 / asked) - 1.0).max() < 0.05
    assert np.log(8.0) / np.log(sizes[1] / sizes[0]) == pytest.approx(asked, abs=0.05)


def test_return_of_random_walkers():
    """From 2R a walker hits the sphere with probability R/|x| = ½; the mean cosine to its old direction is R/|x|.

    Both are harmonic functions.  Four standard errors of 4000 walkers.
    """
    x, count, cosines = (0.0, 0.0, 2.0), 4000, []
    for number in range(count):
        there, back = return_to_sphere(np.uint64(5), number, 1, x, 1.0)
        if back:
            assert np.linalg.norm(there) == pytest.approx(1.0, rel=1e-12, abs=0.0)
            cosines.append(there[2])
    assert len(cosines) / count == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(count))
    assert np.mean(cosines) == pytest.approx(0.5, abs=4 * np.std(cosines) / np.sqrt(len(cosines)))


@pytest.mark.compiled("small")
def test_gap_to_nearest_is_a_lower_bound():
    """Against all grains: `gap_to_nearest` is at most the gap of surfaces, and equal to it where it names a grain."""
    body, rng, named = dla(60, seed=1, **MIXED), np.random.default_rng(2), 0
    grain_set = grain_set_of(body.radius, [body.materials[k] for k in body.material])
    grid = empty_hash_grid(grain_set)
    for i in range(60):
        insert_grain(grid, i, tuple(body.position[i]))
    for number in range(900):
        x = rng.normal(size=3) * size_of(body) * rng.choice([0.3, 5.0, 50.0])
        if number % 3:  # where the search over cells gives the bound only
            x = body.position[number % 60] + rng.normal(size=3) * rng.choice([2.0, 5.0]) * grain_set.largest
        gap, neighbour = gap_to_nearest(grid, body.arrays.position, grain_set, 0, tuple(x))
        true = np.linalg.norm(body.position - x, axis=1) - body.radius - body.radius[0]
        assert gap <= true.min() + 1e-20
        if neighbour >= 0:
            named += 1
            assert neighbour == true.argmin() and gap == pytest.approx(true.min(), rel=1e-9, abs=1e-18)
        else:
            assert gap > 0.0
    assert 90 < named < 810


def test_size_distributions():
    """Moments of 20 000 radii to five standard errors: ⟨ln r⟩ and its spread, cut at 3 σ (a factor 0.9865).

    ⟨r⟩ of r^−3.5 between 1 and 10 is (2.5/1.5)(1 − 10^−1.5)/(1 − 10^−2.5).
    """
    rng, count = np.random.default_rng(1), 20_000
    logs = np.log(Lognormal(1e-7, 0.3).draw(count, rng) / 1e-7)
    assert logs.mean() == pytest.approx(0.0, abs=5 * 0.3 / np.sqrt(count))
    assert logs.std() == pytest.approx(0.3 * 0.9866, rel=5 / np.sqrt(2 * count), abs=0.0)
    assert np.abs(logs).max() <= 0.9 + 1e-12
    drawn = PowerLaw(-3.5, "1 nm", "10 nm").draw(count, rng) / 1e-9
    expected = 2.5 / 1.5 * (1 - 10**-1.5) / (1 - 10**-2.5)
    assert drawn.mean() == pytest.approx(expected, abs=5 * drawn.std() / np.sqrt(count))
    assert drawn.min() >= 1.0 and drawn.max() <= 10.0
    flat = PowerLaw(-1, 1.0, 10.0).draw(count, rng)
    assert np.log(flat).mean() == pytest.approx(np.log(10) / 2, abs=5 * np.log(10) / np.sqrt(12 * count))


@pytest.mark.compiled("small")
def test_populations():
    """Fractions of materials and of magnetic grains to within one grain; moments by the material."""
    body = bpca(200, radius=R, material={"silica": 0.7, "iron": 0.3}, moment="material", seed=1)
    names = np.array([m.name for m in body.materials])[body.material]
    assert (names == "iron").sum() == 60 and 10 < (names[:100] == "iron").sum() < 50
    size = np.linalg.norm(body.moment, axis=1)
    assert size == pytest.approx(np.where(names == "iron", 200.0 * body.mass, 0.0), rel=1e-12, abs=0.0)
    some = bpca(200, radius=R, material="iron", moment="1e-18 A m^2", magnetic=0.25, moments="aligned", seed=1)
    assert (some.moment[:, 2] == 1e-18).sum() == 50 and not some.moment[:, :2].any()


def flux_densities(body):
    """B [T] at each grain from the others, k (3 r̂ (μ·r̂) − μ)/r³, by brute force."""
    apart = body.position[:, None] - body.position[None]
    distance = np.linalg.norm(apart, axis=2) + np.where(np.eye(len(body)), np.inf, 0.0)
    along = np.einsum("ijk,jk->ij", apart, body.moment) / distance**2
    return 1e-7 * ((3.0 * along[..., None] * apart - body.moment[None]) / distance[..., None] ** 3).sum(axis=1)


@pytest.mark.compiled("small")
def test_relaxed_moments():
    """U is below that of random and aligned moments and falls with every sweep; |μ × B| < 1e-5 |μ||B|.

    The bound is ten times the angle at which sweeps end.  k is 1e-7 to nine digits here.
    Two moments lie head to tail, U = −2kμ²/d³.
    """
    body, flat = (
        bpca(60, radius=R, material="iron", moment="1e-16 A m^2", moments=how, seed=4) for how in ("random", "aligned")
    )
    before = magnetic_energy(body)
    done = relaxed(body.copy())
    assert magnetic_energy(done) < min(before, magnetic_energy(flat))
    field = flux_densities(done)
    torque = np.linalg.norm(np.cross(done.moment, field), axis=1)
    assert (torque < 1e-5 * 1e-16 * np.linalg.norm(field, axis=1)).all()
    assert ((done.moment * field).sum(axis=1) > 0.0).all()
    assert magnetic_energy(done) == pytest.approx(-0.5 * (done.moment * field).sum(), rel=1e-8, abs=0.0)
    assert np.linalg.norm(done.moment, axis=1) == pytest.approx(1e-16, rel=1e-12, abs=0.0)
    pair = bpca(2, radius=R, material="iron", moment="1e-16 A m^2", moments="relaxed", seed=4)
    deepest = -2e-7 * 1e-32 / rest_distance("iron", R) ** 3
    assert magnetic_energy(pair) == pytest.approx(deepest, rel=1e-8, abs=0.0)


@pytest.mark.compiled("small")
@pytest.mark.parametrize("ending", ["xyz", "extxyz", "gsd"])
def test_bodies_round_trip_through_files(tmp_path, ending):
    """Positions, radii, moments and materials to rounding (twelve ulps through ångström); contacts in equilibrium."""
    body = bcca(60, radius="power law(-2, 0.1 um, 0.3 um)", material={"silica": 0.5, "iron": 0.5}, moment="material")
    path = write_body(tmp_path / f"body.{ending}", body)
    again = body_from_file(path)
    assert again.position == pytest.approx(body.position, rel=1e-14, abs=1e-14 * size_of(body))
    assert again.radius == pytest.approx(body.radius, rel=1e-15, abs=0.0)
    assert again.moment == pytest.approx(body.moment, rel=1e-15, abs=0.0)
    assert [again.materials[k] for k in again.material] == [body.materials[k] for k in body.material]
    _, distance, rest = pairs_in_contact(again)
    assert len(rest) == 59 and np.abs(distance / rest - 1.0).max() < 1e-13
    with pytest.raises(sand.BadInput, match="exists; give another name"):
        write_body(path, body)
    write_body(path, body, overwrite=True)
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


@pytest.mark.compiled("small")
def test_other_programs_read_bodies(tmp_path):
    """ASE and gsd read the same number of grains, radii and positions."""
    body = bpca(20, radius=R, material=M)
    ase_io = pytest.importorskip("ase.io")
    atoms = ase_io.read(write_body(tmp_path / "a.xyz", body))
    assert atoms.positions == pytest.approx(body.position * 1e10, rel=1e-12, abs=1e-6)
    assert atoms.arrays["radius"] == pytest.approx(body.radius * 1e10, rel=1e-6, abs=0.0)
    again = tmp_path / "b.xyz"
    ase_io.write(again, atoms, format="extxyz")
    assert body_from_file(again, M).position == pytest.approx(body.position, abs=1e-17)


def test_gsd_files_of_other_programs(tmp_path):
    """Positions and diameters in a given unit, materials by the key."""
    import gsd.hoomd

    frame = gsd.hoomd.Frame()
    frame.particles.N = 2
    frame.particles.position, frame.particles.diameter = [[0, 0, 0], [0.999, 0, 0]], [1.0, 1.0]
    with gsd.hoomd.open(str(tmp_path / "two.gsd"), "w") as file:
        file.append(frame)
    body = read_body(tmp_path / "two.gsd", M, length="2 um")
    assert body.radius == pytest.approx([1e-6, 1e-6], rel=1e-6, abs=0.0) and np.ptp(
        body.position[:, 0]
    ) == pytest.approx(1.998e-6, rel=1e-6, abs=0.0)


@pytest.mark.compiled("small")
@pytest.mark.parametrize("kind", sorted(set(KINDS) - {"grain"}))
def test_the_command(tmp_path, capsys, monkeypatch, kind):
    """`sand build KIND` writes a body and reports its properties; the dimension of a chain is 1."""
    monkeypatch.chdir(tmp_path)
    assert main(["build", kind, "--grains", "64", "--out", "a.xyz", "--seed", "2", "--json"]) == 0
    output = json.loads(capsys.readouterr().out)
    assert output["grains"] == 64 and output["file"] == "a.xyz"
    body = body_from_file("a.xyz")
    assert output["radius_of_gyration"] == pytest.approx(size_of(body), rel=1e-6, abs=0.0)
    assert output["contacts"] == len(pairs_in_contact(body)[0])
    if kind == "chain":
        assert output["fractal_dimension"] == pytest.approx(1.0, abs=1e-6)
    assert main(["build", kind, "--grains", "64", "--out", "a.xyz"]) == 2
    assert "exists" in capsys.readouterr().err


@pytest.mark.compiled("contacts", "small")
def test_built_bodies_in_collide_and_run(tmp_path, capsys, monkeypatch):
    """A body from a file, one by kind and one with size laws and moments."""
    monkeypatch.chdir(tmp_path)
    laws = ["--radius", "lognormal(0.1 um, 0.2)", "--material", "silica:0.5,ice:0.5"]
    assert main(["build", "bcca", "--grains", "12", *laws, "--out", "a.xyz"]) == 0
    assert "fractal dimension" in capsys.readouterr().out
    (tmp_path / "hit.toml").write_text(
        '[target]\nkind = "file"\nfile = "a.xyz"\n[projectile]\nkind = "dla"\ngrains = 6\nradius = "0.1 um"\n'
        'moment = "1e-18 A m^2"\nmoments = "relaxed"\n[impact]\nspeed = "0.1 m/s"\n[forces.contact]\n'
    )
    from sand.experiments.collision_case import read_collision

    case = read_collision("hit.toml")
    materials = {"silica": sand.SILICA, "ice": sand.ICE}
    assert {m.name for m in case.target.build(materials, 1).materials} == {"silica", "ice"}
    assert case.projectile.build(materials, 1).moment.any()
    for name, file in (("xyz", "a.xyz"), ("gsd", "b.gsd")):
        if name == "gsd":
            write_body("b.gsd", body_from_file("a.xyz"))
        text = f'[run]\nsteps = 3\n[grains]\nkind = "file"\nfile = "{file}"\n[forces.contact]\n'
        (tmp_path / f"{name}.toml").write_text(text)
        assert main(["run", f"{name}.toml", "--json"]) == 0
        output = json.loads(capsys.readouterr().out)
        assert output["grains"] == 12


@pytest.mark.validate
@pytest.mark.parametrize(
    ("make", "few", "many", "count", "expected", "bound"),
    [(bpca, 1000, 10_000, 6, 2.9, 0.15), (bcca, 100, 1000, 100, 1.9, 0.1), (dlca, 100, 1000, 40, 1.8, 0.1)],
)
def test_dimensions_of_large_aggregates(make, few, many, count, expected, bound):
    """N ∝ r_g^D over a decade, within the known finite-size ranges."""
    found, _ = dimension(make, few, many, count)
    assert found == pytest.approx(expected, abs=bound)


@pytest.mark.compiled("small")
@pytest.mark.parametrize(
    ("given", "message"), [({"moments": "relax"}, "did you mean 'relaxed'"), ({"magnetic": 1.5}, "must not exceed 1")]
)
def test_impossible_moments_are_refused(given, message):
    """Once the grains are placed."""
    with pytest.raises(sand.BadInput, match=message):
        bpca(9, radius=R, material=M, **given)
