"""Every example runs, and its documented results are reproduced."""

import copy
import csv
import importlib.util
import math
import runpy
import sys
import warnings
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components

import sand
from sand.config.build import simulation_of
from sand.config.case import check_case, read_case
from sand.experiments.collision_case import read_collision
from sand.experiments.growth_case import read_growth
from sand.experiments.laboratory_case import read_laboratory
from sand.experiments.scattering import sampling
from sand.experiments.scattering.scatter_case import read_scattering
from sand.experiments.sweep_job import SweepJob
from sand.io.run_folder import read_toml

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda p: p.name)
def test_case_files_are_valid(path):
    """Each is read by the command named in its first comment."""
    reads = {"run": read_case, "grow": read_growth, "collide": read_collision, "scatter": read_scattering}
    reads |= {"sweep": SweepJob, "compress": partial(read_laboratory, command="compress")}
    reads |= {"elastic": partial(read_laboratory, command="elastic")}
    comment = path.read_text().split("[", 1)[0]
    command = next(word for word in reads if f"sand {word} examples/{path.name}" in comment)
    reads[command](path)


def started(name, **changes):
    """The simulation of a case file of the examples, with changes of its [run] table; it must raise no warning."""
    content = read_toml(EXAMPLES / name)
    content["run"] |= changes
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        return simulation_of(check_case(content, name), None)


@pytest.mark.compiled("contacts")
def test_silica_gas():
    """Log-normal radii: the median of ln r is that of the file to four standard errors, 4 × 1.25 × 0.25/√150."""
    gas = started("silica-gas.toml")
    assert abs(np.median(np.log(gas.grains.radius / 80e-9))) < 4.0 * 1.25 * 0.25 / math.sqrt(150)
    gas.run(steps=20)
    assert gas.ledger["total"][-1] == pytest.approx(gas.ledger["total"][0], rel=1e-6, abs=0.0)


@pytest.mark.compiled("contacts")
def test_aggregate_gas():
    """Ten clusters of sixteen grains, which remain; translation + rotation = (3/2 × 9 + 10/2) kT at the start."""
    gas = started("aggregate-gas.toml")
    gas.run(steps=20)
    kinetic = gas.ledger["translation"][0] + gas.ledger["rotation"][0]
    assert kinetic == pytest.approx((13.5 + 5.0) * 1.380649e-23 * 300.0, rel=1e-9, abs=0.0)
    assert (gas.ledger["clusters"] == 10).all() and (gas.ledger["contacts"] == 150).all()


@pytest.mark.compiled("contacts")
def test_pulled_chain(capsys):
    """The largest force printed is the pull-off force, up to the motion between two prints and the dashpots."""
    runpy.run_path(str(EXAMPLES / "pulled_chain.py"))
    *forces, closed_form = [float(line.split()[-2]) for line in capsys.readouterr().out.splitlines()]
    assert max(forces) == pytest.approx(closed_form, rel=0.02, abs=0.0) and forces[-1] < 0.5 * closed_form


@pytest.mark.validate
def test_chain_between_walls():
    """The greatest force on the fixed wall is the pull-off force 3πγR of two grains within 1 %."""
    assert runpy.run_path(str(EXAMPLES / "chain_between_walls.py"))["main"]() == pytest.approx(1.0, abs=0.01)


@pytest.mark.compiled("contacts")
def test_ramped_gamma(capsys):
    """All grains are in one cluster until the adhesion has decreased; the work of the ramp is positive."""
    runpy.run_path(str(EXAMPLES / "ramped_gamma.py"))
    rows = {line.split()[0]: [float(v) for v in line.split()[1:]] for line in capsys.readouterr().out.splitlines()[1:]}
    assert rows["clusters"][:3] == [1.0, 1.0, 1.0] and rows["clusters"][-1] > 20.0
    assert rows["lost_breaking"][-1] > 0.0 > rows["lost_outside"][-1]


