"""What trajectories and exports keep: identities, numbers of materials, unit, crossings of the box, all numbers."""

import re
import tracemalloc
import warnings
import xml.etree.ElementTree as ElementTree

import gsd.hoomd
import numpy as np
import pytest

import sand
from sand.analysis.clusters import cluster_labels
from sand.basics.box import Box
from sand.cli.main import main
from sand.io.bodies import contacts_of, read_body, read_grains, write_body
from sand.io.export import export_frames
from sand.io.extended_xyz import listed
from sand.io.file_frames import open_frames
from sand.io.run_folder import write_toml
from sand.io.trajectory import Frames, TrajectoryWriter

STRANGE = ("ice; amorphous", 'type "A"', "two\nlines", "a\\b", "100 % Ünïcode\u2028", "it's")
"""Names of materials with characters that mean something in files."""


def named(name):
    return sand.SILICA.but(name=name)


def grains_at_step(k):
    """Grains that change as in a run: the first is removed after step 0, one of another material is added in step 2."""
    rng = np.random.default_rng(3)
    size = rng.uniform(1e-8, 3e-8, 6)
    vectors = {name: rng.normal(size=(6, 3)) for name in ("velocity", "spin")}
    whole = sand.Grains(
        rng.uniform(-2e-7, 2e-7, (6, 3)),
        size,
        [named("iron"), named(STRANGE[0]), named("ice"), named("ice"), named("ice"), named(STRANGE[2])],
        moment=1e-18 * rng.normal(size=(6, 3)),
        charge=1.6e-19 * np.arange(6),
        mass=1e-19 * rng.uniform(1.0, 2.0, 6),
        own={"heating": (rng.normal(size=6), "W/m^2")},
        **vectors,
    )
    kept = [np.arange(5), np.arange(1, 5), np.arange(1, 6)][k]
    grains = whole[kept]
    grains.arrays.id[...] = kept
    grains.arrays.image[...] = rng.integers(-3, 4, (6, 3))[kept].T + k
    return grains


def write(path, steps, **resumed):
    writer = TrajectoryWriter(path, **resumed)
    for k in steps:
        grains = grains_at_step(k)
        writer.write(10 * k, 1e-9 * k, grains, Box.periodic(5e-7, 6e-7, None), contacts_of(grains))
    writer.flush()
    writer.close()
    return path


@pytest.fixture(scope="module")
def trajectory(tmp_path_factory):
    return write(tmp_path_factory.mktemp("run") / "trajectory.gsd", range(3))


def test_other_programs_see_one_unit_and_fixed_types(trajectory):
    """The box, which does not change, has the same size in the stored unit; a type is the same material throughout."""
    with gsd.hoomd.open(str(trajectory)) as file:
        stored = list(file)
    assert len({tuple(one.configuration.box[:2].tolist()) for one in stored}) == 1
    types = [list(one.particles.types) for one in stored]
    assert [names[: len(types[0])] for names in types] == [types[0]] * 3 and len(types[2]) == len(types[0]) + 1
    for k, one in enumerate(stored):
        assert one.particles.image.tolist() == grains_at_step(k).image.tolist()


def test_frames_have_the_grains(trajectory):
    """Names, identities, crossings and positions are those that were written, also of a material that vanished."""
    for k, frame in enumerate(Frames(trajectory)):
        grains = grains_at_step(k)
        assert [frame.materials[m] for m in frame.material] == [grains.materials[m].name for m in grains.material]
        assert (frame.id == grains.id).all() and (frame.image == grains.image).all()
        # positions have single precision
        jumps = grains.image * np.array([5e-7, 6e-7, 0.0])
        assert frame.unwrapped == pytest.approx(grains.position + jumps, abs=1e-13)


