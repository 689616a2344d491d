"""A chain between a fixed and a driven grain is pulled until it breaks.  Run it: python examples/pulled_chain.py"""

import sand

chain = sand.Grains([[1.9999e-7 * k, 0, 0] for k in range(5)], "0.1 um", sand.SILICA)
driven = [sand.Driven([0]), sand.Driven([4], velocity=["1 cm/s", 0, 0])]
sim = sand.Simulation(chain, [sand.Contact(damping="critical")], driven=driven)
while sim.ledger.rows == [] or sim.ledger["broken"][-1] == 0:
    sim.run(sim.time + 4e-9)
    print(f"{1e9 * sim.time:4.0f} ns   force on the driven grain {-1e9 * sim.loads()['force'][4, 0]:6.2f} nN")
print(f"pull-off force {1e9 * sand.theory.contact('silica', '0.1 um').pull_off_force:.2f} nN")
