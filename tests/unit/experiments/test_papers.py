"""Figures of papers: means over impact parameters and seeds, thresholds, and what is compared, of synthetic rows."""

import itertools
import json
import math
import shutil

import numpy as np
import pytest

import sand
from sand.analysis.fits import falls_below
from sand.basics.material import material_named
from sand.cli.main import main
from sand.cli.reproduce import comparison_rows
from sand.experiments import reproduce
from sand.experiments.paper_chain import compare_chain
from sand.experiments.paper_compression import compare_compression
from sand.experiments.paper_growth import (
    averaged,
    break_up_speed,
    compare_mass_ratios,
    compare_parameter,
    mass_ratio_panels,
)
from sand.experiments.paper_packings import compare_pressures, compare_strengths, compression_panels, strengths
from sand.experiments.reproduce import FIGURES, Reproduction, papers_folder
from sand.experiments.seed_table import Interval, mean_of, seed_table
from sand.experiments.sequential import collide_in_sequence
from sand.io.sweep_files import read_runs
from sand.plotting.papers import panels_figure
from sand.setup import bpca, grain
from sand.theory import contact

OFFSETS = [math.sqrt((k + 0.5) / 6) for k in range(6)]


def test_a_crossing():
    """f = 1 − ln v/ln 50 is linear in ln v and zero at 50; only a fall counts, and a function without one has none."""
    v = np.geomspace(10.0, 200.0, 7)
    f = 1.0 - np.log(v) / math.log(50.0)
    assert falls_below(v, f, 0.0) == pytest.approx(50.0, rel=1e-12, abs=0.0)
    assert math.isnan(falls_below(v, -f, 0.0)) and math.isnan(falls_below(v, f, -9.0))
    f[3] = math.nan  # a point that is missing is left out: the rest is on the same line
    assert falls_below(v, f, 0.0) == pytest.approx(50.0, rel=1e-12, abs=0.0)


def test_an_interval_over_seeds():
    """Three seeds with zeros at 40, 50 and 62.5: the mean of f in ln v has its zero at the geometric mean 50.

    Without one seed it is at √(50·62.5), √(40·62.5) = 50 and √(40·50); the jackknife of their logarithms, with
    t = 4.303 for two degrees of freedom, is the interval.
    """
    v = np.geomspace(10.0, 200.0, 41)
    zeros = {1: 40.0, 2: 50.0, 3: 62.5}
    table = seed_table({(seed, x): math.log(zero / x) for seed, zero in zeros.items() for x in v})
    found = table.falls_below(0.0)
    without = np.log([math.sqrt(50.0 * 62.5), 50.0, math.sqrt(2000.0)])
    half = 4.302653 * math.sqrt(2.0 / 3.0 * ((without - without.mean()) ** 2).sum())
    assert found.value == pytest.approx(50.0, rel=1e-9, abs=0.0)
    limits = 50.0 * math.exp(-half), 50.0 * math.exp(half)
    assert (found.low, found.high) == pytest.approx(limits, rel=1e-6, abs=0.0)
    one = seed_table({(1, x): math.log(40.0 / x) for x in v}).falls_below(0.0)
    assert one.text("m/s") == "40 (no interval) m/s"


def test_a_verdict():
    """A value within the interval agrees; of one near it this is said; others have the difference and the reason."""
    assert Interval(48.0, 44.0, 52.0).verdict(50.0, "why") == "agrees"
    assert Interval(48.0, 44.0, 52.0).verdict(80.0, "why") == "-32 (-40%): why"
    assert Interval(48.0, 44.0, 52.0).verdict(53.0, "why", within=1.0) == "agrees within 1 of the interval"
    assert Interval(math.nan).verdict(50.0, "why") == "why"


NUMBERS = contact("ice", 1e-7)
SAME = {"offsets": 6, "break_energy": NUMBERS.break_energy, "roll_energy": NUMBERS.roll_energy_clamped}
MASS = 1000.0 * 4.0 / 3.0 * math.pi * 1e-21