@pytest.mark.parametrize("again", [0, 1, 2])
def test_a_continued_trajectory_is_the_same(trajectory, tmp_path, again):
    """A run that is resumed after frame `again` writes the frames of an uninterrupted one."""
    path = write(tmp_path / "t.gsd", range(3))
    write(path, range(again + 1, 3), resume_at=1e-9 * again, written=[1e-9 * k for k in range(again + 1)])
    write(tmp_path / "cut.gsd", range(again + 1))
    write(tmp_path / "cut.gsd", range(again + 1, 3), resume_at=1e-9 * again)
    for other in (path, tmp_path / "cut.gsd"):
        with gsd.hoomd.open(str(trajectory)) as first, gsd.hoomd.open(str(other)) as second:
            assert len(first) == len(second) == 3
            for one, two in zip(first, second, strict=True):
                assert one.log["crc32"] == two.log["crc32"] and one.log["scale/length"] == two.log["scale/length"]


def unlisted(text):
    from urllib.parse import unquote

    return [unquote(name) for name in text.split(";")]


def columns_of_xyz(text):
    """Columns by name of each frame, with time, step and names of materials, as the format defines them."""
    lines, at, frames = text.split("\n"), 0, []
    while at < len(lines) and lines[at]:
        count, head = int(lines[at]), lines[at + 1]
        parts = re.search(r"Properties=(\S+)", head)[1].split(":")
        rows, columns, c = [line.split(" ") for line in lines[at + 2 : at + 2 + count]], {}, 0
        for name, width in zip(parts[::3], map(int, parts[2::3]), strict=True):
            columns[name] = np.array([row[c : c + width] for row in rows]).squeeze()
            c += width
        assert {len(row) for row in rows} == {c}
        columns = {name: values if name == "species" else values.astype(float) for name, values in columns.items()}
        names = unlisted(re.search(r'materials="([^"]*)"', head)[1])
        columns |= {"time": float(re.search(r"Time=(\S+)", head)[1]), "step": int(re.search(r"Step=(\d+)", head)[1])}
        frames.append(columns | {"names": [names[int(k)] for k in columns["material"]], "scale": 1e-10})
        at += 2 + count
    return frames


def columns_of_dump(text):
    frames = []
    for part in text.split("ITEM: TIMESTEP\n")[1:]:
        head, _, body = part.partition("ITEM: ATOMS ")
        titles, *rows = body.splitlines()
        of = dict(zip(titles.split(), np.array([row.split() for row in rows]).T, strict=True))
        materials = unlisted(re.search(r"ITEM: NUMBER OF ATOMS # (.*)", head)[1])
        symbols = [{"iron": "Fe", "ice": "O"}.get(name, "X") for name in materials]
        assert of.pop("element").tolist() == [symbols[int(kind) - 1] for kind in of["type"]]
        of = {name: values.astype(float) for name, values in of.items()}
        vectors = {"pos": "x y z", "velo": "vx vy vz", "spin": "omegax omegay omegaz", "moment": "mux muy muz"}
        frame = {name: np.column_stack([of[c] for c in parts.split()]) for name, parts in vectors.items()}
        frame |= {"images": np.column_stack([of[f"i{axis}"] for axis in "xyz"]), "id": of["id"] - 1}
        frame |= {"charge": of["q"], "mass": of["mass"], "radius": of["radius"], "heating": of["d_heating"]}
        assert (of["v_time"] == of["v_time"][0]).all() and int(head.splitlines()[2]) == len(rows)
        frame |= {"time": of["v_time"][0], "step": int(head.split()[0]), "cluster": of["c_cluster"] - 1}
        frames.append(frame | {"names": [materials[int(k) - 1] for k in of["type"]], "scale": 1.0, "type": of["type"]})
    return frames


def columns_of_data(text):
    names = unlisted(re.search(r"\d+ atom types # (.*)", text)[1])
    head, body = text.split("Atoms # hybrid sphere dipole\n\n")
    atoms, moving = body.split("\nVelocities\n\n")
    of = np.array([row.split() for row in atoms.splitlines()], float).T
    rates = np.array([row.split() for row in moving.splitlines()], float).T
    assert (of[0] == rates[0]).all()
    frame = {"id": of[0] - 1, "pos": of[2:5].T, "radius": of[5] / 2, "charge": of[7], "moment": of[8:11].T}
    frame |= {"mass": of[6] * 4 / 3 * np.pi * (of[5] / 2) ** 3, "images": of[11:].T, "velo": rates[1:4].T}
    step, time = re.match(r"SAND, step (\d+), (\S+) s, units si, boundary p p f", head).groups()
    frame |= {"spin": rates[4:].T, "time": float(time), "step": int(step), "scale": 1.0}
    return frame | {"names": [names[int(k) - 1] for k in of[1]]}


