"""Compares what this system costs with what its alternatives cost, on the same work (`make bench`)."""
