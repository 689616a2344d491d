"""Functions compiled with numba, stages called by address, the cache of compiled code, and atomic operations."""
