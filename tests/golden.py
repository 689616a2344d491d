"""Numbers of short runs over all features of SAND, to compare two revisions bit by bit on the same machine.

    git worktree add /tmp/before REVISION
    PYTHONPATH=/tmp/before/src python tests/golden.py record before.npz
    python tests/golden.py compare before.npz

`compare` repeats the runs, prints every quantity whose bits differ with its largest relative difference, and exits
with 1 if there is one.  The numbers are not committed: bits differ between processors and versions of numba.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

import sand

RUNS: dict[str, Callable[[Path], dict[str, Any]]] = {}
IRON = {"radius": "10 nm", "material": sand.IRON, "moment": "200 A m^2/kg"}
STATE = ("position", "velocity", "spin", "moment", "force", "torque")


def golden(function: Callable[[Path], dict[str, Any]]) -> Callable[[Path], dict[str, Any]]:
    """Register a run; its name is that of the function."""
    RUNS[function.__name__] = function
    return function


def end_of(sim: sand.Simulation) -> dict[str, Any]:
    """State, contacts and energy table of a simulation."""
    numbers: dict[str, Any] = {name: np.asarray(getattr(sim.grains, name)) for name in STATE}
    numbers |= {"time": sim.time, "steps": sim.steps}
    table = sim.contacts
    numbers["contacts"] = np.stack([np.asarray(table[name], float) for name in ("overlap", "slide", "roll", "twist")])
    last = sim.ledger.rows[-1]
    numbers |= {f"ledger {name}": last[name] for name in last}
    return numbers


def gas(number: int = 20, box: str = "0.25 um", **options: Any) -> sand.Grains:
    """Magnetic iron grains at random positions."""
    return sand.setup.gas(number, box, **(IRON | {"temperature": "300 K", "seed": 3} | options))


def impact(**contact: Any) -> list[Any]:
    """Two silica aggregates just before an impact, and the contact model."""
    first = sand.setup.bpca(12, radius="0.1 um", material="silica", seed=1)
    second = sand.setup.bpca(8, radius="0.1 um", material="silica", seed=2)
    met = sand.setup.encounter(first, second, speed="8 m/s", impact_parameter="0.3 b")
    return [met.grains, [sand.Contact(**contact)]]


@golden
def contacts_open(folder: Path) -> dict[str, Any]:
    """Contacts alone: slip beyond the limits, breaking."""
    sim = sand.Simulation(*impact())
    sim.run(steps=6000)
    return end_of(sim)


@golden
def contacts_options(folder: Path) -> dict[str, Any]:
    """slip="reset", variable stiffness, viscoelastic and constant damping, two materials."""
    contact = sand.Contact(slip="reset", stiffness="dt97", damping="viscoelastic", viscous_time="1e-11 s")
    sim = sand.Simulation(impact()[0], [contact], box="4 um")
    sim.run(steps=6000)
    mixed = sand.setup.bpca(12, radius="0.1 um", material="ice", seed=1)
    second = sand.setup.bpca(
        8, radius=sand.setup.Lognormal("0.1 um", 1.3, "0.05 um", "0.2 um"), material="silica", seed=2
    )
    met = sand.setup.encounter(mixed, second, speed="8 m/s", impact_parameter="0.3 b")
    damped = sand.Contact(damping="constant", damping_constant="1e-9 kg/s", slide_factor=2.5, roll_factor=8)
    other = sand.Simulation(met.grains, [damped])
    other.run(steps=3000)
    return end_of(sim) | {f"mixed {name}": value for name, value in end_of(other).items()}


@golden
def dipoles_impulse(folder: Path) -> dict[str, Any]:
    """Dipoles of all pairs by r-RESPA impulses, periodic, with grains that stick."""
    sim = sand.Simulation(gas(), [sand.Contact(), sand.Dipoles()], box="0.25 um")
    sim.run(steps=30000)
    return end_of(sim) | sim.at_grains()


@golden
def dipoles_taylor(folder: Path) -> dict[str, Any]:
    """The two Taylor schemes, and a sum in every step with a fixed step."""
    numbers = {}
    for far in ("taylor", "taylor-literal", "every step"):
        step = "2e-13 s" if far == "every step" else "auto"
        stepping = sand.Verlet(far=far, step=step)
        sim = sand.Simulation(gas(12, "0.2 um"), [sand.Contact(), sand.Dipoles()], box="0.2 um", stepping=stepping)
        sim.run(steps=8000)
        numbers |= {f"{far} {name}": value for name, value in end_of(sim).items()}
    return numbers


@golden
def listed(folder: Path) -> dict[str, Any]:
    """Dipoles and charges from a Verlet list, smooth and sharp cut-offs, and a gas with Brownian motion."""
    grains = gas(100, "0.6 um")
    charged = sand.Grains(
        grains.position, grains.radius, sand.IRON, velocity=grains.velocity, spin=grains.spin, moment=grains.moment,
        charge=np.where(np.arange(100) % 2, 1.6e-19, -1.6e-19),
    )  # fmt: skip
    forces = [
        sand.Contact(), sand.Dipoles("0.12 um"), sand.Charges("0.12 um", cut="sharp"),
        sand.Gas("300 K", pressure="1 bar"),
    ]  # fmt: skip
    search = sand.Neighbours(search="cells")
    sim = sand.Simulation(charged, forces, box="0.6 um", neighbours=search, seed=7)
    sim.run(steps=8000)
    return end_of(sim)


@golden
def walls(folder: Path) -> dict[str, Any]:
    """Grains between a wall at rest and one with a mass that is pressed on them, with dashpots, and with a bath."""
    position = [[2.5e-7 * x, 2.5e-7 * y, 1.05e-7 + 2.2e-7 * z] for x in range(3) for y in range(2) for z in range(2)]
    grains = sand.Grains(position, "0.1 um", "silica", velocity=[0.3, 0.1, -2.0], spin=[1e6, 2e5, 0.0])
    lid = sand.Wall([0, 0, "0.5 um"], [0, 0, -1], "ice", mass="1e-15 kg", force="1 nN")
    numbers = {}
    for bath in (None, "300 K"):
        contact = sand.Contact(damping="critical", bath_temperature=bath)
        sim = sand.Simulation(grains, contact, walls=[sand.Wall([0, 0, 0], [0, 0, 1], "silica"), lid], seed=1)
        sim.run(until="40 ns")
        numbers |= {f"{bath} {name}": value for name, value in end_of(sim).items()}
    return numbers


@golden
def rigid(folder: Path) -> dict[str, Any]:
    """Rigid clusters in a box with dipoles, and with substeps in a gas."""
    contact = sand.Contact(damping="critical", settling_time="5 ns")
    dense = sand.Simulation(
        gas(60, "0.5 um"), [contact, sand.Dipoles(cutoff="0.12 um")], box="0.5 um", stepping=sand.RigidClusters()
    )
    dense.run(until="60 ns")
    forces = [contact, sand.Dipoles(cutoff="0.3 um"), sand.Gas("300 K", pressure="1 bar")]
    thin = sand.Simulation(gas(60, "1 um"), forces, box="1 um", seed=1, stepping=sand.RigidClusters())
    thin.run(until="0.2 us")
    return end_of(dense) | {f"gas {name}": value for name, value in end_of(thin).items()}


@golden
def external(folder: Path) -> dict[str, Any]:
    """Gravity, an electric field, a rotating magnetic field and Newtonian attraction, open space."""
    forces = [
        sand.Contact(), sand.Dipoles(), sand.Attraction(), sand.Gravity("9.81 m/s^2"),
        sand.ElectricField("1 kV/m"), sand.Field(0, shape="rotating", amplitude=["10 mT", 0, 0], frequency="100 MHz",
                                                 axis=[0, 0, 1]),
    ]  # fmt: skip
    sim = sand.Simulation(gas(10, "0.2 um"), forces, box=None)
    sim.run(steps=8000)
    return end_of(sim)


@golden
def many(folder: Path) -> dict[str, Any]:
    """Above the sizes for parallel blocks and spatial sorting; one thread and two."""
    numbers = {}
    body = sand.setup.bpca(4200, radius="0.1 um", material="silica", seed=4)
    for threads in (1, 2):
        sand.set_threads(threads)
        shaken = sand.Grains(
            body.position, body.radius, sand.SILICA,
            velocity=np.random.default_rng(5).normal(0.0, 0.3, body.position.shape),
        )  # fmt: skip
        sim = sand.Simulation(shaken, [sand.Contact()])
        sim.run(steps=400)
        numbers |= {f"loose {threads} {name}": value for name, value in end_of(sim).items()}
        cloud = sand.Simulation(gas(1100, "1 um"), [sand.Contact(), sand.Dipoles()], box="1 um")
        cloud.run(steps=60)
        numbers |= {f"cloud {threads} {name}": value for name, value in end_of(cloud).items()}
    sand.set_threads(None)
    return numbers


@golden
def resumed(folder: Path) -> dict[str, Any]:
    """Files, a stop, a resume from the checkpoint, the frames as read back."""
    sim = sand.Simulation(gas(), [sand.Contact(), sand.Dipoles()], box="0.25 um", out=folder / "r", frame_every="1 ns")
    sim.run(steps=15000)
    again = sand.resume(folder / "r")
    again.run(steps=15000)
    run = sand.open(folder / "r")
    return end_of(again) | {"frames": len(run.frames), "last frame": np.asarray(run.frames[-1].position)}


@golden
def collide(folder: Path) -> dict[str, Any]:
    """`sand collide` of two seeds."""
    (folder / "c.toml").write_text(
        '[target]\nkind = "bpca"\ngrains = 8\nradius = "0.1 um"\nmaterial = "silica"\n'
        '[projectile]\nkind = "bcca"\ngrains = 4\nradius = "0.1 um"\nmaterial = "silica"\n'
        '[impact]\nspeed = "3 m/s"\nimpact_parameter = "0.3 b"\nturn = true\nseeds = [1, 2]\n'
        '[forces.contact]\ndamping = "viscoelastic"\nviscous_time = "1.25e-11 s"\n',
        "utf-8",
    )
    command("collide", folder / "c.toml", "--out", folder / "c", "--workers", "1")
    return dict(numbers_within(json.loads((folder / "c" / "collision.json").read_text("utf-8"))))


@golden
def scatter(folder: Path) -> dict[str, Any]:
    """Cross-section and map of two grains, cross-section of two aggregates."""
    from sand.experiments import scattering

    one = scattering.cross_section(
        "10 nm", "iron", "200 A m^2/kg", "100 K", 1.0, speed_unit="thermal", spin="kT/2", relative_error=0.2, seed=1
    )
    (folder / "s.toml").write_text(
        '[target]\nkind = "chain"\ngrains = 3\nradius = "10 nm"\nmaterial = "iron"\nmoment = "200 A m^2/kg"\n'
        '[projectile]\nradius = "10 nm"\nmaterial = "iron"\nmoment = "200 A m^2/kg"\n'
        '[flight]\ntemperature = "100 K"\nspeed = [0.5, 1.0]\nspeed_unit = "thermal"\n'
        '[measure]\njob = "map"\ncells = 4\nper_cell = 4\nseed = 1\n',
        "utf-8",
    )
    command("scatter", folder / "s.toml", "--out", folder / "s", "--workers", "1")
    return {"sigma": one.sigma, "error": one.sigma_error} | tables_in(folder / "s")


@golden
def grow(folder: Path) -> dict[str, Any]:
    """`sand grow` of two boxes, `sand analyse`."""
    (folder / "g.toml").write_text(
        '[run]\nuntil = "60 ns"\nframe_every = "5 ns"\n[box]\nperiodic = "0.25 um"\n'
        '[grains]\nkind = "gas"\nnumber = 20\n'
        'radius = "10 nm"\nmaterial = "iron"\nmoment = "200 A m^2/kg"\ntemperature = "100 K"\n'
        "[forces.contact]\n[forces.dipoles]\n",
        "utf-8",
    )
    command("grow", folder / "g.toml", "--seeds", "1-2", "--workers", "1", "--out", folder / "g")
    command("analyse", folder / "g")
    return tables_in(folder / "g")


@golden
def build(folder: Path) -> dict[str, Any]:
    """Every kind of aggregate but the single grain."""
    numbers: dict[str, Any] = {}
    for kind in ("chain", "lattice", "hexagonal", "bpca", "bcca", "dla", "dlca", "fractal", "rbd"):
        options = {"grains": 27, "radius": "0.1 um", "material": "silica", "seed": 2}
        body = sand.setup.build(kind, **options)
        numbers |= {f"{kind} position": np.asarray(body.position)}
    relaxed = sand.setup.bpca(20, radius="10 nm", material="iron", moment="200 A m^2/kg", moments="relaxed", seed=1)
    return numbers | {"relaxed": np.asarray(relaxed.moment)}


@golden
def theory(folder: Path) -> dict[str, Any]:
    """Closed forms, Smoluchowski's equation."""
    found = sand.theory.contact("silica", "0.1 um")
    numbers = {name: value for name, value in vars_of(found).items() if isinstance(value, float)}
    kernel = sand.theory.kinetics.brownian("0.1 um", "1e-17 kg", "300 K", 2.0)
    sizes = sand.theory.smoluchowski.log_sizes(1e4, 5)
    numbers_at_start = np.where(sizes == sizes[0], 1e12, 0.0)
    grown = sand.theory.smoluchowski.coagulate(
        kernel, sizes, numbers_at_start, [1.0, 100.0], mass="1e-17 kg", may_lose=0.9
    )
    return numbers | {name: np.asarray(value) for name, value in vars_of(grown).items()}