@pytest.mark.validate
def test_charged_mixture():
    """A neutral mixture: 30 grains of iron with three charges, 90 of silica with one; the energy of 20 steps."""
    gas = started("charged-mixture.toml")
    charges = gas.grains.charge / 1.6e-19
    assert np.rint(charges).tolist() == [3.0] * 30 + [-1.0] * 90 and abs(charges.sum()) < 1e-9
    names = [gas.grains.materials[k].name for k in gas.grains.material]
    assert names == ["oxidised"] * 30 + ["silica"] * 90
    gas.run(steps=20)
    kinetic = gas.ledger["translation"][0]
    assert abs(np.ptp(gas.ledger["total"])) < 1e-3 * kinetic


@pytest.mark.validate
def test_figure_4(tmp_path, monkeypatch, capsys):
    """The script draws its figure and finds a T where hit-and-stick has none."""
    monkeypatch.setattr(sys, "argv", ["figure4.py", str(tmp_path / "figure4.png")])
    runpy.run_path(str(EXAMPLES / "figure4.py"), run_name="__main__")
    message = capsys.readouterr().out
    assert ": T, crossbar" in message
    assert "hit-and-stick gives: straight" in message
    assert 10_000 < (tmp_path / "figure4.png").stat().st_size < 300_000


def loaded(name):
    """A script of the examples as a module, whose names a test may replace."""
    spec = importlib.util.spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.compiled("contacts")
def test_remove_leaving_grains(tmp_path, monkeypatch, capsys):
    """The run ends when fewer than 50 of 100 grains are left; they keep their identities, also in the last frame."""
    monkeypatch.chdir(tmp_path)
    sim = loaded("remove_leaving_grains").sim
    assert "(RemoveLeaving)" in capsys.readouterr().out
    frames = sand.open("leaving").frames
    assert len(frames[0]) == 100 and len(frames[-1]) == len(sim.grains) == 49
    assert (frames[-1].id == sim.grains.id).all() and sim.grains.id[-1] > 49


ALIGNED = "no spin, aligned at the start, plane, 10 b_max"
SELECTED = (ALIGNED, "no spin, plane, 1 R_m", "no spin, sphere, 1 R_m", "spin kT/2, plane, 10 b_max")
PINNED = ("pinned by a field at 40 deg, 80 K, weight 0.2393", "pinned by a field at 18 deg, 80 K, weight 0.1185")
MEAN = "pinned by a field in any direction, 80 K"


@pytest.mark.validate
def test_cross_sections(monkeypatch, capsys):
    """The script's rows equal docs/physics/cross-sections.csv; six of them, recomputed, have these numbers.

    The requested error is 5 %; four standard errors of the difference are about 20 %.  This detects a factor 2, the row
    of another start (0.72, 0.48, 0.98 of Eq. 14) and a missing spin (a factor 3).  Moments along the line of centres
    give the central potential of Eq. 14, σ/π(2R)² = 406.  The mean over directions is Σ weight × row, to the four
    printed digits.
    """
    example = loaded("cross_sections")
    kept = {row[0]: row[1:] for row in csv.reader((EXAMPLES.parent / "docs/physics/cross-sections.csv").open())}
    rows = dict((*example.starts(), *example.spins(), *example.pinned()))
    assert ["set-up", *rows, MEAN] == list(kept)
    monkeypatch.setattr(example, "starts", lambda: [(name, rows[name]) for name in SELECTED])
    monkeypatch.setattr(example, "spins", list)
    monkeypatch.setattr(example, "pinned", lambda: [(name, rows[name]) for name in PINNED])
    example.main(0.05)
    head, *lines = csv.reader(capsys.readouterr().out.splitlines())
    made = {name: [float(number) for number in numbers if number] for name, *numbers in lines}
    assert head == ["set-up", *kept["set-up"]] and list(made) == [*SELECTED, *PINNED, MEAN]
    for name in (*SELECTED, *PINNED):
        (value, error, *_), (known, uncertain) = made[name], map(float, kept[name][:2])
        assert error < 0.051 * value, name
        assert abs(value - known) < 4.0 * math.hypot(error, uncertain), name
    assert abs(made[ALIGNED][0] - 406.0) < 4.0 * made[ALIGNED][1]
    weighted = [(float(name.split()[-1]), made[name]) for name in PINNED]
    assert made[MEAN][0] == pytest.approx(sum(w * row[0] for w, row in weighted), rel=1e-3, abs=0.0)
    assert made[MEAN][1] == pytest.approx(math.hypot(*(w * row[1] for w, row in weighted)), rel=1e-3, abs=0.0)


