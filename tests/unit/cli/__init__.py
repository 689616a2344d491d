"""Tests of `sand.cli`."""
