from __future__ import annotations

import os
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import rclpy
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from rclpy.utilities import get_rmw_implementation_identifier

from deploy.supervision.processes import ROOT
from interfaces.service import instance, process
from interfaces.service.middleware import PROFILES, RANGE, WITHOUT_LOG_FILES
from interfaces.topics import L1
from reactive_node.testing import MakeNode, SpinUntil
from tests.users import NOBODY, fork, needs_root

CYCLONE = get_rmw_implementation_identifier() == "rmw_cyclonedds_cpp"

HANGING = """
from contextlib import suppress
from interfaces import service

def wire(node):
    def hang():
        print("hangs", flush=True)
        while True:
            with suppress(Exception):
                while True:
                    pass
    node.create_timer(0.01, hang)

service.run("hanging", wire)
"""

FAILING = """
import reactivex as rx
from interfaces import service
from interfaces.topics import L1

def wire(node):
    node.publish(L1, rx.timer(0.01).map(lambda _: 1 / 0))
    node.create_timer(0.001, lambda: None)

service.run("failing", wire)
"""

FAILING_WHILE_WIRED = """
from interfaces import service

def wire(node):
    raise LookupError("planted")

service.run("failing", wire)
"""

SPEAKING = """
from interfaces import service
from interfaces.topics import L1

def wire(node):
    node.publish(L1, node.observe(L1).filter(lambda _: False).default_if_empty(7.0))
    publisher = next(each for each in node.publishers if each.msg_type is L1.type)
    node.create_timer(0.01, lambda: publisher.get_subscription_count() > 1 and print("ready", flush=True))

service.run("speaking", wire)
"""

KEYED = """
from datetime import UTC, datetime
from interfaces import service
from interfaces.service import enclave

enclave.arguments = lambda name, namespace: ["--ros-args", "--enclave", enclave.path(name, namespace)]
enclave.keys = lambda name: enclave.Keys(name, datetime(2026, 1, 1, tzinfo=UTC), datetime.now(UTC))
service.run("keyed", lambda node: print(node.health.keys, flush=True))
"""

LASTING_KEYS = """
from datetime import UTC, datetime
from interfaces.service import enclave

begin, end = (datetime(year, 1, 1, tzinfo=UTC) for year in (2026, 9999))
enclave.arguments = lambda name, namespace: ["--ros-args", "--enclave", enclave.path(name, namespace)]
enclave.keys = lambda name: enclave.Keys(name, begin, end)
"""

READY = """
from interfaces import service

def wire(node):
    node.create_timer(0.01, lambda: print("ready", flush=True))

service.run("ready", wire)
"""

WAITING = """
from interfaces import service
from interfaces.service import health
from reactive_node import executor

health.PERIOD = 3600.0
executor._experimental = None  # an older rclpy: its executor waits without an end

def wire(node):
    node.scheduler.schedule(lambda *_: print("ready", flush=True))

service.run("waiting", wire)
"""

PUBLISHING = """
import reactivex as rx
from reactivex.scheduler import ImmediateScheduler
from interfaces import service
from interfaces.topics import L1

def wire(node):
    value = rx.just(7.0, ImmediateScheduler.singleton())
    node.publish(L1, value.do_action(lambda _: print("published", flush=True)))

service.run("publishing", wire)
"""

ENDING = """
import rclpy
from interfaces import service
from interfaces.service import ServiceNode

def announce(owner, name):
    original = getattr(owner, name)
    setattr(owner, name, lambda *arguments: (print(name, flush=True), original(*arguments)))

announce(ServiceNode, "destroy_node")
announce(rclpy, "try_shutdown")

service.run("ending", lambda node: node.create_timer(0.01, lambda: print("ready", flush=True)))
"""

SIGNALLED_AT_EXIT = """
import atexit, os, signal
atexit.register(lambda: os.kill(os.getpid(), signal.SIGTERM))
"""

NO_LAST_RESORT = """
from interfaces.service import process
from reactive_node import node
process._SHUTDOWN_TIMEOUT = node._DELIVERY = 3600.0
"""


class Process:
    def __init__(self, *arguments: str) -> None:
        self.output = ""  # after the end
        self.popen = subprocess.Popen(
            [sys.executable, *arguments], cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )

    def wait_for_line(self) -> str:
        assert self.popen.stdout is not None
        assert select.select([self.popen.stdout], [], [], 30)[0], "no output within 30 s"
        return self.popen.stdout.readline().strip()

    def end(self, by: signal.Signals | None = None) -> tuple[int, str]:
        """Wait, after a signal if given; return the exit code and the standard error."""
        if by is not None:
            self.popen.send_signal(by)
        self.output, errors = self.popen.communicate(timeout=150)
        return self.popen.returncode, errors