@pytest.mark.validate
def test_own_force(tmp_path, monkeypatch, capsys):
    """Eight grains in a trap for 20 µs, resumed with `imports`; ½ k x² at the start, and the ledger closes."""
    example = loaded("own_force")
    monkeypatch.setattr(sand.Simulation, "run", lambda sim, until: _run(sim, until="20 us"))
    example.main(str(tmp_path / "run"))
    text = capsys.readouterr().out
    assert "the requested end is reached" in text and "repulsion" in text
    run = sand.open(tmp_path / "run")
    start = 8 * 0.5 * 2e-7 * 1e-12 * (2.0**2 + 2.2**2 + 2.4**2)
    assert run.ledger["trap"][0] == pytest.approx(start, rel=1e-9, abs=0.0)
    assert abs(np.ptp(run.ledger["total"])) < 1e-3 * start
    monkeypatch.undo()
    rest = sand.resume(tmp_path / "run")  # `loaded` has imported the module, as `imports` would
    assert [force.name for force in rest.forces] == ["contact", "trap", "soft_repulsion"]


_run = sand.Simulation.run


@pytest.mark.validate
def test_growth_variants(tmp_path, monkeypatch, capsys):
    """Thirty grains for 20 ns in two boxes, at 10 K and 1000 K: S follows from contacts of the last frames.

    S = Σ s²/N of clusters found by SciPy's graphs, the mean of both boxes, in the two printed digits; some grains
    collide.  The same seed at a hundred times the temperature has ten times the speeds, to float32.  The other variants
    are valid cases that differ from growth.toml in the tables they name.
    """
    example = loaded("growth_variants")
    for name, changes in example.VARIANTS.items():
        case = example.variant(name, "1 us")
        check_case(case, name)
        assert {table for table in case if case[table] != example.CASE.get(table)} == {"run", *changes}
    small = copy.deepcopy(example.CASE)
    small["run"]["frame_every"], small["box"]["periodic"], small["grains"]["number"] = "10 ns", "0.25 um", 30
    monkeypatch.setattr(example, "CASE", small)
    words = ["growth_variants.py", "--boxes", "2", "--until", "20 ns", "--only", "cold", "--only", "hot"]
    monkeypatch.setattr(sys, "argv", [*words, "--out", str(tmp_path / "out")])
    example.main()
    rows = [row.split() for row in capsys.readouterr().out.splitlines()[1:]]
    assert [row[0] for row in rows] == ["cold", "hot"]
    speeds = []
    for name, size, *_ in rows:
        runs = [sand.open(tmp_path / "out" / name / f"seed-{seed}") for seed in (1, 2)]
        sizes = []
        for run in runs:
            pair = run.frames[-1].pair.astype(int)
            graph = csr_array((np.ones(len(pair)), (pair[:, 0], pair[:, 1])), shape=(30, 30))
            sizes.append((np.bincount(connected_components(graph, directed=False)[1]) ** 2).sum() / 30)
        assert float(size) == pytest.approx(np.mean(sizes), abs=0.0051)
        assert float(size) > 1.1
        speeds.append(runs[0].frames[0].velocity)
    assert np.abs(speeds[1] - 10.0 * speeds[0]).max() < 1e-6 * np.abs(speeds[1]).max()


@pytest.mark.validate
def test_measured_kernel(tmp_path, monkeypatch, capsys):
    """Six pairs at an error of 50 %: σv is of the order of Eq. 14 with μ ∝ N; the table of DustPy is symmetric."""
    monkeypatch.setattr(sampling, "PILOT", 4)
    monkeypatch.setattr(sys, "argv", ["measured_kernel.py", "0.5", str(tmp_path / "kernel")])
    runpy.run_path(str(EXAMPLES / "measured_kernel.py"), run_name="__main__")
    rows = [line.split() for line in capsys.readouterr().out.splitlines()[1:-1]]
    assert len(rows) == 6
    assert all(0.2 < float(row[-2]) < 1.2 for row in rows)
    table = np.loadtxt(tmp_path / "kernel.txt")
    assert np.allclose(table[1:], table[1:].T)


