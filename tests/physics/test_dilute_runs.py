"""Populations of dilute dust as runs: files, interruption, results, and what is refused."""

import math
import types
from pathlib import Path

import numpy as np
import pytest

import sand
from sand.analysis.clusters import cluster_labels
from sand.basics.errors import BadInput
from sand.cli.main import main
from sand.experiments import dilute_encounters, dilute_files, dilute_flight, dilute_growth, dilute_state
from sand.experiments.dilute_encounters import RECENT
from sand.experiments.dilute_kernel import kernel_of
from sand.experiments.growth import growth_of, read_box
from sand.experiments.kernel_table import measured
from sand.io.run_folder import read_json, read_toml, write_toml

pytestmark = pytest.mark.compiled("scattering", "dipoles")
EXAMPLE = Path(__file__).parents[2] / "examples" / "dilute-growth.toml"
FORCES = [sand.Contact(damping="critical", damping_ratio=0.2, settling_time="5 ns"), sand.Dipoles()]
NUMBERS = {"number_density": "3e8 /m^3", "temperature": "100 K"}
STOP = "mean_cluster_size >= 3"


def grains(number=100, **other):
    """Magnetic iron grains, whose positions do not matter."""
    return sand.Grains(np.zeros((number, 3)), "10 nm", "iron", **{"moment": "200 A m^2/kg", **other})


def files_of(folder):
    """Bytes of the files of a population, without those that hold times of the machine."""
    return {name: (folder / name).read_bytes() for name in ("ledger.csv", "encounters.csv", "aggregates.csv")}


class Stopped(Exception):
    """Raised by `Stopper`."""


class Stopper:
    """An observer that interrupts after some hits."""

    def __init__(self, hits):
        self.left = hits

    def see(self, simulation, row):
        """Count down."""
        self.left -= 1
        if self.left == 0:
            raise Stopped


@pytest.fixture(scope="module")
def population(tmp_path_factory):
    """A finished population, resolved."""
    return dilute_growth.grow(
        grains(), FORCES, **NUMBERS, stop=STOP, seed=3, out=tmp_path_factory.mktemp("dilute") / "one"
    )


@pytest.mark.parametrize("checkpoint_every", [0.0, 1e9])
@pytest.mark.parametrize("hits", [1, 23])
def test_a_population_that_is_killed_ends_with_the_same_bits(population, tmp_path, monkeypatch, checkpoint_every, hits):
    """Stopped after some hits, with a checkpoint after each or only at the start, it continues to equal files."""
    monkeypatch.setattr(dilute_files, "CHECKPOINT_EVERY", checkpoint_every)
    place = tmp_path / "killed"
    with pytest.raises(Stopped):
        dilute_growth.grow(grains(), FORCES, **NUMBERS, stop=STOP, seed=3, out=place, observers=[Stopper(hits)])
    dilute_growth.grow(grains(), FORCES, **NUMBERS, stop=STOP, seed=3, out=place)
    assert files_of(place) == files_of(population.folder)


@pytest.mark.parametrize("between", ["thermal", "own"])
def test_observers_see_hits_and_every_thousandth_draw(monkeypatch, tmp_path, between):
    """Every fifth draw: flights = 5, 10, … and those of hits, with the columns of the ledger, which has hits only."""
    monkeypatch.setattr(dilute_growth, "SEEN_EVERY", 5)
    seen = []
    observer = types.SimpleNamespace(see=lambda simulation, row: seen.append(row))
    how = {**NUMBERS, "stop": "mean_cluster_size >= 1.5", "seed": 3, "hits": "stick", "between": between}
    grown = dilute_growth.grow(grains(), FORCES, **how, out=tmp_path / "one", observers=[observer])
    hits = np.cumsum(grown.encounters["end"] == 0)
    expected = [(k, n) for k, n in enumerate(hits, 1) if k % 5 == 0 or grown.encounters["end"][k - 1] == 0]
    assert [(row["flights"], row["hits"]) for row in seen] == expected
    assert len(seen) > hits[-1] == len(grown.ledger["time"]) - 1
    assert {tuple(row) for row in seen} == {tuple(grown.ledger)}


