"""Files of grains of other programs: formats by content, quantities kept or refused, rounded contacts at rest."""

import json
import warnings
from pathlib import Path

import numpy as np
import pytest

import sand
from sand.basics.errors import BadInput
from sand.cli.main import main
from sand.io.bodies import read_body, read_grains, write_body
from sand.io.file_frames import open_frames
from sand.setup.checks import pairs_in_contact
from sand.setup.from_file import body_from_file, start_from_file

R = 1e-7
REST = sand.theory.contact("silica", R).rest_overlap
D = 2.0 * R - REST  # distance of silica grains at rest
NM = [[1e9 * k * D, 0.0, 0.0] for k in range(3)]  # a chain of three [nm]


def told(function, *arguments, **named):
    """Result of a function, and the texts of its notes."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = function(*arguments, **named)
    return found, [str(one.message) for one in caught]


def rows(form, places=NM):
    """Lines of the chain by a format of x, y, z [nm]."""
    return "".join(form.format(*place) + "\n" for place in places)


def fortran(value):
    return f"{value:.15E}".replace("E", "D")


LAMMPS = (
    "LAMMPS data file, units = si\n\n3 atoms\n1 atom types\n0 1e-6 xlo xhi\n0 1e-6 ylo yhi\n0 1e-6 zlo zhi\n\n"
    "Atoms # sphere\n\n"
)
DUMP = (
    "ITEM: TIMESTEP\n{}\nITEM: NUMBER OF ATOMS\n3\nITEM: BOX BOUNDS ff ff ff\n0 1e-6\n0 1e-6\n0 1e-6\nITEM: ATOMS {}\n"
)
TEXTS = {
    "columns": (rows("{:.9f} {} {} 100"), "1 nm"),
    "tabs and comments": ("! made elsewhere\n" + rows("{:.9f}\t{}\t{}\t100  % sphere"), "1 nm"),
    "a number first": ("  3\n\n" + rows("{:.9f} {} {} 100"), "1 nm"),
    "a title like a head of LAMMPS": ("3\n3 atoms\n" + rows("{:.9f} {} {} 100"), "1 nm"),
    "a number and a title": ("3\nmade elsewhere\n" + rows("{:.9f} {} {} 100"), "1 nm"),
    "named columns": ("r z y x\n" + rows("100 {2} {1} {0:.9f}"), "1 nm"),
    "named in a comment": ("# diameter x y z\n" + rows("200 {:.9f} {} {}"), "1 nm"),
    "CSV": ("X,Y,Z,Radius\n" + rows("{:.9f},{},{},100"), "1 nm"),
    "CSV with units": ('"x [nm]","y [nm]","z [nm]","r [um]"\n' + rows("{:.9f},{},{},0.1"), None),
    "CSV with decimal commas": ("x;y;z;r\n" + rows("{:.9f};{};{};100").replace(".", ","), "1 nm"),
    "CSV without names": (rows("{:.9f}, {}, {}, 100.0"), "1 nm"),
    "Fortran": ("".join(f"{fortran(x)} 2*0.0D0 1.0+002\n" for x, _, _ in NM), "1 nm"),
    "MSTM 3": (rows("100 {:.9f} {} {} 1.6 0.01"), "1 nm"),
    "MSTM 4": ("number_spheres\n3\nsphere_data\n" + rows("{:.9f},{},{},100") + "end_of_sphere_data\n", "1 nm"),
    "FracVAL": (rows("  {:.16E}   {:.16E}   {:.16E}   1.0000000000000000E+002"), "1 nm"),
    "numbered": ("".join(f"{k} {x:.9f} 0 0 100\n" for k, (x, _, _) in enumerate(NM, 1)), "1 nm"),
    "extended XYZ": (
        "3\nProperties=species:S:1:pos:R:3:radius:R:1 length_unit=nm\n" + rows("Si {:.9f} {} {} 100"),
        None,
    ),
    "CSV with text": (
        "id,name,x,y,z,r\n" + "".join(f"{k},s{k},{x:.9f},0,0,100\n" for k, (x, _, _) in enumerate(NM)),
        "1 nm",
    ),
    "LAMMPS data": (LAMMPS + "".join(f"{k} 1 2e-7 2650 {x * 1e-9!r} 0 0\n" for k, (x, _, _) in enumerate(NM, 1)), None),
    "LAMMPS dump": (
        DUMP.format(5, "id type radius xs ys zs")
        + "".join(f"{k} 1 1e-7 {x * 1e-3!r} 0 0\n" for k, (x, _, _) in reversed(list(enumerate(NM)))),
        None,
    ),
}


@pytest.mark.filterwarnings("ignore:columns that are no quantity", "ignore:.*. columns (read as|from the fifth)")
@pytest.mark.compiled("small")
@pytest.mark.parametrize("name", TEXTS)
def test_formats_are_known_by_their_content(tmp_path, name):
    """The same chain in each format, in a file whose name says nothing; positions to nine digits of 1 nm."""
    text, length = TEXTS[name]
    (tmp_path / "grains").write_text(text)
    body = body_from_file(tmp_path / "grains", sand.SILICA, length=length)
    assert body.position[:, 0] == pytest.approx([-D, 0.0, D], abs=1e-17)
    assert body.radius == pytest.approx(R, rel=1e-12, abs=0.0) and not body.position[:, 1:].any()


@pytest.mark.compiled("small")
def test_plain_xyz_has_angstroms_and_no_radii(tmp_path):
    """Of two frames the last is read by default; the radius comes from the caller."""
    path = tmp_path / "a.out"
    other = "2\n2 atoms\nSi 0 0 0\nFe 1 0 0\n"
    path.write_text(other + "3\nmade elsewhere\n" + "".join(f"Si {10 * x!r} 0 0\n" for x, _, _ in NM))
    assert body_from_file(path, sand.SILICA, "100 nm").position[2, 0] == pytest.approx(D, rel=1e-12, abs=0.0)
    assert len(read_grains(path, sand.SILICA, 1e-10, frame=0).grains) == 2
    with pytest.raises(BadInput, match="has 2 frames, from 0 to 1; there is no 2"):
        read_grains(path, sand.SILICA, R, frame=2)
    path.write_text("1\n\nSi 0 0 0 7\n")
    with pytest.raises(BadInput, match=r"line 3: 5 columns, but XYZ has 4.*Properties="):
        read_grains(path, sand.SILICA, R)


@pytest.mark.parametrize(
    "text",
    [
        "x [nm],y [nm],z [nm],r [nm]\n0,0,0,100\n",
        "1\nProperties=species:S:1:pos:R:3:radius:R:1 length_unit=nm\nSi 0 0 0 100\n",
        LAMMPS.replace("3 atoms", "1 atoms") + "1 1 2e-7 2650 0 0 0\n",
    ],
    ids=["columns", "XYZ", "LAMMPS"],
)
def test_a_unit_of_length_is_given_once(tmp_path, text):
    """A unit of the caller that differs from that of the file would change all lengths; the same unit is accepted."""
    (tmp_path / "a").write_text(text)
    with pytest.raises(BadInput, match=r"length = '1 um': .* states its unit of length, 1 .*; leave length out"):
        read_grains(tmp_path / "a", sand.SILICA, length="1 um")
    same = "1 m" if text.startswith("LAMMPS") else "1 nm"
    assert read_grains(tmp_path / "a", sand.SILICA, length=same).grains.radius == pytest.approx(R, rel=1e-12, abs=0.0)
    write_body(tmp_path / "b.gsd", sand.Grains([[0, 0, 0]], R, "silica"))
    with pytest.raises(BadInput, match="states its unit of length, 1 m; leave length out"):
        read_grains(tmp_path / "b.gsd", length="1 nm")


def test_what_is_assumed_of_columns_is_said(tmp_path):
    """Velocities without a unit are in SI; a column without a name, as pandas writes its index, is not mentioned."""
    (tmp_path / "a").write_text(",x [nm],y [nm],z [nm],r [nm],vx,vy,vz\n0,0,0,0,100,1,2,3\n")
    found, notes = told(read_grains, tmp_path / "a", sand.SILICA)
    assert found.notes == (f"{tmp_path / 'a'} states no units of velocity: they are taken in SI",) and not notes
    (tmp_path / "a").write_text("x,y,z,r,vx [m/s],vy [m/s],vz [m/s]\n0,0,0,1e-7,1,2,3\n")
    assert not told(read_grains, tmp_path / "a", sand.SILICA)[0].notes


@pytest.mark.compiled("small")
def test_how_a_file_is_understood_is_said_also_if_it_is_refused(tmp_path):
    """The reading `number x y z r` is a note, though the two grains overlap by too much."""
    (tmp_path / "a").write_text("1 0 0 0 10\n2 19.95 0 0 10\n3 39.8 0 0 10\n")
    with pytest.warns(UserWarning, match="columns read as"), pytest.raises(BadInput, match="overlap by"):
        start_from_file(tmp_path / "a", None, sand.SILICA, length="1 um")


@pytest.mark.parametrize("suffix", ["xyz", "gsd"])
def test_bodies_keep_all_their_quantities(tmp_path, suffix):
    """What `write_body` is given comes back, in GSD to single precision; masses of spheres follow the material."""
    vectors = {name: [[0, 1e-3, 2e-3], [3e-3, 0, 1e-3]] for name in ("velocity", "spin")}
    given = {"charge": [1e-18, -2e-18], "mass": [1e-17, 3e-17], "moment": [[0, 0, 1e-18], [1e-18, 0, 0]], **vectors}
    body = sand.Grains([[0, 0, 0], [D, 0, 0]], R, "silica", **given)
    write_body(tmp_path / f"b.{suffix}", body)
    back = read_body(tmp_path / f"b.{suffix}")
    for name in given:
        assert getattr(back, name) == pytest.approx(getattr(body, name), rel=1e-6, abs=0.0), name
    plain = sand.Grains([[0, 0, 0], [D, 0, 0]], R, "silica")
    write_body(tmp_path / f"c.{suffix}", plain)
    other = read_body(tmp_path / f"c.{suffix}", sand.IRON)
    assert other.mass == pytest.approx(sand.Grains([[0, 0, 0]], R, "iron").mass[0], rel=1e-12, abs=0.0)


def test_quantities_of_lammps_files(tmp_path):
    """Velocity, spin, charge, moment and density of `hybrid sphere dipole`; names behind the masses are materials."""
    text = (
        "SAND, units si\n\n2 atoms\n\nMasses\n\n1 1 # silica\n2 1 # iron\n\nAtoms # hybrid sphere dipole\n\n"
        "2 1 4e-7 0 0 2e-7 5300 1e-18 0 0 2e-18\n1 2 0 0 0 2e-7 7874 0 0 0 0\n\n"
        "Velocities\n\n1 0 0 0 0 0 0\n2 1 2 3 4 5 6\n"
    )
    (tmp_path / "a").write_text(text)
    found, notes = told(read_grains, tmp_path / "a")
    grains = found.grains
    assert [grains.materials[k].name for k in grains.material] == ["iron", "silica"] and not notes
    assert grains.velocity[1].tolist() == [1, 2, 3] and grains.spin[1].tolist() == [4, 5, 6]
    assert grains.charge[1] == 1e-18 and grains.moment[1].tolist() == [0, 0, 2e-18]
    assert grains.mass[1] == pytest.approx(5300 * 4.0 / 3.0 * np.pi * R**3, rel=1e-12, abs=0.0)
    (tmp_path / "a").write_text(text.replace("units si", "units lj"))
    with pytest.raises(BadInput, match="does not state its unit of length"):
        read_grains(tmp_path / "a")
    with pytest.raises(BadInput, match="in lj units, in which velocity has no value in SI"):
        read_grains(tmp_path / "a", length="1 m")
    (tmp_path / "a").write_text(
        text.replace("units si", "units cgs").replace("2e-18", "0").replace("5300", "5.3").replace("7874", "7.9")
    )
    assert read_grains(tmp_path / "a").grains.velocity[1] == pytest.approx([0.01, 0.02, 0.03], rel=1e-14, abs=0.0)


def of_hoomd(path, **given):
    """A GSD file as other programs write it."""
    import gsd.hoomd

    frame = gsd.hoomd.Frame()
    p = frame.particles
    p.N, p.position, p.diameter = 3, [[-1, 0, 0], [0, 0, 0], [1, 0, 0]], [1, 1, 1]
    for name, values in given.items():
        setattr(p, name, values)
    frame.configuration.box = [50, 50, 50, 0, 0, 0]
    with gsd.hoomd.open(str(path), "w") as file:
        file.append(frame)


@pytest.mark.parametrize(
    ("units", "length", "mass", "speed"),
    [("si", 1.0, 1.0, 1.0), ("cgs", 1e-2, 1e-3, 1e-2), ("micro", 1e-6, 1e-15, 1.0), ("nano", 1e-9, 1e-21, 1.0)],
)
def test_units_of_lammps_styles(tmp_path, units, length, mass, speed):
    """A silica sphere of 0.1 μm, its mass 2650 kg/m³ × 4π/3 r³ and 1 m/s, written in each style.

    LAMMPS: micro has picograms (10⁻¹² g) and μm/μs, nano attograms (10⁻¹⁸ g) and nm/ns, cgs grams and cm/s.
    """
    weight = sand.SILICA.density * 4.0 / 3.0 * np.pi * R**3
    text = f"ITEM: UNITS\n{units}\n" + DUMP.format(0, "id x y z radius mass vx").replace("\n3\n", "\n1\n")
    row = f"1 0 0 0 {R / length!r} {1.1 * weight / mass!r} {1.0 / speed!r}"
    (tmp_path / "a").write_text(text.replace(" vx", " vx vy vz") + row + " 0 0\n")
    grains = read_grains(tmp_path / "a", sand.SILICA).grains
    assert grains.radius[0] == pytest.approx(R, rel=1e-12, abs=0.0)
    assert grains.mass[0] == pytest.approx(1.1 * weight, rel=1e-12, abs=0.0)
    assert grains.velocity[0, 0] == pytest.approx(1.0, rel=1e-12, abs=0.0)


@pytest.mark.compiled("small")
def test_contacts_across_the_box_of_the_case_are_put_at_rest(tmp_path):
    """Columns state no box: two grains with a gap of 1e-4 r across a face of the case's box are in contact there."""
    length, gap = 1e-6, 1e-4 * R
    place = 0.5 * (length - 2.0 * R - gap)
    (tmp_path / "a").write_text(f"{-place!r} 0 0 {R!r}\n{place!r} 0 0 {R!r}\n")
    (start, notes) = told(start_from_file, tmp_path / "a", sand.Box.periodic(length), sand.SILICA)
    across = length - np.ptp(start.grains.position[:, 0])
    assert across == pytest.approx(D, abs=1e-6 * REST) and "1 contact is put at rest" in notes[0]


