"""External forces on single grains: fields and gravity."""
