"""Tests of `sand.setup`."""
