"""What stands in for the real arm and its surroundings."""
