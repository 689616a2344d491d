"""The kernel specifications that default tests may use; compiling a driver takes about ten seconds.

A test that takes steps names its specifications, ``@pytest.mark.compiled("dipoles")``; ``tests/conftest.py``
enforces that.  Tests of other combinations of forces and integrator are marked ``validate``.  Small kernels that
are not drivers are marked ``compiled("small")``.
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


def _row_of_grains(count: int = 2, **options: Any) -> sand.Grains:
    """Charged magnetic grains in a row without contacts."""
    position = np.arange(count)[:, None] * [[3e-8, 0.0, 0.0]] - [[0.015e-6 * (count - 1), 0.0, 0.0]]
    return sand.Grains(position, 1e-8, sand.IRON, **({"moment": "200 A m^2/kg"} | options))


def contacts() -> sand.Simulation:
    """Contacts alone."""
    return sand.Simulation(_row_of_grains(moment=0.0), [sand.Contact()])


def dipoles() -> sand.Simulation:
    """Contacts, and dipoles within a cut-off over all pairs, in r-RESPA cycles: the most common case."""
    return sand.Simulation(_row_of_grains(), [sand.Contact(), sand.Dipoles(cutoff="1 um")])


def listed() -> sand.Simulation:
    """Contacts, dipoles and charges from a Verlet list, and a gas, in a periodic box."""
    forces = [sand.Contact(), sand.Dipoles("0.05 um"), sand.Charges("0.05 um"), sand.Gas("300 K", pressure="1 mbar")]
    search = sand.Neighbours(margin="5 nm", search="cells")
    return sand.Simulation(_row_of_grains(charge=1e-19), forces, box=BOX, neighbours=search)


def fields() -> sand.Simulation:
    """Contacts, dipoles as in `dipoles`, and a time-dependent field B(t)."""
    field = sand.Field(0.0, shape="oscillating", amplitude="1 mT", frequency="1 MHz")
    return sand.Simulation(_row_of_grains(), [sand.Contact(), sand.Dipoles(cutoff="1 um"), field])


def adaptive() -> sand.Simulation:
    """Contacts and dipoles; Runge–Kutta steps while there are no contacts."""
    return sand.Simulation(_row_of_grains(), [sand.Contact(), sand.Dipoles()], stepping=sand.Adaptive())


def threads() -> sand.Simulation:
    """A thousand grains with contacts and dipoles: loops in blocks, shared by threads."""
    return sand.Simulation(_row_of_grains(1000), [sand.Contact(), sand.Dipoles()])


DRIVERS: dict[str, Callable[[], sand.Simulation]] = {
    each.__name__: each for each in (contacts, dipoles, listed, fields, adaptive, threads)
}
SPECS = (*DRIVERS, "scattering", "small")
"""Drivers by name; two-body scattering; kernels that compile in a second or two."""

WORKERS = {"adaptive": "trajectories", "scattering": "trajectories"}
"""Specifications whose tests share a pytest worker, because tests compare one with the other."""
FIXTURES = {"finished_run": "fields", "run_in_field": "fields"}
"""Fixtures that run a simulation, and the specification of its driver."""


def _key(kernel_spec: KernelSpec) -> KernelSpec:
    """The specification without `wide`, which selects longer vectors on some processors only."""
    return kernel_spec._replace(wide=False)


@functools.cache
def _kernel_specs() -> dict[KernelSpec, str]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return {_key(make()._engine._kernel_spec): name for name, make in DRIVERS.items()}


def name_of(kernel_spec: KernelSpec) -> str | None:
    """Name of a kernel specification, None if it is not in DRIVERS."""
    return _kernel_specs().get(_key(kernel_spec))


def description_of(kernel_spec: KernelSpec) -> str:
    """The true options and the forces of a kernel specification, as text."""
    forces = [getattr(each, "__qualname__", str(each)) for each in (kernel_spec.long_range.loads, kernel_spec.external)]
    return ", ".join([*(name for name, value in kernel_spec._asdict().items() if value is True), *forces])


@contextmanager
def monitored_drivers(use: Callable[[str | None, KernelSpec], None]) -> Iterator[None]:
    """Call `use(name, kernel_spec)` before a compiled driver takes steps."""
    original = engine.driver_for

    def wrapped(driver_for: Callable) -> Callable:
        def monitored_driver_for(kernel_spec: KernelSpec) -> Callable:
            driver = driver_for(kernel_spec)

            @functools.wraps(driver_for)
            def advance(*arguments: Any) -> Any:
                use(name_of(kernel_spec), kernel_spec)
                return driver(*arguments)

            return advance

        return monitored_driver_for

    engine.driver_for = wrapped(original)
    try:
        yield
    finally:
        engine.driver_for = original
