"""How fast, and into what, dust grows one encounter at a time: populations of eight cases, their table and figures.

Run it with:  python examples/dilute_answers.py --cases magnetic plain --seeds 1 16 --workers 2 --out dilute-answers
It writes a table for each case with a row for each population and end, answers.csv with means and 95 % intervals over
populations (Student's t), times.csv and exponents.csv with the most asked for, and three figures.  The same command
continues, and rows that are there are not computed
again; tables of other machines may be joined, a line for each row.  `--cases` without a name reads the tables alone.
Grains of 20 nm are larger than one magnetic domain of iron: that case shows how growth depends on the radius.
"""

from __future__ import annotations

import argparse
import copy
import math
import time
import warnings
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from sand.analysis.clusters import cluster_labels
from sand.analysis.fits import jackknife
from sand.analysis.growth_law import local_degrees
from sand.basics.errors import BadInput
from sand.basics.units import si
from sand.basics.version import __version__
from sand.experiments.dilute_case import population_of
from sand.experiments.dilute_kernel import CLASSES, capture_sums
from sand.experiments.dilute_results import RANGE, RATIOS, degree, exponents, scaled_time
from sand.experiments.executors import executor_for, results_of
from sand.experiments.seed_table import Interval, mean_of
from sand.io.checkpoint_files import checkpoint_files
from sand.io.lock import writing
from sand.io.run_folder import make_folder, read_toml
from sand.io.table import read_table, write_table
from sand.io.trajectory import Frames
from sand.plotting.papers import Curve, Guide, Panel, panels_figure
from sand.plotting.run_figure import save

CASE = read_toml(Path(__file__).with_name("dilute-growth.toml"))
TEMPERATURE = si(CASE["grains"]["temperature"], "K", "temperature")
MOMENT, ELEMENTARY = CASE["grains"]["moment"], 1.602176634e-19
SIGNS = [{"share": 0.5, "charge": sign * ELEMENTARY} for sign in (1, -1)]
CASES: dict[str, dict[str, dict[str, Any]]] = {
    "magnetic": {},
    "plain": {"grains": {"moment": None}, "forces": {"dipoles": None}},
    "half": {"grains": {"moment": None, "classes": [{"share": 0.5, "moment": MOMENT}, {"share": 0.5}]}},
    "field": {"forces": {"field": {"flux_density": [0, 0, 50e-6]}}},
    "large": {"grains": {"radius": "20 nm"}},
    "charged": {"grains": {"classes": SIGNS}, "forces": {"charges": {}}},
    "charged-plain": {"grains": {"moment": None, "classes": SIGNS}, "forces": {"dipoles": None, "charges": {}}},
    "own": {"method": {"between": "own"}},
}
"""What the cases have that examples/dilute-growth.toml has not; None takes a key away."""
ENDS = {"resolve": (30,), "stick": (30, 100)}
"""S at which populations are measured."""
LEVELS = (1.5, 2, 3, 4, 6, 8, 11, 16, 20, 24, 30, 45, 64, 80, 96)
"""S whose times are in the tables."""
WINDOWS = ((2, 20), (2, 96), (8, 96))
"""Ranges of S in which degrees are fitted."""
KEY = ("case", "hits", "seed", "end")
LARGE = (30, 150)
"""Range of N of further fits of γ and D_f."""
POINTS = 40


def case_of(name: str, hits: str, number: int, end: float) -> dict[str, Any]:
    """The case of a population."""
    case = copy.deepcopy(CASE)
    del case["grow"]
    case["grains"]["number"], case["method"]["hits"] = number, hits
    case["run"]["stop"] = f"mean_cluster_size >= {end:g}"
    for table, changes in CASES[name].items():
        case[table] = {key: value for key, value in (case[table] | changes).items() if value is not None}
    return case


