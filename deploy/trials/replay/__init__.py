"""Replay: feeds a record through the services of this checkout in virtual time, and compares what they publish."""

import deploy.trials.simulation  # noqa: F401 (first: it reports a missing simulation)
