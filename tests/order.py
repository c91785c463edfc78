"""The order in which test files begin."""

from __future__ import annotations

LONGEST = (
    "tests/chaos/test_promises.py",
    "tests/chaos/test_partition.py",
    "tests/chaos/test_quick.py",
    "tests/system",
    "tests/component/test_service_life.py",
    "interfaces/reactive_node/tests/test_signals_operations.py",
    "interfaces/reactive_node/tests/test_signals_samples.py",
    "interfaces/reactive_node/tests/test_signals_runs.py",
)
"""Files and folders that begin first: begun last, they would run while other workers have nothing to do."""


def place(test: str) -> int:
    """Return the place of a test by its identifier, such as ``tests/system/test_demo.py::test``."""
    found = (number for number, path in enumerate(LONGEST) if test.startswith(path))
    return next(found, len(LONGEST))
