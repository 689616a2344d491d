"""Growth of magnetic grains at different temperatures, in an external field and in a gas.

Run it with:  python examples/growth_variants.py --boxes 3 --until "4 us" --workers 2 --out variants
After an interruption, the same command continues.  `sand analyse variants/cold variants/hot` compares two variants.
"""

from __future__ import annotations

import argparse
import copy
from pathlib import Path

from sand.experiments.executors import executor_for
from sand.experiments.growth_boxes import grow
from sand.experiments.growth_report import read_ensemble
from sand.io.run_folder import read_toml

CASE = read_toml(Path(__file__).with_name("growth.toml"))
VARIANTS = {
    "as it is": {},
    "cold": {"grains": {"temperature": "10 K"}},
    "hot": {"grains": {"temperature": "1000 K"}},
    "field": {"forces": {"field": {"flux_density": [0, 0, 0.05]}}},
    "drag": {"forces": {"gas": {"temperature": "100 K", "pressure": "10 mbar"}}},
}


def variant(name: str, until: str) -> dict:
    """Return the case of growth.toml with the changes of a variant."""
    case = copy.deepcopy(CASE)
    case["run"]["until"] = until
    for table, changes in VARIANTS[name].items():
        case[table].update(changes)
    return case


def main() -> None:
    """Simulate each variant and print its final size and exponents."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--boxes", type=int, default=3)
    parser.add_argument("--until", default="4 us")
    parser.add_argument("--workers", type=int, default=1)
    parser.add_argument("--out", default="variants")
    parser.add_argument("--only", choices=list(VARIANTS), action="append")
    options = parser.parse_args()
    print(f"{'':10} {'final S':>16} {'z':>12} {'gamma':>12} {'D_f':>12}")
    with executor_for(options.workers) as executor:
        for name in options.only or VARIANTS:
            folder = Path(options.out) / name.replace(" ", "-")
            grow(variant(name, options.until), range(1, options.boxes + 1), folder, executor)
            growth = read_ensemble(folder).growth
            fits = [(growth.z, "exponent"), (growth.moment, "exponent"), (growth.dimension, "value")]
            columns = ["-" if fit is None else f"{getattr(fit, key):.2f} ± {fit.error:.2f}" for fit, key in fits]
            print(f"{name:10} {growth.mean[-1]:8.2f} ± {growth.error[-1]:.2f}", *(f"{text:>12}" for text in columns))


if __name__ == "__main__":
    main()
