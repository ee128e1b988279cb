"""What to record next, and what it would decide."""