def growth_rows(zero, **extra):
    """Rows whose growth efficiency (1 + b²)·ln(zero/v) averages to 3/2 ln(zero/v), for two seeds."""
    runs = itertools.product((1, 2), np.geomspace(10.0, 200.0, 10), OFFSETS)
    found = [
        {"seed": s, "speed": v, "offset": b, "growth_efficiency": (1 + b * b) * math.log(zero / v)} for s, v, b in runs
    ]
    return [SAME | {"grain_mass": MASS, "mass_ratio": 1.0} | row | extra for row in found]


def test_the_break_up_speed_of_ice():
    """20 √(E_break/m) = 76.5 m/s for grains of 0.1 µm with γ = 0.1 J/m², E = 7 GPa, ν = 0.25."""
    assert break_up_speed(growth_rows(50.0)[0]) == pytest.approx(76.46, abs=0.01)


def test_runs_that_are_missing_are_left_out():
    """A speed of one seed without all its impact parameters is not averaged; the other seed is."""
    rows = growth_rows(50.0)
    table = averaged([row for row in rows if (row["seed"], row["speed"], row["offset"]) != (1, 10.0, OFFSETS[2])])
    assert math.isnan(table.of_seeds[0, 0]) and table.mean[0] == pytest.approx(1.5 * math.log(5.0), rel=1e-12, abs=0.0)


def test_a_campaign_that_has_just_begun():
    """One run, of one of six impact parameters: no average, no critical speed; the figure is drawn all the same."""
    rows = growth_rows(50.0, bodies="500 + 500")[:1]
    assert compare_mass_ratios(rows)[0].ours == "outside the range of the campaign"
    assert [len(curve.x) for panel in mass_ratio_panels(rows) for curve in panel.curves] == [0, 1]
    panels_figure(mass_ratio_panels(rows), "title")


def test_mass_ratios_are_compared():
    """Critical speeds of 50 and 60 m/s: the formula's 76.5 m/s is outside; their ratio is 1.2."""
    rows = growth_rows(50.0, bodies="500 + 500") + growth_rows(60.0, bodies="500 + 4000")
    other, one, ratio = compare_mass_ratios(rows)
    assert one.ours.startswith("50 (50 … 50) m/s") and one.verdict.startswith("-26 (-35%)")
    assert (
        other.what == "critical speed of 500 + 4000"
        and ratio.ours.startswith("1.2")
        and ratio.verdict.startswith("agrees")
    )


def test_the_exponent_of_a_parameter():
    """v_crit = 50 ξ^0.3 has the exponent 0.3, beyond the 0.05 that count as none."""
    rows = [row for xi in (2.0, 8.0, 32.0) for row in growth_rows(50.0 * (xi / 8.0) ** 0.3, xi=xi)]
    *_, slope = compare_parameter("xi", "ξ", "Å", 1.0, rows)
    assert slope.ours.startswith("0.3 (") and slope.verdict.startswith("+0.3:")
    rows = [row for xi in (2.0, 8.0, 32.0) for row in growth_rows(50.0, xi=xi)]
    assert compare_parameter("xi", "ξ", "Å", 1.0, rows)[-1].verdict == "agrees"


def test_compression_is_compared():
    """r_g ∝ E^−0.1 from 10 E_roll to N E_roll gives the exponent; ½ − 0.1 ln(E/(10 N_k E_break)) is half at 10."""
    n, roll = 1000, SAME["roll_energy"]
    rows = [
        SAME | {
            "seed": seed, "grains": n, "contacts_before": 998.0, "contacts_per_grain": 1.0, "impact_energy": energy,
            "gyration": 20.0 * (energy / roll) ** (-0.1 if 10.0 < energy / roll < n else 0.3),
            "largest_remnant": 0.5 - 0.1 * math.log(energy / (10.0 * 998.0 * SAME["break_energy"])),
        }
        for seed in (1, 2, 3)
        for energy in np.geomspace(0.45 * SAME["roll_energy"], 19.0 * 998.0 * SAME["break_energy"], 60)
    ]  # fmt: skip
    exponent, disruption = compare_compression(rows)
    assert exponent.ours.startswith("-0.1 (") and exponent.verdict.startswith("agrees")
    assert disruption.ours.startswith("10 (") and disruption.verdict.startswith("agrees")


