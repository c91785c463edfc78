"""Replay: feeds a record through these services in virtual time, and compares what they publish."""

import tests.simulation  # noqa: F401 (first: it reports a missing simulation)
