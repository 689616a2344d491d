"""Tests of `sand.forces`."""
