"""Tests of `sand.config`."""
