"""Files for optics: dipoles and spheres of aggregates, as the documented formats of ADDA, DDSCAT and MSTM have them."""

import math
import re

import numpy as np
import pytest

import sand
from sand.analysis.clusters import cluster_labels
from sand.basics.box import Box
from sand.cli.main import main
from sand.io.bodies import contacts_of, write_body
from sand.io.export import export_frames
from sand.io.file_frames import open_frames
from sand.io.grain_files import open_grains
from sand.io.optics import Optics, Spheres, dipoles_of, read_dipoles
from sand.io.trajectory import Frames, TrajectoryWriter

R = 1e-7


def spheres(position, radius, material=None):
    """Spheres of a body."""
    position, radius = np.array(position, float), np.array(radius, float)
    return Spheres(position, radius, np.zeros(len(radius), int) if material is None else np.array(material))


def body(tmp_path, grains):
    """A file with grains as one body, opened as frames."""
    write_body(tmp_path / "body.gsd", grains)
    return open_frames(tmp_path / "body.gsd")


def export(frames, place, form, **settings):
    """The one file that an export of frames writes."""
    (path,) = export_frames(frames, place / "x", form, cluster_labels, optics=Optics(**settings))
    return path


def chain(number=3, materials=("ice",)):
    """Grains of several sizes in a row, which touch."""
    radius = R * (1.0 + 0.5 * (np.arange(number) % 2))
    x = np.concatenate([[0.0], np.cumsum(radius[1:] + radius[:-1])]) * (1.0 - 1e-4)
    kinds = [materials[k % len(materials)] for k in range(number)]
    return sand.Grains(np.column_stack([x, 0 * x, 0 * x]), radius, kinds)


def test_dipoles_by_brute_force():
    """A lattice point is a dipole if it is in a grain, of the one in which it is deepest; all points of a box tried."""
    rng = np.random.default_rng(4)
    some = spheres(rng.uniform(-2, 2, (9, 3)), rng.uniform(0.7, 1.2, 9), np.arange(9))
    made = dipoles_of(some, 0.31)
    cells = np.ceil(
        np.ptp(np.concatenate([some.position + some.radius[:, None], some.position - some.radius[:, None]]), axis=0)
        / 0.31
    )
    points = np.stack(np.meshgrid(*(np.arange(int(n)) for n in cells), indexing="ij"), axis=-1).reshape(-1, 3)
    depth = some.radius - np.linalg.norm((made.origin + 0.31 * points)[:, None] - some.position, axis=2)
    inside = depth.max(axis=1) > 0.0
    expected = {tuple(p): int(k) for p, k in zip(points[inside].tolist(), depth.argmax(axis=1)[inside], strict=True)}
    assert {tuple(p): int(k) for p, k in zip(made.cell.tolist(), made.material, strict=True)} == expected
    assert made.cell.min() >= 0


def test_symmetry_and_volume_of_a_sphere():
    """The lattice is centred: 48 symmetries. The volume P d³ approaches 4πr³/3.

    Whether a cell of the 4πr²/d² at the surface counts is uncertain by 0.29 of its volume; by symmetry 1/48 of them
    are independent. The relative error of the volume is thus about 1.7 (d/r)²; twice as much is allowed.
    """
    for across in (10, 11, 40):
        bound = 3.4 * (2.0 / across) ** 2
        made = dipoles_of(spheres([[0.3, -7.0, 2.0]], [1.0]), 2.0 / across)
        centred = 2 * made.cell - (across - 1)
        points = {tuple(p) for p in centred.tolist()}
        for turned in (centred[:, [1, 2, 0]], centred[:, [1, 0, 2]], -centred, centred * [1, 1, -1]):
            assert {tuple(p) for p in turned.tolist()} == points
        volume = len(points) * (2.0 / across) ** 3
        assert volume / (4.0 / 3.0 * math.pi) == pytest.approx(1.0, abs=bound)
        assert made.position.mean(axis=0) == pytest.approx([0.3, -7.0, 2.0], abs=1e-12)


def scanned_by_adda(text):
    """Dipoles (x, y, z, domain) as InitDipFile of ADDA reads them: comments, `Nmat=`, three or four whole numbers."""
    lines = text.splitlines()
    while lines[0].startswith("#"):
        lines.pop(0)
    several = re.fullmatch(r"Nmat=(\d+)", lines[0])
    rows = [[int(word) for word in line.split()] for line in lines[1 if several else 0 :]]
    assert {len(row) for row in rows} == {4 if several else 3}
    return [(*row, 1) if not several else tuple(row) for row in rows], int(several[1]) if several else 1


