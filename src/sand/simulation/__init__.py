"""The simulation object: assembly, time stepping, ledger, observers and output."""
