"""Integrators, choice of the step, and the compiled driver."""
