"""Single-line faults, and the tests that should catch each of them; `tests.faults.plant` plants them.

They are slips that people make: a sign, a factor 2, an image or a unit that is forgotten, one too many or too few, a
row that is lost, an error that is swallowed.  They lie in formulas, loops, settings, files, commands, set-up and
analysis.
"""

from __future__ import annotations

from dataclasses import dataclass

KINDS = ("sign", "factor 2", "forgotten image", "forgotten unit", "off by one", "lost row", "swallowed error")
AREAS = ("formula", "loop", "settings", "files", "command", "analysis", "set-up")


@dataclass(frozen=True)
class Fault:
    """One line that is wrong.

    Attributes:
        name: for the table.
        kind: of KINDS.
        area: of AREAS.
        file: from the top of the checkout.
        old, new: part of a line that occurs once in the file, and what stands there instead.
        tests: names of tests that should fail, of the checkout that this file belongs to.
        before: those of the starting commit, where they differ.
    """

    name: str
    kind: str
    area: str
    file: str
    old: str
    new: str
    tests: tuple[str, ...]
    before: tuple[str, ...] = ()

    def named(self, before: bool) -> tuple[str, ...]:
        """The tests to run first."""
        return self.before if before and self.before else self.tests

    @property
    def searched(self) -> str:
        """What words of the command line are looked for in."""
        return f"{self.name} | {self.kind} | {self.area} | {self.file}"


def _in(area: str, folder: str, tests: str, *rows: tuple[str, str, str, str, str, str]) -> tuple[Fault, ...]:
    """Faults of one area: name, kind, file below src/sand/FOLDER, old, new, test below tests/TESTS."""
    return tuple(
        Fault(name, kind, area, f"src/sand/{folder}{file}", old, new, (f"tests/{tests}{test}",))
        for name, kind, file, old, new, test in rows
    )


FORMULAS = _in(
    "formula",
    "",
    "unit/",
    (
        "half the JKR force",
        "factor 2",
        "physics/adhesion.py",
        "return 4.0 * pull_off_force * (cube * cube - cube)",
        "return 2.0 * pull_off_force * (cube * cube - cube)",
        "test_adhesion.py::test_special_points_are_exact",
    ),
    (
        "the cut-off pushes where it should pull",
        "sign",
        "physics/dipole.py",
        "(both - 5.0 * product) + slope * energy",
        "(both - 5.0 * product) - slope * energy",
        "test_dipole.py::test_force_is_the_slope_of_the_energy",
    ),
    (
        "the rate of 1/r^5 as if it were 1/r^4",
        "off by one",
        "physics/dipole_rates.py",
        "-3.0 * inverse3 * radial, -5.0 * three * radial",
        "-3.0 * inverse3 * radial, -4.0 * three * radial",
        "test_far.py::test_taylor_rates_are_finite_differences",
    ),
    (
        "friction of a spin with r^3 for r^4",
        "forgotten unit",
        "physics/gas.py",
        "accommodation * density * speed * radius**4",
        "accommodation * density * speed * radius**3",
        "test_gas_drag.py::test_the_shortest_time",
    ),
    (
        "a quaternion product with one wrong sign",
        "sign",
        "physics/rotation.py",
        "cosine * q[1] + y * q[3] + z * q[0] - x * q[2]",
        "cosine * q[1] + y * q[3] - z * q[0] - x * q[2]",
        "test_rotation.py::test_turn_is_a_rotation_in_the_laboratory_frame",
    ),
    (
        "the rate of a cut central force",
        "sign",
        "physics/central.py",
        "grow += slope_rate - slope * radial * inverse2",
        "grow += slope_rate + slope * radial * inverse2",
        "test_far.py::test_central_force_is_minus_the_gradient",
    ),
    (
        "Box and Muller without the 2",
        "factor 2",
        "physics/noise.py",
        "math.sqrt(-2.0 * math.log(uniform(word1)))",
        "math.sqrt(-1.0 * math.log(uniform(word1)))",
        "test_noise.py::test_moments_of_the_normals",
    ),
    (
        "pairs of equal sizes counted twice",
        "factor 2",
        "theory/smoluchowski.py",
        "np.where(i == j, 0.5, 1.0)",
        "np.where(i == j, 1.0, 1.0)",
        "test_kinetics.py::test_constant_kernel_against_the_exact_solution",
    ),
    (
        "no images along z",
        "forgotten image",
        "core/box.py",
        "v[2] - span.z * np.rint(v[2] * span.inverse_z)",
        "v[2]",
        "test_box.py::test_nearest_image_is_the_shortest",
    ),
) + _in(
    "formula",
    "",
    "physics/",
    (
        "sliding forgets where it ends",
        "factor 2",
        "physics/contact.py",
        "slide = dot(add(before.slide, left.slide), sub(reached.slide, left.slide))",
        "slide = dot(before.slide, sub(reached.slide, left.slide))",
        "test_contact_law.py::test_what_yielding_dissipates",
    ),
)

