"""Tests of `sand.simulation`."""
