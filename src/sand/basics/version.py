"""The version of SAND."""

__version__ = "0.1.0"
