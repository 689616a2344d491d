"""State of a simulation: time, grains, contacts and box as arrays."""
