"""Ensembles of growth simulations: run, resume, analyse, report."""

import json
import math

import numpy as np
import pytest
import tomli_w

import sand
from sand.analysis.body_motion import BodyMotion
from sand.basics.constants import BOLTZMANN
from sand.cli.main import main
from sand.experiments.growth import BoxResult, boxes_in, growth_of, read_box
from sand.experiments.growth_boxes import grow, run_box, shared_settings
from sand.experiments.growth_report import temperatures_over_time

pytestmark = pytest.mark.filterwarnings(
    "ignore:contacts of iron",
    "ignore:grains in contact vibrate",
    "ignore:grains overlap too deeply",
    "ignore:moments of iron",
)

CASE = {
    "run": {"until": "30 ns", "frame_every": "1 ns"},
    "box": {"periodic": "0.25 um"},
    "grains": {
        "kind": "gas",
        "number": 30,
        "radius": "10 nm",
        "material": "iron",
        "moment": "200 A m^2/kg",
        "temperature": "300 K",
    },
    "forces": {"contact": {}, "dipoles": {}},
}


@pytest.fixture(scope="module")
def ensembles(tmp_path_factory):
    """Three boxes with moments and three without, run in this process."""
    top = tmp_path_factory.mktemp("growth")
    grow(CASE, [1, 2, 3], top / "magnetic")
    plain = CASE | {
        "grains": {k: v for k, v in CASE["grains"].items() if k != "moment"},
        "forces": {"contact": {}},
    }
    grow(plain, [1, 2, 3], top / "plain")
    return top


@pytest.mark.compiled("dipoles", "contacts")
def test_each_box_is_a_run_of_its_seed(ensembles, tmp_path):
    """The bits of a simulation with that seed, whatever the seed of the case and the other boxes are."""
    alone = tmp_path / "alone"
    grow(CASE | {"run": CASE["run"] | {"seed": 99}}, [2], alone)
    ours, theirs = (sand.open(top / "seed-2") for top in (alone, ensembles / "magnetic"))
    assert (ours.frames[-1].position == theirs.frames[-1].position).all()
    assert ours.case["run"]["seed"] == 2


@pytest.mark.compiled("dipoles")
def test_a_second_call_continues_the_boxes(tmp_path):
    """To a later end, with the bits of an uninterrupted run; a finished box is left unchanged."""
    short = CASE | {"run": {"until": "10 ns", "frame_every": "1 ns"}}
    assert run_box(short, 1, str(tmp_path / "seed-1")) == "finished"
    assert run_box(CASE, 1, str(tmp_path / "seed-1")) == "finished"
    assert run_box(CASE, 1, str(tmp_path / "whole")) == "finished"
    ours, theirs = (sand.open(tmp_path / name) for name in ("seed-1", "whole"))
    assert (ours.frames[-1].position == theirs.frames[-1].position).all()
    before = (tmp_path / "seed-1" / "trajectory.gsd").read_bytes()
    assert run_box(CASE, 1, str(tmp_path / "seed-1")) == "finished"
    assert (tmp_path / "seed-1" / "trajectory.gsd").read_bytes() == before
    other = CASE | {"box": {"periodic": "0.26 um"}}
    with pytest.raises(sand.BadInput, match=r"different \[box\]"):
        run_box(other, 1, str(tmp_path / "seed-1"))
    (tmp_path / "seed-x").mkdir()  # a foreign file, which is ignored
    with pytest.raises(sand.BadInput, match=r"seed-1 contains a box with different \[box\]"):
        grow(other, [2], tmp_path)


@pytest.mark.compiled("dipoles")
def test_what_is_read_of_a_box(ensembles):
    """S(t) is that of the ledger; the last cluster table is that of the last frame."""
    box = read_box(ensembles / "magnetic" / "seed-1", looks=5)
    run = sand.open(ensembles / "magnetic" / "seed-1")
    assert (box.size == run.ledger["mean_cluster_size"]).all()
    last = box.aggregates["time"] == box.aggregates["time"].max()
    sizes = box.aggregates["grains"][last]
    alone = 30 - sizes.sum()
    assert ((sizes**2).sum() + alone) / 30 == pytest.approx(box.size[-1], rel=1e-12, abs=0.0)
    assert len(np.unique(box.aggregates["time"])) == 5
    assert (box.aggregates["moment"] <= box.aggregates["grains"] * box.moment * (1 + 1e-6)).all()


