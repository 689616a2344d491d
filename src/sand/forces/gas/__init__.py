"""Gas drag and Brownian motion."""
