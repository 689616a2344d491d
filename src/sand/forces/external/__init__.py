"""External forces on single grains: magnetic and electric fields, gravity."""
