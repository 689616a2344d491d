"""Tests of `sand.analysis`."""