LOOPS = _in(
    "loop",
    "",
    "unit/",
    (
        "the row of cells beyond a wall ends one cell early",
        "off by one",
        "kernels/cells.py",
        "(0, high - nx + 1)",
        "(0, high - nx)",
        "test_cells.py::test_many_grains_in_thin_cells",
    ),
    (
        "both grains are pushed the same way",
        "sign",
        "kernels/gathering.py",
        "force = sub(force, load(contacts.push, c))",
        "force = add(force, load(contacts.push, c))",
        "test_gathering.py::test_sums_are_those_of_brute_force",
    ),
) + _in(
    "loop",
    "",
    "physics/",
    (
        "no reaction of a dipole's force",
        "sign",
        "kernels/dipoles.py",
        "accrue(force, j, (-f[0], -f[1], -f[2]))",
        "accrue(force, j, f)",
        "test_magnetics.py::test_loads_against_brute_force_with_images",
    ),
    (
        "a touch is given a whole kick",
        "factor 2",
        "kernels/events.py",
        "owed - 0.5 * dt * dot(load(contacts.push, c), n)",
        "owed - dt * dot(load(contacts.push, c), n)",
        "test_conservation.py::test_a_touch_keeps_what_verlet_keeps_wherever_in_a_step_it_falls",
    ),
    (
        "one weight of Dormand and Prince",
        "sign",
        "stepping/runge_kutta.py",
        "[35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84]",
        "[35 / 384, 0.0, 500 / 1113, 125 / 192, 2187 / 6784, 11 / 84]",
        "test_adaptive.py::test_scattering_run_back_comes_home",
    ),
    (
        "after a break the others keep the wrong twist",
        "lost row",
        "kernels/events.py",
        "contacts.twist[kept] = contacts.twist[c]",
        "contacts.twist[kept] = contacts.twist[kept]",
        "test_conservation.py::test_a_struck_chain_closes_its_books",
    ),
)

SETTINGS = _in(
    "settings",
    "",
    "unit/",
    (
        "a tesla without a second",
        "forgotten unit",
        "core/units.py",
        '"T": (0, 0, 1, -2, -1, 0)',
        '"T": (0, 0, 1, -1, -1, 0)',
        "test_units.py::test_text_with_units",
    ),
    (
        "a run of no steps",
        "off by one",
        "run/case.py",
        "steps: Annotated[int, Field(ge=1, strict=True)]",
        "steps: Annotated[int, Field(ge=0, strict=True)]",
        "test_case.py::test_one_mistake_is_one_line",
    ),
    (
        "a material with a number that cannot be",
        "swallowed error",
        "core/material.py",
        "problems += error.problems",
        "problems += []",
        "test_grains.py::test_materials_check_themselves",
    ),
    (
        "a moment per mass taken for a moment",
        "forgotten unit",
        "core/grains.py",
        "per_mass * mass",
        "per_mass",
        "test_grains.py::test_what_follows_from_radius_and_material",
    ),
)

FILES = _in(
    "files",
    "files/",
    "unit/",
    (
        "orientations are read one place off",
        "off by one",
        "frame.py",
        "np.roll(np.asarray(p.orientation), -1, axis=1)",
        "np.roll(np.asarray(p.orientation), 1, axis=1)",
        "test_files.py::test_the_trajectory_holds_what_the_world_held",
    ),
    (
        "a check sum without the numbers",
        "swallowed error",
        "checkpoint.py",
        "digest.update(array.tobytes())",
        "digest.update(b'')",
        "test_files.py::test_a_damaged_checkpoint_is_refused_and_the_older_one_used",
    ),
    (
        "a table without its first row",
        "lost row",
        "table.py",
        "    for row in rows:\n",
        "    for row in rows[1:]:\n",
        "test_scattering.py::test_the_command",
    ),
    (
        "radii in metres among angstroms",
        "forgotten unit",
        "xyz.py",
        "[grains.position / ANGSTROM, grains.radius / ANGSTROM, grains.moment]",
        "[grains.position / ANGSTROM, grains.radius, grains.moment]",
        "test_builders.py::test_bodies_come_back_from_files",
    ),
    (
        "a full disk is not told",
        "swallowed error",
        "folder.py",
        'raise FilesFailed(f"cannot write {path}: {error.strerror}; what was there is untouched") from error',
        "return",
        "test_files.py::test_a_failed_write_leaves_the_old_file",
    ),
)

COMMANDS = _in(
    "command",
    "cli/",
    "unit/",
    (
        "the last frame of a slice",
        "off by one",
        "export.py",
        "first + 1 if first != -1 else None",
        "first + 1",
        "test_opened.py::test_the_export_command",
    ),
    (
        "a mistake ends with exit code 0",
        "swallowed error",
        "main.py",
        "return str(error).splitlines(), MISTAKE",
        "return str(error).splitlines(), DONE",
        "test_cli.py::test_mistakes_are_lines_and_exit_code_2",
    ),
    (
        "an end before the start",
        "swallowed error",
        "options.py",
        'return si(value, "s", name, above=0.0)',
        'return si(value, "s", name)',
        "test_cli.py::test_mistakes_are_lines_and_exit_code_2",
    ),
)

AROUND = _in(
    "analysis",
    "analysis/",
    "unit/",
    (
        "a cluster is made whole without images",
        "forgotten image",
        "clusters.py",
        "whole[i] + box.nearest(whole[j] - whole[i])",
        "whole[i] + (whole[j] - whole[i])",
        "test_clusters.py::test_clusters_are_made_whole",
    ),
) + _in(
    "set-up",
    "setup/",
    "unit/",
    (
        "a gas overlaps across the faces of its box",
        "forgotten image",
        "gas.py",
        "apart = box.nearest(here - placed[done])",
        "apart = here - placed[done]",
        "test_gas.py::test_no_two_grains_are_closer_than_the_clearance",
    ),
)

FAULTS = FORMULAS + LOOPS + SETTINGS + FILES + COMMANDS + AROUND
