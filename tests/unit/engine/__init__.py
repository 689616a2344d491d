"""Tests of `sand.engine`."""
