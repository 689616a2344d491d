"""The table of contacts against formulas evaluated contact by contact."""

import numpy as np
import pytest

import sand
from sand.contact import jkr, mechanics
from sand.contact.constants_table import column_loops
from sand.contact.poses import pose_at
from sand.simulation.contact_table import COLUMNS

from ...physics.setups import random_aggregate


def moving_aggregate(**options):
    """An aggregate in motion, with contacts near and at their limits."""
    rng = np.random.default_rng(5)
    grains = random_aggregate(15, 6, radii=(5e-8, 1e-7), velocity=0.5 * rng.normal(size=(15, 3)))
    sim = sand.Simulation(grains, [sand.Contact(**options)])
    sim.run(until="5 ns")
    return sim


@pytest.mark.compiled("contacts")
@pytest.mark.parametrize("stiffness", ["frozen", "dt97"])
def test_every_column_against_formulas(stiffness):
    """Displacements, fractions of limits, loads and energies from each pose; forces add up to the grains'."""
    sim = moving_aggregate(stiffness=stiffness)
    table, w = sim.contacts, sim.state
    assert set(table) == {name for name, _, _ in COLUMNS}
    force = np.zeros((15, 3))
    for c, (i, j) in enumerate(table["pair"]):
        plain = column_loops(jkr.LAW).at(w.contacts, c)
        pose = pose_at(w.grains.arrays, w.contacts, sim.box.span, c, w.contacts.twist[c])
        r1, r2 = sim.grains.radius[i], sim.grains.radius[j]
        overlap = r1 + r2 - np.linalg.norm(sim.grains.position[i] - sim.grains.position[j])
        y = jkr.LAW.radius_root(overlap, plain)
        constants = mechanics.scaled_stiffness(plain, y, stiffness == "dt97")
        n = np.array(pose.n)
        d = r1 * np.array(pose.n1) - r2 * np.array(pose.n2)
        slide = np.linalg.norm(d - (d @ n) * n)
        xi = constants.reduced_radius * (np.array(pose.n1) + np.array(pose.n2))
        roll = np.linalg.norm(xi - (xi @ n) * n)
        row = {name: table[name][c] for name in table}
        assert row["overlap"] == pytest.approx(overlap, rel=1e-6, abs=0.0)
        assert row["contact_radius"] == pytest.approx(constants.rest_radius * y**2, rel=1e-6, abs=0.0)
        assert row["slide_share"] == pytest.approx(slide / constants.slide_limit, rel=1e-6, abs=1e-9)
        assert row["roll_share"] == pytest.approx(roll / constants.roll_limit, rel=1e-6, abs=1e-9)
        assert row["twist_share"] == pytest.approx(abs(w.contacts.twist[c]) / constants.twist_limit, rel=1e-6, abs=0.0)
        assert row["stretch_share"] == pytest.approx(-overlap / constants.break_overlap, rel=1e-6, abs=0.0)
        assert row["energy_sliding"] == pytest.approx(0.5 * constants.slide_stiffness * slide**2, rel=1e-6, abs=1e-28)
        assert row["force"] @ n == pytest.approx(row["normal_force"], rel=1e-6, abs=0.0)
        across = row["force"] - (row["force"] @ n) * n
        assert np.linalg.norm(across) == pytest.approx(row["slide_force"], rel=1e-2, abs=1e-16)
        assert row["twist_torque"] == pytest.approx(-constants.twist_stiffness * row["twist"], rel=1e-12, abs=0.0)
        assert row["roll_torque"] == pytest.approx(
            constants.roll_stiffness * constants.reduced_radius * roll, rel=1e-6, abs=0.0
        )
        force[i] += row["force"]
        force[j] -= row["force"]
    assert force == pytest.approx(sim.grains.force, abs=1e-9 * np.abs(force).max())
    assert (table["slide_share"] <= 1 + 1e-9).all()
    energies = sim.loads()["energy"]
    for mode in ("normal", "sliding", "rolling", "twisting"):
        assert table[f"energy_{mode}"].sum() == pytest.approx(energies[mode], rel=1e-9, abs=0.0)


@pytest.mark.compiled("contacts")
def test_as_a_data_frame_and_a_dataset():
    """One row per contact, vectors split into components, units where the format supports them."""
    pandas, xarray = pytest.importorskip("pandas"), pytest.importorskip("xarray")
    table = moving_aggregate().contacts
    frame, dataset = table.to_pandas(), table.to_xarray()
    assert isinstance(frame, pandas.DataFrame)
    assert isinstance(dataset, xarray.Dataset)
    assert (frame["grain1"].to_numpy() == table["pair"][:, 0]).all()
    assert (frame["force_y"].to_numpy() == table["force"][:, 1]).all()
    assert dataset["force_y"].attrs["units"] == "N"
    assert dataset.sizes["contact"] == len(table["pair"])


@pytest.mark.compiled("contacts")
def test_no_contacts():
    """An empty table has all columns and no rows."""
    sim = sand.Simulation(sand.Grains([[0, 0, 0]], 1e-8, sand.SILICA), [sand.Contact()])
    assert sim.contacts["pair"].shape == (0, 2)
    assert sim.contacts["force"].shape == (0, 3)
    assert "0 contacts" in repr(sim.contacts)
