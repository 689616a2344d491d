"""The engine: arrays and compiled program of a simulation, made from grains, forces and settings, and changed."""