@pytest.mark.validate
def test_selective_coagulation(tmp_path, monkeypatch, capsys):
    """Table, figure, and the measures of a known set of clusters.

    Grains 0 to 3 are magnetic.  Clusters {0, 1, 4}, {2}, {3}, {5, 6}, {7}: S of magnetic grains (3 + 3 + 1 + 1)/4 = 2,
    of the others (3 + 2 + 2 + 1)/4 = 2; shares 2/4, 3/4; swept 1/4; two of three grains of the first are magnetic.
    """
    example = loaded("selective_coagulation")
    found = example.measure(np.arange(8) < 4, np.array([[0, 1], [1, 4], [5, 6]]))
    assert found == pytest.approx((2.0, 2.0, 0.5, 0.75, 0.25, 1.0, 1.0, 1.0, 2.0 / 3.0), rel=1e-6, abs=0.0)
    # v = sqrt(16 kT/(pi m)) relative, K = pi (2r)^2 v
    mass = 4.0 / 3.0 * math.pi * 1e-24 * sand.IRON.density
    rate = 4e-16 * math.pi * math.sqrt(16.0 * 1.380649e-21 / (math.pi * mass))
    expected = 0.5 * 40 * example.MAGNETIC_DENSITY * rate * 3e-6
    assert example.expected_contacts(40, 3e-6) == pytest.approx(expected, rel=1e-6, abs=0.0)
    monkeypatch.setattr(example, "ROWS", 2)
    out = str(tmp_path / "out")
    words = ["selective_coagulation.py", "--grains", "6", "--seeds", "2", "--until", "20 ns", "--out", out]
    monkeypatch.setattr(sys, "argv", words)
    example.main()
    assert "2 boxes of 6 + 6 grains" in capsys.readouterr().out
    rows = list(csv.DictReader(Path(f"{out}.csv").read_text().splitlines()))
    assert [float(row["time"]) for row in rows] == [0.0, 1e-8, 2e-8]
    assert float(rows[0]["size_magnetic"]) == 1.0 and float(rows[0]["share_plain"]) == 0.0
    assert 10_000 < Path(f"{out}.png").stat().st_size < 150_000


@pytest.mark.validate
def test_sweeping_nets(tmp_path, monkeypatch, capsys):
    """Table and figure; the cross-section of a single grain is π(2r)², the sphere's of 64 grains π(5r)²."""
    example = loaded("sweeping_nets")
    assert example.area_of_sphere(64) == pytest.approx(25e-16 * math.pi, rel=1e-6, abs=0.0)
    monkeypatch.setattr(example, "ROWS", 2)
    one = example.simulate(sand.setup.grain(radius=1e-8, material=sand.IRON, moment="200 A m^2/kg"), 40, 2e-9, 1)
    assert one[0, 3] == pytest.approx(4e-16 * math.pi, rel=1e-9, abs=0.0)
    out = str(tmp_path / "out")
    words = ["sweeping_nets.py", "--grains", "8", "--gas", "40", "--seeds", "2", "--until", "4 ns", "--out", out]
    monkeypatch.setattr(sys, "argv", words)
    example.main()
    assert "2 nets of 8 grains until 4 ns" in capsys.readouterr().out
    rows = list(csv.DictReader(Path(f"{out}.csv").read_text().splitlines()))
    assert len(rows) == 3 and float(rows[0]["expected"]) == 0.0 < float(rows[-1]["expected"])
    assert 10_000 < Path(f"{out}.png").stat().st_size < 150_000