@golden
def analysis(folder: Path) -> dict[str, Any]:
    """Shapes, dimensions, clusters."""
    body = sand.setup.bcca(64, radius="0.1 um", material="silica", seed=3)
    position = np.asarray(body.position)
    return {
        "radius of gyration": sand.analysis.shape.gyration_radius(position, body.mass, body.radius),
        "area": np.asarray(sand.analysis.shape.projected_area(position, body.radius)[:1]),
        "dimension": sand.analysis.fractal.correlation_dimension(position).value,
    }


@golden
def chain(folder: Path) -> dict[str, Any]:
    """The paper's Figure 4: a chain struck by a grain."""
    from sand.experiments import chain_impact

    hit = chain_impact.strike(sand.IRON, "10 nm", speed=240.0, place=-0.6, contact=sand.Contact())
    return {"position": np.asarray(hit.grains.position), "time": hit.time}


def vars_of(thing: Any) -> dict[str, Any]:
    """Numerical arrays among the attributes of an object."""
    items = thing._asdict() if hasattr(thing, "_asdict") else vars(thing)
    return {name: value for name, value in items.items() if isinstance(value, (float, np.ndarray))}


def numbers_of(table: Path) -> dict[str, Any]:
    """Columns of numbers in a csv file."""
    rows = [line.split(",") for line in table.read_text("utf-8").splitlines() if line and not line.startswith("#")]
    columns = {}
    for name, *column in zip(*rows, strict=False):
        try:
            columns[name] = np.array([float(value) if value else np.nan for value in column])
        except ValueError:
            continue
    return columns


