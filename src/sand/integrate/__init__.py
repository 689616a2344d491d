"""Integrators, step-size control, the driver, and the stages that it calls."""
