"""Starting from a frame of a trajectory: single precision is corrected, no contact is made or broken."""

import copy
import math

import numpy as np
import pytest

import sand
from sand.cli.main import main
from sand.io.bodies import SINGLE_PRECISION
from sand.io.trajectory import read_frames
from sand.setup.from_frame import restore_overlaps

RADIUS = 1e-8
STIFFNESS = 100.0
"""Upper bound of k_n [N/m] of two silica grains; in equilibrium it is 2 E* a0 = 57 N/m."""


@pytest.fixture(scope="module")
def collision_run(tmp_path_factory):
    """A fast grain hits a compact cluster in a corner of a periodic box; folder and frames of the run."""
    folder = tmp_path_factory.mktemp("frames") / "crash"
    cluster = sand.setup.bpca(40, radius=RADIUS, material="silica", seed=1)
    corner = np.array([1.4e-7, 0.9e-7, 1.4e-7])
    positions = np.vstack([cluster.position, cluster.position[0] + [0, 0, 1.5e-7]])
    positions = sand.Box.periodic("0.3 um").wrap(positions + corner)
    speed = np.zeros((41, 3))
    speed[40] = [0.3, 0.4, -30.0]
    grains = sand.Grains(positions, RADIUS, "silica", velocity=speed, moment="2 A m^2/kg")
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles()], box="0.3 um", out=folder, frame_every="0.25 ns")
    sim.run(until="10 ns")
    return folder, read_frames(folder / "trajectory.gsd"), sim


@pytest.mark.compiled("dipoles", "small")
def test_the_run_covers_the_hard_cases(collision_run):
    """The run has stretched and displaced contacts, some at a limit, and contacts across the box faces."""
    _, frames, _ = collision_run
    shares = np.vstack([frame.share for frame in frames])
    assert (shares[:, 0] > 0.05).any()
    assert (shares[:, 2] > 0.2).any()
    last = frames[-1]
    apart = last.position[last.pair[:, 0]] - last.position[last.pair[:, 1]]
    assert (np.abs(apart) > 1e-7).any()


@pytest.mark.compiled("dipoles")
def test_every_frame_starts_a_run_with_its_contacts(collision_run):
    """Pairs are equal, overlaps to rounding (64 ε of the coordinates in radii), displacements to single precision.

    Contact forces agree to k_n times the rounding of overlaps plus the rounding of the frame.
    """
    _, frames, _ = collision_run
    for number, frame in enumerate(frames):
        start = sand.setup.from_frame(frame, {"silica": sand.SILICA})
        sim = sand.Simulation(start.grains, [sand.Contact(), sand.Dipoles()], box=start.box, contacts=start.contacts)
        table = sim.contacts
        assert {tuple(sorted(p)) for p in table["pair"].tolist()} == {tuple(sorted(p)) for p in frame.pair.tolist()}
        assert (table["pair"] == frame.pair).all(), f"frame {number}"
        assert table["overlap"] == pytest.approx(frame.overlap, rel=0, abs=64 * 2.3e-16 * 16 * RADIUS)
        floor = 64 * 2.3e-16 * RADIUS
        for name in ("slide", "roll"):
            was = getattr(frame, name)  # directions of n are known to 16 · 6e-8/2 rad
            assert table[f"{name}_vector"] == pytest.approx(was, rel=0, abs=1e-6 * np.abs(was).max() + floor)
        assert table["twist"] == pytest.approx(frame.twist, rel=1e-6, abs=1e-12)
        rounding = STIFFNESS * 64 * 2.3e-16 * 16 * RADIUS
        assert table["force"] == pytest.approx(frame.force, rel=0, abs=2e-6 * np.abs(frame.force).max() + rounding)
        assert np.abs(sim.grains.position - frame.position).max() < 16 * SINGLE_PRECISION * RADIUS * 4
        assert sim.ledger["made"][-1] == sim.ledger["broken"][-1] == 0