def columns_of_vtp(path):
    def values(one):
        width = int(one.get("NumberOfComponents", 1))
        numbers = np.array((one.text or "").split(), float)
        return numbers.reshape(-1, width) if width > 1 else numbers

    root = ElementTree.parse(path).getroot()
    points = {one.get("Name"): values(one) for one in root.find(".//PointData")}
    field = {one.get("Name"): one for one in root.find(".//FieldData")}
    names = bytes(int(byte) for byte in field["materials"].text.split()).decode().split("\0")[:-1]
    frame = points | {"pos": values(root.find(".//Points/DataArray")), "velo": points["velocity"]}
    frame |= {"images": points["image"], "names": [names[int(k)] for k in points["material"]], "scale": 1.0}
    return frame | {"time": values(field["TimeValue"])[0], "step": int(values(field["step"])[0])}


@pytest.mark.filterwarnings("ignore:LAMMPS data files have no place")
@pytest.mark.parametrize("chosen", [slice(None), slice(1, None)])
@pytest.mark.parametrize("form", ["xyz", "lammps-dump", "lammps-data", "vtk"])
def test_round_trip_of_everything(trajectory, tmp_path, form, chosen):
    """Every number of a frame is in every format exactly; lengths in ångström and densities lose their last digit.

    Materials and identities have the same numbers in all frames, whichever are exported.
    """
    frames = Frames(trajectory)
    paths = export_frames(frames, tmp_path / "out", form, cluster_labels, chosen)
    if form == "xyz":
        found = columns_of_xyz(paths[0].read_text("utf-8"))
    elif form == "lammps-dump":
        found = columns_of_dump(paths[0].read_text("utf-8"))
    elif form == "lammps-data":
        found = [columns_of_data(path.read_text("utf-8")) for path in paths]
    else:
        found = [columns_of_vtp(path) for path in paths[1:]]
    wanted = {"pos": "position", "velo": "velocity", "images": "image"}
    exact = ["velo", "moment", "spin", "charge", "id", "images", "time", "step"]
    exact += ["mass", "heating"] if form != "lammps-data" else []
    assert len(found) == len(frames[chosen])
    for theirs, ours in zip(found, frames[chosen], strict=True):
        for name in exact:
            value = np.asarray(getattr(ours, wanted.get(name, name)))
            # 9 digits restore a number of single precision
            assert np.array_equal(np.asarray(theirs[name]).astype(value.dtype), value), name
        for name in ("pos", "radius"):
            # one rounding each of the quotient, of the product, and of the unit itself
            value = getattr(ours, wanted.get(name, name))
            assert theirs[name] * theirs["scale"] == pytest.approx(value, rel=4e-16, abs=0.0)
        assert theirs["mass"] == pytest.approx(ours.mass, rel=1e-7, abs=0.0)
        if "type" in theirs:
            assert [frames.material_names()[int(k) - 1] for k in theirs["type"]] == theirs["names"]
        assert theirs["names"] == [ours.materials[k] for k in ours.material]


