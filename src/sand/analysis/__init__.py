"""Measuring what has grown."""