def test_a_file_of_many_frames_is_read_once(tmp_path, monkeypatch):
    """Frames are parsed from the text in memory: no time that grows as the square of their number."""
    from sand.io import file_frames

    texts = [
        DUMP.format(k, "id x y z radius") + "".join(f"{j} {2e-7 * j} 0 0 1e-7\n" for j in (1, 2, 3)) for k in (4, 5)
    ]
    (tmp_path / "a").write_text("".join(texts))
    opened, open_grains = [], file_frames.open_grains
    monkeypatch.setattr(file_frames, "open_grains", lambda path: opened.append(path) or open_grains(path))
    monkeypatch.setattr("sand.io.bodies.open_grains", file_frames.open_grains)
    frames = open_frames(tmp_path / "a", material="silica")
    assert frames.steps.tolist() == [4, 5] and [frame.step for frame in frames] == [4, 5] and len(opened) == 1


@pytest.mark.compiled("small")
def test_gsd_of_others_needs_a_unit(tmp_path):
    """The unit is asked for; velocities without a unit are refused; the diameter 1 is the default of the format."""
    of_hoomd(tmp_path / "a.bin")
    with pytest.raises(BadInput, match=r"GSD of another program.*does not state its unit of length; give it: length ="):
        read_grains(tmp_path / "a.bin", sand.SILICA)
    assert read_grains(tmp_path / "a.bin", sand.SILICA, length="200 nm").grains.radius == pytest.approx(R, abs=1e-22)
    assert read_grains(tmp_path / "a.bin", sand.SILICA, R, "200 nm").grains.radius == pytest.approx(R, abs=1e-22)
    start, _ = told(start_from_file, tmp_path / "a.bin", None, sand.SILICA, length="200 nm")
    assert start.box.lengths == pytest.approx([1e-5] * 3, rel=1e-6, abs=0.0)
    assert "all diameters are 1 unit of length" in read_grains(tmp_path / "a.bin", sand.SILICA, length="1 um").notes[0]
    of_hoomd(tmp_path / "a.bin", mass=[5, 5, 5], diameter=[1, 1, 1.001])
    assert "masses are not read" in read_grains(tmp_path / "a.bin", sand.SILICA, length="1 um").notes[0]
    of_hoomd(tmp_path / "a.bin", velocity=[[0, 1, 0]] * 3)
    with pytest.raises(BadInput, match="velocities are in units that the file does not state; set them to 0"):
        read_grains(tmp_path / "a.bin", sand.SILICA, length="200 nm")


