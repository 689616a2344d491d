"""Numerical tools: vectors, quaternions, random numbers, and loops that vectorise."""