def test_a_chain_is_compared():
    """N = r_g^1.9 before E_imp = E_roll and r_g^2.5 after it are found."""
    rows = [
        SAME | {
            "seed": seed, "speed": v, "grains": 2**k, "gyration": (2.0**k) ** (1.0 / (1.9 if v < 1.0 else 2.5)),
            "impact_energy": SAME["roll_energy"] * (0.5 if v < 1.0 else 2.0),
        }
        for seed in (1, 2)
        for v in (0.1, 4.0)
        for k in range(1, 11)
    ]  # fmt: skip
    slow, fast = compare_chain(rows)
    assert slow.ours.startswith("1.9 (") and fast.ours.startswith("2.5 (")
    assert slow.verdict.startswith("agrees") and fast.verdict.startswith("agrees")


def test_a_mean_over_seeds():
    """1, 2, 6: the mean 3 with the standard error √(7/3), times t = 4.303 of two degrees of freedom; one has none."""
    found = mean_of([1.0, 2.0, 6.0])
    half = 4.302653 * math.sqrt(7.0 / 3.0)
    assert found == pytest.approx((3.0, 3.0 - half, 3.0 + half), rel=1e-6, abs=0.0)
    assert mean_of([4.0]).text() == "4 (no interval)" and math.isnan(mean_of([1.0, math.nan]).value)


SCALE = {"pressure_scale": 4.74e5, "contact_time": 2e-10, "surface_energy": 0.1, "radius": 1e-7}


def compressed(rate, end, factor):
    """Rows of compressions by two seeds: P = factor (1 ± 0.1) × 4.74e5 Pa φ³; rolling goes over into sliding."""
    phi = np.exp(np.arange(math.log(0.01), math.log(end), 0.02))
    return [
        SCALE | {
            "seed": seed, "run": f"{rate}-{seed}", "rate": rate / 2e-10, "mean_filling": p, "rate_ratio": 0.04 / p,
            "stress": factor * (1.3 - 0.2 * seed) * 4.74e5 * p**3, "coordination": 2.0 + 9.38 * p**1.62 + 0.1 * p,
            "share_rolling": 0.8 * (p < 0.35), "share_sliding": 0.8 * (p > 0.35), "share_twisting": 0.1,
        }
        for seed in (1, 2)
        for p in phi.tolist()
    ]  # fmt: skip


def test_pressures_are_compared():
    """Both rates beside φ³, what reaches φ = 0.6 beside the other laws; a box that is too fast is the reason given.

    Tatsuuma's law over φ³ is (1 − φ/0.74)^−3: within 3 % of φ = 0.3 the rows are 0.2919 … 0.3038.
    """
    rows = compressed(1e-5, 0.6, 1.1) + compressed(3e-6, 0.12, 0.5)
    found = {one.what: one for one in compare_pressures(rows)}
    one = found["P/((E_roll/r³) φ³) at φ = 0.1, C_v = 1e-05"]
    assert one.ours == "1.1 (-0.298 … 2.5)" and one.verdict.startswith("not decided")  # 1.1 (1.1, 0.9), t = 12.7
    slow = found["P/((E_roll/r³) φ³) at φ = 0.03, C_v = 3e-06"]
    assert slow.ours.startswith("0.5 (") and len([name for name in found if "C_v = 3e-06" in name]) == 4
    dense = found["P/((E_roll/r³)(1/φ − 1/0.74)⁻³) at φ = 0.3"].ours
    assert float(dense.split()[0]) == pytest.approx(1.1 * (1.0 - 0.3 / 0.74) ** 3, rel=0.02, abs=0.0)
    z = found["Z/(2 + 9.38 φ^1.62) at φ = 0.6"]
    assert z.ours == "1.01 (1.01 … 1.01)" and z.verdict == "+0.0098 (+1%): within 5%"
    reached = "φ = 0.1, 0.2, 0.3, 0.4, 0.5, 0.6"
    assert found[f"share of rolling in what is dissipated at {reached}"].ours == "0.80, 0.80, 0.80, 0.00, 0.00, 0.00"
    one_seed = [row | {"stress": 2.0 * 4.74e5 * row["mean_filling"] ** 3} for row in rows if row["seed"] == 1]
    verdict = compare_pressures(one_seed)[0].verdict
    assert verdict == "+1 (+100%): perhaps the rate: the box is 1.3 times too fast"
    low = [row | {"stress": 0.25 * row["stress"]} for row in one_seed]  # a rate that is too fast does not explain it
    assert compare_pressures(low)[0].verdict == "-0.5 (-50%): no reason is known"
    panels = compression_panels(rows)
    assert [one.label for one in panels[1].curves] == ["$C_v$ = 1e-05", "$C_v$ = 3e-06"]
    assert panels[1].curves[0].y == pytest.approx(np.full(60, 1.1), rel=1e-3, abs=0.0)
    assert panels[1].curves[0].weak.tolist() == (panels[1].curves[0].x < 0.04).tolist()