def xyz(path, places, box, pbc="T T T"):
    """Extended XYZ of silica grains of 0.1 um, in a cube of side `box` [m]."""
    head = f'Lattice="{box * 1e10!r} 0 0 0 {box * 1e10!r} 0 0 0 {box * 1e10!r}" '
    head += f'Properties=species:S:1:pos:R:3:radius:R:1 pbc="{pbc}"'
    lines = (f"Si {x * 1e10!r} {y * 1e10!r} {z * 1e10!r} 1000" for x, y, z in places)
    path.write_text("\n".join([str(len(places)), head, *lines]) + "\n")


@pytest.mark.compiled("small")
def test_bodies_cut_by_the_box_are_whole(tmp_path):
    """A chain across a face has its extent 3 D; in the box of its file it stays as it is; an endless one is refused."""
    path, box = tmp_path / "a", 2e-6
    places = [((k * D + 0.8e-6) % box, 0.0, 0.0) for k in range(4)]
    xyz(path, places, box)
    body = body_from_file(path, sand.SILICA)
    assert np.ptp(body.position[:, 0]) == pytest.approx(3.0 * D, rel=1e-12, abs=0.0)
    start, notes = told(start_from_file, path, None, sand.SILICA)
    assert start.box.lengths == (box,) * 3 and not notes
    assert start.grains.position[:, 0] == pytest.approx(np.array(places)[:, 0] - 0.5 * box, abs=1e-20)
    start, notes = told(start_from_file, path, sand.Box.open(), sand.SILICA)
    assert np.ptp(start.grains.position[:, 0]) == pytest.approx(3.0 * D, rel=1e-12, abs=0.0)
    assert start.box.is_open and any("the box of the case is used" in note for note in notes)
    xyz(path, [(k * D, 0.0, 0.0) for k in range(10)], 10.0 * D)
    with pytest.raises(BadInput, match=r"touches its own image across the box.* has no end"):
        body_from_file(path, sand.SILICA)