@pytest.mark.compiled("dipoles")
def test_first_ledger_row_equals_that_of_the_frame(collision_run):
    """All energies of the new run's first row equal those of the earlier ledger to single precision."""
    _, frames, old = collision_run
    k = len(frames) // 2
    start = sand.setup.from_frame(frames[k], {"silica": sand.SILICA})
    sim = sand.Simulation(start.grains, [sand.Contact(), sand.Dipoles()], box=start.box, contacts=start.contacts)
    sim.loads()
    for name in ("translation", "rotation", "normal", "sliding", "rolling", "twisting", "magnetic"):
        was = old.ledger[name][k]
        assert sim.ledger[name][0] == pytest.approx(was, rel=3e-6, abs=3e-6 * abs(old.ledger["translation"][k])), name


@pytest.mark.compiled("dipoles")
def test_a_frame_as_a_simulation(collision_run):
    """`sand.open(DIR).at(k)`: energies at grains add up to the ledger's row, to single precision."""
    folder, frames, old = collision_run
    k = len(frames) // 2
    at = sand.open(folder).at(k).at_grains()
    elastic = sum(old.ledger[name][k] for name in ("normal", "sliding", "rolling", "twisting"))
    scale = abs(old.ledger["translation"][k])
    assert at["contacts"].sum() == pytest.approx(elastic, rel=3e-6, abs=3e-6 * scale)
    assert at["magnetic"].sum() == pytest.approx(old.ledger["magnetic"][k], rel=3e-6, abs=3e-6 * scale)


@pytest.mark.compiled("dipoles")
def test_continuation_follows_the_original_run(collision_run):
    """After one frame interval positions agree with the next frame of the original run.

    The start differs by 1e-7 (single precision of velocities and displacements) and steps differ; the integration error
    is far above that, so the bound is a thousandth of the displacement in the interval.
    """
    _, frames, _ = collision_run
    k = len(frames) // 2
    start = sand.setup.from_frame(frames[k], {"silica": sand.SILICA})
    sim = sand.Simulation(start.grains, [sand.Contact(), sand.Dipoles()], box=start.box, contacts=start.contacts)
    sim.run(until=frames[k + 1].time - frames[k].time)
    moved = np.abs(start.box.nearest(frames[k + 1].position - frames[k].position)).max()
    late = abs(sim.time - (frames[k + 1].time - frames[k].time)) * np.abs(sim.grains.velocity).max()
    assert np.abs(start.box.nearest(sim.grains.position - frames[k + 1].position)).max() < 1e-3 * moved + late
    assert len(sim.contacts["pair"]) == len(frames[k + 1].pair)


def test_position_correction_of_random_packings():
    """Positions rounded to 24 bits: dense lattices with redundant contacts, small gaps, a periodic box.

    Overlaps are restored to 64 ε of the coordinates, coordinates change by a few roundings, and no new pair overlaps.
    """
    rng = np.random.default_rng(3)
    for box in (sand.Box.open(), sand.Box.periodic(12 * RADIUS * 0.99)):
        grid = np.array([[x, y, z] for x in range(6) for y in range(6) for z in range(6)], float)
        true = (grid - 2.5) * 2.0 * RADIUS * 0.99 + rng.normal(size=(216, 3)) * 0.02 * RADIUS
        radius = RADIUS * rng.uniform(0.97, 1.03, 216)
        pairs = box.close_pairs(true, 2.2 * RADIUS)
        apart = np.linalg.norm(box.nearest(true[pairs[:, 0]] - true[pairs[:, 1]]), axis=1)
        overlap = radius[pairs].sum(axis=1) - apart
        kept = overlap > -0.01 * RADIUS  # some of them stretched
        in_contact = pairs[kept]
        rounded = np.float64(np.float32(true / RADIUS)) * RADIUS
        found = restore_overlaps(rounded, radius, box, in_contact, overlap[kept])
        apart = np.linalg.norm(box.nearest(found[in_contact[:, 0]] - found[in_contact[:, 1]]), axis=1)
        assert radius[in_contact].sum(axis=1) - apart == pytest.approx(
            overlap[kept], rel=0, abs=64 * 2.3e-16 * 12 * RADIUS
        )
        assert np.abs(box.nearest(found - rounded)).max() < 12 * SINGLE_PRECISION * RADIUS * 10
        assert kept.sum() > 400