def scanned_by_ddscat(text):
    """Dipoles as FROM_FILE of DDSCAT 7 reads them: seven lines, then JA IX IY IZ and three compositions."""
    lines = text.splitlines()
    assert all(len(line) < 255 for line in lines)
    number = int(lines[1].split()[0])
    vectors = [[float(word) for word in line.split()[:3]] for line in lines[2:6]]
    assert vectors[:3] == [[1, 0, 0], [0, 1, 0], [1, 1, 1]]
    rows = [[int(word) for word in line.split()] for line in lines[7:]]
    assert len(rows) == number and [row[0] for row in rows] == list(range(1, number + 1))
    assert all(row[4] == row[5] == row[6] for row in rows)
    return [tuple(row[1:5]) for row in rows], np.array(vectors[3])


@pytest.mark.parametrize("materials", [("ice",), ("ice", "silica")])
def test_adda_and_ddscat(tmp_path, materials):
    """Both files have the dipoles of the body; domains count from 1; sizes and offsets are those of the grains."""
    frames = body(tmp_path, chain(3, materials))
    adda, ddscat = (export(frames, tmp_path, form, spacing=R / 6) for form in ("adda", "ddscat"))
    dipoles, domains = scanned_by_adda(adda.read_text("utf-8"))
    assert domains == len(materials)
    again, offset = scanned_by_ddscat(ddscat.read_text("utf-8"))
    assert again == dipoles and len(set(dipoles)) == len(dipoles)
    grains = frames[0]
    a_eff = np.cbrt((grains.radius.astype(float) ** 3).sum()) / 1e-6
    for path in (adda, ddscat):
        stated = float(re.search(r"a_eff = (\S+) um", path.read_text("utf-8"))[1])
        assert stated == pytest.approx(a_eff, rel=1e-6, abs=0.0)
    table = np.array(dipoles)
    volume = len(table) * (R / 6) ** 3
    assert volume == pytest.approx(4.0 / 3.0 * math.pi * (a_eff * 1e-6) ** 3, rel=0.04, abs=0.0)
    place = (offset + table[:, :3]) * R / 6  # relative to the centre of volume
    centre = (grains.position * grains.radius[:, None] ** 3).sum(axis=0) / (grains.radius**3).sum()
    depth = grains.radius - np.linalg.norm(place[:, None] - (grains.position - centre), axis=2)
    assert depth.max(axis=1).min() > -1e-4 * R
    owner = grains.material[depth.argmax(axis=1)] if len(materials) > 1 else np.zeros(len(table))
    assert ((table[:, 3] - 1) == owner).mean() > 0.999  # of dipoles in the overlap, rounding may decide


@pytest.mark.parametrize("form", ["adda", "ddscat"])
def test_read_again(tmp_path, form):
    """Dipoles that were written are read again, with the spacing and, from DDSCAT, the origin."""
    frames = body(tmp_path, chain(3, ("ice", "silica")))
    found = read_dipoles(export(frames, tmp_path, form, spacing=R / 4))
    grains = frames[0]
    centre = (grains.position * grains.radius[:, None] ** 3).sum(axis=0) / (grains.radius**3).sum()
    expected = dipoles_of(Spheres(grains.position - centre, grains.radius.astype(float), grains.material), R / 4)
    assert (found.cell == expected.cell).all() and (found.material == expected.material).all()
    assert found.spacing == pytest.approx(R / 4, rel=1e-8, abs=0.0)
    if form == "ddscat":
        assert found.position == pytest.approx(expected.position, rel=0.0, abs=1e-6 * R)


def test_files_of_other_programs(tmp_path):
    """Shape files as ADDA's `-save_geom` writes them; text that is none is refused in one line."""
    (tmp_path / "a.geom").write_text("#generated by ADDA v.1.5\n#shape: 'box'\n#box size: 1x1x2\n0 0 0\n0 0 1\n")
    found = read_dipoles(tmp_path / "a.geom")
    assert found.cell.tolist() == [[0, 0, 0], [0, 0, 1]] and math.isnan(found.spacing)
    for text in ("0 0\n", "a b c\n", "", "x\n2 = NAT\n1 0 0\n0 1 0\n1 1 1\n0 0 0\nJA IX\n1 0 0 0 1\n"):
        (tmp_path / "a.geom").write_text(text)
        with pytest.raises(sand.BadInput, match="is not a shape file of ADDA or DDSCAT 7"):
            read_dipoles(tmp_path / "a.geom")


def scanned_by_mstm(text):
    """Records of MSTM's `read_sphere_data_input_file`: x y z radius, (n,k) or not, in 256 characters."""
    rows = []
    for line in text.splitlines():
        assert len(line) < 256
        found = re.fullmatch(r"(\S+) (\S+) (\S+) (\S+)(?: \(([^,]+),([^)]+)\))?", line)
        rows.append([float(word) for word in found.groups() if word is not None])
    return np.array(rows)


