"""Integrators, step-size control, and the compiled drivers."""
