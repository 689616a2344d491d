"""Tests of `sand.viewer`."""