Start = Callable[..., Process]


@pytest.fixture
def start(domain_id: int) -> Iterator[Start]:
    with ExitStack() as stack:

        def start(*arguments: str) -> Process:
            process = Process(*arguments)
            stack.enter_context(process.popen)
            stack.callback(process.popen.kill)
            return process

        yield start


def service(name: str, announce: bool = False) -> tuple[str, ...]:
    """The command line of a service; ``announce``: it prints a line when it handles signals."""
    if not announce:
        return "-m", f"services.{name}"
    announced = (
        "from interfaces.service import process; handle_signals = process.handle_signals\n"
        "process.handle_signals = lambda: (handle_signals(), print('begun', flush=True))"
    )
    script = f"import runpy; runpy.run_module('services.{name}', run_name='__main__', alter_sys=True)"
    return "-c", f"{NO_LAST_RESORT}\n{announced}\n{script}"


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_signal_ends_a_service_that_hangs(start: Start, number: signal.Signals) -> None:
    process = start("-c", HANGING)
    assert process.wait_for_line() == "hangs"

    assert process.end(by=number) == (0, "")


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_service_publishes_a_last_value_at_a_signal(
    start: Start, number: signal.Signals, make_node: MakeNode, spin_until: SpinUntil
) -> None:
    heard: list[float] = []
    peer = make_node("peer")
    reader = peer.create_subscription(L1.type, L1.name, lambda message: heard.append(message.data), L1.qos)
    process = start("-c", NO_LAST_RESORT + SPEAKING)
    assert process.wait_for_line() == "ready"
    spin_until(reader.get_publisher_count)  # each is matched with the other one, not only in its graph

    assert process.end(by=number) == (0, "")
    spin_until(lambda: heard)
    assert heard == [7.0]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_service_that_waits_for_nothing_ends_at_a_signal(start: Start, number: signal.Signals) -> None:
    process = start("-c", NO_LAST_RESORT + WAITING)
    assert process.wait_for_line() == "ready"

    assert process.end(by=number) == (0, "")


def test_who_was_woken_by_signals_before_still_is() -> None:
    reading, writing = os.pipe()
    os.set_blocking(writing, False)
    before = signal.set_wakeup_fd(writing)
    executor: Any = SimpleNamespace(wake=lambda: None)
    try:
        process._wake_at_signals(executor)
    finally:
        woken = signal.set_wakeup_fd(before)
        os.close(reading)
        os.close(writing)

    assert woken == writing


def test_second_signal_ends_a_service_at_once(start: Start) -> None:
    process = start("-c", NO_LAST_RESORT + HANGING)
    assert process.wait_for_line() == "hangs"
    begin = time.monotonic()
    while process.popen.poll() is None and time.monotonic() - begin < 10.0:
        process.popen.send_signal(signal.SIGTERM)
        with suppress(subprocess.TimeoutExpired):
            process.popen.wait(0.05)

    assert process.end() == (0, "")


def test_hung_service_ends_within_a_second() -> None:
    assert process._SHUTDOWN_TIMEOUT < 1.0


def test_service_ends_in_order(start: Start) -> None:
    ending = start("-c", ENDING)
    assert ending.wait_for_line() == "ready"

    assert ending.end(by=signal.SIGTERM) == (0, "")
    assert ending.output.split()[-2:] == ["destroy_node", "try_shutdown"]


@pytest.mark.parametrize(
    ("program", "error"), [(FAILING, "ZeroDivisionError"), (FAILING_WHILE_WIRED, "LookupError: planted")]
)
def test_unexpected_error_is_logged_once_and_ends_the_service(start: Start, program: str, error: str) -> None:
    code, errors = start("-c", program).end()

    assert code == 1
    assert errors.count("Traceback") == 1
    assert errors.count(error) == 1
    assert "[failing]" in errors


def test_service_ends_with_its_keys(start: Start) -> None:
    code, errors = start("-c", KEYED).end()
    assert code == 2
    assert re.search(
        "^keyed: the keys of /keyed have ended at [^\n]*: make keystore[^\n]*$", errors, re.MULTILINE
    )


