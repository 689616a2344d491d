"""python -m benchmarks [--quick] [--json]: a table of what SAND costs on this machine."""

from __future__ import annotations

import argparse
import json
import warnings

import sand
from sand.simulation.run_writer import versions

from . import compare, estimates, files, quick_figures, regimes, rigid_clusters, scaling, settling, vibrations
from .long_range import growth, savings, tell
from .rows import all_rows
from .table import HEAD, about, line, tell_about


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="smaller worlds, less repetition")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    parser.add_argument("--long-range", action="store_true", help="what lists and multiple time steps save, instead")
    parser.add_argument("--files", action="store_true", help="what frames and checkpoints cost, instead")
    parser.add_argument("--estimates", action="store_true", help="write benchmarks/estimates.csv, instead")
    parser.add_argument("--page", action="store_true", help="what the page of a run costs in a browser, instead")
    parser.add_argument("--scaling", action="store_true", help="cost of a grain's step from 100 grains on, instead")
    parser.add_argument(
        "--quoted", action="store_true", help="measure what README and docs quote and write docs/measured.json, instead"
    )
    parser.add_argument("--tests", action="store_true", help="with --quoted: time the default tests, too")
    parser.add_argument("--settling", action="store_true", help="write docs/physics/settling.csv, instead (a minute)")
    parser.add_argument("--vibrations", action="store_true", help="write docs/physics/vibrations.csv, instead (hours)")
    parser.add_argument(
        "--rigid-clusters", action="store_true", help="write docs/physics/rigid-clusters.csv, instead (an hour)"
    )
    parser.add_argument("--regimes", action="store_true", help="physical time per hour and its accuracy, instead")
    parser.add_argument("--compare", metavar="REV", help="this working tree beside another revision, in turns, instead")
    parser.add_argument("--rounds", type=int, default=compare.ROUNDS, help="of --compare, at least 6 (default 7)")
    options = parser.parse_args()
    if options.compare and options.rounds < 6:
        parser.error(f"--rounds {options.rounds}: an interval of 95 % needs at least 6 rounds")
    warnings.simplefilter("ignore")
    sand.set_threads(1)  # a row that needs more says so
    if options.tests and not options.quoted:
        parser.error("--tests is for --quoted")
    if options.quoted:
        print(quick_figures.write(options.tests))
        return
    if options.estimates:
        print(estimates.write())
        return
    if options.settling:
        print(settling.write())
        return
    if options.vibrations:
        print(vibrations.write())
        return
    if options.rigid_clusters:
        print(rigid_clusters.write())
        return
    if options.compare:
        compared = compare.compare(options.compare, options.rounds)
        print(json.dumps({"revision": options.compare, "rows": compared})) if options.json else compare.show(compared)
        return
    if options.page:
        from . import page  # needs Playwright and a Chromium

        told = page.all_rows(options.quick)
        print(json.dumps({"versions": versions(), "rows": told})) if options.json else page.tell(told)
        return
    if options.long_range:
        rows, grown = savings((100, 1000) if options.quick else (100, 1000, 10_000)), growth()
        print(json.dumps({"rows": rows, "growth": grown})) if options.json else tell(rows, grown)
        return
    if options.files:
        cost = files.costs(1000 if options.quick else 10_000)
        print(json.dumps(cost)) if options.json else files.tell(cost)
        return
    for module, asked in ((scaling, options.scaling), (regimes, options.regimes)):
        if asked:
            told = module.rows(options.quick)
            print(json.dumps(about() | {"rows": list(told)})) if options.json else module.tell(told)
            return
    table(options.quick, options.json)


def table(quick: bool, as_json: bool) -> None:
    """The rows, printed as they come, or one JSON object."""
    told = about()
    if as_json:
        print(json.dumps(told | {"rows": list(all_rows(quick))}))
        return
    tell_about(told)
    print(HEAD)
    missed = 0
    for one in all_rows(quick):
        print(line(one), flush=True)
        missed += one["met"] is False
    print(f"{missed} missed")


if __name__ == "__main__":
    main()