@pytest.mark.filterwarnings("ignore:.*not read. virial")
@pytest.mark.parametrize("form", ["xyz", "lammps-dump", "vtk"])
def test_shares_in_the_virial(tmp_path, form):
    """Of a run with stress each grain has its nine numbers, xx, xy, … zz in J; its other columns are read as before.

    Frames have them in single precision, 2^-24 = 6e-8, written with nine digits.
    """
    grains, shares = grains_at_step(0), 1e-18 * np.arange(45.0).reshape(5, 3, 3)
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    writer.write(0, 0.0, grains, Box.open(), contacts_of(grains), virial=shares)
    writer.close()
    path = export_frames(Frames(tmp_path / "trajectory.gsd"), tmp_path / "out", form, cluster_labels)[-1]
    if form == "vtk":
        points = {one.get("Name"): one for one in ElementTree.parse(path).iter("DataArray")}
        found, unit = points["virial"].text, points["virial"].find("InformationKey").text
        assert points["virial"].get("NumberOfComponents") == "9" and unit == "J"
        numbers = np.array(found.split(), float)
    else:
        lines = path.read_text("utf-8").splitlines()
        first, names = (9, lines[8].split()[2:]) if form == "lammps-dump" else (2, [])
        at = names.index("d2_virial[1]") if names else -9
        numbers = np.array([line.split()[at:][:9] for line in lines[first:]], float).ravel()
        assert "virial:R:9" in lines[1] if form == "xyz" else names[at + 8] == "d2_virial[9]"
        known = {material.name: material for material in grains.materials}
        read = read_grains(path, materials=known).grains
        assert (read.moment == grains.moment).all() and list(read.own) == OWN_KEPT[form]
    assert numbers == pytest.approx(shares.ravel(), rel=7e-8, abs=0.0)


@pytest.mark.parametrize("name", STRANGE)
def test_names_survive(name, tmp_path):
    """Names of materials with characters that mean something in a file come back from bodies in both formats."""
    for file in ("b.xyz", "b.gsd"):
        body = sand.setup.chain(2, radius="0.1 um", material=named(name))
        write_body(tmp_path / file, body)
        assert read_body(tmp_path / file, materials={name: named(name)}).materials[0].name == name


def test_ordinary_names_are_written_as_they_are():
    assert listed(["iron", "water ice", "Eis (ß)"]) == "iron;water ice;Eis (ß)"
    assert len(listed(STRANGE).split(";")) == len(STRANGE) and listed(STRANGE).isprintable()


def test_memory_does_not_grow_with_the_number_of_frames(tmp_path):
    """The largest memory in use during an export is that of a frame and its text."""
    grains = sand.setup.gas(300, "10 um", radius="0.1 um", material="silica", temperature="300 K", seed=1)

    def peak(count):
        path = tmp_path / f"{count}.gsd"
        writer = TrajectoryWriter(path)
        for k in range(count):
            writer.write(k, 1e-9 * k, grains, Box.periodic(1e-5), contacts_of(grains))
        writer.close()
        frames = Frames(path)
        export_frames(frames, tmp_path / "warm", "xyz", cluster_labels, slice(1))
        tracemalloc.start()
        (written,) = export_frames(frames, tmp_path / str(count), "xyz", cluster_labels)
        found = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return found, written.stat().st_size

    (few, small), (many, large) = peak(3), peak(30)
    assert large > 9 * small
    assert many < 1.2 * few  # the list of numbers and caches of the reader are small; all texts would be 10 × few


def test_an_overwritten_run_names_what_was_made_of_it(tmp_path):
    """Exports and figures stay when a run is replaced, and a warning names them; without any there is none."""
    folder = tmp_path / "run"
    grains = sand.Grains([[0, 0, 0]], 1e-7, "silica")
    sand.Simulation(grains, [], out=folder)
    write_toml(folder / "case.toml", {}, "a run")
    write(folder / "trajectory.gsd", [0])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        sand.Simulation(grains, [], out=folder, overwrite=True)
    write_toml(folder / "case.toml", {}, "a run")
    write(folder / "trajectory.gsd", [0])
    (folder / "plots").mkdir()
    for name in ("trajectory.xyz", "plots/size.png", "notes.txt"):
        (folder / name).write_text("")
    with pytest.warns(
        UserWarning, match=r"keeps plots/size\.png, trajectory\.xyz, which the earlier run may have left"
    ):
        sand.Simulation(grains, [], out=folder, overwrite=True)
    assert (folder / "trajectory.xyz").exists() and (folder / "notes.txt").exists()


def test_files_of_a_longer_export_are_named(tmp_path, capsys):
    """`sand export --overwrite` of fewer frames says that files of the export before stay."""
    write(tmp_path / "trajectory.gsd", range(3))
    words = ["export", str(tmp_path), "--to", "vtk", "--out", str(tmp_path / "a")]
    assert main(words) == 0
    assert main([*words, "--overwrite", "--frames", "-1"]) == 0
    told = capsys.readouterr().err
    assert "2 files of an earlier export stay" in told and "a-000000000000.vtp" in told
    assert main([*words, "--overwrite"]) == 0
    assert "earlier export" not in capsys.readouterr().err