@pytest.mark.validate
def test_particle_cluster(tmp_path, monkeypatch, capsys):
    """Table and figure of four grains, both ways; the statistics of encounters; exponents of straight chains.

    P(b < d) = ∫ v f(v) min(d², b̂²) dv / ∫ v f(v) b̂² dv, and the mean of v likewise, with b̂² = 3 (α/m̄v²)^(2/3) + R²
    and v f(v) ∝ v³ exp(−m̄v²/2kT), by quadrature; four standard errors of 20,000 draws are 0.014 and 1 %.
    Chains: r_g = D √((N² − 1)/12), so that ln r_g has a slope of 1.00 from 8 to 64 grains, and μ = N μ₁.
    """
    example = loaded("particle_cluster")
    grain = sand.setup.grain(radius=1e-8, material=sand.IRON, moment="200 A m^2/kg")
    size, mass, heat = example.net_moment(grain), float(grain.mass[0]), 1.380649e-21
    v = np.linspace(1e-3, 3.0, 200_000)
    reach = 3.0 * (2e-7 * 2.0 * size**2 / (0.75 * mass * v**2)) ** (2.0 / 3.0) + (8e-8) ** 2
    weight = v**3 * np.exp(-0.75 * mass * v**2 / (2.0 * heat))
    rng = np.random.default_rng(1)
    drawn = np.array([example.drawn_encounter(8e-8, (size, 2.0 * size), 0.75 * mass, rng) for _ in range(20_000)])
    for d in (1e-7, 3e-7):
        expected = (weight * np.minimum(d**2, reach)).sum() / (weight * reach).sum()
        assert (drawn[:, 1] < d).mean() == pytest.approx(expected, abs=0.014)
    assert drawn[:, 0].mean() == pytest.approx((v * weight * reach).sum() / (weight * reach).sum(), rel=0.01, abs=0.0)
    sizes = np.array([2, 4, 8, 16, 32, 64])
    chains = np.tile(2e-8 * np.sqrt((sizes**2 - 1.0) / 12.0), (3, 1))
    assert example.exponent(sizes, chains).exponent == pytest.approx(1.0036, abs=0.0005)
    assert example.exponent(sizes, np.tile(sizes * size, (3, 1))).exponent == pytest.approx(1.0, rel=1e-6, abs=0.0)
    out = str(tmp_path / "out")
    words = ["particle_cluster.py", "--grains", "4", "--repetitions", "2", "--out", out]
    monkeypatch.setattr(sys, "argv", words)
    example.main()
    text = capsys.readouterr().out
    assert text.count("unstuck 0, slipped 0") == 4 and text.count("gamma") == 2
    rows = list(csv.DictReader(Path(f"{out}.csv").read_text().splitlines()))
    assert [row["N"] for row in rows] == ["2", "4"] * 4
    # two grains in contact: r_g = D/2, with the rest distance of the contact
    distance = 2e-8 - sand.theory.contact(sand.IRON, 1e-8).rest_overlap
    assert all(float(row["r_g/r"]) == pytest.approx(0.5e8 * distance, rel=1e-3, abs=0.0) for row in rows[::2])
    assert all(1.0 < float(row["moment/moment_1"]) <= 2.0 for row in (rows[0], rows[2]))
    assert 10_000 < Path(f"{out}.png").stat().st_size < 150_000


@pytest.mark.validate
@pytest.mark.parametrize(
    "name", ["silica-gas", "charged-mixture", "aggregate-gas", "field-off", "one-cluster", "logarithmic-frames"]
)
def test_an_example_is_resumed_bit_for_bit(name, tmp_path):
    """800 steps at once, and 300 steps, a new object from the checkpoint, and 500 steps: the same state and ledger."""
    whole, first = (simulation_of(read_case(EXAMPLES / f"{name}.toml"), tmp_path / part) for part in ("whole", "parts"))
    whole.run(steps=800)
    first.run(steps=300)
    rest = sand.resume(tmp_path / "parts")
    rest.run(steps=500)
    assert rest.steps == whole.steps and rest.time == whole.time
    for key, array in whole.state.to_arrays().items():
        np.testing.assert_array_equal(array, rest.state.to_arrays()[key], err_msg=key)
    assert rest.ledger.rows[-1] == whole.ledger.rows[-1]