def populations(number: int, out: Path, ends: Sequence[float], item: tuple[str, str, int]) -> list[dict[str, Any]]:
    """Rows of the population of a case, a rule for hits and a seed, one for each end."""
    warnings.simplefilter("ignore", UserWarning)  # of iron as a solid, and of one domain: said in the docstring
    name, hits, seed = item
    folder, rows = out / f"{name}-{hits}" / f"seed-{seed}", list[dict[str, Any]]()
    spent = math.nan if folder.is_dir() and checkpoint_files(folder) else 0.0  # unknown if it continues
    for end in ends:
        began = time.process_time()
        grown = population_of(case_of(name, hits, number, end), seed, folder)
        spent += time.process_time() - began
        last = grown.ledger
        key = dict(zip(KEY, (name, hits, seed, end), strict=True))
        counts = {column: int(last[column][-1]) for column in ("grains", "clusters", "hits", "flights")}
        events = {column: int(grown.encounters[column].sum()) for column in ("made", "slipped", "broken")}
        rows.append(
            key
            | {"outcome": grown.outcome, "sand": __version__, "cpu_seconds": spent, "draws": int(last["step"][-1])}
            | {f"{column}_count" if column == "hits" else column: value for column, value in counts.items()}
            | events
            | {"others": float(last["others"][-1]), "size": float(last["mean_cluster_size"][-1])}
            | growth_of(last)
            | shapes_of(grown)
        )
    return rows


def growth_of(ledger: Any) -> dict[str, float]:
    """Times n₀t [s/m³] at sizes S and ratios n/n₀; NaN beyond the end."""
    size = ledger["mean_cluster_size"]
    row = {f"t_{level:g}": scaled_time(ledger, size >= level) for level in LEVELS}
    return row | {f"t_ratio_{ratio:g}": scaled_time(ledger, ledger["number_ratio"] <= ratio) for ratio in RATIOS}


def shapes_of(grown: Any) -> dict[str, float]:
    """Exponents and means by classes of N of the aggregates, with copies; shares; sums for c."""
    frames = Frames(grown.folder / "trajectory.gsd")
    frame = frames[-1]
    frames.close()
    moments = np.linalg.norm(frame.moment, axis=1)
    radius, moment = float(frame.radius.max()), float(moments.max())
    found = grown.aggregates
    grains, gyration = found["grains"], found["gyration_radius"] / radius
    net = found["moment"] / moment if moment > 0.0 else np.zeros(len(grains))
    row: dict[str, float] = {}
    for name, between in (("", RANGE), ("_large", LARGE)):
        row[f"gamma{name}"], row[f"dimension{name}"] = exponents(found, between)
    magnetic = moments > 0.0
    row |= shares(magnetic, cluster_labels(len(magnetic), frame.pair)) if (~magnetic).any() and magnetic.any() else {}
    sums = capture_sums(grown.encounters, TEMPERATURE)
    number = np.searchsorted(CLASSES, grains, "right") - 1
    for k, least in enumerate(CLASSES[:-1]):
        values = {"number": grains, "gyration": gyration, "moment": net}
        for name, each in values.items():
            chosen = each[(number == k) & (each > 0.0)]
            row[f"{name}_{least}"] = float(np.exp(np.log(chosen).mean())) if len(chosen) else math.nan
        row |= {f"larger_{least}": float(sums.sizes[k]), f"hits_{least}": float(sums.hits[k])}
        row |= {f"expected_{least}": float(sums.expected[k])}
    return row


def shares(magnetic: np.ndarray, labels: np.ndarray) -> dict[str, float]:
    """Shares of a mixture: of magnetic and of other grains that are in aggregates, and of magnetic ones in these.

    `purity` is the last one in aggregates with two magnetic grains or more.
    """
    size, count = np.bincount(labels), np.bincount(labels, magnetic)
    bound, pure = size >= 2, count >= 2
    return {
        "magnetic_in_aggregates": float(bound[labels[magnetic]].mean()),
        "others_in_aggregates": float(bound[labels[~magnetic]].mean()),
        "share_magnetic": float(count[bound].sum() / size[bound].sum()),
        "purity": float(count[pure].sum() / size[pure].sum()),
    }


