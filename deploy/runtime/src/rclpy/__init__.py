"""rclpy, the ROS 2 client library for Python, on Eclipse Cyclone DDS and without a ROS installation.

Names, signatures and behaviour are those of ROS 2 Jazzy. Unsupported methods raise NotImplementedError.
"""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Callable
from types import ModuleType
from typing import TYPE_CHECKING

from rclpy.context import Context
from rclpy.parameter import Parameter
from rclpy.signals import (
    SignalHandlerOptions,
    install_signal_handlers,
    uninstall_signal_handlers,
)
from rclpy.task import Future
from rclpy.utilities import get_default_context, get_rmw_implementation_identifier, ok, try_shutdown
from rclpy.utilities import shutdown as _shutdown

if TYPE_CHECKING:
    from rclpy.executors import Executor
    from rclpy.node import Node

__all__ = [
    "Context",
    "Future",
    "Parameter",
    "SignalHandlerOptions",
    "create_node",
    "get_default_context",
    "get_global_executor",
    "get_rmw_implementation_identifier",
    "init",
    "ok",
    "shutdown",
    "spin",
    "spin_once",
    "spin_until_future_complete",
    "try_shutdown",
]

_executor: Executor | None = None


def __getattr__(name: str) -> ModuleType:
    if importlib.util.find_spec(f"{__name__}.{name}") is None:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    return importlib.import_module(f"{__name__}.{name}")


def init(
    *,
    args: list[str] | None = None,
    context: Context | None = None,
    domain_id: int | None = None,
    signal_handler_options: SignalHandlerOptions | None = None,
) -> None:
    """Initialize a context: it joins the DDS domain.

    :param args: command line arguments, ``sys.argv`` if ``None``; ROS arguments follow ``--ros-args``.
    :param context: context to initialize; the default context if ``None``.
    :param domain_id: DDS domain; by default the value of ``ROS_DOMAIN_ID``.
    :param signal_handler_options: signals that shut down; by default SIGINT and SIGTERM for the default
        context, none for others.
    :raises RuntimeError: if the context is already initialized.
    """
    default = get_default_context()
    context = default if context is None else context
    if signal_handler_options is None:
        signal_handler_options = SignalHandlerOptions.ALL if context is default else SignalHandlerOptions.NO
    context.init(args, domain_id=domain_id)
    install_signal_handlers(signal_handler_options)


def get_global_executor() -> Executor:
    """Return the executor that :func:`spin` and similar functions use by default."""
    global _executor
    if _executor is None:
        from rclpy.executors import SingleThreadedExecutor

        _executor = SingleThreadedExecutor()
        _executor._rclpy_is_global = True

        def end() -> None:
            global _executor
            ended, _executor = _executor, None
            if ended is not None:
                # Do not wait: a callback on another thread may wait for the thread that shuts down.
                ended.shutdown(timeout_sec=0)

        get_default_context().on_shutdown(end)
    return _executor


def shutdown(*, context: Context | None = None, uninstall_handlers: bool | None = None) -> None:
    """Shut down a context: spinning ends.

    :param context: context to shut down; the default context if ``None``.
    :param uninstall_handlers: whether to stop handling signals; by default, only for the default context.
    :raises RuntimeError: if the context is not initialized or already shut down.
    """
    _shutdown(context=context)
    if uninstall_handlers is None:
        uninstall_handlers = context is None or context is get_default_context()
    if uninstall_handlers:
        uninstall_signal_handlers()


def create_node(
    node_name: str,
    *,
    context: Context | None = None,
    cli_args: list[str] | None = None,
    namespace: str | None = None,
    use_global_arguments: bool = True,
    enable_rosout: bool = True,
    start_parameter_services: bool = True,
    parameter_overrides: list[Parameter] | None = None,
    allow_undeclared_parameters: bool = False,
    automatically_declare_parameters_from_overrides: bool = False,
    enable_logger_service: bool = False,
) -> Node:
    """Create a node; see :class:`rclpy.node.Node`."""
    from rclpy.node import Node

    return Node(
        node_name,
        context=context,
        cli_args=cli_args,
        namespace=namespace,
        use_global_arguments=use_global_arguments,
        enable_rosout=enable_rosout,
        start_parameter_services=start_parameter_services,
        parameter_overrides=parameter_overrides,
        allow_undeclared_parameters=allow_undeclared_parameters,
        automatically_declare_parameters_from_overrides=automatically_declare_parameters_from_overrides,
        enable_logger_service=enable_logger_service,
    )


def _with_executor(node: Node, executor: Executor | None, work: Callable[[Executor], None]) -> None:
    chosen = get_global_executor() if executor is None else executor
    try:
        chosen.add_node(node)
        work(chosen)
    finally:
        chosen.remove_node(node)


def spin_once(node: Node, *, executor: Executor | None = None, timeout_sec: float | None = None) -> None:
    """Run one callback of ``node``; wait for it at most ``timeout_sec`` (``None``: no limit)."""
    _with_executor(node, executor, lambda chosen: chosen.spin_once(timeout_sec))


def spin(node: Node, executor: Executor | None = None) -> None:
    """Run the callbacks of ``node`` until the context is shut down."""

    def work(chosen: Executor) -> None:
        while chosen.context.ok():
            chosen.spin_once()

    _with_executor(node, executor, work)


def spin_until_future_complete(
    node: Node, future: Future, executor: Executor | None = None, timeout_sec: float | None = None
) -> None:
    """Run the callbacks of ``node`` until ``future`` is done, or for ``timeout_sec``."""
    chosen = get_global_executor() if executor is None else executor
    was_added = chosen.add_node(node)
    try:
        chosen.spin_until_future_complete(future, timeout_sec)
    finally:
        if was_added:
            chosen.remove_node(node)
