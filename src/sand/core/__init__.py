"""The ground floor: compiler door, vectors, units, errors, and the data a simulation is made of."""
