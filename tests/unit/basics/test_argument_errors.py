"""Wrong arguments in scripts: each raises BadInput with one line that says what to write. Nothing is compiled."""

import operator
import pickle
import sys
import warnings
from types import SimpleNamespace

import numpy as np
import pint
import pytest

import sand
from sand.basics.quantity_array import QuantityArray
from sand.config.case import check_case
from sand.io.bodies import write_body
from sand.io.run_folder import LEDGER, TRAJECTORY
from sand.io.trajectory import read_frames
from sand.simulation.contact_table import ContactTable


@pytest.fixture(scope="module")
def namespace(tmp_path_factory):
    """Names that the expressions may use: two grains, a simulation before its first step, an empty table."""
    x = [[0, 0, 0], [3e-8, 0, 0]]
    grains = sand.Grains(x, 1e-8, "silica")
    run = tmp_path_factory.mktemp("run")
    write_body(run / "body.gsd", grains)
    (run / "body.gsd").rename(run / TRAJECTORY)
    body = read_frames(run / TRAJECTORY)[0]
    (run / LEDGER).write_text("step,total\n0,1.0\n")
    table = ContactTable.__new__(ContactTable)
    table.update({"pair": np.zeros((0, 2), int), "overlap": np.zeros(0)})
    return {
        "sand": sand,
        "np": np,
        "x": x,
        "iron": {"radius": "10 nm", "material": "iron"},
        "grains": grains,
        "sim": sand.Simulation(grains, [sand.Contact()]),
        "table": table,
        "frame": SimpleNamespace(radius=np.ones(2), pair=np.zeros((0, 2), int)),
        "run": str(run),
        "body": body,
    }


ARGUMENTS = [
    ("sand.Grains(x, '10 nm', 'iron', velocties=[0, 0, 1])", "no argument 'velocties'; did you mean 'velocity'?"),
    ("sand.Grains(x, material='iron')", "Grains: radius is missing"),
    ("sand.Grains(x, 1e-8)", "Grains: material is missing"),
    ("sand.Grains(x, 1e-8, 'iron', [0, 0, 1])", "takes 3 arguments without a name (position, radius, material), not 4"),
    ("sand.Grains(x, 1e-8, 7)", "material = 7; give a sand.Material or the name of a preset"),
    ("sand.Grains(x, 1e-8, None)", "material = None; give a sand.Material or the name of a preset"),
    ("sand.Grains(x, 1e-8, 'irn')", "unknown material 'irn'; did you mean 'iron'?"),
    ("sand.Grains(None, 1e-8, 'iron')", "position must be an array of shape (N, 3)"),
    ("sand.Grains(x, None, 'iron')", "radius = None is not a quantity in m"),
    (
        "sand.Grains(x, 1e-8, 'iron', velocity='5 m/s')",
        "velocity has shape () but must be (2, 3) for 2 grains, or three numbers for all",
    ),
    ("sand.Grains(x, 1e-8, 'iron', velocity=[0, 1])", "velocity has shape (2,) but must be (2, 3)"),
    ("sand.Grains(x, 1e-8, 'iron', moment=[0, 0])", "moment has shape (2,) but must be (2, 3)"),
    ("sand.Grains(x, 1e-8, 'iron', moment=np.array(['a', 'b']))", "moment = array of shape (2,)"),
    ("sand.Grains(x, 1e-8, 'iron', own={'surface heat': '1 J'})", "such as 'surface_heat'"),
    ("sand.Grains(x, 1e-8, 'iron', own={'heat': '25 degC'})", "write '298.15 K' for 25 degC"),
    ("grains.with_own({'radius': 1.0})", "own: 'radius' has a meaning in SAND already"),
    ("sand.Material('dust', 1000.0, 0.1, 1e9)", "Material: poisson_ratio is missing"),
    ("sand.Material(7, 1000.0, 0.1, 1e9, 0.2)", "name = 7 must be text"),
    ("sand.Material('dust', 1000.0, 0.1, 1e9, 0.2, density_=3)", "no argument 'density_'; did you mean 'density'?"),
    ("sand.IRON.but(densty=3)", "a material has no 'densty'; did you mean 'density'?"),
    ("sand.Box.periodic()", "Box.periodic: x is missing"),
    ("sand.Box.periodic(lenght='1 um')", "Box.periodic: there is no argument 'lenght'"),
    ("sand.Box('1 um')", "lengths = '1 um' must be lengths in m or None; see sand.Box.periodic"),
    ("sand.Box.periodic(sand.Box.open())", "is not a quantity in m"),
    ("sand.Contact(slip=np.array([1.0, 2.0]))", "slip = array of shape (2,) must be text"),
    ("sand.Contact(stifness='dt97')", "no argument 'stifness'; did you mean 'stiffness'?"),
    ("sand.Contact(None)", "contact: slip = None; allowed: clamp, reset"),
    ("sand.Dipoles(cutoff=np.array([1e-7, 2e-7]))", "dipoles: cutoff = array of shape (2,) is not a quantity in m"),
    ("sand.Dipoles(cut_off='1 um')", "no argument 'cut_off'; did you mean 'cutoff'?"),
    ("sand.Field()", "Field: flux_density is missing"),
    ("sand.Field(flux='1 mT')", "no argument 'flux'"),
    ("sand.Field('1 mT', shape=None)", "field: shape = None; allowed: constant"),
    ("sand.Gas()", "Gas: temperature is missing"),
    ("sand.Gas('100 K', density=1e-6, brownian='no')", "brownian = 'no' must be true or false"),
    ("sand.Gravity()", "Gravity: acceleration is missing"),
    ("sand.ElectricField(field='1 V/m')", "no argument 'field'"),
    ("sand.Verlet(step=np.array([1e-9, 2e-9]))", "stepping: step = array of shape (2,) is not a quantity in s"),
    ("sand.Verlet(dt='1 ns')", "there is no argument 'dt'"),
    ("sand.RigidClusters(vibration=np.ones(2))", "vibration = array of shape (2,) is not a number"),
    ("sand.Neighbours(margin=np.ones(2))", "margin = array of shape (2,) is not a quantity"),
    ("sand.Neighbours(search=np.ones(2))", "search = array of shape (2,) must be text"),
    ("sand.set_threads(threads=2)", "set_threads: there is no argument 'threads'"),
    ("sand.set_threads([2])", "number = [2] must be a whole number"),
]

