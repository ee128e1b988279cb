"""Proposals of the next record, and the smallest effects that records would have shown."""
