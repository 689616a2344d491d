"""Single-line faults, and the test that should catch each of them; `tests.faults.plant` plants them.

They are typical programming errors: a sign, a factor 2, a forgotten image or unit, an index off by one, a lost row, a
swallowed error; in formulas, loops, settings, files, commands, set-up and analysis.
"""

from __future__ import annotations

from dataclasses import dataclass

KINDS = ("sign", "factor 2", "forgotten image", "forgotten unit", "off by one", "lost row", "swallowed error")
AREAS = ("formula", "loop", "settings", "files", "command", "analysis", "set-up")
SOURCES, TESTS = "src/sand/", "tests/"


@dataclass(frozen=True)
class Fault:
    """A fault in one line.

    Attributes:
        name: for the table.
        kind: of KINDS.
        area: of AREAS.
        file: path below SOURCES.
        old, new: part of a line that occurs once in the file, and its replacement.
        test: path below TESTS and name of the test that should fail.
    """

    name: str
    kind: str
    area: str
    file: str
    old: str
    new: str
    test: str

    @property
    def named(self) -> str:
        """The test to run first, relative to the root of the checkout."""
        return TESTS + self.test

    @property
    def searched(self) -> str:
        """The text in which words of the command line are searched."""
        return f"{self.name} | {self.kind} | {self.area} | {self.file}"