def stretched(filling, seed, strength, peak):
    """Rows of a stretch whose tension rises linearly to a plateau of five rows, and falls."""
    strain = 0.02 * np.arange(1, 41)
    tension = np.interp(strain, [0.0, peak, peak + 0.08, peak + 0.1, 9.0], strength * np.array([0, 1, 1, 0, 0]))
    whole = SCALE | {
        "filling_at_start": filling,
        "seed": seed,
        "run": f"{filling}-{seed}",
        "aggregate.filling": filling,
    }
    return [
        whole | {"strain": x, "stress": y, "rate_ratio": 0.5} for x, y in zip(strain.tolist(), tension, strict=True)
    ]


def test_strengths_are_compared():
    """The largest mean over five rows is the plateau; 6e5 φ^1.8 is found, and a tension that still rises is said."""
    fillings = (0.05, 0.1, 0.2, 0.3)
    rows = [
        row
        for phi in fillings
        for seed in (1, 2, 3)
        for row in stretched(phi, seed, 6e5 * phi**1.8 * (1.05, 0.95, 1.0)[seed - 1], 0.4)
    ]
    assert [round(one["strain"], 9) for one in strengths(rows)] == [0.44] * 12
    assert not any(one["at_end"] for one in strengths(rows))
    *ratios, slope = compare_strengths(rows)
    assert [one.ours.split()[0] for one in ratios] == ["1"] * 4 and all(one.verdict == "agrees" for one in ratios)
    assert slope.ours.startswith("1.8 (") and slope.verdict == "agrees"
    assert compare_strengths(rows + stretched(0.02, 1, 9e5, 5.0))[-1].ours == slope.ours  # no strength, and not fitted
    rising = compare_strengths(stretched(0.1, 1, 9e3, 5.0))
    assert rising[0].verdict.endswith("still rising at the end of 1 of 1 runs")


@pytest.mark.compiled("contacts")
def test_a_sequence_of_collisions():
    """Slow grains stick: N doubles, contacts are kept, E_imp is that of bodies of N grains; and it is reproducible."""
    found = collide_in_sequence(grain(radius=1e-7, material="ice"), 4, speed=4.0, seed=3)
    assert [one.fragments for one in found] == [(2,), (4,), (8,), (16,)]
    assert [one.contacts_before for one in found[1:]] == [2 * one.contacts_after for one in found[:-1]]
    energy = [0.25 * MASS * 2**k * 16.0 for k in range(4)]  # reduced mass N m/2 of two bodies of N grains
    assert [one.impact_energy for one in found] == pytest.approx(energy, rel=1e-12, abs=0.0)
    again = collide_in_sequence(grain(radius=1e-7, material="ice"), 4, speed=4.0, seed=3)
    assert again == found


@pytest.mark.compiled("contacts")
def test_the_largest_fragment_goes_on():
    """A collision that breaks the bodies: the next one begins with two copies of the largest fragment, at rest."""
    first, second = collide_in_sequence(bpca(12, radius=1e-7, material="silica", seed=1), 2, speed=8.0, seed=1)
    assert len(first.fragments) > 1
    largest = first.fragments[0]
    assert sum(second.fragments) == 2 * largest and second.impact_energy == pytest.approx(
        first.impact_energy * largest / 12, rel=1e-12, abs=0.0
    )
    assert second.gyration_before[0] == pytest.approx(first.gyration_after, rel=1e-6, abs=0.0)