def test_keys_are_those_of_the_supervised_program(start: Start, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SUPERVISOR_PROCESS_NAME", "velocity")
    assert "the keys of /velocity have ended" in start("-c", KEYED).end()[1]


@pytest.mark.parametrize("option", ["-e", "--enclave"])
def test_enclave_of_the_command_line_counts(start: Start, option: str) -> None:
    assert start("-c", KEYED, "--ros-args", option, "/other").wait_for_line() == "None"


def test_signal_after_the_end_does_not_change_the_exit_code(start: Start) -> None:
    assert start("-c", SIGNALLED_AT_EXIT + FAILING_WHILE_WIRED).end()[0] == 1


def test_second_instance_refuses_to_start_and_names_the_first(start: Start, domain_id: int) -> None:
    first = start("-c", READY)
    assert first.wait_for_line() == "ready"

    code, errors = start("-c", READY).end()

    assert code == 1
    assert errors == f"ready: /ready already runs in domain {domain_id}\n"


@needs_root
@pytest.mark.parametrize(
    ("program", "supervised", "starts"),
    [
        (READY, False, False),
        (READY, True, True),
        (LASTING_KEYS + READY, False, True),
        (LASTING_KEYS + READY, True, True),
    ],
)
def test_only_a_service_that_is_started_by_hand_gives_way_to_another_user(
    start: Start,
    domain_id: int,
    monkeypatch: pytest.MonkeyPatch,
    program: str,
    supervised: bool,
    starts: bool,
) -> None:
    if supervised:
        monkeypatch.setenv("SUPERVISOR_PROCESS_NAME", "ready")
    context = SimpleNamespace(get_domain_id=lambda: domain_id)
    theirs: Any = SimpleNamespace(context=context, get_fully_qualified_name=lambda: "/ready")
    with fork(lambda: instance.claim(theirs), user=NOBODY):
        ready = start("-c", program)
        if starts:
            assert ready.wait_for_line() == "ready"
        else:
            assert ready.end() == (1, f"ready: /ready already runs in domain {domain_id}\n")


def test_second_instance_refuses_before_its_first_message(start: Start) -> None:
    assert start("-c", PUBLISHING).wait_for_line() == "published"
    second = start("-c", PUBLISHING)
    assert second.end()[0] == 1
    assert second.output == ""


@pytest.mark.parametrize(
    ("arguments", "name"),
    [([], "/arm1/ready"), (["--ros-args", "-r", "__ns:=/arm2"], "/arm2/ready")],
)
def test_namespace_of_the_environment_is_the_default(
    start: Start, monkeypatch: pytest.MonkeyPatch, arguments: list[str], name: str
) -> None:
    monkeypatch.setenv("REACTIVE_ARM_NAMESPACE", "/arm1")
    first = start("-c", READY, *arguments)
    assert first.wait_for_line() == "ready"

    _, errors = start("-c", READY, *arguments).end()

    assert errors.startswith(f"ready: {name} already runs")


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["services.config_publisher"], "config_publisher: .*must be one of l1, l2, theta1, theta2, not ''"),
        (["services.config_publisher", "l1", "--ros-args", "-p", "value:=-1.0"], "config_l1: .*-1.0.*value"),
        (["services.config_publisher", "l1", "--ros-args", "-p", "value:=.nan"], "config_l1: .*nan.*value"),
        (
            ["services.config_publisher", "l1", "--ros-args", "-p", "value:=long"],
            "config_l1: .*'long'.*value",
        ),
        (
            ["services.dead_mans_switch", "--ros-args", "-p", "scenario:=/nowhere.yaml"],
            "dead_mans_switch: /nowhere.yaml: No such file or directory",
        ),
        (
            ["services.robot_state", "--ros-args", "-p", "rate:=30.0", "--param", "robot_state:raet:=30.0"],
            "robot_state: raet: no such parameter; the parameters are .*rate",
        ),
        (
            ["services.robot_state", "--ros-args", "-p", "robot_stat:rate:=30.0", "-r", "__ns:=/arm1"],
            "robot_state: robot_stat:rate: this node is /arm1/robot_state; leave the name of the node out",
        ),
        (
            ["services.kinematics", "--rate=3"],
            "kinematics: --rate=3: no such option; those of ROS follow after --ros-args",
        ),
        (
            ["services.kinematics", "rate:=3"],
            "kinematics: rate:=3: no such option; those of ROS follow after --ros-args",
        ),
    ],
)
def test_user_error_is_one_line_and_exit_code_2(start: Start, arguments: list[str], reason: str) -> None:
    code, errors = start("-m", *arguments).end()

    assert code == 2
    assert errors.count("\n") == 1
    assert re.match(reason, errors)


