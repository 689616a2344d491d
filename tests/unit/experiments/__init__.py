"""Tests of `sand.experiments`."""