SIMULATIONS = [
    ("sand.Simulation()", "Simulation: grains is missing"),
    ("sand.Simulation(grains, froces=[])", "no argument 'froces'; did you mean 'forces'?"),
    ("sand.Simulation(sand.Grains)", "grains = sand.Grains is a class"),
    ("sand.Simulation(grains, [sand.Contact])", "sand.Contact is a class; write sand.Contact()"),
    ("sand.Simulation(grains, sand.Contact)", "sand.Contact is a class; write sand.Contact()"),
    ("sand.Simulation(grains, 'contact')", "forces = 'contact'; give a list such as [sand.Contact()]"),
    ("sand.Simulation(grains, 7)", "forces = 7; give a list such as [sand.Contact()]"),
    ("sand.Simulation(grains, ['contact'])", "'contact' is not a force"),
    (
        "sand.Simulation(grains, stepping='verlet')",
        "stepping = 'verlet'; give sand.Verlet(…) or sand.RigidClusters(…)",
    ),
    ("sand.Simulation(grains, stepping=sand.Verlet)", "stepping = sand.Verlet is a class; write sand.Verlet(…)"),
    ("sand.Simulation(grains, neighbours='cells')", "neighbours = 'cells'; give sand.Neighbours(…)"),
    ("sand.Simulation(grains, box='big')", "box length x = 'big' is not a quantity in m"),
    ("sand.Simulation(grains, seed='a')", "seed = 'a' must be a whole number"),
    ("sand.Simulation(grains, seed=-1)", "seed = -1 must be a whole number of at least 0"),
    ("sand.Simulation(grains, seed=2**63)", "must be a whole number of at least 0, below 2**63"),
    ("sand.Simulation(grains, out=7)", "out = 7 must be a path"),
    ("sand.Simulation(grains, observers=7)", "observers = 7 must be a list"),
    ("sand.Simulation(grains, observers=[7])", "observers: 7 is not a sand.Observer"),
    ("sand.Simulation(grains, observers=[sand.Observer])", "sand.Observer is a class; write sand.Observer()"),
    ("sand.Simulation(grains, observers=sand.Observer())", "must be a list"),
    ("sand.Simulation(grains, contacts=[[0, 1]])", "contacts = [[0, 1]]; give sand.setup.StrainedContacts(…)"),
    ("sand.Simulation(grains, frame_every='often')", "frame_every = 'often' is not a quantity in s"),
    ("sand.Simulation(grains, row_every='1 s wall')", "wall time is for checkpoint_every only"),
    ("sim.run(stop='clustrs == 1')", "unknown quantity 'clustrs'; did you mean 'clusters'?"),
    ("sim.run('5 us', 100)", "takes 1 argument without a name (until), not 2"),
    ("sim.run(untill='5 us')", "no argument 'untill'; did you mean 'until'?"),
    ("sim.run(steps='10')", "steps = '10' must be a whole number"),
    ("sim.view(7)", "path = 7 must be a path"),
    ("sim.ledger['energi']", "there is no column 'energi'; allowed"),
    ("sim.ledger['totl']", "there is no column 'totl'; did you mean 'total'?"),
    ("sim.ledger[3]", "there is no column 3"),
    ("table['overlp']", "there is no column 'overlp'; did you mean 'overlap'?"),
    ("grains.velocty", "grains have no 'velocty'; did you mean 'velocity'?"),
    ("sim.grain", "a simulation has no 'grain'; did you mean 'grains'?"),
    ("sand.Simulaton", "module 'sand' has no 'Simulaton'; did you mean 'Simulation'?"),
    ("sand.experiments.scatering", "has no 'scatering'; did you mean 'scattering'?"),
    ("sand.resume(None)", "folder = None must be a path"),
    ("sand.resume('nowhere', frces=[])", "there is no folder nowhere"),
    ("sand.open(None)", "folder = None must be a path"),
    ("sand.open()", "folder is missing"),
    ("sand.open(run, 3)", "folder = 3 must be a path"),
    ("sand.open('nowhere-*')", "no folder has a name like nowhere-*"),
    ("sand.open(run).arrays('speed')", "frames have no array 'speed'"),
    ("sand.open(run).frames.speed", "frames have no 'speed'"),
    ("sand.open(run).ledger['totl']", "there is no column 'totl'; did you mean 'total'?"),
    ("sand.open(run).frames[10**6]", "there is no 1000000"),
    ("sand.open(run).frames['last']", "frame 'last' must be a whole number"),
    ("sand.open(run).contacts('last')", "frame = 'last' must be a whole number"),
    ("sand.open(run).at('last')", "frame = 'last' must be a whole number"),
    ("sand.open(run).export(7)", "form = 7 must be text"),
    ("sand.open(run).picture(color='speed')", "no argument 'color'; did you mean 'colour'?"),
    ("sand.open(run).picture(size=7)", "size = 7 must be two whole numbers"),
    ("sand.open(run).picture(colour=np.ones(2))", "colour = array of shape (2,) must be text"),
    ("sand.open(run).flux_density('now')", "time = 'now' is not a quantity in s"),
]