def table_of(path: Path) -> list[dict[str, Any]]:
    """Rows of a table; numbers, NaN for empty cells."""
    if not path.exists():
        return []
    names, *lines = read_table(path, KEY)
    texts = ("case", "hits", "outcome", "sand")
    return [
        {k: v if k in texts else float(v or "nan") for k, v in zip(names, line, strict=True)} for line in lines if line
    ]


def add_rows(path: Path, rows: Sequence[dict[str, Any]]) -> None:
    """Add rows to a table, which other processes may do as well; those with equal keys are replaced."""
    make_folder(path.parent, shared=True)
    with writing(path.parent, patience=60.0):
        known = {tuple(row[name] for name in KEY): row for row in (*table_of(path), *rows)}
        ordered = [known[key] for key in sorted(known)]
        names = list(dict.fromkeys(name for row in ordered for name in row))
        write_table(path, [{name: _cell(value) for name, value in row.items()} for row in ordered], names)


def _cell(value: Any) -> Any:
    if not isinstance(value, float):
        return value
    return "" if math.isnan(value) else f"{value:.5g}" if value % 1.0 else int(value)


def intervals(rows: Sequence[dict[str, Any]]) -> dict[str, tuple[Interval, int]]:
    """Estimate and 95 % interval over populations of each quantity, with their number: means; z from λ; c of ratios."""
    texts = (*KEY, "outcome", "sand")
    names = [name for name in dict.fromkeys(name for row in rows for name in row) if name not in texts]
    values = {name: np.array([row.get(name, math.nan) for row in rows], float) for name in names}
    for first, last in WINDOWS:
        levels = np.array([level for level in LEVELS if first <= level <= last], float)
        times = np.array([[row.get(f"t_{level:g}", math.nan) for level in levels] for row in rows], float)
        values[f"lambda_{first}_{last}"] = np.array(
            [degree(levels, each) if np.isfinite(each).all() else math.nan for each in times]
        )
    known = {name: each[np.isfinite(each)].tolist() for name, each in values.items()}
    found = {name: (mean_of(each), len(each)) for name, each in known.items() if each}
    for first, last in WINDOWS:
        if (degrees := found.get(f"lambda_{first}_{last}")) is not None:
            z = Interval(*(1.0 / (1.0 - each) if each < 1.0 else math.inf for each in degrees[0]))
            found[f"z_{first}_{last}"] = z, degrees[1]
    # of a class with few hits ratios of single populations are skewed: sums of all are divided
    sums = {name: np.array([np.nan_to_num(values[f"{name}_{k}"]) for k in CLASSES[:-1]]) for name in SUMS}
    if sums["hits"].sum() >= LEAST_HITS:
        found["c"] = (ratio_of(sums["hits"].sum(axis=0), sums["expected"].sum(axis=0)), len(rows))
    for k, hits, expected, larger in zip(CLASSES[:-1], sums["hits"], sums["expected"], sums["larger"], strict=True):
        found.pop(f"larger_{k}", None)
        if hits.sum() >= LEAST_HITS:
            found[f"c_{k}"] = (ratio_of(hits, expected), len(rows))
            found[f"larger_{k}"] = (ratio_of(larger * expected, expected), len(rows))
    return found


def ratio_of(above: np.ndarray, below: np.ndarray) -> Interval:
    """Σ above/Σ below over populations (K,), with the 95 % interval of a jackknife over them; NaN if Σ below is 0."""
    with np.errstate(divide="ignore", invalid="ignore"):
        value = float(above.sum() / below.sum())
        return Interval(value, *jackknife(value, (above.sum() - above) / (below.sum() - below))[1:])


