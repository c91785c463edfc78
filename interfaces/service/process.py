"""The life of a service's process: start, spin, end.

Exit codes: 0 on SIGTERM or Ctrl-C; 1 after an error of the recipe, or if the service already runs; 2 after an
error in the command line, the environment, the parameters or the scenario. An error is one line on standard
error, or one log message. Before the service spins, a signal ends the process on the spot. From then on it
ends in order, and its recipe may publish a last value; if that takes too long, or a second signal comes, the
process ends on the spot as well.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import traceback
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import Executor
from rclpy.signals import SignalHandlerOptions
from rclpy.task import Future

from interfaces.arm_variables import NAMESPACE
from interfaces.plain_text import plain
from interfaces.service import enclave, instance, middleware, overrides
from interfaces.service.errors import UserError
from interfaces.service.node import ServiceNode
from reactive_node.executor import create_executor

SUPERVISED = "SUPERVISOR_PROCESS_NAME"
"""Environment variable: the name that supervisord gives to a program."""
USER_ERRORS = (NameValidationException, ParameterException, UserError)
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_SHUTDOWN_TIMEOUT = 0.8  # [s], of the second that a service has to end


def run(name: str, wire: Callable[[ServiceNode], None]) -> NoReturn:
    """Run a service until the process ends.

    :param name: name of the node, unless remapped.
    :param wire: declares the parameters, builds the recipe and connects it with topics.
    """
    handle_signals()
    code = _run(name, wire)
    for number in _SIGNALS:  # too late to change the exit code
        signal.signal(number, signal.SIG_IGN)
    sys.exit(code)


def refuse(name: str, reason: str) -> NoReturn:
    """End after an error in the command line; the reason goes to standard error."""
    sys.exit(_refuse(name, reason, 2))


def _run(name: str, wire: Callable[[ServiceNode], None]) -> int:
    try:
        chosen = _enclave(name)
        with middleware.without_shared_memory():
            arguments = [*middleware.WITHOUT_LOG_FILES, *sys.argv, *chosen]
            # rclpy's handlers would shut DDS down at once, before a last value is published.
            rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
            node = ServiceNode(name, namespace=os.environ.get(NAMESPACE, ""))
        node.health.keys = enclave.keys(chosen[-1]) if chosen else None
    except (*USER_ERRORS, RuntimeError, UnicodeError) as error:  # of domain, discovery or DDS; no UTF-8
        rclpy.try_shutdown()
        return _refuse(name, error, 2)
    try:
        return _spin(node, wire)
    except USER_ERRORS as error:
        return _refuse(name, error, 2)
    except instance.AlreadyRunning as error:
        return _refuse(name, error, 1)
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def _enclave(name: str) -> list[str]:
    """Return the arguments that choose the enclave: that of the supervised program, unless it is given."""
    if {"-e", "--enclave"} & {*sys.argv}:
        return []
    return enclave.arguments(os.environ.get(SUPERVISED, name), os.environ.get(NAMESPACE, ""))


def _spin(node: ServiceNode, wire: Callable[[ServiceNode], None]) -> int:
    # The start of an arm has looked for other users; they stop none of its services from coming back.
    by_hand = SUPERVISED not in os.environ and node.health.keys is None
    with instance.claim(node, others_count=by_hand), create_executor() as executor:
        try:
            wire(node)
            overrides.check(node, sys.argv[1:])
            executor.add_node(node)
            _wake_at_signals(executor)
            executor.spin_until_future_complete(_end_of_spin())
        except USER_ERRORS:
            raise
        except Exception:
            node.get_logger().fatal(traceback.format_exc())
            return 1
    return 0


def _refuse(name: str, reason: object, code: int) -> int:
    print(f"{name}: {plain(' '.join(str(reason).split()))}", file=sys.stderr)
    return code


def handle_signals() -> None:
    """End at SIGTERM and Ctrl-C."""
    for number in _SIGNALS:
        signal.signal(number, _end)


def _end_of_spin() -> Future:
    """Return a future that the next signal completes; one more ends the process on the spot."""
    end = Future()

    def on_signal(number: int, frame: FrameType | None) -> None:
        if end.done():
            _end()
        last_resort = threading.Timer(_SHUTDOWN_TIMEOUT, _end)
        last_resort.daemon = True
        last_resort.start()
        end.set_result(None)

    for number in _SIGNALS:
        signal.signal(number, on_signal)
    return end


def _wake_at_signals(executor: Executor) -> None:
    """Wake the executor at each signal: while the main thread waits in DDS, Python runs no handler."""
    if (other := signal.set_wakeup_fd(-1)) != -1:  # Cyclone DDS: its ground wakes the executors itself
        signal.set_wakeup_fd(other)
        return
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    signal.set_wakeup_fd(writing)

    def wake() -> None:
        while os.read(reading, 1):
            executor.wake()

    threading.Thread(target=wake, daemon=True).start()


def _end(*signal: object) -> NoReturn:
    os._exit(0)