@pytest.mark.parametrize(
    "content",
    [
        "",
        "# robot_state:\n",
        "{}",
        "robot_state: {ros__parameters: {rate: !hertz 30.0}}",
        "/x: {ros__parameters: {}}",
    ],
)
def test_empty_or_tagged_parameter_file_starts_a_service(start: Start, tmp_path: Path, content: str) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(content)
    assert start("-c", READY, "--ros-args", "--params-file", str(file)).wait_for_line() == "ready"


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        ("robot_state: {ros__parameters: {a: {b: 1}}}", "a.b: no such parameter; the parameters are "),
        (
            "/x: {ros__parameters: {y: 1}}\nrobot_state: {ros__parameters: {raet: 1}}",
            "robot_state: raet: no such",
        ),
        ("/robot_state: {ros__parameters: {raet: 1}}", "robot_state: raet: no such parameter; "),
        ("/**: {ros__parameters: {a: &a 1, b: *a}}", "line 1"),
        ("robot_state:", "line 1"),
    ],
)
def test_error_in_a_parameter_file_is_one_line(
    start: Start, tmp_path: Path, content: str, reason: str
) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text(content)
    code, errors = start("-m", "services.robot_state", "--ros-args", "--params-file", str(file)).end()
    assert (code, errors.splitlines()[-1].startswith("robot_state: ")) == (2, True)
    assert reason in errors.splitlines()[-1]


def test_parameter_file_may_name_parameters_of_other_services(start: Start, tmp_path: Path) -> None:
    file = tmp_path / "parameters.yaml"
    file.write_text("/**: {ros__parameters: {rate: 30.0}}")
    ready = start("-c", READY, "--ros-args", "--params-file", str(file), "-p", "use_sim_time:=false")
    assert ready.wait_for_line() == "ready"


@pytest.mark.parametrize(
    ("variable", "value", "reason"),
    [
        ("ROS_DOMAIN_ID", "one", "ROS_DOMAIN_ID"),
        ("REACTIVE_ARM_NAMESPACE", "/arm 1", "/arm 1"),
        *([("CYCLONEDDS_URI", "<no xml", "")] if CYCLONE else []),
    ],
)
def test_unusable_environment_is_reported_without_a_traceback(
    start: Start, monkeypatch: pytest.MonkeyPatch, variable: str, value: str, reason: str
) -> None:
    monkeypatch.setenv(variable, value)
    ending = start("-c", ENDING)
    code, errors = ending.end()
    assert (code, ending.output) == (2, "try_shutdown\n")
    assert re.match(f"ending: .*{reason}", errors.splitlines()[-1])
    assert "Traceback" not in errors


def test_rclpy_handles_no_signals_and_writes_no_log_files(monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {}

    def init(**options: Any) -> None:
        given.update(options)
        raise RuntimeError("planted")

    monkeypatch.setattr(rclpy, "init", init)
    monkeypatch.setattr(sys, "argv", ["service", "l1", "--ros-args", "-p", "value:=1.0"])
    assert process._run("service", lambda node: None) == 2
    assert given["signal_handler_options"] is SignalHandlerOptions.NO
    assert given["args"] == [*WITHOUT_LOG_FILES, *sys.argv]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
@pytest.mark.parametrize("delay", [0.0, 0.03, 0.06, 0.1, 0.15, 0.2, 0.25, 0.3, 0.4, 0.6])
def test_signal_ends_a_service_at_every_moment(start: Start, number: signal.Signals, delay: float) -> None:
    process = start(*service("operator_watchdog", announce=True))
    assert process.wait_for_line() == "begun"
    time.sleep(delay)

    assert process.end(by=number) == (0, "")


def test_service_has_no_shared_memory_and_is_seen_by_others(
    start: Start, make_node: MakeNode, spin_until: SpinUntil
) -> None:
    process = start("-c", READY)
    assert process.wait_for_line() == "ready"
    maps = Path(f"/proc/{process.popen.pid}/maps").read_text()
    assert "/dev/shm/fastrtps" not in maps
    node = make_node(kind=Node)
    spin_until(lambda: "ready" in node.get_node_names())


BEYOND = """
from pathlib import Path
import rclpy

rclpy.init(args=[])
node = rclpy.create_node("node")
print("/dev/shm/fastrtps" in Path("/proc/self/maps").read_text())
"""


def test_process_of_an_arm_on_two_hosts_has_no_shared_memory(domain_id: int) -> None:
    own = {RANGE: "SUBNET", PROFILES: str(ROOT / "deploy" / "fastdds.xml")}
    alone = ["unshare", "--map-root-user", "--net", "sh", "-c", 'ip link set lo up; exec "$0" -c "$1"']
    done = subprocess.run(
        [*alone, sys.executable, BEYOND], env=os.environ | own, capture_output=True, text=True
    )
    if "unshare" in done.stderr:
        pytest.skip(f"platform: {done.stderr}")
    assert done.stdout == "False\n", done.stderr
