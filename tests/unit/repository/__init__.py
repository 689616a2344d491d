"""Tests of the repository: docs, builds, figures that pages quote."""