def test_growth_in_gas():
    """The numbers of the text of growth-in-gas.toml, to 1 %: stopping time 10 µs, n b³ = 2e-3, cut-off 12.5 b.

    growth-coasting.toml is the same but for the gas and its comments.
    """
    case = check_case(read_toml(EXAMPLES / "growth-in-gas.toml"), "case")
    gas = simulation_of(case, None)
    moment, heat = float(np.linalg.norm(gas.grains.moment[0])), 1.380649e-23 * 100.0
    b = math.sqrt(3.0) * (2e-7 * moment**2 / heat) ** (1.0 / 3.0)
    friction = next(force for force in gas.forces if force.name == "gas")
    dipoles = next(force for force in gas.forces if force.name == "dipoles")
    assert friction.shortest_time(gas.grains) == pytest.approx(1e-5, rel=0.01, abs=0.0)
    assert 300 * b**3 / 17e-6**3 == pytest.approx(2e-3, rel=0.01, abs=0.0)
    assert dipoles.cutoff / b == pytest.approx(12.5, rel=0.01, abs=0.0)
    told, coasting = (read_toml(EXAMPLES / f"growth-{name}.toml") for name in ("in-gas", "coasting"))
    del told["forces"]["gas"]
    assert told == coasting


def test_capture_rates():
    """Rates of pairs by Eq. 14, and touches between two frames.

    ⟨σv⟩ of unequal clusters is that of `kinetics.capture`, to the digits of μ0/4π (1e-9).
    """
    example = runpy.run_path(str(EXAMPLES / "capture_rates.py"))
    m, mu, volume = 3.3e-20, 6.6e-18, 1e-15
    kernel = sand.theory.kinetics.capture(
        "10 nm", m, mu, "100 K", exponent=1.0, reading="aligned", speed="thermal", c=1.0
    )
    sizes = np.array([1.0, 3.0, 1.0, 5.0])
    found = example["expected_rates"](mu * sizes, m * sizes, sizes == 1.0, volume)
    pairs = [[(1, 1)], [(1, 3), (1, 5), (3, 1), (1, 5)], [(3, 5)]]
    expected = [sum(kernel(a * m, b * m) for a, b in kind) / volume for kind in pairs]
    assert found == pytest.approx(expected, rel=1e-8, abs=0.0)
    before = np.array([0, 1, 2, 2, 3, 4, 5, 5, 6])  # a pair and two grains join, the smallest first
    after = np.array([0, 0, 1, 1, 1, 1, 2, 2, 2])
    assert example["touches"](before, after).tolist() == [2.0, 1.0, 1.0]


def test_thermal_capture():
    """Cross-sections of Eq. 14 give c = 1; c ∝ v² gives its mean over Maxwell's distribution with the weight v^(-1/3).

    ⟨c⟩ of c = a m̄v²/2k_BT = a x is a Γ(7/3)/Γ(4/3) = 4a/3, which Gauss–Laguerre quadrature gives to rounding.
    """
    example = runpy.run_path(str(EXAMPLES / "thermal_capture.py"))
    mean_rate = example["mean_rate"]
    spread = math.sqrt(1.380649e-23 * 100.0 / example["REDUCED"])

    class Found:
        c_error = 0.0

        def __init__(self, c):
            self.c = c

    for law, mean in ((lambda v: 1.0, 1.0), (lambda v: 0.1 * 0.5 * (v / spread) ** 2, 0.1 * 4.0 / 3.0)):
        mean_rate.__globals__["cross_section"] = lambda law=law, **options: Found(law(options["speed"]))
        c, error, rate, rows = mean_rate(100.0, 150.0, 0.02)
        assert c == pytest.approx(mean, rel=1e-12, abs=0.0) and error == 0.0 and len(rows) == 6
    kernel = sand.theory.kinetics.capture(
        "10 nm", example["MASS"], 200 * example["MASS"], "100 K", reading="aligned", speed="thermal"
    )
    assert rate / c == pytest.approx(kernel(example["MASS"], example["MASS"]), rel=1e-9, abs=0.0)


