"""The life of a service's process: start, spin, end.

Exit codes: 0 on SIGTERM or Ctrl-C; 1 after an error of the recipe, or if the service already runs; 2 after an
error in the command line, the environment, the parameters or the scenario. An error is one line on standard
error, or one log message. Before the service spins, a signal ends the process on the spot. From then on it
shuts down in order; if that takes too long, or a second signal comes, the process ends on the spot as well.
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
from rclpy.executors import ExternalShutdownException

from interfaces.service import enclave, instance, middleware, overrides
from interfaces.service.errors import UserError
from interfaces.service.node import ServiceNode
from reactive_node.executor import create_executor

NAMESPACE = "REACTIVE_ARM_NAMESPACE"
"""Environment variable: the default namespace of every service; ``--ros-args -r __ns:=…`` wins."""
SUPERVISED = "SUPERVISOR_PROCESS_NAME"
"""Environment variable: the name that supervisord gives to a program."""
USER_ERRORS = (NameValidationException, ParameterException, UserError)
_SIGNALS = (signal.SIGINT, signal.SIGTERM)
_SHUTDOWN_TIMEOUT = 0.8  # [s], of the second that a service has to end

_spins = False


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
            rclpy.init(args=[*sys.argv, *chosen])
            node = ServiceNode(name, namespace=os.environ.get(NAMESPACE, ""))
        node.health.keys = enclave.keys(chosen[-1]) if chosen else None
    except (*USER_ERRORS, RuntimeError) as error:  # RuntimeError: of domain, discovery or DDS
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
    global _spins
    with instance.claim(node), create_executor() as executor:
        try:
            wire(node)
            overrides.check(node, sys.argv[1:])
            executor.add_node(node)
            _spins = True
            executor.spin()
        except ExternalShutdownException:
            pass
        except USER_ERRORS:
            raise
        except Exception:
            if not node.context.ok():  # a signal has shut down rclpy just before a message was published
                return 0
            node.get_logger().fatal(traceback.format_exc())
            return 1
    return 0


def _refuse(name: str, reason: object, code: int) -> int:
    print(f"{name}: {' '.join(str(reason).split())}", file=sys.stderr)
    return code


def handle_signals() -> None:
    """Handle SIGTERM and Ctrl-C; rclpy chains its handlers to these."""
    for number in _SIGNALS:
        signal.signal(number, _on_signal)


def _on_signal(number: int, frame: FrameType | None) -> None:
    global _spins
    if not _spins:
        _end()
    _spins = False
    last_resort = threading.Timer(_SHUTDOWN_TIMEOUT, _end)
    last_resort.daemon = True
    last_resort.start()


def _end() -> None:
    os._exit(0)
