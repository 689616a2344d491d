"""Limits of the model, which a start warns of: vibration, creep, grains as solids, and cut-offs."""