def test_position_correction_of_a_rigid_packing():
    """32 grains of an fcc block exactly 2r apart: rounding decides which overlap; after correction none does.

    Far from the origin single precision resolves 6e-8 of the distance only, which is not reported as damage.
    """
    cell = np.array([[0, 0, 0], [0.5, 0.5, 0], [0.5, 0, 0.5], [0, 0.5, 0.5]])
    grid = np.array([[x, y, z] for x in range(2) for y in range(2) for z in range(2)], float)
    block = (grid[:, None] + cell).reshape(-1, 3) * 2.0 * math.sqrt(2.0) * RADIUS
    none = np.zeros((0, 2), int)
    for away in (0.0, 1e5 * RADIUS):
        rounded = np.float64(np.float32((block + away) / RADIUS)) * RADIUS
        found = restore_overlaps(rounded, np.full(32, RADIUS), sand.Box.open(), none, np.zeros(0))
        pairs = sand.Box.open().close_pairs(found, 2.5 * RADIUS)
        assert np.linalg.norm(found[pairs[:, 0]] - found[pairs[:, 1]], axis=1).min() > 2.0 * RADIUS
        assert np.abs(found - rounded).max() < 1e-3 * RADIUS + 64 * SINGLE_PRECISION * away


@pytest.mark.compiled("dipoles")
def test_a_frame_with_nan_is_refused(collision_run):
    """The last frame of a run that ended with non-finite numbers is refused with its step."""
    _, frames, _ = collision_run
    frame = copy.copy(frames[4])
    frame.velocity = frame.velocity.copy()
    frame.velocity[3] = np.nan
    with pytest.raises(sand.BadInput, match=f"step {frame.step}: velocity .* not finite; use an earlier frame"):
        sand.setup.from_frame(frame, {"silica": sand.SILICA})


@pytest.mark.compiled("small")
def test_a_frame_without_contacts_starts_a_run(tmp_path):
    """The first frame of a gas: grains as they were, no contact."""
    grains = sand.setup.gas(5, 1e-6, radius=1e-8, material="iron", temperature="100 K", seed=1)
    sand.Simulation(grains, [sand.Contact()], box=1e-6, out=tmp_path / "gas").run(steps=1)
    start = sand.setup.from_frame(sand.open(tmp_path / "gas").frames[0], {"iron": sand.IRON})
    again = sand.Simulation(start.grains, [sand.Contact()], box=start.box, contacts=start.contacts)
    again.run(steps=1)
    assert len(again.contacts["pair"]) == 0 and len(again.grains) == 5


def test_overlap_by_rounding_makes_no_contact():
    """Two grains with a tiny gap that overlap once rounded are separated again."""
    positions = np.array([[0.0, 0, 0], [2.0 * RADIUS * (1 - 3e-8), 0, 0], [0, 5 * RADIUS, 0]])
    none = np.zeros((0, 2), int)
    found = restore_overlaps(positions, np.full(3, RADIUS), sand.Box.open(), none, np.zeros(0))
    gap = np.linalg.norm(found[0] - found[1]) / (2 * RADIUS) - 1
    assert 0 < gap < 2e-9
    assert (found[2] == positions[2]).all()


def captured(capsys):
    return capsys.readouterr()


@pytest.mark.compiled("dipoles")
def test_the_command(collision_run, tmp_path, monkeypatch, capsys):
    """`sand run --from` starts from a frame of an earlier run and reports it; case files and `resume` work, too."""
    folder, frames, _ = collision_run
    monkeypatch.chdir(tmp_path)
    assert main(["run", "--from", str(folder), "--frame", "20", "--until", "0.1 ns"]) == 0
    message = " ".join(captured(capsys).out.split())
    assert f"trajectory.gsd, step {frames[20].step}" in message
    assert f"{len(frames[20].pair)} contacts kept" in message
    new = sand.open("crash-from-20")
    assert new.frames[0].time == 0.0
    assert (new.frames[0].pair == frames[20].pair).all()
    assert new.case["grains"] == {
        "kind": "file",
        "material": "silica",
        "file": str((folder / "trajectory.gsd").resolve()),
        "frame": 20,
    }
    (tmp_path / "mine.toml").write_text(
        f'[run]\nuntil = "0.1 ns"\nframe_every = "0.25 ns"\n[grains]\nkind = "file"\nfile = "{folder}"\nframe = 20\n'
        "[forces.contact]\n[forces.dipoles]\ncutoff = 4e-08\n"
    )
    assert main(["run", "mine.toml", "--quiet"]) == 0
    again = sand.open("mine")
    assert (again.frames[-1].position == new.frames[-1].position).all()
    assert main(["resume", "mine", "--until", "0.2 ns", "--quiet"]) == 0
    assert main(["run", "--from", str(folder), "--frame", "20", "--until", "0.2 ns", "--out", "x", "--quiet"]) == 0
    assert (sand.open("x").frames[-1].position == sand.open("mine").frames[-1].position).all()