def numbers_within(content: Any, path: str = "") -> Iterator[tuple[str, float]]:
    """Every number in the content of a JSON file, by its path, except wall times."""
    if isinstance(content, bool) or "wall" in path:
        return
    if isinstance(content, (int, float)):
        yield path, float(content)
    elif isinstance(content, (list, dict)):
        for key, value in content.items() if isinstance(content, dict) else enumerate(content):
            yield from numbers_within(value, f"{path}/{key}")


def tables_in(folder: Path) -> dict[str, Any]:
    """Columns of numbers in all tables of a folder."""
    return {
        f"{table.relative_to(folder)} {name}": value
        for table in sorted(folder.rglob("*.csv"))
        for name, value in numbers_of(table).items()
    }


def command(*words: Any) -> None:
    """A command of `sand`, in a process of its own."""
    done = subprocess.run([sys.executable, "-m", "sand", *map(str, words)], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(f"{words}: {done.stderr}")


def all_numbers(only: list[str]) -> dict[str, np.ndarray]:
    """Every number of every run, by run and name."""
    numbers = {}
    for name, run in RUNS.items():
        if only and name not in only:
            continue
        with tempfile.TemporaryDirectory() as folder, warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found = run(Path(folder))
        print(f"{name}: {len(found)} quantities", file=sys.stderr, flush=True)
        numbers |= {f"{name}: {key}": np.asarray(value, dtype=float) for key, value in found.items()}
    return numbers


def compare(before: dict[str, np.ndarray], now: dict[str, np.ndarray]) -> list[str]:
    """A line for each quantity that differs in any bit."""
    lines = [f"{key}: only {'before' if key in before else 'now'}" for key in sorted(before.keys() ^ now.keys())]
    for key in sorted(before.keys() & now.keys()):
        a, b = before[key], now[key]
        if a.shape != b.shape:
            lines.append(f"{key}: {a.shape} before, {b.shape} now")
        elif a.tobytes() != b.tobytes():
            scale = np.nanmax(np.abs(a)) or 1.0
            lines.append(f"{key}: {np.nanmax(np.abs(a - b)) / scale:.3g} of the largest entry")
    return lines


def main() -> int:
    """Record or compare."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("job", choices=("record", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--only", nargs="+", default=[], choices=list(RUNS), metavar="RUN", help="names of runs")
    given = parser.parse_args()
    print(f"sand from {Path(sand.__file__).parent}", file=sys.stderr)
    now = all_numbers(given.only)
    if given.job == "record":
        np.savez_compressed(given.file, **now)
        return 0
    with np.load(given.file, allow_pickle=False) as stored:
        before = {key: stored[key] for key in stored.files if not given.only or key.split(":")[0] in given.only}
    lines = compare(before, now)
    print("\n".join(lines) or f"all {len(now)} quantities have the same bits")
    return int(bool(lines))


if __name__ == "__main__":
    sys.exit(main())
