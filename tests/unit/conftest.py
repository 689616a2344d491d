"""What unit tests share."""

import warnings

import numpy as np
import pytest

import sand


@pytest.fixture(scope="session")
def looked_at(tmp_path_factory):
    """A finished run of six grains, five of them in a row, in a field that turns; its folder and simulation."""
    folder = tmp_path_factory.mktemp("looked-at") / "run"
    position = [[(2e-8 - 1e-10) * k, 0, 0] for k in range(5)] + [[0, 2e-7, 0]]
    grains = sand.Grains(position, 1e-8, sand.IRON, moment="200 A m^2/kg", velocity=np.eye(6, 3) * 0.1)
    field = sand.Field(0.0, shape="rotating", amplitude=["1 mT", 0, 0], frequency="10 GHz", axis=[0, 0, 1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sim = _run(grains, field, folder)
    return folder, sim


def _run(grains, field, folder):
    sim = sand.Simulation(grains, [sand.Contact(), sand.Dipoles(), field], out=folder, frame_every="10 ps")
    sim.run(until="50 ps")
    return sim
