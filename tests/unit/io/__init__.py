"""Tests of `sand.io`."""
