"""Long-range forces between pairs of grains."""
