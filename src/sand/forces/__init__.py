"""Forces of a simulation: pair forces, external forces, and a gas."""