def test_the_ledger_and_the_table_of_encounters_agree(population):
    """Hits, flights and draws of the ledger are those of encounters.csv; S grows by each hit; energies add up.

    Over all hits: energy at the touch + kinetic + distant + contacts + losses = kinetic energy left to the gas +
    potential + contacts … so that kinetic + contacts + distant + losses is 0 to 1e-3 of what contacts release.
    """
    ledger, found = population.ledger, population.encounters
    assert ledger["step"][-1] == len(found["event"]) and ledger["hits"][-1] == (found["end"] == 0).sum()
    assert ledger["flights"][-1] == len(found["event"])
    assert (np.diff(ledger["mean_cluster_size"]) > 0.0).all() and ledger["mean_cluster_size"][-1] >= 3.0
    assert found["event"].tolist() == list(range(len(found["event"])))
    books = math.fsum(float(ledger[name][-1]) for name in dilute_files.HIT_CHANGES)
    released = -float(ledger["contacts"][-1])
    assert released > 0.0 and abs(books) < 1e-3 * released
    kinetic = found["touch_kinetic"] + found["touch_rotation"] + found["kinetic"]
    assert ledger["to_gas"][-1] == pytest.approx(kinetic[found["end"] == 0].sum(), rel=1e-9, abs=0.0)
    hits = found["end"] == 0
    touch = (found["energy_start"] + found["flight_error"])[hits].sum()
    assert ledger["touch_energy"][-1] == pytest.approx(touch, rel=1e-9, abs=0.0)
    assert ledger["flight_error"][-1] == pytest.approx(found["flight_error"][hits].sum(), rel=1e-9, abs=0.0)
    ratio = found["impact_parameter"] / found["bound"]
    assert ratio.max() < 1.0


def test_results_are_read_as_those_of_boxes(population):
    """`sand.open`, frames with separate bodies, and the analysis of ensembles read a population.

    S of the last frame's contacts is that of the ledger, and moments in aggregates.csv are those of its clusters.
    """
    run = sand.open(population.folder)
    assert run.summary["outcome"] == "finished" and len(run.frames) >= 3
    sizes = np.bincount(cluster_labels(len(run.frames[-1]), run.frames[-1].pair))
    assert (sizes**2).sum() / sizes.sum() == pytest.approx(run.ledger["mean_cluster_size"][-1], rel=1e-12, abs=0.0)
    assert sizes[sizes > 1].tolist() == population.aggregates["grains"].tolist()
    box = read_box(population.folder)
    found = growth_of([box], (1.5, 3.0))
    assert found.temperatures == {} and found.moment is not None


def test_the_analysis_has_all_bodies_and_their_copies(tmp_path):
    """Aggregates of the last frame in `sand analyse` are those of aggregates.csv, copies included.

    The population has been doubled, so that there are copies; statistics are equal to the single precision of frames,
    and the order of both tables is the same. S of all clusters is that of the ledger.
    """
    how = {**NUMBERS, "stop": "mean_cluster_size >= 8", "seed": 1, "hits": "stick"}
    grown = dilute_growth.grow(grains(), FORCES, **how, out=tmp_path / "one")
    table, box = grown.aggregates, read_box(grown.folder)
    found, sizes = box.aggregates, box.last_sizes
    assert (sizes**2).sum() / sizes.sum() == pytest.approx(grown.ledger["mean_cluster_size"][-1], rel=1e-12, abs=0.0)
    assert len(sizes) == grown.ledger["clusters"][-1] and sizes.sum() == grown.ledger["grains"][-1] > 100
    assert len(np.unique(table["body"])) < len(table["body"]) and table["copy"].any()
    last = found["time"] == found["time"][-1]
    for name in ("grains", "mass", "moment", "gyration_radius"):
        assert found[name][last] == pytest.approx(table[name], rel=1e-5, abs=0.0)


def test_the_kernel_follows_from_hits_and_bounds(population):
    """K = Σ hits/Σ(1/K̂): of single grains with the seed's few hits within 4 standard errors of 3.03e-14 m³/s."""
    kernel = population.kernel()
    assert kernel.edges[0] == 1 and kernel.value[0, 1] == kernel.value[1, 0]
    assert abs(kernel.value[0, 0] - 3.03e-14) < 4.0 * kernel.error[0, 0]
    # the table of classes is a kernel of any two masses in its range, which the coagulation equation takes
    mass = float(population.encounters["mass1"].min())
    table = measured(kernel.rows(), extrapolate=True)
    assert table(mass, mass) == pytest.approx(kernel.value[0, 0], rel=1e-6, abs=0.0)
    assert table(2.0 * mass, mass) == pytest.approx(kernel.value[0, 1], rel=1e-6, abs=0.0)
    both = kernel_of([population.encounters] * 2)
    assert both.value[0, 0] == pytest.approx(kernel.value[0, 0], rel=1e-12, abs=0.0)


STICK = {**NUMBERS, "hits": "stick", "seed": 1}


def test_encounters_with_others_count_after_a_hundred_hits(tmp_path, monkeypatch):
    """A population that would stop at once (any number of others is too many) has its first hundred hits."""
    monkeypatch.setattr(dilute_growth, "MOST_OTHERS", 1e-30)
    found = dilute_growth.grow(grains(), FORCES, **STICK, stop="mean_cluster_size >= 1e9", out=tmp_path / "one")
    assert found.outcome == "not binary" and found.ledger["hits"][-1] == RECENT