def test_mstm(tmp_path):
    """x y z radius in µm about the centre of volume; indices by material; SAND reads the file again as grains."""
    frames = body(tmp_path, chain(4, ("ice", "silica")))
    indices = {"ice": 1.31 + 0.01j, "silica": 1.45 + 0j}
    path = export(frames, tmp_path, "mstm", indices=indices)
    rows, grains = scanned_by_mstm(path.read_text("utf-8")), frames[0]
    assert rows[:, 3] == pytest.approx(grains.radius / 1e-6, rel=1e-6, abs=0.0)
    weight = rows[:, 3, None] ** 3
    assert (rows[:, :3] * weight).sum(axis=0) / weight.sum() == pytest.approx(0.0, abs=1e-6)
    apart = np.diff(rows[:, :3], axis=0)
    assert apart == pytest.approx(np.diff(grains.position, axis=0) / 1e-6, rel=0.0, abs=1e-6)
    expected = [indices[grains.materials[k]] for k in grains.material]
    assert (rows[:, 4] + 1j * rows[:, 5] == expected).all()
    (tmp_path / "body.gsd").unlink()
    export(body(tmp_path, chain(4)), tmp_path, "mstm")
    again = open_grains(path).frame(0)
    assert again.position == pytest.approx(rows[:, :3], rel=0.0, abs=1e-12)
    assert again.radius == pytest.approx(rows[:, 3], rel=0.0, abs=1e-12)


def test_largest_cluster_across_a_face(tmp_path):
    """Of a frame the largest cluster is written, in one piece across a periodic face; a note tells of the others."""
    position = np.array([[-4.9e-7, 0, 0], [4.95e-7 - R * 1.85, 0, 0], [0, 3e-7, 0]])
    position[1, 0] = 1e-6 - 4.9e-7 - 2 * R * (1 - 1e-4)
    grains, box = sand.Grains(position, R, "ice"), Box.periodic(1e-6)
    writer = TrajectoryWriter(tmp_path / "trajectory.gsd")
    writer.write(0, 0.0, grains, box, contacts_of(grains, box))
    writer.flush()
    writer.close()
    with pytest.warns(UserWarning, match="hold the largest cluster; grains of other clusters are left out"):
        path = export(Frames(tmp_path / "trajectory.gsd"), tmp_path, "mstm")
    rows = scanned_by_mstm(path.read_text("utf-8"))
    assert len(rows) == 2
    assert abs(rows[1, 0] - rows[0, 0]) == pytest.approx(0.2, abs=1e-4)


@pytest.mark.parametrize(
    ("form", "settings", "line"),
    [
        ("adda", {"spacing": 2e-7}, "spacing = 200 nm is more than 100 nm, the smallest radius"),
        ("ddscat", {"spacing": 1e-11}, "spacing = 10 pm makes"),
        ("mstm", {}, "there is no refractive index of ice, silica; give it: --index 'ice=1.5+0.01i'"),
        ("mstm", {"indices": {"ice": 1.3}}, "there is no refractive index of silica"),
    ],
)
def test_refused(tmp_path, form, settings, line):
    """One line for a spacing that is too large or too small, and for missing indices."""
    with pytest.raises(sand.BadInput) as caught:
        export(body(tmp_path, chain(3, ("ice", "silica"))), tmp_path, form, **settings)
    assert line in str(caught.value) and "\n" not in str(caught.value)


def test_command(tmp_path, capsys):
    """`sand export`: the file, how it is used, and errors of options, one line each."""
    write_body(tmp_path / "body.gsd", chain(3))
    path = str(tmp_path / "body.gsd")
    for form, end in (("adda", "geom"), ("ddscat", "dat"), ("mstm", "pos")):
        more = ["--index", "ice=1.31+0.01i"] if form == "mstm" else ["--spacing", "25 nm"]
        assert main(["export", path, "--to", form, *more]) == 0
        assert "  use    " in capsys.readouterr().out
        assert (tmp_path / f"body-frames-000000000000.{end}").exists()
    assert "(1.31,0.01)" in (tmp_path / "body-frames-000000000000.pos").read_text("utf-8")
    assert read_dipoles(tmp_path / "body-frames-000000000000.geom").spacing == pytest.approx(25e-9, rel=1e-8, abs=0.0)
    wrong = ["--spacing", "3 kg", "--index", "ice", "--index", "ice=-1"]
    assert main(["export", path, "--to", "vtk", *wrong]) == 2
    lines = capsys.readouterr().err.splitlines()
    for part in (
        "--spacing is for --to adda and ddscat",
        "--spacing = '3 kg'",
        "--index is for --to mstm",
        "'ice'",
        "'ice=-1'",
    ):
        assert any(part in line for line in lines), part
