"""Numerical tools: vectors, quaternions, random numbers, inverse square roots, SIMD alignment and padding."""
