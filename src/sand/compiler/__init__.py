"""Decorators that compile functions with numba, the cache of compiled code, and atomic operations."""