@pytest.mark.parametrize("name", FIGURES)
def test_the_case_of_each_figure(name):
    """The case of the full version is read; its first comment names the command; seeds come after sizes of bodies."""
    job = Reproduction(name)
    assert all(Reproduction(other).figure is job.figure for other in job.figure.also)
    assert f"sand reproduce {name}" in (papers_folder() / f"{name}.toml").read_text("utf-8").split("[", 1)[0]
    assert len(job.rows) == len(job.names) > 1
    sizes = [sum(n for key, n in row.values.items() if key.endswith(".grains")) for row in job.rows]
    assert [(size, row.seed) for size, row in zip(sizes, job.rows, strict=True)] == sorted(
        (size, row.seed) for size, row in zip(sizes, job.rows, strict=True)
    )


def test_the_speeds_of_wada_2008():
    """From 0.45 E_roll to 30 N_k E_break with N_k = 998; the reduced mass is that of 250 grains (2 %)."""
    for name in ("wada2008-ice", "wada2008-quartz"):
        job = Reproduction(name)
        speeds, material = sorted({row.values["impact.speed"] for row in job.rows}), job.content["target"]["material"]
        numbers, mass = contact(material, 1e-7), 4.0 / 3.0 * math.pi * 1e-21 * material_named(material).density
        energies = 0.45 * numbers.roll_energy_clamped, 30.0 * 998.0 * numbers.break_energy
        ends = [math.sqrt(8.0 * energy / (1000.0 * mass)) for energy in energies]
        assert [speeds[0], speeds[-1]] == pytest.approx(ends, rel=0.02, abs=0.0)
        assert np.diff(np.log(speeds)) == pytest.approx(math.log(speeds[-1] / speeds[0]) / 11, rel=1e-6, abs=0.0)