def test_c_of_a_class_is_that_of_all_its_hits():
    """c = Σ hits/Σ expected over populations, also where one of them expected little, with a jackknife over them.

    With c_k of all but one population each, the interval is t √(3/4 Σ(c_k − ⟨c_k⟩)²) wide on both sides, t = 3.182 of
    three degrees of freedom; N of the class is Σ N expected/Σ expected. 30 hits at least. The mean of ratios is 1.5.
    """
    example = loaded("dilute_answers")
    hits, expected, larger = np.array([9.0, 1.0, 12.0, 9.0]), np.array([30.0, 0.2, 30.0, 31.0]), np.arange(3.0, 7.0)
    rows = []
    for k in range(4):
        none = {f"{name}_{least}": 0.0 for name in example.SUMS for least in example.CLASSES[:-1]}
        rows.append(none | {"hits_5": hits[k], "expected_5": expected[k], "larger_5": larger[k]})
        rows[k] |= {"hits_9": 7.0, "expected_9": 20.0, "larger_9": 12.0}
    found = example.intervals(rows)
    without = np.array([np.delete(hits, k).sum() / np.delete(expected, k).sum() for k in range(4)])
    half = 3.182446 * math.sqrt(0.75 * ((without - without.mean()) ** 2).sum())
    c, number = found["c_5"]
    assert c == pytest.approx((31.0 / 91.2, 31.0 / 91.2 - half, 31.0 / 91.2 + half), rel=1e-6, abs=0.0) and number == 4
    assert found["larger_5"][0].value == pytest.approx((larger * expected).sum() / 91.2, rel=1e-12, abs=0.0)
    assert "c_9" not in found and "c_1" not in found and "larger_9" not in found
    assert found["c"][0].value == pytest.approx(59.0 / 171.2, rel=1e-12, abs=0.0)


@pytest.mark.validate
def test_dilute_answers(tmp_path, monkeypatch, capsys):
    """Tables of two populations of two cases; nothing is computed twice; shares of a known mixture.

    Grains 0 to 3 are magnetic.  Clusters {0, 1, 4}, {2}, {3}, {5, 6}, {7}: 2 of 4 magnetic grains and 3 of 4 others are
    in aggregates, which have 2 magnetic grains of 5; of those with two magnetic ones 2 of 3.  Of the half magnetic dust
    magnetic grains are in aggregates, K of the others being 50 times smaller.
    """
    example = loaded("dilute_answers")
    found = example.shares(np.arange(8) < 4, np.array([0, 0, 1, 2, 0, 3, 3, 4]))
    assert list(found.values()) == pytest.approx([0.5, 0.75, 0.4, 2.0 / 3.0], rel=1e-12, abs=0.0)
    words = ["dilute_answers.py", "--cases", "magnetic", "half", "--hits", "stick", "--seeds", "1", "2"]
    words += ["--grains", "200", "--until", "3", "--out", str(tmp_path / "out")]
    monkeypatch.setattr(sys, "argv", words)
    example.main()
    assert "half, stick, seed 2: S = 3" in capsys.readouterr().out
    table = (tmp_path / "out" / "half.csv").read_text("utf-8")
    rows = list(csv.DictReader(table.splitlines()))
    assert [row["seed"] for row in rows] == ["1", "2"] and all(float(row["purity"]) > 0.8 for row in rows)
    assert all(float(row["t_2"]) < float(row["t_3"]) and row["t_8"] == "" for row in rows)
    example.main()
    assert "seed" not in capsys.readouterr().out and (tmp_path / "out" / "half.csv").read_text("utf-8") == table
    answers = list(csv.DictReader((tmp_path / "out" / "answers.csv").read_text("utf-8").splitlines()))
    mean = next(float(row["value"]) for row in answers if (row["case"], row["quantity"]) == ("half", "t_2"))
    assert mean == pytest.approx(np.mean([float(row["t_2"]) for row in rows]), rel=1e-4, abs=0.0)
    assert all((tmp_path / "out" / f"{name}.png").stat().st_size > 10_000 for name in ("sizes", "shapes", "kernel"))
