"""From a record to its pendulum: one method a file, one common result."""
