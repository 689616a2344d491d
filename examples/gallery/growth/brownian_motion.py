r"""
Brownian motion in a thin gas
=============================

Five hundred grains in a gas move freely at first and diffuse later. The mean square displacement is compared with
Langevin's equation; its statistical error is 4 %.

With the stopping time :math:`\tau` it is :math:`\langle x^2\rangle=(6k_BT\tau/m)\,[t-\tau(1-e^{-t/\tau})]`.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand
from sand.basics.constants import BOLTZMANN

temperature, count = 300.0, 500
position = np.zeros((count, 3))
position[:, 0] = 1e-3 * np.arange(count)  # far apart, so that no grains touch
mass = sand.Grains(position, "10 nm", "silica").mass[0]
speed = np.sqrt(BOLTZMANN * temperature / mass) * np.random.default_rng(1).normal(size=(count, 3))
grains = sand.Grains(position, "10 nm", "silica", velocity=speed)

gas = sand.Gas(temperature, pressure="0.5 bar", cross_section="2e-19 m^2")
tau = gas.shortest_time(grains)
sim = sand.Simulation(grains, [gas], stepping=sand.Verlet(step="1 ns"), seed=1)
times, squares = tau * np.geomspace(0.1, 30, 12), []
for time in times:
    sim.run(until=time)
    squares.append(((sim.grains.position - position) ** 2).sum(axis=1).mean())

shape = times - tau * (1 - np.exp(-times / tau))
expected = 6 * BOLTZMANN * temperature * tau / mass * shape
plt.loglog(times / tau, squares, "o", label="simulation")
plt.loglog(times / tau, expected, label="Langevin's equation")
plt.xlabel("time / stopping time")
plt.ylabel("mean square displacement [m²]")
plt.legend()
print(f"stopping time {tau:.2e} s, ratio at the end {squares[-1] / expected[-1]:.3f}")

# %%
# What to change
# --------------
#
# * `pressure` or `density`: the stopping time is proportional to its inverse.
# * `accommodation=0`: molecules are reflected like light by a mirror, and the drag is smaller.
# * `wind=["1 m/s", 0, 0]`: the gas carries the grains along.
