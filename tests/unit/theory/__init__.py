"""Tests of `sand.theory`."""
