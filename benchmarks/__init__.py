"""How fast: every row is measured beside a peer in the same run, because machines are shared."""
