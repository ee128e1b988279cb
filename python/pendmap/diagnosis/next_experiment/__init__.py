"""Proposals of the next record, and detection limits of effects."""