# fmt: off
FAULTS = (
    # formulas
    Fault("velocities of a deformed box that grow with it", "sign", "formula", "numerics/flow.py",
          "return along / (1.0 + dt * span.rate_x)", "return along * (1.0 + dt * span.rate_x)",
          "unit/numerics/test_flow.py::test_a_drift_keeps_the_velocity_in_the_laboratory"),
    Fault("images above slide the other way", "sign", "formula", "basics/box.py",
          "along = v[0] - span.tilt * crossed", "along = v[0] + span.tilt * crossed",
          "unit/basics/test_box.py::test_the_nearest_image_in_a_tilted_box"),
    Fault("velocities that shear does not turn", "sign", "formula", "numerics/flow.py",
          "along = v[0] - dt * sheared(upwards, span)", "along = v[0] + dt * sheared(upwards, span)",
          "unit/numerics/test_flow.py::test_a_drift_in_a_sheared_box"),
    Fault("a wrapped tilt without its crossings", "forgotten image", "loop", "components/deformation_stage.py",
          "np.int32(turns) * grains.image[2, i]", "np.int32(0) * grains.image[2, i]",
          "physics/test_shear.py::test_wrapping_the_tilt_changes_nothing"),
    Fault("the anchors of lists jump where the tilt is wrapped", "forgotten image", "loop",
          "components/deformation_stage.py", "pair_list.built[3] -= turns", "pair_list.built[3] -= 0.0 * turns",
          "physics/test_shear.py::test_wrapping_the_tilt_changes_nothing"),
    Fault("the work of shear with the other stress", "off by one", "loop", "components/deformation_stage.py",
          "found[8] + far[2], found[6])", "found[8] + far[2], found[2])",
          "physics/test_shear.py::test_the_work_of_shear_closes_the_ledger"),
    Fault("cells beyond a tilted face without the tilt", "forgotten image", "loop", "neighbours/cell_list.py",
          "along = position[0] - steps", "along = position[0] - 0.0 * steps",
          "unit/neighbours/test_neighbour_lists.py::test_lists_in_tilted_boxes"),
    Fault("the time of a contact with the mass of a grain", "factor 2", "formula", "theory/compression.py",
          "math.sqrt(0.5 * mass", "math.sqrt(mass",
          "unit/theory/test_compression.py::test_scales_of_ice_grains"),
    Fault("half the JKR force", "factor 2", "formula", "contact/jkr.py",
          "return 4.0 * pull_off_force * (cube * cube - cube)", "return 2.0 * pull_off_force * (cube * cube - cube)",
          "unit/contact/test_jkr.py::test_special_points_are_exact"),
    Fault("the cut-off pushes where it should pull", "sign", "formula", "forces/pair/dipole_formulas.py",
          "(both - 5.0 * product) + slope * energy", "(both - 5.0 * product) - slope * energy",
          "unit/forces/test_dipole.py::test_force_is_minus_the_gradient_of_the_energy"),
    Fault("the rate of 1/r^5 as if it were 1/r^4", "off by one", "formula", "forces/pair/dipole_rates.py",
          "-3.0 * inverse3 * radial, -5.0 * three * radial", "-3.0 * inverse3 * radial, -4.0 * three * radial",
          "unit/forces/test_pair_forces.py::test_taylor_rates_against_finite_differences"),
    Fault("friction of a spin with r^3 for r^4", "forgotten unit", "formula", "forces/gas_drag.py",
          "accommodation * density * speed * radius**4", "accommodation * density * speed * radius**3",
          "unit/forces/test_gas_drag.py::test_shortest_relaxation_time"),
    Fault("a quaternion product with one wrong sign", "sign", "formula", "numerics/quaternion.py",
          "cosine * q[1] + y * q[3] + z * q[0] - x * q[2]", "cosine * q[1] + y * q[3] - z * q[0] - x * q[2]",
          "unit/numerics/test_quaternion.py::test_turn_is_a_rotation_in_the_laboratory_frame"),
    Fault("the rate of a cut central force", "sign", "formula", "forces/pair/generic_loops.py",
          "energy * slope_rate - dot(force, moving) * slope", "energy * slope_rate + dot(force, moving) * slope",
          "unit/forces/test_pair_forces.py::test_central_force_is_minus_the_gradient"),
    Fault("Box and Muller without the 2", "factor 2", "formula", "numerics/random.py",
          "math.sqrt(-2.0 * math.log(uniform(word1)))", "math.sqrt(-1.0 * math.log(uniform(word1)))",
          "unit/numerics/test_random.py::test_moments_of_the_normals"),
    Fault("pairs of equal sizes counted twice", "factor 2", "formula", "theory/smoluchowski.py",
          "np.where(i == j, 0.5, 1.0)", "np.where(i == j, 1.0, 1.0)",
          "unit/theory/test_kinetics.py::test_constant_kernel_against_the_exact_solution"),
    Fault("no images along z", "forgotten image", "formula", "basics/box.py",
          "v[2] - span.z * np.rint(v[2] * span.inverse_z)", "v[2]",
          "unit/basics/test_box.py::test_nearest_image_is_the_shortest"),
    Fault("sliding forgets where it ends", "factor 2", "formula", "contact/mechanics.py",
          "slide = dot(add(start.slide, left.slide), sub(end.slide, left.slide))",
          "slide = dot(start.slide, sub(end.slide, left.slide))",
          "generic/test_contact_laws.py::test_dissipation_of_slip"),
    Fault("work at the start of a step with the separation at its end", "sign", "formula", "contact/damping.py",
          "+ dt * dot(start.force, cross(rolling, velocity))", "- dt * dot(start.force, cross(rolling, velocity))",
          "physics/test_damping.py::test_losses_of_a_step_are_the_work_of_velocity_verlet"),
    Fault("half the variance of thermal loads", "factor 2", "formula", "contact/damping.py",
          "math.sqrt(2.0 * thermal_energy / dt)", "math.sqrt(thermal_energy / dt)",
          "physics/test_damping.py::test_covariance_of_the_thermal_loads"),
    Fault("a charge keeps half the potential of its own smeared charge", "factor 2", "formula", "forces/pair/ewald.py",
          "return 2.0 * alpha * sources.k / math.sqrt(math.pi) * math.erf(z)",
          "return alpha * sources.k / math.sqrt(math.pi) * math.erf(z)",
          "unit/forces/test_ewald_charges.py::test_lattice_energies"),
    # loops
    Fault("a pair of the Verlet list counts twice in the stress", "factor 2", "loop", "forces/pair/long_range_loops.py",
          "neighbour[m]], 0.5, out)", "neighbour[m]], 1.0, out)",
          "physics/test_stress.py::test_pair_forces_with_cutoff"),
    Fault("arms of contacts with walls point to the wall", "sign", "loop", "components/walls.py",
          "* n).sum(axis=0) * n", "* n).sum(axis=0) * -n", "physics/test_stress.py::test_chain_between_walls"),
    Fault("waves downwards with the phase of waves upwards", "sign", "loop", "forces/pair/ewald_loops.py",
          "even * c - odd_i * s, even_i * c + odd * s", "even * c + odd_i * s, even_i * c + odd * s",
          "unit/forces/test_ewald.py::test_ewald_sum_against_images_in_a_sphere"),
    Fault("splines beyond the last column of a mesh are not added to the first", "forgotten image", "loop",
          "forces/pair/mesh_loops.py",
          "density[k, line, m] += density[k, line, columns + m]", "density[k, line, m] += density[k, line, m]",
          "unit/forces/test_ewald_mesh.py::test_charges_on_the_same_mesh"),
    Fault("second derivative along z of a tree with the wrong sign", "sign", "loop", "forces/pair/tree_operators.py",
          "x * xz + y * yz - z * (xx + yy)", "x * xz + y * yz + z * (xx + yy)",
          "unit/forces/test_tree.py::test_loads_against_all_pairs"),
    Fault("the row of cells beyond a wall ends one cell early", "off by one", "loop", "neighbours/cell_list.py",
          "(start + mx, high, start + mx)", "(start + mx, high - 1, start + mx)",
          "unit/neighbours/test_neighbour_lists.py::test_many_grains_in_thin_cells"),
    Fault("both grains are pushed the same way", "sign", "loop", "contact/gather.py",
          "force = sub(force, load(contacts.force, c))", "force = add(force, load(contacts.force, c))",
          "unit/contact/test_gather.py::test_sums_are_those_of_brute_force"),
    Fault("no reaction of a dipole's force", "sign", "loop", "forces/pair/dipole_loops.py",
          "accrue(force, j, (-f[0], -f[1], -f[2]))", "accrue(force, j, f)",
          "physics/test_magnetic_dynamics.py::test_loads_against_brute_force_with_images"),
    Fault("a forming contact is given a whole kick", "factor 2", "loop", "contact/transitions.py",
          "mass * gain + 0.5 * dt * dot(load(contacts.force, c), n)",
          "mass * gain + dt * dot(load(contacts.force, c), n)",
          "physics/test_conservation.py::test_contact_formation_conserves_the_modified_energy_of_verlet"),
    Fault("the work of a field on free grains with the wrong sign", "sign", "loop", "integrate/flight.py",
          "ENERGY) - before + work", "ENERGY) - before - work",
          "examples/test_forest_ruth.py::test_work_of_an_oscillating_and_of_a_ramped_field"),
    Fault("the second half of a kick is a whole one", "factor 2", "loop", "integrate/driver.py",
          "= kick(s.grains, 0.5 * s.clock[STEP])", "= kick(s.grains, s.clock[STEP])",
          "physics/test_magnetic_dynamics.py::test_oscillation_of_two_distant_dipoles"),
    Fault("after a break the others keep the wrong twist", "lost row", "loop", "contact/events.py",
          "contacts.twist[kept] = contacts.twist[c]", "contacts.twist[kept] = contacts.twist[kept]",
          "unit/contact/test_remove_broken.py::test_each_column_moves_with_its_contact"),
    Fault("a dashpot acts for half a step, whenever the grains touched", "factor 2", "loop", "contact/damping.py",
          "(contacts.force, c)), held.pose.n) * elapsed", "(contacts.force, c)), held.pose.n) * 0.5 * step.dt",
          "physics/test_damping.py::test_the_times_of_touch_and_break_are_resolved"),
    # rigid clusters
    Fault("the bound of contact loads has no lever arms", "lost row", "loop", "integrate/rigid/rigid_body.py",
          "torques += 2.0 * math.sqrt(extent) * forces", "torques += 0.0 * math.sqrt(extent) * forces",
          "unit/integrate/test_rigid_body.py::test_the_bound_of_contact_loads_holds_for_every_contact_of_a_tumbling_chain"),
    Fault("twice the energy removed at rest", "factor 2", "loop", "engine/rigid/cluster_bodies.py",
          "removed = 0.5 * float((m", "removed = 1.0 * float((m",
          "physics/test_rigid_clusters.py::test_the_ledger_closes"),
    Fault("touches are seen at half the closing speed", "factor 2", "formula", "integrate/rigid/body_touches.py",
          "reach = TOUCH_SPEED * closing * h", "reach = 0.5 * closing * h",
          "physics/test_rigid_clusters.py::test_no_touch_is_missed"),
    Fault("friction of a body along the axes of the laboratory", "sign", "loop", "integrate/rigid/body_friction.py",
          "linear = turned(load4(bodies.orientation, first), linear)", "linear = linear",
          "physics/test_rigid_gas.py::test_friction_of_a_body_is_the_matrix_exponential"),
    Fault("loads of substeps act twice", "lost row", "loop", "integrate/rigid/rigid_body.py",
          "if excludes_loads or bodies.quick[first] == 1:", "if excludes_loads:",
          "physics/test_substeps.py::test_substeps_are_of_order_two_and_as_accurate_as_steps_of_all"),
    Fault("the same noise in many substeps", "off by one", "loop", "engine/rigid/quick_bodies.py",
          "own.count[SUBSTEPS] = state.count[STEPS] + state.count[SUBSTEPS]",
          "own.count[SUBSTEPS] = state.count[STEPS]",
          "physics/test_substeps.py::test_numbers_of_the_noise_of_a_gas_are_used_once"),
    Fault("slow pairs touch unseen", "swallowed error", "loop", "integrate/rigid/substeps.py",
          "if gap <= 2.0 * reach_of_pair", "if gap <= 0.0 * reach_of_pair",
          "physics/test_substeps.py::test_slow_grains_that_touch_within_a_step_are_seen"),
    Fault("awake clusters without substeps", "lost row", "loop", "integrate/rigid/substeps.py",
          "or bodies.asleep[first] == 0 else 0", "else 0",
          "physics/test_substeps.py::test_awake_clusters_move_in_substeps"),
    Fault("awake clusters are not turned by far bodies", "lost row", "loop", "engine/rigid/quick_bodies.py",
          "excluded_force, grains.torque - bodies.excluded_torque", "excluded_force, 0.0 * grains.torque",
          "physics/test_substeps.py::test_momenta_are_conserved_to_rounding"),
    Fault("far fields do not limit the step", "lost row", "loop", "integrate/rigid/substeps.py",
          "energy += norm(load(grains.moment, i)) * norm(load(fields, i))", "energy += 0.0",
          "physics/test_substeps.py::test_loads_besides_those_in_substeps_allow_the_step"),
    # settings and units
    Fault("tesla with 1/s instead of 1/s²", "forgotten unit", "settings", "basics/unit_factors.py",
          '"T": (0, 0, 1, -2, -1, 0)', '"T": (0, 0, 1, -1, -1, 0)',
          "unit/basics/test_units.py::test_built_in_units_agree_with_pint"),
    Fault("a run of no steps", "off by one", "settings", "config/case.py",
          "int | None, Whole(1, MOST_STEPS)", "int | None, Whole(0, MOST_STEPS)",
          "unit/basics/test_messages.py::test_wrong_input_gives_its_lines"),
    Fault("a material with an impossible value", "swallowed error", "settings", "basics/settings.py",
          "value = errors.take(key.setting.read, value, where, instead=value)", "value = value",
          "unit/basics/test_grains.py::test_materials_are_checked"),
    Fault("a moment per mass taken for a moment", "forgotten unit", "settings", "basics/grains.py",
          '("A m^2/kg", mass)', '("A m^2/kg", 1.0)',
          "unit/basics/test_grains.py::test_derived_quantities"),
    # files
    Fault("quaternion components are read one position off", "off by one", "files", "io/frame.py",
          "np.roll(np.asarray(p.orientation), -1, axis=1)", "np.roll(np.asarray(p.orientation), 1, axis=1)",
          "unit/io/test_frame_quantities.py::test_a_frame_holds_grains_and_contacts"),
    Fault("a check sum without the numbers", "swallowed error", "files", "io/checkpoint.py",
          "digest.update(array.tobytes())", "digest.update(b'')",
          "unit/io/test_checkpoint_numbers.py::test_numbers_that_were_changed_are_refused"),
    Fault("a table without its first row", "lost row", "files", "io/table.py",
          "writer.writerows(rows)", "writer.writerows(rows[1:])",
          "unit/io/test_tables.py::test_a_table_has_all_its_rows"),
    Fault("radii in metres among angstroms", "forgotten unit", "files", "io/extended_xyz.py",
          "[grains.position / ANGSTROM, grains.radius / ANGSTROM, grains.velocity,",
          "[grains.position / ANGSTROM, grains.radius, grains.velocity,",
          "unit/setup/test_builders.py::test_bodies_round_trip_through_files"),
    Fault("a full disk is not reported", "swallowed error", "files", "io/run_folder.py",
          'raise FilesFailed(f"cannot write {path}: {error.strerror}; {left}") from error', "return",
          "unit/io/test_files.py::test_a_failed_write_leaves_the_old_file"),
    # commands
    Fault("the last frame of a slice", "off by one", "command", "cli/options.py",
          "first + 1 if first != -1 else None", "first + 1",
          "unit/results/test_results.py::test_the_export_command"),
    Fault("wrong input ends with exit code 0", "swallowed error", "command", "cli/program.py",
          "return str(error).splitlines(), BAD_INPUT", "return str(error).splitlines(), DONE",
          "unit/basics/test_messages.py::test_wrong_input_gives_its_lines"),
    Fault("an end before the start", "swallowed error", "command", "simulation/cadence.py",
          'seconds = si(value, "s", name, above=0.0)', 'return si(value, "s", name)',
          "unit/basics/test_messages.py::test_wrong_input_gives_its_lines"),
    # analysis
    Fault("a cluster is made whole without images", "forgotten image", "analysis", "basics/clusters.py",
          "whole[i] + box.nearest(whole[j] - whole[i])", "whole[i] + (whole[j] - whole[i])",
          "unit/analysis/test_clusters.py::test_clusters_are_made_whole"),
    Fault("images of a percolating cluster", "sign", "analysis", "analysis/clusters.py",
          "n + sign * step", "n + step",
          "unit/analysis/test_clusters.py::test_percolation_axes_by_two_roads"),
    Fault("the end of a packing between walls", "off by one", "analysis", "experiments/laboratory_walls.py",
          "(1.0 - left) / rate", "left / rate",
          "unit/experiments/test_laboratory.py::test_walls_touch_the_outermost_grains"),
    # set-up
    Fault("a gas overlaps across the faces of its box", "forgotten image", "set-up", "setup/gas.py",
          "dx - lx * round(dx * ix), dy - ly", "dx, dy - ly",
          "unit/setup/test_setup_gas.py::test_no_two_grains_are_closer_than_the_clearance"),
)
# fmt: on
