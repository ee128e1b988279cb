"""Methods of identification: one module each, and their registry."""
