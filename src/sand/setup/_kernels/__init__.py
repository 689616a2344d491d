"""Compiled loops of the builders."""
