"""Flights of two magnetic grains, beside SciPy's DOP853 with a right-hand side in NumPy."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

import sand
from sand.basics.constants import MAGNETIC
from sand.experiments.scattering import flight, trajectory
from sand.experiments.scattering.flights import fly
from sand.experiments.scattering.sampling import Task

from .table import row
from .timing import in_turns, thread

GRAINS = {"radius": "10 nm", "material": sand.IRON, "moment": "200 A m^2/kg", "temperature": "100 K"}
TARGETS = {"none": 2000.0, "kT/2": 300.0}
"""Flights per second."""


def all_rows(quick: bool) -> Iterator[dict[str, Any]]:
    """Flights with both kinds of spin; b up to 1.2 b_max, v_th, 10 b_max. SciPy flies a cold one of the same length."""
    for spin, rate in TARGETS.items():
        one = flight(**GRAINS, speed=1, speed_unit="thermal", spin=spin)
        number = 100 if quick else 1000
        tasks = [Task(k, 0, number // 10) for k in range(10)]
        width = 0.12 * one.scales.capture
        fly(one, [Task(0, 0, 1)], width)

        def ours(one: Any = one, tasks: Any = tasks, width: float = width, number: int = number) -> float:
            return thread(lambda: fly(one, tasks, width)) / number

        def peer(one: Any = one) -> float:
            return thread(lambda: in_scipy(one))

        pair = in_turns(ours, peer if spin == "none" else None, 2 if quick else 3)
        name = f"scattering, one flight, spin {spin}"
        yield row(name, pair, "ms", 1e3 / rate, scale=1e3, of="SciPy DOP853, NumPy")


def in_scipy(one: Any) -> None:
    """One cold flight of the same length, errors 1e-9, as one would write it."""
    path = trajectory(one, "0.8 b_max")
    mass, inertia = float(one.target.mass[0]), float(one.target.inertia[0])
    size = float(np.linalg.norm(one.target.moment[0]))

    def rates(_t: float, y: np.ndarray) -> np.ndarray:
        r, u, e1, e2, w1, w2 = y.reshape(6, 3)
        d = math.sqrt(r @ r)
        a, b = size * e1, size * e2
        force = 3.0 * MAGNETIC / d**5 * ((a @ r) * b + (b @ r) * a + (a @ b - 5.0 * (a @ r) * (b @ r) / d**2) * r)
        field1 = MAGNETIC * (3.0 * r * (b @ r) / d**5 - b / d**3)
        field2 = MAGNETIC * (3.0 * r * (a @ r) / d**5 - a / d**3)
        turns = np.cross(a, field1) / inertia, np.cross(b, field2) / inertia
        return np.concatenate((u, 2.0 * force / mass, np.cross(w1, e1), np.cross(w2, e2), *turns))

    start = np.concatenate(
        (
            path.projectile[0] - path.target[0],
            path.velocity_projectile[0] - path.velocity_target[0],
            *(path.moment_projectile[0], path.moment_target[0], path.spin_projectile[0], path.spin_target[0]),
        )
    )
    scale = np.repeat([1e-8, 0.2, 1.0, 1.0, 1e7, 1e7], 3)
    solve_ivp(rates, (0.0, path.time[-1]), start, method="DOP853", rtol=1e-9, atol=1e-9 * scale)