def synthetic_box(z, gamma, dimension, seed, grains=1000):
    """A box whose S(t), moments and sizes follow given laws, with a random factor in τ."""
    rng = np.random.default_rng(seed)
    time = np.linspace(0, 1e-5, 201)
    own = math.exp(0.1 * rng.normal())
    n = np.round(np.exp(rng.uniform(math.log(2), math.log(200), 300)))
    scatter = np.exp(0.1 * rng.normal(size=(2, 300)))
    return BoxResult(
        f"box-{seed}",
        time,
        (1.0 + own * 10 * time / 1e-5) ** z,
        grains,
        1e-8,
        2e-18,
        {
            "grains": n,
            "moment": 2e-18 * n**gamma * scatter[0],
            "gyration_radius": 1e-8 * (n / 1.3) ** (1 / dimension) * scatter[1],
            "rings": (n > 150).astype(float),
            "time": np.full(300, 1e-5),
        },
        {"grains": {"number": grains}},
    )


@pytest.mark.slow
def test_exponents_of_synthetic_boxes():
    """γ and D_f within four standard errors; the local degree is that of S = (1 + t/zτ)^z, 1 − 1/z, z in its interval.

    A straight line misses z, because S begins at 1. Boxes differ in τ by a tenth, which changes λ by its square.
    """
    growth = growth_of([synthetic_box(2.0, 0.63, 1.4, seed, 10**6) for seed in range(8)], (2.0, 100.0))
    assert growth.z.low < 2.0 < growth.z.high
    assert len(growth.local_degrees) == 5
    assert [one.degree for one in growth.local_degrees] == pytest.approx([0.5] * 5, abs=0.01)
    assert growth.slope.exponent < 1.8
    for law, exact in ((growth.moment, 0.63), (growth.moment_without_rings, 0.63)):
        assert abs(law.exponent - exact) < 4 * law.error < 0.04
    assert abs(growth.dimension.value - 1.4) < 4 * growth.dimension.error < 0.08
    assert growth.missing == {}
    assert growth.error[-1] == pytest.approx(growth.sizes[:, -1].std(ddof=1) / math.sqrt(8), rel=1e-12, abs=0.0)


@pytest.mark.compiled("dipoles")
def test_missing_results_give_a_reason(ensembles):
    """Boxes without moments, and boxes that hardly grew."""
    growth = growth_of([read_box(one) for one in boxes_in(ensembles / "plain")])
    assert growth.moment is None and growth.missing["moment"] == "the grains have no moments"
    assert growth.z is None and "fewer than three times have S between 2" in growth.missing["z"]
    assert growth.local_degrees is None and "fewer than three times" in growth.missing["local_degrees"]
    with pytest.raises(sand.BadInput, match=r"different \[grains\]"):
        growth_of([synthetic_box(2, 0.6, 1.4, 1), synthetic_box(2, 0.6, 1.4, 2, grains=10)])


def median_rotation(box, chosen):
    """Median energy of rotation of the chosen bodies of all frames read, over 1.183 k_B [K]."""
    energies = np.concatenate([motion.rotation[chosen(motion.grains)] for _, motion in box.bodies])
    return np.median(energies) / (1.1829869421876689 * BOLTZMANN)


