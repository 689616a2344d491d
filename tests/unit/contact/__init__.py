"""Tests of `sand.contact`."""
