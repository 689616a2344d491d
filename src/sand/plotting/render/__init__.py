"""Rendered images of grains: ray casting and shading on the CPU, without a browser or graphics card."""