SETUPS = [
    ("sand.setup.gas(10, '1 um', raduis='10 nm', material='iron')", "did you mean 'radius'?"),
    ("sand.setup.gas(10, '1 um', material='iron')", "gas: radius is missing"),
    ("sand.setup.gas('1 um', 10, **iron)", "number = '1 um' must be a whole number"),
    ("sand.setup.gas(10, None, **iron)", "a gas needs a box that is periodic"),
    ("sand.setup.gas(10**30, '1 um', **iron)", "must be a whole number from 1 to 1e+08"),
    ("sand.setup.gas(10, '1 um', spins=np.ones(3), **iron)", "spins = array of shape (3,) must be text"),
    ("sand.setup.gas(10, '1 um', seed='a', **iron)", "seed = 'a' must be a whole number"),
    ("sand.setup.gas(10, '1 um', temperature=None, **iron)", "temperature = None is not a quantity in K"),
    (
        "sand.setup.build('silica', 10, radius='10 nm', material='silica')",
        "kind = 'silica'; a material; allowed: grain, chain",
    ),
    ("sand.setup.build('bpac', 10, **iron)", "kind = 'bpac'; did you mean 'bpca'?"),
    ("sand.setup.build(10, **iron)", "kind = 10 must be text"),
    ("sand.setup.build('bpca', 10, radus='10 nm', material='iron')", "did you mean 'radius'?"),
    ("sand.setup.build('lattice', shape=5, **iron)", "shape = 5 must be a list"),
    (
        "sand.setup.build('lattice', shape=[5, 5], **iron)",
        "shape = [5, 5] must be three whole numbers, such as [5, 5, 5]",
    ),
    ("sand.setup.bpca(10**30, **iron)", "must be a whole number from 1 to 1e+08"),
    ("sand.setup.bpca(10, '10 nm', 'iron')", "takes 1 argument without a name (grains), not 3"),
    ("sand.setup.chain(3, radius='10 nm', material=7)", "material = 7; give a sand.Material"),
    ("sand.setup.chain(3, moments=np.ones(3), **iron)", "moments = array of shape (3,) must be text"),
    (
        "sand.setup.chain(3, radius='10 nm', material=['iron', None, 'ice'])",
        "material of grain 1 = None; give a sand.Material",
    ),
    ("sand.setup.lattice(10**10, **iron)", "from 1 to 1e+08"),
    ("sand.setup.lattice(10**4, **iron)", "10000 x 10000 x 10000 is too large: at most 1e+08 grains"),
    ("sand.setup.Lognormal('10 nm')", "Lognormal: sigma is missing"),
    ("sand.setup.PowerLaw(-3.5, '1 nm', max='2 nm')", "there is no argument 'max'"),
    ("sand.setup.encounter(grains, 7, speed=1)", "projectile = 7; give sand.Grains(…)"),
    ("sand.setup.encounter(grains, grains)", "encounter: speed is missing"),
    ("sand.setup.encounter(grains, grains, speed=1, along=None)", "along = None must be 'x', 'y', 'z'"),
    ("sand.setup.turned_at_random(grains, 7)", "rng = 7; give numpy.random.default_rng(seed)"),
    ("sand.setup.from_frame(7, {})", "frame = 7; give a frame"),
    ("sand.setup.magnetic_energy(x)", "body = [[0, 0, 0], [3e-08, 0, 0]]; give sand.Grains(…)"),
    ("sand.setup.in_space_order(x)", "give sand.Grains(…)"),
]

