"""Tests of `sand.components`."""