@pytest.mark.compiled("small")
@pytest.mark.parametrize("step", [2.0009, 1.9999, 1.998])
def test_rounded_coordinates_are_put_at_rest(tmp_path, step):
    """Gaps up to 1e-3 r and overlaps below 2 δ0 (2.1e-3 r) become δ0 exactly in a chain, and a note says so."""
    path = tmp_path / "a"
    path.write_text("".join(f"{step * k:.4f} 0 0 1\n" for k in range(4)))
    body, notes = told(body_from_file, path, sand.SILICA, length="100 nm")
    _, overlap, rest = pairs_in_contact(body, sand.Box.open())
    assert len(overlap) == 3 and overlap == pytest.approx(rest, rel=1e-9, abs=0.0)
    assert len(notes) == 1 and "3 contacts are put at rest, grains move by at most" in notes[0]
    path.write_text("".join(f"{2.0 * k * (1.0 - 0.5 * REST / R)!r} 0 0 1\n" for k in range(4)))
    assert not told(body_from_file, path, sand.SILICA, length="100 nm")[1]


@pytest.mark.compiled("small")
def test_rings_are_fitted_by_least_squares(tmp_path):
    """Of a triangle all three overlaps are met; of a hexagon with a small grain the sum of squares is least.

    Six grains round a seventh have twelve distances for eleven free coordinates in their plane: a radius that differs
    by 8e-4 leaves a residue. It is the least possible where the sum of squares has no slope: at each grain the sum of
    the differences times the directions of the contacts is zero.
    """
    path = tmp_path / "a"
    path.write_text("0 0 0 1\n2.0003 0 0 1\n1 1.7325 0 1\n")
    body, notes = told(body_from_file, path, sand.SILICA, length="100 nm")
    _, overlap, rest = pairs_in_contact(body, sand.Box.open())
    assert len(overlap) == 3 and overlap == pytest.approx(rest, rel=1e-8, abs=0.0) and "rings do not" not in notes[0]
    ring = [(2.0 * np.cos(k * np.pi / 3.0), 2.0 * np.sin(k * np.pi / 3.0)) for k in range(6)]
    lines = [f"{x:.6f} {y:.6f} 0 {1.0 - 0.0008 * (k == 0)}" for k, (x, y) in enumerate([*ring, (0.0, 0.0)])]
    path.write_text("\n".join(lines) + "\n")
    body, notes = told(body_from_file, path, sand.SILICA, length="100 nm")
    pairs, overlap, rest = pairs_in_contact(body, sand.Box.open())
    apart = body.position[pairs[:, 0]] - body.position[pairs[:, 1]]
    pull = (overlap - rest)[:, None] * apart / np.linalg.norm(apart, axis=1)[:, None]
    slope = np.zeros((7, 3))
    np.add.at(slope, pairs[:, 0], pull)
    np.add.at(slope, pairs[:, 1], -pull)
    residue = np.abs(overlap - rest).max()
    assert len(pairs) == 12 and 1e-6 * R < residue < 1e-3 * R
    assert np.abs(slope).max() < 1e-5 * residue
    assert f"overlaps differ from those of equilibrium by at most {residue:.2g} m" in notes[0]


