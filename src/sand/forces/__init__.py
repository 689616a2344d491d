"""What a user puts into the list of forces."""