SUMS = ("hits", "expected", "larger")
LEAST_HITS = 30
"""Fewest hits of all populations for c, of a class or of all."""
SHOWN = ("t_2", "t_8", "t_20", "t_96", "t_ratio_0.5", "t_ratio_0.2", "lambda_2_20", "lambda_2_96", "lambda_8_96")
SHOWN += ("z_8_96", "gamma", "dimension", "gamma_large", "dimension_large", "share_magnetic", "purity", "c")
SHOWN += ("cpu_seconds",)


SUMMARY = {
    "times": {
        "t_ratio_0.5": "n₀t at n/n₀ = 0.5 [s/m³]",
        "t_ratio_0.2": "at 0.2",
        "t_2": "at S = 2",
        "t_8": "at 8",
        "t_20": "at 20",
        "t_96": "at 96",
        "lambda_2_20": "λ, S = 2–20",
        "lambda_2_96": "λ, S = 2–96",
        "lambda_8_96": "λ, S = 8–96",
        "z_8_96": "z, S = 8–96",
    },
    "exponents": {
        "gamma": "γ, N = 3–100",
        "gamma_large": "γ, N = 30–150",
        "dimension": "D_f, N = 3–100",
        "dimension_large": "D_f, N = 30–150",
        "c": "c",
        "cpu_seconds": "CPU time of a population [s]",
    },
}
"""Quantities of the summaries times.csv and exponents.csv, and titles of their columns."""


def _text(found: tuple[Interval, int] | None, populations: int) -> str:
    """A mean with its interval; nothing if not all populations have it."""
    return found[0].text() if found is not None and found[1] == populations else ""


def figures(groups: dict[tuple[str, str, float], list[dict[str, Any]]], out: Path) -> None:
    """Figures of each case, at its largest S: S(t) and λ(S); r_g and μ over N; c by classes."""
    last = {}
    for (name, _, _), rows in sorted(groups.items(), key=lambda each: each[0][2]):
        last[name] = rows
    sizes, degrees, radii, moments, factors = (list[Curve]() for _ in range(5))
    for look, (name, rows) in enumerate(last.items()):
        found = intervals(rows)
        label = f"{name}, {rows[0]['hits']}"
        levels = [level for level in LEVELS if found.get(f"t_{level:g}", (0, 0))[1] == len(rows)]
        if levels:
            times = [found[f"t_{level:g}"][0] for level in levels]
            sizes.append(Curve(label, np.array([each.value for each in times]), np.array(levels, float), look=look))
        degrees += local_curve(label, rows, levels, look)
        for curves, quantity in ((radii, "gyration"), (moments, "moment")):
            curves += class_curve(label, found, "number", quantity, look)
        factors += class_curve(label, found, "larger", "c", look)
    number = np.array([2.0, 300.0])
    grains = "grains N"
    first = [Panel("n₀t (s/m³)", "S", sizes, log="xy"), Panel("S", "λ = d ln Ṡ/d ln S", degrees)]
    laws = [Guide("N^(1/1.2)", number, number ** (1.0 / 1.2))], [Guide("N^0.63, the paper", number, number**0.63)]
    second = [Panel(grains, "r_g/r", radii, laws[0], log="xy"), Panel(grains, "μ/μ₁", moments, laws[1], log="xy")]
    third = [Panel("grains of the larger body", "c = K/⟨π b_max² v⟩", factors)]
    for name, panels in (("sizes", first), ("shapes", second), ("kernel", third)):
        save(panels_figure(panels, "growth in dilute dust, one encounter at a time"), out / f"{name}.png")


def class_curve(label: str, found: dict[str, tuple[Interval, int]], x: str, y: str, look: int) -> list[Curve]:
    """A curve over classes of N that more than half of the populations have; none if there are fewer than two."""
    most = max(number for _, number in found.values())
    least = [k for k in CLASSES[:-1] if 2 * found.get(f"{y}_{k}", (0, 0))[1] > max(most, 2) and f"{x}_{k}" in found]
    least = [k for k in least if found[f"{y}_{k}"][0].value > 0.0]
    if len(least) < 2:
        return []
    values = np.array([found[f"{y}_{k}"][0] for k in least])
    return [Curve(label, np.array([found[f"{x}_{k}"][0].value for k in least]), *values.T, look=look)]


