"""Tests of `sand.numerics`."""
