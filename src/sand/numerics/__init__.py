"""Numerical tools: vectors, quaternions, random numbers, SIMD alignment and padding."""
