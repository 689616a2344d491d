"""Running: the simulation object, its books, its case files."""
