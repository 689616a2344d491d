"""The `sand` command: the only room that prints.  Nothing heavy is imported before a command runs."""