@pytest.mark.draws
@pytest.mark.compiled("contacts", "small", "deformation")
@pytest.mark.filterwarnings("ignore:in .* run.*overlap too deeply", "ignore:.*too fast for a static stress")
@pytest.mark.parametrize("name", ["wada2013-ice", "wada2008-quartz", "suyama2008", "kataoka2013", "tatsuuma2019"])
def test_the_small_version(tmp_path, monkeypatch, capsys, name):
    """The command: table, comparison and figure; called again, nothing is computed, and the results are the same."""
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", name, "--small", "--json"]) == 0
    first = json.loads(capsys.readouterr().out)
    place = tmp_path / f"{name}-small" / "results"
    assert first["rows"] == first["design"] == first["done"] and first["cpu_seconds"] > 0.0
    tables = {"rows.csv"} if not name.startswith("wada") else set()
    assert {path.name for path in place.iterdir()} == {"sweep.csv", "comparison.csv", "figure.png", *tables}
    assert len(sand.open(place).table["seed"]) == first["rows"]
    lines = (place / "comparison.csv").read_text("utf-8").splitlines()
    assert len(lines) > 1 and all("small version" in line and "no result of physics" in line for line in lines[1:])
    if name.startswith("wada"):
        assert first["comparison"][-1].keys() == {"what", "paper", "ours", "verdict"}
    table = (place / "sweep.csv").read_bytes()
    assert main(["reproduce", name, "--small", "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == first and (place / "sweep.csv").read_bytes() == table


@pytest.mark.compiled("contacts", "small")
def test_known_rows_are_not_computed_again(tmp_path, monkeypatch):
    """Rows of the table that comes with SAND are taken; the others are computed, and the table has all of them."""
    monkeypatch.setattr(reproduce, "papers_folder", lambda: tmp_path / "papers")
    shutil.copytree(papers_folder(), tmp_path / "papers")
    whole = Reproduction("suyama2008", tmp_path / "whole", small=True).run()
    place = tmp_path / "papers" / "suyama2008"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(tmp_path / "whole" / "results", place)
    lines = (place / "sweep.csv").read_text().splitlines(keepends=True)
    (place / "sweep.csv").write_text("".join(lines[:-1]))
    job = Reproduction("suyama2008", tmp_path / "rest", small=True, known=True)
    assert (len(job.known), len(job.rows), len(job.names)) == (1, 1, 2)
    found = job.run()
    assert found["comparison"] == whole["comparison"] and found["rows"] == 2
    (place / "sweep.csv").write_text("".join(lines))
    job = Reproduction("suyama2008", tmp_path / "none", small=True, known=True)
    assert not job.rows and job.run()["rows"] == 2


@pytest.mark.draws
@pytest.mark.compiled("deformation")
@pytest.mark.filterwarnings("ignore:.*too fast for a static stress")
def test_packings_that_are_compressed_before(tmp_path, monkeypatch):
    """Their cost is part of what is expected; names of runs do not depend on the folder; known runs need no packing."""
    monkeypatch.setattr(reproduce, "papers_folder", lambda: tmp_path / "papers")
    shutil.copytree(papers_folder(), tmp_path / "papers")
    job, other = (Reproduction("tatsuuma2019", tmp_path / name, small=True) for name in ("one", "other"))
    assert job.names == other.names and job.content != other.content
    expected = job.expected(job.left())
    job.run()
    alone = Reproduction("tatsuuma2019", tmp_path / "one", small=True)
    assert expected.seconds > alone.expected(alone.rows).seconds > 0.0
    starts = sand.open(tmp_path / "one" / "results").table
    assert starts["filling_at_start"] == pytest.approx(starts["aggregate.filling"], rel=0.02, abs=0.0)
    assert (starts["grains"] == 64).all()
    place = tmp_path / "papers" / "tatsuuma2019"
    shutil.rmtree(place, ignore_errors=True)
    shutil.copytree(tmp_path / "one" / "results", place)
    known = Reproduction("tatsuuma2019", tmp_path / "known", small=True, known=True)
    assert not known.rows
    known.run()
    for name in ("rows.csv", "sweep.csv", "comparison.csv"):
        assert (tmp_path / "known" / "results" / name).read_bytes() == (place / name).read_bytes()
    assert not (tmp_path / "known" / "compressed").exists()


@pytest.mark.compiled("small")
def test_an_interruption_names_the_same_command(tmp_path, monkeypatch, capsys):
    """`sand resume` would continue the sweep, but neither compress packings nor compare: the command itself does."""

    def stopped(*_):
        raise KeyboardInterrupt

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(Reproduction, "run", stopped)
    assert main(["reproduce", "tatsuuma2019", "--small", "--quiet"]) == 130
    text = capsys.readouterr().err
    assert "to continue, call the same command again" in text and "sand resume" not in text


def test_the_list(capsys):
    """Without a name: all figures with their numbers of runs.  An unknown one: the nearest name."""
    assert main(["reproduce", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found) == list(FIGURES) and found["wada2013-ice"]["runs"] == 540
    assert found["kataoka2013"]["also"] == ["tatsuuma2023", "arakawa2019"]
    assert main(["reproduce", "wada2013"]) == 2
    assert capsys.readouterr().err == "sand: there is no figure 'wada2013'; did you mean 'wada2013-ice'?\n"


@pytest.mark.compiled("contacts")
def test_the_expected_time_is_the_measured_one(tmp_path):
    """Runs in the table that comes with SAND are expected to take the CPU time that they took there, on one core."""
    job = Reproduction("kataoka2013", tmp_path / "there")
    rows = read_runs(papers_folder() / "kataoka2013")
    assert len(job.rows) == len(rows) == 8
    measured = sum(float(one["cpu_seconds"]) for one in rows)
    assert job.expected(job.rows).seconds == pytest.approx(measured, rel=1e-9, abs=0.0)


def test_a_small_version_is_beside_the_paper():
    """What the paper gives is printed also for a small version, and the verdict only once, as a note."""
    one = {"what": "P", "paper": "1 (from memory)", "ours": "0.9", "verdict": "agrees"}
    content = {"comparison": [one], "rows": 1, "design": 1, "cpu_seconds": 1.0, "folder": "there"}
    assert dict(comparison_rows(content))["P"] == "0.9; paper: 1 (from memory): agrees"
    assert dict(comparison_rows(content | {"note": "small"}))["P"] == "0.9; paper: 1 (from memory)"
