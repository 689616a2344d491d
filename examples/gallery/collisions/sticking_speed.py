r"""
Sticking speed of two grains
============================

Two grains of silica collide head-on. Below the sticking speed they stay together, above it they rebound. The diagram
compares the coefficient of restitution with JKR theory.

Grains that meet with a speed :math:`v` above the sticking speed :math:`v_s` part with :math:`\sqrt{v^2-v_s^2}`.
"""

import matplotlib.pyplot as plt
import numpy as np

import sand

radius = 0.5e-6
theory = sand.theory.contact("silica", radius)
speeds = theory.sticking_speed * np.array([0.8, 0.95, 1.05, 1.2, 1.5, 2.0, 3.0])
found = []
for speed in speeds:
    half = 0.5 * speed
    pair = sand.Grains(
        [[-1.001 * radius, 0, 0], [1.001 * radius, 0, 0]], radius, "silica", velocity=[[half, 0, 0], [-half, 0, 0]]
    )
    sim = sand.Simulation(pair, [sand.Contact()])
    sim.run(until="1 us", stop="broken >= 1")
    after = sim.grains.velocity[1, 0] - sim.grains.velocity[0, 0]
    found.append(after / speed if sim.ledger["broken"][-1] else 0.0)

smooth = np.linspace(0.7, 3.1, 300) * theory.sticking_speed
plt.plot(smooth, [theory.rebound_speed(v) / v for v in smooth], label="JKR theory")
plt.plot(speeds, found, "o", label="simulation")
plt.xlabel("relative speed [m/s]")
plt.ylabel("coefficient of restitution")
plt.legend()
print(f"sticking speed {theory.sticking_speed:.3f} m/s")

# %%
# What to change
# --------------
#
# * `radius`: the sticking speed is proportional to :math:`r^{-5/6}`.
# * `sand.Contact(damping="viscoelastic", viscous_time="1e-11 s")`: damping raises the sticking speed.
# * `sand.Contact(law="dmt")`: without hysteresis equal grains never stick without damping.
