"""Starts Python programs from a warm supervisord: its fork runs the program, without a new interpreter.

Most of a start is the import of rclpy and ReactiveX. supervisord imports them once; the fork that it makes
for each program has them already and shares their memory. The code of this checkout is read at each start, so
an edited service counts from its next restart.

For the process table, the fork gets the command line and the environment that a new interpreter would have
(prctl(2), PR_SET_MM_MAP). Where the kernel cannot do that, and for programs that are no modules of this
environment's Python or have another directory or path, supervisord starts a new interpreter as usual.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import importlib
import importlib.util
import inspect
import mmap
import os
import pkgutil
import runpy
import signal
import struct
import sys
import threading
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import ModuleType
from typing import Any, NoReturn

from deploy.supervision import processes
from deploy.supervision.rclpy_choice import GROUND

LIBRARIES = (
    "json",
    "reactive_node",
    "reactive_node.executor",
    "reactive_node.ros_time",
    "reactive_node.signals",
    "reactivex.operators",
    "reactivex.operators._multicast",
    "reactivex.operators._publish",
    "reactivex.operators.connectable._refcount",
    "rclpy.executors",
    "rclpy.serialization",
    "ros_yaml",
    "unicodedata",
    "websockets.server",
)
"""The modules outside of this checkout that the services import."""
CYCLONEDDS = ("rclpy_ground.cyclonedds.participant", "rclpy_ground.cyclonedds.wakeup")
"""The modules that the ground of Cyclone DDS imports late."""
TYPES = (
    "diagnostic_msgs.msg.DiagnosticArray",
    "diagnostic_msgs.msg.DiagnosticStatus",
    "diagnostic_msgs.msg.KeyValue",
    "geometry_msgs.msg.PointStamped",
    "geometry_msgs.msg.TwistStamped",
    "rcl_interfaces.msg.FloatingPointRange",
    "rcl_interfaces.msg.IntegerRange",
    "rcl_interfaces.msg.Log",
    "rcl_interfaces.msg.Parameter",
    "rcl_interfaces.msg.ParameterDescriptor",
    "rcl_interfaces.msg.ParameterEvent",
    "rcl_interfaces.msg.ParameterValue",
    "rcl_interfaces.msg.SetParametersResult",
    "rcl_interfaces.srv.DescribeParameters",
    "rcl_interfaces.srv.GetParameters",
    "rcl_interfaces.srv.GetParameterTypes",
    "rcl_interfaces.srv.ListParameters",
    "rcl_interfaces.srv.SetParameters",
    "rcl_interfaces.srv.SetParametersAtomically",
    "sensor_msgs.msg.JointState",
    "std_msgs.msg.Bool",
    "std_msgs.msg.Float64",
    "std_msgs.msg.Header",
    "std_msgs.msg.String",
    "type_description_interfaces.srv.GetTypeDescription",
)
"""The types of messages and of the services that each node has."""
OPTIONAL = ("tf2_msgs.msg.TFMessage",)
"""A type that ROS 2's wheels do not have."""

_NAMES = 40_000  # more than Python has room for in its table of names, and than a program adds
_PR_SET_MM, _PR_SET_MM_MAP = 35, 14
_NO_FILE = 0xFFFFFFFF

_names: mmap.mmap  # the command line and the environment of this process, for as long as it lives


def import_libraries() -> None:
    """Import what programs need; what cannot be imported is an error of the program that imports it."""
    if (numpy := importlib.util.find_spec("numpy")) and numpy.origin:
        sys.modules.setdefault("numpy", LazyModule("numpy", numpy.origin))
    gc.disable()  # imports leave next to no garbage, and to look for it takes a fifth of the time
    for name in libraries():
        with suppress(Exception):
            importlib.import_module(name)
    for name in types():
        with suppress(Exception):
            _use(pkgutil.resolve_name(name))
    with suppress(Exception):
        _use_names()
    # Now it knows the files of all modules, which the first log message of each fork would ask for.
    inspect.getmodule(import_libraries.__code__)
    for number in range(_NAMES):  # the table of names grows now: each fork would grow a copy of its own
        sys.intern(f"name {number}")
    gc.freeze()  # a collection in a fork would copy the memory that it shares
    gc.enable()


class LazyModule(ModuleType):
    """A module that the first look at one of its names imports.

    The message packages of ROS 2 import numpy for types with matrices: 17 MB that no service needs.
    """

    def __init__(self, name: str, file: str) -> None:
        super().__init__(name)
        self.__file__ = file  # known without the import: each log message looks at that of all modules

    def __getattr__(self, name: str) -> Any:
        del sys.modules[self.__name__]
        vars(self).update(vars(importlib.import_module(self.__name__)))
        return getattr(self, name)


def libraries() -> tuple[str, ...]:
    """Return the modules that programs import on the rclpy at hand."""
    return LIBRARIES + (CYCLONEDDS if os.environ.get(GROUND) else ())


def types() -> tuple[str, ...]:
    """Return the types that programs use, as far as their packages exist."""
    return TYPES + (OPTIONAL if importlib.util.find_spec("tf2_msgs") else ())


