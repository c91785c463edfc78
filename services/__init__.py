"""The services: one reactive recipe and one process each."""

import interfaces.stopping  # noqa: F401  before all else: from here on a signal ends the process in order
