"""Tests of `sand.results`."""
