"""Tests of `sand.basics`."""
