"""Runs the tests for one mutant after another in its working directory: a copy of the checkout.

This is a program of its own and imports nothing of the copy. It loads the libraries once, those of its
arguments first, and forks for each request: a line of JSON on standard input, the arguments of pytest. It
answers with two lines: the child's pid, and then the exit code of pytest.
"""

import contextlib
import importlib
import json
import os
import random
import sys
from types import ModuleType
from typing import Any

LIBRARIES = (
    "_pytest.assertion.rewrite",
    "hypothesis",
    "pytest",
    "rclpy.executors",
    "rclpy.node",
    "reactivex.operators",
    "reactivex.testing",
    "diagnostic_msgs.msg",
    "geometry_msgs.msg",
    "sensor_msgs.msg",
    "std_msgs.msg",
)


class ExamplesFirst:
    """A plugin of pytest: tests with drawn examples, which take longer, run last."""

    def pytest_collection_modifyitems(self, items: list[Any]) -> None:
        items.sort(key=lambda item: item.get_closest_marker("hypothesis") is not None)


def main() -> None:
    sys.path[0] = os.getcwd()
    pytest, *_ = [importlib.import_module(name) for name in ("pytest", *sys.argv[1:], *LIBRARIES)]
    print("ready", flush=True)
    for line in sys.stdin:
        pid = os.fork()
        if pid == 0:
            _test(pytest, json.loads(line))
        print(pid, flush=True)
        _, status = os.waitpid(pid, 0)
        print(os.waitstatus_to_exitcode(status), flush=True)


def _test(pytest: ModuleType, arguments: list[str]) -> None:
    """Run pytest, with its output in the file `output`, and end the process with its exit code."""
    code = 1
    with contextlib.suppress(BaseException):
        os.setsid()
        random.seed()  # the random state of the parent would give every child the same ROS domain
        output = os.open("output", os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        for descriptor in (1, 2):
            os.dup2(output, descriptor)
        os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
        code = int(pytest.main(arguments, plugins=[ExamplesFirst()]))
    os._exit(code)


if __name__ == "__main__":
    main()