def test_frames_within_one_step_have_different_numbers(tmp_path):
    """`TIMESTEP` of a dump is the step; where frames share steps it is the index of the frame, whichever are chosen."""
    grains = sand.Grains([[0, 0, 0]], 1e-7, "silica")
    for steps, wanted in (((3, 7, 9), ["7", "9"]), ((3, 3, 4), ["1", "2"])):
        writer = TrajectoryWriter(tmp_path / "t.gsd")
        for k, step in enumerate(steps):
            writer.write(step, 1e-9 * k, grains, Box.open(), contacts_of(grains))
        writer.close()
        (path,) = export_frames(Frames(tmp_path / "t.gsd"), tmp_path / "t", "lammps-dump", cluster_labels, slice(1, 3))
        assert re.findall(r"ITEM: TIMESTEP\n(\d+)", path.read_text()) == wanted
        assert [frame.time for frame in open_frames(path)] == [1e-9, 2e-9]
        (tmp_path / "t.gsd").unlink()


KEPT = ("velocity", "spin", "moment", "charge", "mass")
OWN_KEPT = {"xyz": ["heating"], "lammps-dump": [], "lammps-data": []}
"""Own quantities with their unit that SAND reads again from its exports; a LAMMPS dump has no place for the unit."""


@pytest.mark.filterwarnings("ignore:LAMMPS data files have no place")
@pytest.mark.parametrize("form", list(OWN_KEPT))
@pytest.mark.parametrize("suffix", [".gsd", ".xyz"])
def test_exports_of_a_body_are_read_again(tmp_path, form, suffix):
    """A body, exported and read, has the numbers and materials that the table of formats says, time and step included.

    Lengths in ångström, masses by density, and radii by diameter are rounded a few times in double precision.
    """
    body = grains_at_step(0)
    known = {m.name: m for m in body.materials}
    write_body(tmp_path / f"b{suffix}", body)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # unknown materials are drawn as silica
        path, *_ = export_frames(open_frames(tmp_path / f"b{suffix}"), tmp_path / "out", form, cluster_labels)
    found = read_grains(path, materials=known)
    grains = found.grains
    assert [grains.materials[k] for k in grains.material] == [body.materials[k] for k in body.material]
    for name in ("position", "radius", *KEPT):
        assert getattr(grains, name) == pytest.approx(getattr(body, name), rel=1e-15, abs=0.0), name
    assert list(grains.own) == OWN_KEPT[form]
    assert all((grains.own[name] == body.own[name]).all() for name in grains.own)
    assert dict(grains.own.units) == {name: body.own.units[name] for name in grains.own}
    assert (found.time, found.step) == (0.0, 0)
    assert not any("taken in SI" in note for note in found.notes)
    assert any("d_heating" in note for note in found.notes) == (form == "lammps-dump")


@pytest.mark.filterwarnings("ignore:LAMMPS data files have no place")
@pytest.mark.parametrize("form", list(OWN_KEPT))
def test_exports_of_a_run_are_read_again(trajectory, tmp_path, form):
    """The last frame of a run, exported and read: as of a body, with its box, time and step."""
    frames = Frames(trajectory)
    *_, path = export_frames(frames, tmp_path / "out", form, cluster_labels)
    found, last = read_grains(path, materials={m.name: m for m in grains_at_step(2).materials}), frames[-1]
    for name in ("position", "radius", *KEPT):
        # the numbers of a frame have single precision, of which the digits are exact
        assert getattr(found.grains, name) == pytest.approx(np.asarray(getattr(last, name), float), rel=1e-8, abs=0.0)
    assert [found.grains.materials[k].name for k in found.grains.material] == [last.materials[k] for k in last.material]
    assert found.box.lengths[:2] == pytest.approx(last.box.lengths[:2], rel=1e-15, abs=0.0)
    assert found.box.lengths[2] is None
    assert (found.time, found.step) == (last.time, last.step)


