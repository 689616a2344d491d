"""Fixtures of unit tests: two finished runs and a small page bundle."""

import warnings

import numpy as np
import pytest

import sand
from sand.io import page_bundle as page_files

from .pages import SCRIPT


@pytest.fixture(scope="session")
def finished_run(tmp_path_factory):
    """Folder and simulation of a finished run of six grains, five of them in a row, in a rotating field."""
    folder = tmp_path_factory.mktemp("looked-at") / "run"
    position = [[(2e-8 - 1e-10) * k, 0, 0] for k in range(5)] + [[0, 2e-7, 0]]
    grains = sand.Grains(position, 1e-8, sand.IRON, moment="200 A m^2/kg", velocity=np.eye(6, 3) * 0.1)
    field = sand.Field(0.0, shape="rotating", amplitude=["1 mT", 0, 0], frequency="10 GHz", axis=[0, 0, 1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sim = _run(grains, field, folder)
    return folder, sim


def _run(grains, field, folder):
    sim = sand.Simulation(
        grains, [sand.Contact(), sand.Dipoles(cutoff="10 um"), field], out=folder, frame_every="10 ps"
    )
    sim.run(until="50 ps")
    return sim


@pytest.fixture(scope="session")
def run_in_field(tmp_path_factory):
    """A short run of eight magnetic grains, two of them in contact, in a field."""
    run_folder = tmp_path_factory.mktemp("plot") / "run"
    grains = sand.Grains(
        [[2e-8 * 0.998 * (k % 2), 5e-8 * (k // 2), 0.0] for k in range(8)],
        "10 nm",
        sand.SILICA,
        moment=np.tile([0.0, 0.0, 1e-18], (8, 1)),
    )
    grains.arrays.velocity[0] = np.arange(8) * 0.1
    sim = sand.Simulation(
        grains,
        [sand.Contact(), sand.Dipoles(), sand.Field("1 mT", shape="ramp", final="1 mT", end="1 s")],
        box="400 nm",
        out=str(run_folder),
        frame_every="1 ns",
    )
    sim.run(until="3 ns")
    return run_folder


@pytest.fixture
def bundle(tmp_path, monkeypatch):
    """A small page bundle in place of the real one; its script contains text that would end its element."""
    home = tmp_path / "bundle"
    home.mkdir()
    (home / "grainview.js").write_text(SCRIPT)
    (home / "grainview.css").write_text("body::after { content: '</style>' }")
    monkeypatch.setattr(page_files, "PAGE", home)
    return home
