"""What weighted poses say, and where they come from."""
