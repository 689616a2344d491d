"""Long-range forces between pairs of grains: dipoles, charges, gravitation."""