def _use(type_: Any) -> None:
    """Let a type make what it makes on its first use: its hash and code, or load the library with both."""
    from rclpy.serialization import deserialize_message, serialize_message
    from rclpy.type_support import check_for_type_support

    check_for_type_support(type_)
    # A service's endpoint has the type of its request or response.
    parts = [type_.Request, type_.Response] if hasattr(type_, "Request") else [type_]
    for part in parts:
        getattr(part, "_TYPE_HASH", "")
        deserialize_message(serialize_message(part()), part)


def _use_names() -> None:
    from rclpy.expand_topic_name import expand_topic_name
    from rclpy.validate_full_topic_name import validate_full_topic_name

    validate_full_topic_name(expand_topic_name("topic", "node", "/namespace"))


def executor(execve: Callable[..., NoReturn]) -> Callable[[str, Sequence[str], Mapping[str, str]], NoReturn]:
    """Return a stand-in for :func:`os.execve` that runs a Python module in this process."""
    programs, directory = Path(sys.executable).parent, os.getcwd()

    def is_alike(environment: Mapping[str, str]) -> bool:
        """Whether a new interpreter would be like this one: these variables count at its start."""
        names = {name for name in (*os.environ, *environment) if name.startswith(("PYTHON", "LD_"))}
        same = all(environment.get(name) == os.environ.get(name) for name in names)
        return same and os.getcwd() == directory

    def execute(filename: str, argv: Sequence[str], environment: Mapping[str, str]) -> NoReturn:
        is_ours = argv[1:2] == ["-m"] and Path(filename).parent == programs
        if is_ours and is_alike(environment):
            with suppress(OSError):  # a kernel that cannot do this
                set_command_line(argv, environment)
                _run(argv, environment)
        execve(filename, argv, environment)

    return execute


def set_command_line(argv: Sequence[str], environment: Mapping[str, str]) -> None:
    """Give this process another command line and environment in the process table. May raise OSError."""
    global _names
    arguments = b"".join(os.fsencode(word) + b"\0" for word in argv)
    variables = b"".join(os.fsencode(f"{name}={value}") + b"\0" for name, value in environment.items())
    _names = mmap.mmap(-1, len(arguments + variables), mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    _names.write(arguments + variables)
    begin = ctypes.addressof(ctypes.c_char.from_buffer(_names))
    middle, end = begin + len(arguments), begin + len(arguments + variables)
    libc = ctypes.CDLL(None, use_errno=True)
    libc.sbrk.restype = ctypes.c_void_p
    stat = processes.stat_of(os.getpid())
    start_code, end_code, start_stack = map(int, stat[23:26])
    start_data, end_data, start_brk = map(int, stat[42:45])
    layout = struct.pack(
        "12Q2I",  # struct prctl_mm_map
        *(start_code, end_code, start_data, end_data, start_brk, libc.sbrk(0), start_stack),
        *(begin, middle, middle, end),
        *(0, 0, _NO_FILE),  # the auxiliary vector and the executable stay
    )
    if libc.prctl(_PR_SET_MM, _PR_SET_MM_MAP, layout, ctypes.c_ulong(len(layout)), 0):
        raise OSError(ctypes.get_errno(), "this kernel renames no process")


def _run(argv: Sequence[str], environment: Mapping[str, str]) -> NoReturn:
    """Run the module of a `python -m` in this process, and end with its exit code."""
    for number in signal.valid_signals():
        if callable(signal.getsignal(number)):  # a handler of supervisord
            signal.signal(number, signal.SIG_DFL)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.set_wakeup_fd(-1)
    os.environ.clear()
    os.environ.update(environment)
    sys.orig_argv, sys.argv = list(argv), list(argv[2:])
    for package in ("deploy", "interfaces"):  # supervisord's own part of this checkout, as old as its start
        _forget(package)
    code = 1
    try:
        if "sitecustomize" in sys.modules:  # Python imports it at each start
            importlib.reload(sys.modules["sitecustomize"])
        runpy.run_module(argv[2], run_name="__main__", alter_sys=True)
        code = 0
    except SystemExit as end:
        code = _exit_code(end)
    except BaseException:
        traceback.print_exc()
    finally:
        _end(code)


def _forget(package: str) -> None:
    """Forget an imported package and its modules.

    Their parents know them: to go through all of ``sys.modules`` would copy the memory of every name.
    """
    for child in [*vars(sys.modules.pop(package))]:
        if (module := f"{package}.{child}") in sys.modules:
            _forget(module)


def _exit_code(end: SystemExit) -> int:
    if end.code is None or isinstance(end.code, int):
        return end.code or 0
    print(end.code, file=sys.stderr)
    return 1


def _end(code: int) -> NoReturn:
    """End as an interpreter does, but without a way back into supervisord's code."""
    try:
        threading._shutdown()  # type: ignore[attr-defined] # ends pools, joins threads; as multiprocessing does
        atexit._run_exitfuncs()
        sys.stdout.flush()
        sys.stderr.flush()
    finally:
        os._exit(code)