@pytest.mark.compiled("small")
def test_the_largest_overlap_is_allowed_itself(tmp_path):
    """20 − 19.99 is above 1e-3 · 10 in double precision, but an overlap of 1e-3 r."""
    assert 20 - 19.99 > 1e-3 * 10
    (tmp_path / "a").write_text("0 0 0 10\n19.99 0 0 10\n")
    assert "1 contact is put at rest" in told(body_from_file, tmp_path / "a", sand.SILICA, length="1 um")[1][0]


def test_the_gap_that_is_named_is_that_to_the_nearest_surface(tmp_path):
    """A grain far from the largest cluster, but 0.1 um from another; and one nearer to a large grain by surface."""
    (tmp_path / "a").write_text("0 0 0 1\n2 0 0 1\n10 0 0 1\n13 0 0 1\n30 0 0 1\n35 0 0 3\n26 0 0 1\n")
    with pytest.raises(BadInput) as caught:
        body_from_file(tmp_path / "a", sand.SILICA, length="100 nm")
    text = str(caught.value)
    assert "grain 2 has no contact with the rest of the body: a gap of about 1e-07 m to grain 3" in text
    assert "grain 4 has no contact with the rest of the body: a gap of about 1e-07 m to grain 5" in text


@pytest.mark.parametrize(
    "force",
    [sand.Charges(cutoff="none"), sand.Dipoles(cutoff="none"), sand.Contact()],
    ids=["charges", "dipoles", "contact"],
)
def test_grains_at_one_place_are_refused(force):
    """At the start of a simulation in which grains interact: the force between them has no direction."""
    grains = sand.Grains([[0, 0, 0], [0, 0, 0]], R, "silica", charge=1e-19, moment=[0, 0, 1e-18])
    with pytest.raises(BadInput, match="grains 0 and 1 are at the same place; leave one of them out"):
        sand.Simulation(grains, [force])
    assert sand.Simulation(grains, [sand.Field([0, 0, 1e-3])]).steps == 0  # these do not see each other


