"""Neighbour search: cell lists, Verlet lists with a skin, spatial sorting."""
