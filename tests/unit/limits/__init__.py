"""Tests of `sand.limits`."""
