"""The `sand` command; the only package that prints. Slow imports happen when a command runs."""
