"""Reading and writing of files; no other package opens files."""
