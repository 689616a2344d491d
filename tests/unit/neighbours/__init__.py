"""Tests of `sand.neighbours`."""
