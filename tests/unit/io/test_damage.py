"""Damaged files of a run: reported in one line, kept under another name, and no wrong number is ever read."""

import json
import random
import shutil
import warnings
import zipfile

import numpy as np
import pytest

import sand
from sand.cli.main import main
from sand.io import run_folder as files
from sand.io.damage import sealed
from sand.io.gsd_index import ENTRY, read_index
from sand.io.ledger_table import LedgerFile, keep_if_damaged, read_ledger
from sand.io.live_trajectory import LiveTrajectory
from sand.io.trajectory import Frames, TrajectoryWriter, read_frames
from sand.viewer.dataset import run_dataset

from ..synthetic_trajectories import grains_of, write_trajectory

COLUMNS = ("step", "time", "translation", "normal", "lost_forming", "total", "momentum_x", "contacts")


def rows_of(count):
    """Synthetic ledger rows."""
    rng = np.random.default_rng(1)
    rows = []
    for k in range(count):
        energies = {name: float(v) for name, v in zip(COLUMNS[2:5], rng.normal(size=3) * 1e-18, strict=True)}
        row = {"step": 60 * k, "time": 1e-12 * k, **energies}
        rows.append(
            {**row, "total": float(np.sum(list(energies.values()))), "momentum_x": 1e-25 * k, "contacts": k % 7}
        )
    return rows


def ended_run(folder, count=40):
    """ledger.csv and summary.json of a finished run."""
    folder.mkdir(exist_ok=True)
    file = LedgerFile(folder / files.LEDGER, COLUMNS, rows_of(count)[:3])
    for row in rows_of(count)[3:]:
        file.append(row)
    content = {"outcome": "finished", "time": 1.5e-9, "steps": 60 * (count - 1), "drift": 3.2e-5, "choices": {"a": "b"}}
    files.write_json(folder / files.SUMMARY, sealed(files.plain(content | file.described())))
    return rows_of(count)