EXPERIMENTS = [
    ("sand.experiments.collision.collide(grains, 7, speed=1)", "projectile = 7; give sand.Grains(…)"),
    ("sand.experiments.collision.collide(grains, grains)", "collide: speed is missing"),
    ("sand.experiments.collision.collide(grains, grains, velocity=1)", "no argument 'velocity'"),
    ("sand.experiments.collision.collide_many(7, [1])", "build = 7 must be a function"),
    ("sand.experiments.collision.collide_many(lambda s: (grains, grains), 7, speed=1)", "seeds = 7 must be a list"),
    ("sand.experiments.collision.collide_many(lambda s: s, [1], 4)", "executor = 4"),
    ("sand.experiments.scattering.cross_section('10 nm', 7, speed=1)", "material = 7; give a sand.Material"),
    ("sand.experiments.scattering.cross_section('10 nm', 'iron', sped=1)", "did you mean 'speed'?"),
    ("sand.experiments.scattering.cross_section('10 nm', 'iron', speed=1, seed='a')", "seed = 'a'"),
    ("sand.experiments.scattering.measure(7)", "setup = 7; give"),
    ("sand.experiments.scattering.probability_map(7)", "flights = 7 must be a list"),
    ("sand.experiments.kernel_table.on_grid(7, [1.0])", "kernel = 7 must be a function"),
    ("sand.theory.contact(7, '10 nm')", "material = 7; give a sand.Material"),
    ("sand.theory.contact('iron')", "contact: radius is missing"),
    ("sand.theory.contact('iron', '10 nm', mixing=np.ones(2))", "mixing = array of shape (2,) must be text"),
    ("sand.theory.coupling('1e-18 A m^2', '20 nm')", "coupling: temperature is missing"),
    ("sand.theory.capture_radius(momnt1=1)", "did you mean 'moment1'?"),
    ("sand.theory.growth_exponents(reading=np.ones(2))", "reading = array of shape (2,) must be text"),
    ("sand.theory.kinetics.capture('10 nm', 1e-20, 1e-18, 100, speed=np.ones(2))", "must be text"),
    ("sand.theory.kinetics.constant(1.0)('a', 'b')", "mass = 'a' is not a quantity in kg"),
    ("sand.theory.smoluchowski.coagulate(7, [1, 2], 1.0, [1.0], mass=1.0)", "kernel = 7 must be a function"),
    ("sand.theory.smoluchowski.coagulate(max, 7, 1.0, [1.0], mass=1.0)", "sizes = 7 must be an array of numbers"),
    ("sand.analysis.clusters.cluster_labels('2', [])", "count = '2' must be a whole number"),
    ("sand.analysis.clusters.cluster_labels(2, [[0, 5]])", "pairs name grains from 0 to 5; there are 2"),
    ("sand.analysis.clusters.cluster_labels(2, 'ab')", "pairs = 'ab' must be an array of numbers"),
    ("sand.analysis.shape.gyration_radius('abc')", "position = 'abc' must be an array of numbers"),
    ("sand.analysis.shape.gyration_radius(x, [1.0])", "mass must have one entry for each of 2 grains"),
    ("sand.analysis.fits.power_law('a', [1, 2])", "x = 'a' must be an array of numbers"),
    ("sand.analysis.fits.power_law([1, 2], [1, 2], groups=[1])", "groups must have one entry for each"),
    ("sand.analysis.quantities.measured(frame, np.ones(2))", "name = array of shape (2,) must be text"),
    ("sand.analysis.frame_statistics.aggregate_statistics(7)", "frame = 7; give a frame"),
    ("sand.analysis.internal_motion.internal_kinetic_energy(None, [], sand.Box.open())", "grains = None; give a frame"),
    ("sand.analysis.quantities.quantity('radius', frame=sand.Grains)", "frame = sand.Grains; give a frame"),
    ("sand.analysis.fits.jackknife(None, [1.0, 2.0])", "estimate = None is not a number"),
    ("sand.analysis.fits.jackknife((1, 2, 3), [1.0, 2.0])", "estimate = (1, 2, 3) must be one number"),
    (
        "sand.analysis.fractal.ensemble_dimension([5, 20], [1, 3], 1.0, least=10**5000)",
        "least = <int> is a whole number",
    ),
    ("sand.analysis.clusters.percolating_clusters(x, [[1], [2]], sand.Box.open())", "pairs"),
    (
        "sand.theory.growth.aggregate_moment('1 A m^2', 10, exponent=1e30)",
        "exponent = 1e+30 must be at least 0 and at most 1",
    ),
    (
        "sand.theory.smoluchowski.log_sizes(100, per_decade=1e30)",
        "per_decade = 1e+30 must be at least 4 and at most 3000",
    ),
    ("sand.setup.gas(5, '1 um', classes=np.zeros((1, 3)), **iron)", "classes.0 = array of shape (3,); give a table"),
    ("sand.setup.aggregates.rest_distance('iron', 0)", "radius = 0.0 must be above 0 m"),
    ("sand.setup.turned(grains, 7)", "rotation = 7; give a scipy.spatial.transform.Rotation"),
    ("sand.setup.from_frame(body, materials={1: 2})", "unknown material 'silica'"),
    ("sand.setup.from_frame(body, materials={'silica': 2})", "material = 2; give a sand.Material"),
    ("sim.run(until=sand.Grains)", "until = sand.Grains is not a quantity in s"),
    ("sim.run(stop=sand.Grains)", "stop = sand.Grains is not a condition"),
    ("sim.ledger[{}]", "there is no column {}"),
    ("sand.plotting.render.still.still_picture(body, view=[[1, 2], [3]])", "three finite numbers, not all 0"),
    ("sand.plotting.render.still.still_picture(body, field={1: 2})", "field = {1: 2} is not a quantity in T"),
    ("sand.plotting.render.still.still_picture(body, size=['a', 300])", "size 'a'x300: width and height"),
]