def test_flights_without_hit_or_escape_are_counted(tmp_path, monkeypatch):
    """With at most 300 steps half of the flights end on their way: a warning, `end` 2, and their number in the ledger.

    All other draws are hits, as many as the ledger has, or misses.
    """
    monkeypatch.setattr(dilute_flight, "MOST_FLIGHT_STEPS", 300)
    with pytest.warns(UserWarning, match="still together"):
        found = dilute_growth.grow(grains(), FORCES, **STICK, stop="mean_cluster_size >= 1.5", out=tmp_path / "one")
    ends = found.encounters["end"]
    assert (ends == 2).sum() == found.ledger["bound"][-1] > 0
    assert (found.encounters["flight_steps"][ends == 2] == 300).all() and (ends == 0).sum() == found.ledger["hits"][-1]
    assert set(ends) == {0.0, 1.0, 2.0}


def test_charges_that_turn_around_before_their_flight_are_no_misses(tmp_path):
    """Equal charges at 100 K: an end of its own, without a flight; the ledger counts flights alone.

    Q/e = 835 K k_B of two elementary charges at 20 nm, 8 k_BT, keeps thermal bodies apart; opposite ones all hit.
    """
    charge = np.resize([1.0, -1.0], 100) * 1.602176634e-19
    own = grains(moment=None, charge=charge)
    forces = [FORCES[0], sand.Charges()]
    found = dilute_growth.grow(own, forces, **STICK, stop="mean_cluster_size >= 4", out=tmp_path / "one")
    ends = found.encounters["end"]
    repelled = ends == 3
    assert repelled.any() and (found.encounters["flight_steps"][repelled] == 0).all()
    flown = found.encounters["flight_steps"] > 0
    assert found.ledger["flights"][-1] == flown.sum() and not (flown & repelled).any()
    assert set(ends[flown]) == {0.0, 1.0}
    single = (found.encounters["grains1"] == 1) & (found.encounters["grains2"] == 1) & ~flown
    assert single.sum() > 10 and (repelled == have_like_charges(found.encounters))[single].all()


def have_like_charges(encounters):
    """Which pairs of single grains have charges of one sign, where those of even and odd numbers have opposite ones."""
    return (encounters["body1"] + encounters["body2"]) % 2 == 0


def test_pairs_without_a_flight_are_repelled_or_miss(monkeypatch, tmp_path):
    """If all orbits stay outside of the start of flights: like charges are repelled, opposite ones miss each other."""
    monkeypatch.setattr(dilute_encounters, "kepler_start", lambda *of_a_pair: None)
    own = grains(moment=None, charge=np.resize([1.0, -1.0], 100) * 1.602176634e-19)
    found = dilute_growth.grow(own, [FORCES[0], sand.Charges()], **STICK, until="2e6 s", out=tmp_path / "one")
    like = have_like_charges(found.encounters)
    assert 10 < like.sum() < len(like) - 10 and found.ledger["flights"][-1] == found.ledger["hits"][-1] == 0
    assert (found.encounters["end"] == np.where(like, 3.0, 1.0)).all()


def test_a_checkpoint_of_an_earlier_version_is_refused(tmp_path, monkeypatch):
    """One line, where the checkpoint lacks a number; nothing changes in the folder."""
    numbers = tuple(name for name in dilute_state.SINGLE_NUMBERS if name != "bound")
    with monkeypatch.context() as patched:
        patched.setattr(dilute_state, "SINGLE_NUMBERS", numbers)
        dilute_growth.grow(grains(), FORCES, **STICK, stop="mean_cluster_size >= 1.2", out=tmp_path / "one")
    with pytest.raises(BadInput, match="earlier version"):
        dilute_growth.grow(grains(), FORCES, **STICK, stop="mean_cluster_size >= 1.5", out=tmp_path / "one")


def small_case(tmp_path, **changes):
    """The example with a hundred grains to S = 2, joined at the touch, with other keys."""
    content = read_toml(EXAMPLE)
    content["grains"]["number"] = 100
    content["run"]["stop"] = "mean_cluster_size >= 2"
    content["grow"]["seeds"] = [1, 2]
    content["method"]["hits"] = "stick"
    for name, value in changes.items():
        table, key = name.split("__")
        content.setdefault(table, {})[key] = value
    write_toml(tmp_path / "case.toml", content, "test")
    return tmp_path / "case.toml"