@pytest.mark.compiled("dipoles")
@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["--frame", "3"], ["--from"]),
        ([], ["CASE.toml", "--from"]),
        (["bare.toml", "--from", "RUN", "--out", "RUN", "--overwrite"], ["holds the run that the grains come from"]),
        (["--from", "bare.toml"], ["holds no grains"]),
        (["--from", "."], ["not the folder of a run"]),
        (["iron.toml"], ["grains.material", "silica", "iron"]),
        (["--from", "nowhere"], ["there is no file or folder nowhere"]),
        (["--from", "RUN", "--frame", "999"], ["41 frames", "from 0 to 40", "999"]),
        (["other.toml", "--from", "RUN"], ["box", "400 nm", "300 nm", "leave [box] out"]),
        (["bare.toml", "--from", "RUN"], ["contacts are given", "Contact"]),
        (["soft.toml", "--from", "RUN", "--frame", "STRETCHED"], ["soft.toml", "beyond its break"]),
        (["both.toml"], ["number", "leave it out"]),
        (["fileless.toml"], ["file is missing"]),
        (["foreign.toml"], ["foreign.gsd", "not a trajectory"]),
    ],
)
def test_wrong_requests_are_refused(collision_run, tmp_path, monkeypatch, capsys, words, parts):
    """One line each, nothing written."""
    folder, frames, _ = collision_run
    stretched = int(np.argmax([frame.share[:, 0].max() for frame in frames]))
    monkeypatch.chdir(tmp_path)
    run, forces = '[run]\nuntil = "1 ns"\n', "[forces.contact]\n"
    grains = "[grains]\nkind = 'gas'\nnumber = 2\nradius = '1 nm'\n"
    cases = {
        "other": run + grains + forces + "[box]\nperiodic = '0.4 um'\n",
        "bare": run + grains,
        "soft": run + grains + forces + "[materials.silica]\nlike = 'silica'\nsurface_energy = '1e-7 J/m^2'\n",
        "both": run + f"[grains]\nkind = 'file'\nnumber = 4\nfile = '{folder}'\n",
        "iron": run + f"[grains]\nkind = 'file'\nmaterial = 'iron'\nfile = '{folder}'\n" + forces,
        "fileless": run + "[grains]\nkind = 'file'\n",
        "foreign": run + "[grains]\nkind = 'file'\nfile = 'foreign.gsd'\n",
    }
    for name, text in cases.items():
        (tmp_path / f"{name}.toml").write_text(text)
    (tmp_path / "foreign.gsd").write_text("hello")
    before = sorted(tmp_path.iterdir())
    meant = {"RUN": str(folder), "STRETCHED": str(stretched)}
    assert main(["run", *(meant.get(word, word) for word in words)]) == 2
    message = "\n".join(line for line in captured(capsys).err.splitlines() if "compiling" not in line)
    assert message.count("\n") == 0, message
    assert all(part in message for part in parts), message
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.compiled("dipoles")
def test_an_inconsistent_frame_is_refused(collision_run):
    """An overlap that the positions cannot have is refused, not enforced."""
    _, frames, _ = collision_run
    frame = frames[3]
    overlap = frame.overlap.copy()
    overlap[5] += 0.3 * RADIUS
    with pytest.raises(sand.BadInput, match="damaged"):
        restore_overlaps(frame.position, frame.radius, frame.box, frame.pair.astype(int), overlap)
