"""Small numerical tools: vectors, quaternions, random numbers, roots, alignment and vectorisation."""
