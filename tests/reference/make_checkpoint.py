"""Makes tests/reference/run-v10: a small run with a checkpoint, which releases with the same format must read.

    python tests/reference/make_checkpoint.py

To be run once for each format of checkpoints; an old folder is never made anew.
"""

import shutil
import tempfile
import warnings
from pathlib import Path

import sand
from sand.io.checkpoint import VERSION

HERE = Path(__file__).parent


def main() -> None:
    """A magnetic chain in a gas, with contacts, stopped about half-way to 80 ps."""
    warnings.simplefilter("ignore")
    goal = HERE / f"run-v{VERSION}"
    if goal.exists():
        raise SystemExit(f"{goal} is there already; an old folder is never made anew")
    grains = sand.setup.aggregates.chain(4, radius="10 nm", material=sand.IRON, moment="200 A m^2/kg")
    with tempfile.TemporaryDirectory() as parent:
        folder = Path(parent) / "run"
        forces = [sand.Contact(), sand.Dipoles(), sand.Gas("100 K", pressure="1 mbar")]
        sim = sand.Simulation(grains, forces, out=folder, seed=4, frame_every="10 ps")
        sim.run(until="30 ps")
        sim.run(until="80 ps", steps=1)
        goal.mkdir()
        for path in (folder / "case.toml", folder / "ledger.csv", sorted(folder.glob("checkpoint-*.npz"))[-1]):
            shutil.copy(path, goal)


if __name__ == "__main__":
    main()