SLIPS = [*ARGUMENTS, *SIMULATIONS, *SETUPS, *EXPERIMENTS]


@pytest.mark.parametrize(("slip", "line"), SLIPS, ids=[slip for slip, _ in SLIPS])
def test_a_wrong_argument_gives_one_line(namespace, slip, line):
    """BadInput with one line: what is wrong or what to write instead."""
    with warnings.catch_warnings(), pytest.raises(sand.BadInput) as caught:
        warnings.simplefilter("ignore")
        eval(slip, dict(namespace))
    assert line in str(caught.value)
    assert "\n" not in str(caught.value)


LONG, REGISTRY = "x" * 5000, pint.UnitRegistry()


@pytest.mark.parametrize(
    "make",
    [
        lambda: sand.Grains([[0, 0, 0]], 1e-8, LONG),
        lambda: sand.Grains([[0, 0, 0]], 1e-8, "iron", **{LONG: 1}),
        lambda: sand.Contact(slip="a b " * 2000),
        lambda: getattr(sand, LONG),
        lambda: check_case({"run": {"until": LONG, "stop": LONG}, LONG: {}, "grains": {"material": LONG}}, "case"),
    ],
)
def test_long_values_are_shortened(make):
    """Values of thousands of characters lose their middle in messages; the end of the message stays."""
    with pytest.raises(sand.BadInput) as caught:
        make()
    assert all(len(problem) <= 1500 and not problem.endswith("…") for problem in caught.value.problems)
    path = "/" + "folder/" * 40 + "file.toml"
    assert path in str(sand.BadInput(f"there is no file {path}"))


