"""Tests of `sand.integrate`."""
