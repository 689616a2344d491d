"""Grains lose their adhesion: aggregates that are shaken fall apart.  Run it with:  python examples/ramped_gamma.py"""

import sand

body = sand.setup.bpca(30, radius="0.1 um", material="silica", seed=1)
contact = sand.Contact(surface_energy_factor=sand.Ramp(["1", "0.01"], ["10 ns", "60 ns"]))
sim = sand.Simulation(body, [contact], frame_every="1 ns")
with sim.change() as change:
    change.velocity += 0.03 * body.position / 1e-7  # each layer of grains moves faster than the one inside it
print(sim.run(until="100 ns"))
for name in ("clusters", "normal", "lost_breaking", "lost_outside"):
    print(f"{name:14}", *(f"{value:10.3g}" for value in sim.ledger[name][::20]))