def test_velocities_of_a_body_are_relative_to_its_centre(tmp_path):
    """The motion of the centre of mass is left out, with a note; a rotation is kept."""
    head = "Properties=species:S:1:pos:R:3:radius:R:1:velo:R:3 other_units=SI\n"
    text = "".join(f"Si {10 * NM[k][0]!r} 0 0 1000 0 {5 + k} 0\n" for k in range(3))
    (tmp_path / "a").write_text("3\n" + head + text)
    body, notes = told(body_from_file, tmp_path / "a", sand.SILICA)
    assert body.velocity[:, 1] == pytest.approx([-1.0, 0.0, 1.0], abs=1e-12)
    assert len(notes) == 1 and "that of the centre of mass, which is 6 m/s" in notes[0]
    (tmp_path / "a").write_text("3\n" + head.replace(" other_units=SI", "") + text)
    _, notes = told(body_from_file, tmp_path / "a", sand.SILICA)
    assert any("states no units of velocity: they are taken in SI" in note for note in notes)


CASE = (
    '[run]\nsteps = 2\n{box}[grains]\nkind = "file"\nfile = "{file}"\nmaterial = "silica"\n{more}\n[forces.contact]\n'
)


@pytest.mark.compiled("contacts", "small")
def test_a_gas_starts_from_a_file(tmp_path, monkeypatch, capsys):
    """Free grains, a body, and the velocities of the file; a radius beside a trajectory is refused."""
    monkeypatch.chdir(tmp_path)
    Path("gas").write_text(
        "# x y z r vx vy vz\n" + rows("{:.9f} {} {} 100 0 0 0") + "0 800 0 100 0 0 3\n0 -900 0 100 0 0 0\n"
    )
    Path("c.toml").write_text(CASE.format(box='[box]\nperiodic = "3 um"\n', file="gas", more='length = "1 nm"'))
    assert main(["run", "c.toml", "--out", "o", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["grains"] == 5
    first = sand.open("o").frames[0]
    assert len(first.pair) == 2 and first.velocity[:, 2].tolist() == [0, 0, 0, 3, 0]
    assert first.box.lengths == (3e-6,) * 3
    Path("c.toml").write_text(CASE.format(box="", file="o", more='radius = "1 um"'))
    assert main(["run", "c.toml", "--out", "p"]) == 2
    assert "grains: radius: the trajectory" in capsys.readouterr().err


@pytest.mark.compiled("small")
@pytest.mark.usefixtures("bundle")
def test_pictures_and_exports_of_files(tmp_path, monkeypatch, capsys):
    """`plot`, `view` and `export` take a body, and ask for a missing radius; the file itself is not overwritten."""
    monkeypatch.chdir(tmp_path)
    write_body("b.xyz", sand.Grains([[0, 0, 0], [D, 0, 0]], R, "silica"))
    assert main(["plot", "b.xyz", "--out", "p", "--size", "320x200"]) == 0 and Path("p/still.png").exists()
    assert main(["view", "b.xyz", "--html", "b.html", "--quiet"]) == 0 and Path("b.html").exists()
    assert main(["export", "b.xyz", "--to", "lammps-data", "--out", "c"]) == 0
    assert main(["export", "b.xyz", "--to", "xyz", "--out", "b", "--overwrite"]) == 2
    assert "this is the file that is exported" in capsys.readouterr().err
    again = open_frames("c-000000000000.data")[0]
    assert again.position == pytest.approx(np.array([[0, 0, 0], [D, 0, 0]]), abs=1e-16) and len(again.pair) == 1
    Path("d").write_text("1\n\nSi 0 0 0\n")
    assert main(["plot", "d", "--out", "q"]) == 2
    assert "has no radii; give a radius" in capsys.readouterr().err
    assert main(["plot", "d", "--out", "q", "--size", "320x200", "--radius", "10 nm", "--material", "iron"]) == 0


def test_own_quantities_of_named_columns(tmp_path):
    """A column with a name of its own and a unit is an own quantity, in SI; one without a unit is named in a note."""
    (tmp_path / "a").write_text("x,y,z,r,heating [mW/m^2],porosity\n0,0,0,1e-7,2,0.5\n")
    found, notes = told(read_grains, tmp_path / "a", sand.SILICA)
    assert found.grains.own["heating"] == pytest.approx([2e-3], rel=1e-12, abs=0.0)
    assert list(found.grains.own) == ["heating"] and "not read: porosity" in found.notes[0] and not notes