def local_curve(label: str, rows: Sequence[dict[str, Any]], levels: Sequence[float], look: int) -> list[Curve]:
    """Local degrees of the mean S(t) of populations, in windows of S with a ratio of 4; none if S is too small."""
    if len(levels) < 4:
        return []
    logs = np.log([[row[f"t_{level:g}"] for level in levels] for row in rows])
    along = np.linspace(logs[:, 0].max(), logs[:, -1].min(), POINTS)
    if along[-1] <= along[0]:
        return []
    size = np.exp([np.interp(along, own, np.log(levels)) for own in logs])
    try:
        found = local_degrees(np.exp(along), size)
    except BadInput:  # S grows by less than 1.5
        return []
    x = np.array([math.sqrt(each.low_size * each.high_size) for each in found])
    low, value, high = np.array([(each.low, each.degree, each.high) for each in found]).T
    return [Curve(label, x, value, low, high, look=look)]


def summarise(out: Path) -> None:
    """Write answers.csv and the figures of all tables of a folder, and print the answers."""
    groups: dict[tuple[str, str, float], list[dict[str, Any]]] = {}
    for name in CASES:
        for row in table_of(out / f"{name}.csv"):
            groups.setdefault((name, row["hits"], row["end"]), []).append(row)
    lines, summary = [], {table: list[dict[str, Any]]() for table in SUMMARY}
    for (name, hits, end), rows in groups.items():
        found = intervals(rows)
        for table, columns in SUMMARY.items():
            head = {"case": f"{name}, {hits}", "until S": f"{end:g}", "populations": len(rows)}
            summary[table].append(head | {title: _text(found.get(each), len(rows)) for each, title in columns.items()})
        print(f"{name}, {hits}, S = {end:g}: {len(rows)} populations")
        for quantity, (value, number) in found.items():
            one = {"case": name, "hits": hits, "end": end, "quantity": quantity, **value._asdict()}
            lines.append({key: _cell(cell) for key, cell in one.items()} | {"populations": number})
            if quantity in SHOWN:
                print(f"  {quantity:16} {value.text()}")
    if lines:
        write_table(out / "answers.csv", lines)
        for table, summed in summary.items():
            write_table(out / f"{table}.csv", summed)
        figures(groups, out)


def main() -> None:
    """Grow the populations that are missing, and summarise all."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", nargs="*", choices=list(CASES), default=list(CASES))
    parser.add_argument("--hits", nargs="+", choices=list(ENDS), default=list(ENDS))
    parser.add_argument("--seeds", nargs=2, type=int, default=(1, 16), metavar=("FIRST", "LAST"))
    parser.add_argument("--grains", type=int, default=1000, help="at the start of a population")
    parser.add_argument("--until", type=float, default=math.inf, help="largest S")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", default="dilute-answers", help="folder of tables, figures and populations")
    options = parser.parse_args()
    out = Path(options.out).absolute()
    ends = {hits: sorted({min(end, options.until) for end in ENDS[hits]}) for hits in options.hits}
    known = {tuple(row[name] for name in KEY) for case in options.cases for row in table_of(out / f"{case}.csv")}
    seeds = range(options.seeds[0], options.seeds[1] + 1)
    items = [(case, hits, seed) for seed in seeds for case in options.cases for hits in options.hits]
    with executor_for(options.workers) as executor:
        for hits in options.hits:
            left = [one for one in items if one[1] == hits and not {(*one, end) for end in ends[hits]} <= known]
            work = partial(populations, options.grains, out, ends[hits])
            for (case, _, seed), rows in results_of(executor, work, left):
                add_rows(out / f"{case}.csv", rows)
                print(f"{case}, {hits}, seed {seed}: S = {rows[-1]['size']:.3g}, {rows[-1]['outcome']}", flush=True)
    summarise(out)


if __name__ == "__main__":
    main()
