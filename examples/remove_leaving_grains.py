"""Grains that leave a sphere of 0.4 µm are removed: a cloud in free space that loses its fast grains."""

import numpy as np

import sand


class RemoveLeaving(sand.Updater):
    every = "1 ns"

    def act(self, simulation):
        leaving = np.linalg.norm(simulation.grains.position, axis=1) > 0.4e-6
        if leaving.any() and not leaving.all():
            with simulation.change() as state:
                state.remove(leaving)
        return len(simulation.grains) < 50


grains = sand.setup.gas(100, "0.5 um", radius="20 nm", material="silica", temperature="3e5 K", seed=1)
sim = sand.Simulation(grains, [sand.Contact()], updaters=[RemoveLeaving()], out="leaving")
print(sim.run(until="0.5 us"), f"{len(sim.grains)} grains left, with identities {sim.grains.id.tolist()}")