def test_many_wrong_entries_are_counted():
    """Of thousands of wrong entries of a list the first hundred are described."""
    with pytest.raises(sand.BadInput) as caught:
        sand.Driven(["x"] * 5000)
    assert len(caught.value.problems) == 101 and caught.value.problems[-1] == "… and 4900 more errors"


@pytest.mark.parametrize("value", [np.full((2, 3), 1.0) * REGISTRY.Unit("cm/s"), "1 cm/s"])
def test_what_numpy_writes_into_a_change_keeps_its_unit(value):
    """Functions of NumPy that write into an array of a change convert text and quantities, or refuse them."""
    everywhere = np.ones((2, 3), bool)
    writers = [
        lambda array, value: np.copyto(array, value),
        lambda array, value: np.copyto(dst=array, src=value),
        lambda array, value: np.putmask(array, everywhere, value),
        lambda array, value: np.place(array, everywhere, value),
        lambda array, value: np.put(array, range(6), value),
        lambda array, value: array.put(range(6), value),
        lambda array, value: operator.iadd(array, value),
        lambda array, value: operator.isub(array, f"-{value}" if isinstance(value, str) else -value),
    ]
    for write in writers:
        array = QuantityArray(np.zeros((2, 3)), "m/s", "velocity")
        write(array, value)
        assert np.asarray(array) == pytest.approx(np.full((2, 3), 0.01), rel=1e-15, abs=0.0)
        with pytest.raises(sand.BadInput, match=r"velocity = .* is not a quantity in m/s"):
            write(array, "1 m" if isinstance(value, str) else value * REGISTRY.s)
    array.fill("2 mm/s")
    np.copyto(plain := np.zeros((2, 3)), array)
    assert (plain == 2e-3).all()
    array += [1.0, 2.0, 3.0]
    assert array[0].tolist() == [1.002, 2.002, 3.002]


@pytest.mark.parametrize(
    ("slip", "package"),
    [("table.to_pandas()", "pandas"), ("table.to_xarray()", "xarray"), ("sand.open(run).to_pandas()", "pandas")],
)
def test_missing_optional_package_is_named(namespace, monkeypatch, slip, package):
    """The line names the package to install."""
    monkeypatch.setitem(sys.modules, package, None)  # importing it fails
    with pytest.raises(sand.BadInput, match=f"needs {package}, which is not installed: pip install {package}"):
        eval(slip, dict(namespace))


def test_membership_and_get_of_tables(namespace):
    """`in` and `get` work as for any mapping, `hasattr` for grains and simulations."""
    assert "overlp" not in namespace["table"] and namespace["table"].get("overlp") is None
    assert not hasattr(namespace["grains"], "velocty") and not hasattr(namespace["sim"], "grain")


def test_all_wrong_settings_are_reported_together():
    """Types and ranges, one line each."""
    with pytest.raises(sand.BadInput) as caught:
        sand.Contact(slip=3, slide_factor=-1.0, roll_factor="x")
    assert len(caught.value.problems) == 3
    with pytest.raises(sand.BadInput) as caught:
        sand.RigidClusters(step_fraction=-1.0, contact_stepping="verlet")
    assert len(caught.value.problems) == 2
    with pytest.raises(sand.BadInput) as caught:
        sand.Grains([[0, 0, 0]], 1e-8, "iron", velocty=1, spim=2)
    assert [line.split(";")[1] for line in caught.value.problems] == [
        " did you mean 'velocity'?",
        " did you mean 'spin'?",
    ]
    again = pickle.loads(pickle.dumps(caught.value))  # as a worker process sends it
    assert again.problems == caught.value.problems and str(again) == str(caught.value)
