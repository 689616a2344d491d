"""Groups of the default tests by the stages that they compile.

A test that compiles anything names its groups, ``@pytest.mark.compiled("dipoles")``; ``tests/conftest.py`` enforces
that.  Tests with the same first group share a worker of pytest-xdist, so that workers seldom wait for the same code;
what several workers need, each compiles a part of (`sand.compiler.ahead`).  The longest groups start first, and tests
that compile nothing fill the end.
"""

from __future__ import annotations

SPECS = ("contacts", "dipoles", "listed", "fields", "flights", "threads", "scattering", "deformation", "shear", "small")
"""Contacts alone; with dipoles; with a Verlet list and a gas; with fields in time; an integrator of the user;
blocks shared by threads; two-body scattering; a box that is deformed; one that is sheared; anything that compiles in a
second or two."""
WORKERS = {"flights": "trajectories", "scattering": "trajectories"}
"""Groups that share a worker, because tests compare one with the other."""
STARTS = (
    *("dipoles", "contacts", "deformation", "shear", "small", "trajectories", "listed", "fields", "threads", "sources"),
)
"""The groups in the order in which workers start them, the longest first; the last one parses all files once."""
FIXTURES = {"finished_run": "fields", "run_in_field": "fields"}
"""Fixtures that run a simulation, and the group of its stages."""
