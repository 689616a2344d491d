"""Figures of runs and experiments, and rendered images of grains."""
