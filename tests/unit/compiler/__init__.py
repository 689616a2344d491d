"""Tests of `sand.compiler`."""
