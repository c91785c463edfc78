"""The services: one reactive recipe and one process each."""

import sys

from interfaces import stopping

if sys.argv[0] == "-m":  # Python is about to run one: a signal may come while it is still loading
    stopping.prepare()
