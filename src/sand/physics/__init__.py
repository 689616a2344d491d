"""Formulas: pure functions of floats and 3-tuples.  No arrays, no loops, no files."""
