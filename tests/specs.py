"""The kernel specifications that default tests may use: each driver takes some ten seconds to compile.

A test that takes steps names what it uses, ``@pytest.mark.compiled("dipoles")``; ``tests/conftest.py`` enforces that.
Tests that need any other combination of forces and integrator belong behind ``--validate``. Small kernels that are
not drivers are marked ``compiled("small")``.
"""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

import sand
from sand.integrate.kernel_spec import KernelSpec
from sand.simulation import engine

BOX = "0.3 um"


def _pair(count: int = 2, **options: Any) -> sand.Grains:
    """Charged magnetic grains in a row, far apart."""
    position = np.arange(count)[:, None] * [[3e-8, 0.0, 0.0]] - [[0.015e-6 * (count - 1), 0.0, 0.0]]
    return sand.Grains(position, 1e-8, sand.IRON, **({"moment": "200 A m^2/kg"} | options))


def contacts() -> sand.Simulation:
    """Contacts alone."""
    return sand.Simulation(_pair(moment=0.0), [sand.Contact()])


def dipoles() -> sand.Simulation:
    """Contacts, and dipoles within a cut-off summed over all pairs in cycles (r-RESPA): the main job."""
    return sand.Simulation(_pair(), [sand.Contact(), sand.Dipoles(cutoff="1 um")])


def listed() -> sand.Simulation:
    """Contacts, dipoles and charges from a Verlet list, and a gas, in a periodic box."""
    forces = [sand.Contact(), sand.Dipoles("0.05 um"), sand.Charges("0.05 um"), sand.Gas("300 K", pressure="1 mbar")]
    search = sand.Neighbours(margin="5 nm", search="cells")
    return sand.Simulation(_pair(charge=1e-19), forces, box=BOX, neighbours=search)


def fields() -> sand.Simulation:
    """Contacts, dipoles as in `dipoles`, and a field B(t)."""
    field = sand.Field(0.0, shape="oscillating", amplitude="1 mT", frequency="1 MHz")
    return sand.Simulation(_pair(), [sand.Contact(), sand.Dipoles(cutoff="1 um"), field])


def adaptive() -> sand.Simulation:
    """Contacts and dipoles, with Runge-Kutta steps while nothing touches."""
    return sand.Simulation(_pair(), [sand.Contact(), sand.Dipoles()], stepping=sand.Adaptive())


def threads() -> sand.Simulation:
    """More than a thousand grains with contacts and dipoles: loops in blocks, shared by threads."""
    return sand.Simulation(_pair(1000), [sand.Contact(), sand.Dipoles()])


DRIVERS: dict[str, Callable[[], sand.Simulation]] = {
    each.__name__: each for each in (contacts, dipoles, listed, fields, adaptive, threads)
}
SPECS = (*DRIVERS, "scattering", "small")
"""Drivers by name; flights of two bodies; whatever compiles in a second or two."""

WORKERS = {"adaptive": "flights", "scattering": "flights"}
"""Specifications that share a worker, because tests compare one with the other."""
FIXTURES = {"looked_at": "fields", "in_a_field": "fields"}
"""Fixtures shared by many tests that run a simulation, and its driver."""


def _key(plan: KernelSpec) -> KernelSpec:
    """The plan without `wide`, which chooses longer vectors on few processors only."""
    return plan._replace(wide=False)


@functools.cache
def _plans() -> dict[KernelSpec, str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {_key(make()._engine._kernel_spec): name for name, make in DRIVERS.items()}


def name_of(plan: KernelSpec) -> str | None:
    """The specification that a plan belongs to, None if it is no canonical one."""
    return _plans().get(_key(plan))


def parts_of(plan: KernelSpec) -> str:
    """What a driver is made of, in a few words."""
    forces = [getattr(each, "__qualname__", str(each)) for each in (plan.long_range.loads, plan.external)]
    return ", ".join([*(name for name, value in plan._asdict().items() if value is True), *forces])


@contextmanager
def watched(use: Callable[[str | None, KernelSpec], None]) -> Iterator[None]:
    """Call `use(name, plan)` before a compiled driver takes steps."""
    kept = engine.driver_for

    def wrapped(driver_for: Callable) -> Callable:
        def watched_driver_for(plan: KernelSpec) -> Callable:
            driver = driver_for(plan)

            @functools.wraps(driver_for)
            def advance(*arguments: Any) -> Any:
                use(name_of(plan), plan)
                return driver(*arguments)

            return advance

        return watched_driver_for

    engine.driver_for = wrapped(kept)
    try:
        yield
    finally:
        engine.driver_for = kept