@pytest.mark.parametrize(("units", "seconds"), [("si", 1.0), ("metal", 1e-12), ("real", 1e-15), ("micro", 1e-6)])
def test_the_time_of_a_dump(tmp_path, units, seconds):
    """LAMMPS writes `ITEM: TIME` before the snapshot it belongs to, in the unit of time of its style."""
    snapshot = (
        "ITEM: TIME\n{}\nITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n1\nITEM: BOX BOUNDS ff ff ff\n0 1\n0 1\n0 1\n"
        "ITEM: ATOMS id x y z radius\n1 0 0 0 50\n"
    )
    (tmp_path / "d").write_text(f"ITEM: UNITS\n{units}\n" + snapshot.format(0.25, 1) + snapshot.format(0.5, 2))
    times = [read_grains(tmp_path / "d", sand.SILICA, frame=k).time for k in (0, 1)]
    assert times == pytest.approx([0.25 * seconds, 0.5 * seconds], rel=1e-15, abs=0.0)


def test_tilted_boxes_in_files(tmp_path):
    """Frames with and without a tilt: the box of SAND is exact; GSD, XYZ and LAMMPS files have the same lattice.

    a1 = (L_x, 0, 0), a2 = (0, L_y, 0), a3 = (T, 0, L_z), about the origin; GSD has T/L_z, LAMMPS the bounds of the
    parallelepiped in a dump, and its sides in a data file.
    """
    grains = sand.Grains([[0, 0, 0], [1e-7, 0, 2e-7]], "20 nm", sand.ICE)
    boxes = [Box.periodic(5e-7, 6e-7, 7e-7, tilt=tilt) for tilt in (0.0, 1.2e-7, -2e-7)]
    path, writer = tmp_path / "a.gsd", TrajectoryWriter(tmp_path / "a.gsd")
    for k, box in enumerate(boxes):
        writer.write(10 * k, 1e-9 * k, grains, box, contacts_of(grains))
    writer.close()
    frames = list(Frames(path))
    assert [frame.box for frame in frames] == boxes
    with gsd.hoomd.open(path) as file:
        for k, tilt in ((1, 1.2e-7), (2, -2e-7)):
            sides = file[k].configuration.box[:3] * 20e-9
            assert file[k].configuration.box[4] == pytest.approx(tilt / 7e-7, rel=1e-6, abs=0)
            assert sides == pytest.approx([5e-7, 6e-7, 7e-7], rel=1e-6, abs=0)
    texts = {}
    for form in ("xyz", "lammps-dump", "lammps-data"):
        made = export_frames(frames[1:2], tmp_path / form, form, lambda number, pair: np.arange(2))
        texts[form] = made[0].read_text(encoding="utf-8")
    lattice, origin = (
        [float(v) for v in re.search(rf'{name}="([^"]*)"', texts["xyz"])[1].split()] for name in ("Lattice", "Origin")
    )
    assert lattice == pytest.approx([5000, 0, 0, 0, 6000, 0, 1200, 0, 7000], rel=1e-12, abs=0)
    assert origin == pytest.approx([-3100, -3000, -3500], rel=1e-12, abs=0)
    bounds = re.search(r"BOX BOUNDS xy xz yz pp pp pp\n(.*)\n(.*)\n(.*)\n", texts["lammps-dump"]).groups()
    expected = [[-3.1e-7, 3.1e-7, 0], [-3e-7, 3e-7, 1.2e-7], [-3.5e-7, 3.5e-7, 0]]
    for line, one in zip(bounds, expected, strict=True):
        assert [float(v) for v in line.split()] == pytest.approx(one, rel=1e-12, abs=0)
    assert re.search(r"^-3\.1\d*e-07 1\.89*\d*e-07 xlo xhi$", texts["lammps-data"], re.MULTILINE)
    tilts = re.search(r"^0 (\S+) 0 xy xz yz$", texts["lammps-data"], re.MULTILINE)
    assert float(tilts[1]) == pytest.approx(1.2e-7, rel=1e-12, abs=0)