@pytest.mark.compiled("dipoles")
def test_the_commands(ensembles, tmp_path, monkeypatch, capsys):
    """`sand grow` writes what `grow` does; `sand analyse` reports, compares, writes tables and a figure."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "box.toml").write_text(tomli_w.dumps(CASE | {"run": CASE["run"] | {"until": "3 ns"}}))
    assert main(["grow", "box.toml", "--seeds", "1-2", "--out", "few", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["outcomes"] == {"1": "finished", "2": "finished"}
    words = [str(ensembles / "magnetic"), str(ensembles / "plain")]
    assert main(["analyse", *words, "--out", "told", "--json"]) == 0
    message = json.loads(capsys.readouterr().out)
    assert message["comparison"]["sigma"] > 3
    boxes = [read_box(one) for one in boxes_in(ensembles / "magnetic")]
    for kind, chosen in (("single", lambda n: n == 1), ("clusters", lambda n: n > 1)):
        heat = [median_rotation(box, chosen) for box in boxes]
        found = message["ensembles"][0]["temperatures"][kind]
        assert found["rotation_median"] == pytest.approx(np.mean(heat), rel=1e-12, abs=0.0)
        assert found["rotation_median_error"] == pytest.approx(np.std(heat, ddof=1) / 3**0.5, rel=1e-12, abs=0.0)
    assert message == json.loads((tmp_path / "told" / "analysis.json").read_text())
    assert [one["boxes"] for one in message["ensembles"]] == [3, 3]
    assert message["ensembles"][0]["mean_size"] > 1.5 * message["ensembles"][1]["mean_size"]
    assert (tmp_path / "told" / "growth.png").stat().st_size > 10_000
    degrees = (tmp_path / "told" / "degrees.csv").read_text().splitlines()
    found = message["ensembles"][0]["local_degrees"] or []
    assert len(degrees) == 1 + len(found)
    assert len((tmp_path / "told" / "growth.csv").read_text().splitlines()) == 1 + 2 * 31
    assert main(["analyse", *words, "--out", "told"]) == 2
    assert "--overwrite" in capsys.readouterr().err
    assert main(["analyse", str(ensembles / "magnetic" / "seed-1"), "--window", "1.2", "4"]) == 0
    shown = capsys.readouterr().out
    assert "1 of 30 grains" in shown and "nan" not in shown and "single grains  translation" in shown


@pytest.mark.parametrize("forces", [3, [1], {"contact": 3}])
def test_odd_forces_of_a_case_are_refused(forces):
    """[forces] of a case.toml that was edited holds something else than tables."""
    with pytest.raises(sand.BadInput, match="must be tables"):
        shared_settings({"run": {}, "forces": forces})


def test_temperatures_are_pooled_at_equal_times():
    """T = 2 E/(3 k_B) of the bodies of all boxes at one time; a box that ended early has frames at times of its own."""

    def box(times, temperature):
        energy = 1.5 * BOLTZMANN * temperature * np.ones(2)
        bodies = BodyMotion(np.ones(2, int), np.ones(2), energy, 2.0 * energy, np.zeros(2))
        return BoxResult("", np.zeros(1), np.ones(1), 2, 1.0, 0.0, {}, {}, tuple((t, bodies) for t in times))

    boxes = [box([1.0, 2.0, 3.0], 100.0), box([1.0, 2.0 * (1.0 + 1e-12), 3.0], 300.0), box([0.4, 0.8, 1.2], 900.0)]
    found = temperatures_over_time(boxes)
    assert found[:, 0].tolist() == [1.0, 2.0, 3.0]
    assert found[:, 1] == pytest.approx([200.0] * 3, rel=1e-12, abs=0.0)
    assert found[:, 2] == pytest.approx([400.0] * 3, rel=1e-12, abs=0.0)
    assert temperatures_over_time([box([], 1.0)]).shape == (0, 4)


@pytest.mark.parametrize("odd", ["seeds = 3", 'seeds = [1, "two"]', "seeds = [1.5]", "seeds = [-1]", "seeds = [true]"])
def test_edited_seeds_of_a_folder_of_boxes(tmp_path, odd):
    """One line for seeds that are no list of whole numbers; nothing is run."""
    (tmp_path / "case.toml").write_text(f"# Written by SAND: a test\n[grow]\n{odd}\n")
    with pytest.raises(sand.BadInput, match="must be a list of whole numbers") as caught:
        grow(CASE, [1], tmp_path)
    assert len(caught.value.problems) == 1 and not list(tmp_path.glob("seed-*"))