def test_the_command_grows_a_population_for_each_seed(tmp_path, capsys):
    """`sand grow`: folders of seeds, the same bits as alone; with a later end it goes on, as from the start."""
    case, place = small_case(tmp_path), tmp_path / "grown"
    assert main(["grow", str(case), "--out", str(place), "--workers", "1", "--quiet"]) in (0, None)
    assert read_json(place / "growth.json")["seeds"] == [1, 2]
    later, other = small_case(tmp_path, run__stop="mean_cluster_size >= 2.5"), tmp_path / "other"
    assert main(["grow", str(later), "--out", str(place), "--workers", "1", "--quiet"]) in (0, None)
    assert main(["grow", str(later), "--out", str(other), "--seeds", "2", "--workers", "1", "--quiet"]) in (0, None)
    assert files_of(place / "seed-2") == files_of(other / "seed-2")
    times = [[frame.time for frame in sand.open(each / "seed-2").frames] for each in (place, other)]
    assert times[0] == times[1]
    assert main(["resume", str(place / "seed-1"), "--quiet"]) in (0, None)
    assert main(["info", str(place / "seed-1")]) in (0, None) and "population" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"number_density": "1e19 /m^3"}, "others on average"),
        ({"number_density": "-1 /m^3"}, "number_density"),
        ({"temperature": 0.0}, "temperature"),
        ({"hits": "bounce"}, "'resolve'"),
        ({"stop": None}, "stop is missing"),
        ({"stop": "kinetic_energy > 1 J"}, "kinetic_energy"),
    ],
)
def test_wrong_arguments_are_refused(tmp_path, changes, words):
    """One line says what is wrong; nothing is written."""
    arguments = {**NUMBERS, "stop": STOP, "seed": 1, "out": tmp_path / "none", **changes}
    with pytest.raises(BadInput, match=words):
        dilute_growth.grow(grains(), FORCES, **arguments)
    assert not (tmp_path / "none").exists()


def test_few_grains_undamped_contacts_and_other_forces_are_refused(tmp_path):
    """Fewer than 100 bodies; hits = 'resolve' without damping; gravity; a cut-off; no contact model; a dense gas."""
    how = {**NUMBERS, "stop": STOP, "out": tmp_path / "none"}
    gas = sand.Gas(temperature="100 K", density="1 kg/m^3", molecule_mass="2.3 u")
    cases = [
        (grains(50), FORCES, "too few"),
        (grains(), [sand.Contact(), sand.Dipoles()], "undamped"),
        (grains(), [*FORCES, sand.Gravity("1 m/s^2")], "gravity"),
        (grains(), [FORCES[0], sand.Dipoles(cutoff="1 um")], "cut-off"),
        (grains(), [sand.Dipoles()], "sand.Contact"),
        (grains(), [*FORCES, gas], "stopping length"),
        (grains(), [*FORCES, sand.Gas(temperature="90 K", density="1e-8 kg/m^3", molecule_mass="2.3 u")], "90 K"),
    ]
    for own, forces, words in cases:
        with pytest.raises(BadInput, match=words):
            dilute_growth.grow(own, forces, **how)


def test_moments_that_flip_within_a_flight_are_refused(tmp_path):
    """At 1000 K the moments of 10 nm iron flip within nanoseconds (K₁V/4): superparamagnetic."""
    with pytest.raises(BadInput, match="superparamagnetic"):
        dilute_growth.grow(
            grains(), FORCES, number_density="1e8 /m^3", temperature="1000 K", stop=STOP, out=tmp_path / "x"
        )


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"box__periodic": "1 um"}, "box"),
        ({"run__frame_every": "1 us"}, "frame_every"),
        ({"stepping__accuracy": 1e-6}, "stepping"),
        ({"method__kind": "boxes"}, "hits"),
        ({"method__between": "cold"}, "between"),
        ({"grains__spins": "none"}, "spins"),
    ],
)
def test_keys_that_encounters_do_not_have_are_refused(tmp_path, capsys, changes, words):
    """One line names the key."""
    assert main(["grow", str(small_case(tmp_path, **changes)), "--out", str(tmp_path / "none")]) not in (0, None)
    assert words in capsys.readouterr().err and not (tmp_path / "none").exists()


def test_a_field_aligns_bodies_on_their_way(tmp_path):
    """In 50 mT (μB = 240 k_BT) the energy at each start is −2μB of aligned moments to a few k_BT; flights keep it.

    Energy errors of flights that hit are below 3 k_BT rms with the field, too; growth differs from that without.
    """
    forces = [sand.Contact(), sand.Dipoles(), sand.Field([0.0, 0.0, 0.05])]
    how = {**NUMBERS, "stop": "mean_cluster_size >= 1.5", "seed": 2, "hits": "stick"}
    found = dilute_growth.grow(grains(), forces, **how, out=tmp_path / "field").encounters
    plain = dilute_growth.grow(grains(), forces[:2], **how, out=tmp_path / "plain").encounters
    hits = found["end"] == 0
    assert hits.sum() > 10 and found["time"][-1] != plain["time"][-1]
    assert np.sqrt((found["flight_error"][hits] ** 2).mean()) < 3.0 * 1.380649e-21
    single = hits & (found["grains1"] + found["grains2"] == 2)
    assert (found["energy_start"][single] < -0.95 * 2.0 * 6.6e-18 * 0.05).all()
