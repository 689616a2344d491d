"""The simulation object: composition, stepping, ledger, observers, output."""
