"""Tests of `sand.plotting`."""