def read_with_notes(read, path):
    """What is read, and the number of warnings; None if it is refused in one line."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            found = read(path)
        except sand.BadInput as error:
            assert len(error.problems) == 1 and str(path.parent) in str(error)
            return None, 0
    return found, len(caught)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "read"), [(files.LEDGER, read_ledger), (files.SUMMARY, files.read_json)])
def test_changed_bytes_never_give_other_numbers(tmp_path, name, read):
    """Each of 800 changed bytes: refused, a warning, or the same numbers."""
    ended_run(tmp_path)
    path, rng = tmp_path / name, random.Random(3)
    good, whole = path.read_bytes(), read(path)
    refused = 0
    for _ in range(800):
        bad = bytearray(good)
        bad[rng.randrange(len(bad))] = rng.choice(b'0123456789.,-e\n" x\x00\xff')
        path.write_bytes(bad)
        found, notes = read_with_notes(read, path)
        refused += found is None
        if name == files.SUMMARY and found is not None:
            numbers = {key: value for key, value in whole.items() if key in found}
            assert all(found[key] == value for key, value in numbers.items()) and len(numbers) >= len(whole) - 1
        else:
            assert found in (None, whole) or notes, bytes(bad)
    assert refused > 600


def test_the_ledger_of_a_running_simulation_is_checked_by_rows(tmp_path):
    """Without a summary a changed digit or an extra column is noticed; an incomplete last row is no error."""
    ended_run(tmp_path)
    (tmp_path / files.SUMMARY).unlink()
    path = tmp_path / files.LEDGER
    good = path.read_text()
    lines = good.splitlines()
    parts = lines[5].split(",")
    for changed, message in (
        (lambda: [*parts[:2], str(2 * float(parts[2])), *parts[3:]], "total = .*columns add up to"),
        (lambda: ["60", *parts[1:]], "steps and times must grow"),
        (lambda: [*parts, "1"], "has 9 columns, not 8"),
        (lambda: [*parts[:2], "nan", *parts[3:]], "not finite"),
        (lambda: [*parts[:2], "x", *parts[3:]], "not a number"),
    ):
        path.write_text("\n".join([*lines[:5], ",".join(changed()), *lines[6:]]) + "\n")
        with pytest.raises(sand.BadInput, match=f"row 5 .*{message}"):
            read_ledger(path)
    path.write_text(good[:-20])
    assert read_with_notes(read_ledger, path) == (rows_of(40)[:-1], 0)
    path.write_text(
        "\n".join([*lines[:-1], ",".join([*lines[-1].split(",")[:2], "nan", "1.0", "1.0", "nan", "0.0", "1"])]) + "\n"
    )
    assert np.isnan(read_ledger(path)[-1]["total"])  # the last row of a run that ended with an error outcome


def test_ledgers_shorter_or_longer_than_the_summary(tmp_path):
    """Half of it: a warning.  More rows (a resumed run): none.  A missing row: a warning."""
    rows = ended_run(tmp_path)
    path = tmp_path / files.LEDGER
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(lines[:21]))
    with pytest.warns(UserWarning, match=r"ledger\.csv has 20 of the 40 rows that the run had written"):
        assert read_ledger(path) == rows[:20]
    path.write_text("".join(lines[:7] + lines[8:]))
    with pytest.warns(UserWarning, match="39 of the 40 rows"):
        read_ledger(path)
    path.write_text("".join(lines) + lines[-1].replace("2340,", "2400,"))
    assert read_with_notes(read_ledger, path)[1] == 0
    assert len(read_ledger(path)) == 41
    path.write_text(
        "".join(lines).replace("1.9000000000000002e-24", "1.9000000000000001e-24").replace(",1.9e-24", ",1.8e-24")
    )
    with pytest.raises(sand.BadInput, match=r"do not match the digest in summary\.json"):
        read_ledger(path)


def test_a_damaged_ledger_is_kept_on_resume(tmp_path):
    """Before it is rewritten from a checkpoint; one that is only shorter or longer is not kept."""
    rows = ended_run(tmp_path)
    path, aside = tmp_path / files.LEDGER, tmp_path / "ledger.csv.damaged"
    good = path.read_text()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for text in (good, good[:-30], good + "7,torn", good[: len(good) // 2]):
            path.write_text(text)
            keep_if_damaged(path, COLUMNS, rows)
    keep_if_damaged(path, COLUMNS, rows[:20])
    bad = good[:900] + "7" + good[901:]
    for number in ("", "-2"):
        path.write_text(bad)
        with pytest.warns(UserWarning, match=rf"ledger\.csv did not hold .*now ledger\.csv\.damaged{number}"):
            keep_if_damaged(path, COLUMNS, rows)
        assert aside.with_name(aside.name + number).read_text() == bad and not path.exists()


@pytest.fixture
def run(finished_run, tmp_path):
    """A copy of a finished run."""
    return shutil.copytree(finished_run[0], tmp_path / "run")


def test_all_readers_report_damage(run, capsys):
    """Changed ledger and summary: `sand.open`, `sand info`, `sand plot` and the page; half a ledger: a warning."""
    ledger, summary = run / files.LEDGER, run / files.SUMMARY
    known = json.loads(summary.read_text())
    assert known["ledger_rows"] == 6 and len(known["ledger_sha256"]) == len(known["sha256"]) == 64
    lines = ledger.read_text().splitlines(keepends=True)
    ledger.write_text("".join(lines[:4]))
    with pytest.warns(UserWarning, match="3 of the 6 rows"):
        assert len(sand.open(run).ledger["step"]) == 3
    for words in (["info", str(run)], ["plot", str(run), "--what", "energies"]):
        assert main(words) == 0
        message = capsys.readouterr().err.strip().splitlines()
        assert len(message) == 1 and "note:" in message[0] and "3 of the 6 rows" in message[0]
    assert "3 of the 6 rows" in run_dataset(run).manifest()["note"]
    ledger.write_text("".join([*lines[:3], lines[3].replace("5", "6"), *lines[4:]]))
    for words in (["info", str(run)], ["plot", str(run), "--what", "energies", "--overwrite"]):
        assert main(words) == 2
        assert "ledger.csv is damaged: row 3" in capsys.readouterr().err
    assert "ledger.csv is damaged" in run_dataset(run).manifest()["note"]
    ledger.write_text("".join(lines))
    summary.write_text(summary.read_text().replace('"steps": ', '"steps": 1'))
    with pytest.raises(sand.BadInput, match=r"summary\.json is damaged"):
        sand.open(run).summary  # noqa: B018
    assert main(["info", str(run)]) == 2
    assert "summary.json is damaged" in capsys.readouterr().err
    assert "summary.json is damaged" in run_dataset(run).manifest()["note"]


def test_a_damaged_checkpoint_is_reported_and_kept(run, capsys):
    """`sand resume` names it and the older one it uses; the file is kept under another name."""
    old, new = sorted(run.glob("checkpoint-*.npz"))
    bad = bytearray(new.read_bytes())
    with zipfile.ZipFile(new) as archive:  # headers of the archive have bytes without meaning
        bad[archive.getinfo("grains/position.npy").header_offset + 100] ^= 1
    new.write_bytes(bad)
    with pytest.warns(
        UserWarning, match=f"{new.name} is .*now {new.name}.damaged, and the run continues from {old.name}"
    ):
        assert sand.resume(run).steps == int(old.stem.split("-")[1])
    assert not new.exists() and new.with_name(f"{new.name}.damaged").read_bytes() == bytes(bad)
    sand.Simulation(grains_of(2), out=run, overwrite=True)
    assert not list(run.glob("*.damaged"))


@pytest.mark.validate
def test_every_entry_of_a_damaged_index(tmp_path):
    """Of 40 frames, 30 are before the checkpoint: if one of these is lost it is reported and the file kept."""
    good = write_trajectory(tmp_path / "good.gsd", [[(0, 1)]] * 40, 4)
    offset, entries = read_index(good)
    written, rng = [10 * k for k in range(41)], random.Random(5)
    message = 0
    for number in sorted(rng.sample(range(len(entries)), 40)):
        for field, value in (("location", 0), ("location", 2**40), ("frame", 2**33), ("type", 200)):
            path = tmp_path / f"{number}-{field}-{value}" / "trajectory.gsd"
            path.parent.mkdir()
            bad = entries.copy()
            bad[number][field] = value
            content = bytearray(good.read_bytes())
            content[offset : offset + len(entries) * ENTRY.itemsize] = bad.tobytes()
            path.write_bytes(content)
            with pytest.raises(sand.BadInput):
                Frames(path)
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                TrajectoryWriter(path, 290, written).close()
            steps = [frame.step for frame in read_frames(path)]
            assert steps == written[: len(steps)]
            lost = max(30 - len(steps), 0)
            kept = list(path.parent.glob("*.damaged*"))
            assert len(caught) == len(kept) == (lost > 0)
            if not steps:
                assert "cannot be repaired; it is now trajectory.gsd.damaged" in str(caught[0].message)
                assert kept[0].read_bytes() == bytes(content)
            elif lost:
                assert f"{lost} of its 30 frames are lost; a copy of it is trajectory.gsd.damaged" in str(
                    caught[0].message
                )
                assert kept[0].read_bytes() == bytes(content)
                TrajectoryWriter(path, 290, written).close()  # damage is reported once only
                message += 1
            shutil.rmtree(path.parent)
    assert message > 40


def test_a_trajectory_whose_index_is_empty(tmp_path):
    """A file with data but no index entry: an error; repaired and kept."""
    path = write_trajectory(tmp_path / "trajectory.gsd", [[(0, 1)]] * 5, 3)
    offset, entries = read_index(path)
    with open(path, "r+b") as file:
        file.seek(offset)
        file.write(bytes(len(entries) * ENTRY.itemsize))
    for read in (read_frames, LiveTrajectory, Frames):
        with pytest.raises(sand.BadInput, match="holds data but no frame"):
            read(path)
    with pytest.warns(UserWarning, match=r"cannot be repaired; it is now trajectory\.gsd\.damaged"):
        TrajectoryWriter(path, 40, [0, 10, 20, 30, 40]).close()
    assert read_frames(path) == []
    empty = tmp_path / "empty.gsd"
    TrajectoryWriter(empty).close()
    assert read_frames(empty) == []


def test_the_checksum_covers_step_and_materials(tmp_path):
    """Other values there are refused, frame by frame."""
    import gsd.hoomd

    path = write_trajectory(tmp_path / "new.gsd", [[(0, 1)]] * 3, 3)
    with gsd.hoomd.open(str(path), "r") as file:
        frames = [file[k] for k in range(3)]
    for change, number in (("step", 1), ("types", 0)):
        other = tmp_path / f"{change}.gsd"
        with gsd.hoomd.open(str(other), "w") as file:
            for k, frame in enumerate(frames):
                step, types = frame.configuration.step, frame.particles.types
                if change == "step" and k == number:
                    frame.configuration.step = step + 5
                if change == "types":
                    frame.particles.types = ["silica"]
                file.append(frame)
                frame.configuration.step, frame.particles.types = step, types
        with pytest.raises(sand.BadInput, match="checksum"):
            Frames(other)[number]
