"""Loops over arrays.  Formulas come from physics; what to do when comes from stepping."""
