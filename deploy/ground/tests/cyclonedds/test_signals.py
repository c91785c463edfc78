"""Ctrl-C and SIGTERM end spinning at once, without an error; a step of the clock delays no timer.

At its end, the interpreter stops daemon threads for good, whatever they hold.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from rclpy_ground.cyclonedds import wakeup

SPIN = """
import asyncio, signal, threading
import rclpy
from rclpy.executors import ExternalShutdownException
rclpy.init(args=[])
{}
node = rclpy.create_node("spinner")
timer = node.create_timer(0.0, lambda: (timer.cancel(), print("spinning", flush=True)))
try:
    rclpy.spin(node)
except (KeyboardInterrupt, ExternalShutdownException):
    pass  # or spin() returns, if the signal came while a callback ran
print(rclpy.ok())
node.destroy_node()
rclpy.try_shutdown()
"""

SHUTDOWN_ON_ANOTHER_THREAD = """
thread = threading.Thread(target=rclpy.shutdown)
thread.start()
thread.join()
"""
SECOND_INIT = SHUTDOWN_ON_ANOTHER_THREAD + "rclpy.init(args=[])"
ASYNCIO_SIGNAL_HANDLER = """
async def handle():
    loop = asyncio.get_running_loop()
    loop.add_signal_handler(signal.SIGUSR1, print)
    loop.remove_signal_handler(signal.SIGUSR1)
asyncio.run(handle())
"""


ENDS_WHILE_A_LOCK_IS_HELD = """
import threading, time
import rclpy
from std_msgs.msg import String
from rclpy_ground.cyclonedds.participant import Participant

is_held = threading.Event()

def take_slowly(participant):
    is_held.set()
    time.sleep(0.5)

def main():
    rclpy.init(args=[])
    node = rclpy.create_node("left_to_the_interpreter")
    node.itself = node  # only the last collection of garbage frees it
    Participant._take = take_slowly
    node.create_publisher(String, "announced", 1)
    is_held.wait()

main()
"""


@contextmanager
def running(code: str, *arguments: str, **options: Any) -> Iterator[Any]:
    command = [sys.executable, "-c", code, *arguments]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(command, text=True, **pipes, **options) as process:
        try:
            yield process
        finally:
            process.kill()


def is_asleep(pid: int) -> bool:
    return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "S"


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize(
    "before",
    [
        pytest.param("", id="plain"),
        pytest.param(SECOND_INIT, id="second init"),
        pytest.param(ASYNCIO_SIGNAL_HANDLER, id="after asyncio"),
    ],
)
def test_a_signal_ends_spinning_and_shuts_the_context_down(
    number: signal.Signals, before: str, domain_id: int
) -> None:
    with running(SPIN.format(before)) as process:
        assert process.stdout.readline() == "spinning\n"
        while not is_asleep(process.pid):  # in DDS, whose wait no signal interrupts
            time.sleep(0.001)
        process.send_signal(number)
        assert process.wait(10) == 0
        assert process.stdout.read() == "False\n"
        assert process.stderr.read() == ""


def test_shutdown_on_another_thread_restores_the_signal_handlers(domain_id: int) -> None:
    code = f"""
import signal, threading
import rclpy
rclpy.init(args=[])
{SHUTDOWN_ON_ANOTHER_THREAD}
try:
    signal.raise_signal(signal.SIGINT)
except KeyboardInterrupt:
    print("interrupted", flush=True)
signal.raise_signal(signal.SIGTERM)
print("survived")
"""
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.stdout, done.stderr) == ("interrupted\n", "")
    assert done.returncode == -signal.SIGTERM


BLOCKED_MAIN_THREAD = """
import ctypes, threading
import rclpy
from rclpy.executors import ExternalShutdownException
rclpy.init(args=[])
node = rclpy.create_node("spinner")
libc, mutex = ctypes.CDLL(None), ctypes.create_string_buffer(64)
def spin():
    timer = node.create_timer(0.0, lambda: (timer.cancel(), print("spinning", flush=True)))
    try:
        rclpy.spin(node)
    except ExternalShutdownException:
        pass  # or spin() returns, if the signal came while the callback ran
    print("ended", flush=True)
threading.Thread(target=spin).start()
libc.pthread_mutex_lock(mutex)
libc.pthread_mutex_lock(mutex)  # forever
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_spinning_thread_while_the_main_thread_blocks(
    number: signal.Signals, domain_id: int
) -> None:
    with running(BLOCKED_MAIN_THREAD) as process:
        assert process.stdout.readline() == "spinning\n"
        process.send_signal(number)
        assert process.stdout.readline() == "ended\n"


SPIN_AND_INIT_AGAIN = f"""
import time
{SPIN.format("")}
rclpy.init(args=[])
end = time.monotonic() + 0.6
while rclpy.ok() and time.monotonic() < end:
    time.sleep(0.01)
print(rclpy.ok(), flush=True)
"""


SLOW_READING = """
import os, threading, time
read = os.read
def read_late(*arguments):
    if threading.current_thread().name == "rclpy-signals":
        time.sleep(0.3)
    return read(*arguments)
os.read = read_late
"""


@pytest.mark.parametrize("before", [pytest.param("", id="plain"), pytest.param(SLOW_READING, id="late")])
def test_a_handled_signal_does_not_end_the_next_context(before: str, domain_id: int) -> None:
    with running(before + SPIN_AND_INIT_AGAIN) as process:
        assert process.stdout.readline() == "spinning\n"
        process.send_signal(signal.SIGINT)
        assert process.stdout.readline() == "False\n"
        assert process.stdout.readline() == "True\n"


# DDS waits until a time of day: a wait that has begun before a step back by an hour takes an hour longer.
STEP_BACK = """
import sys
import rclpy
from std_msgs.msg import String
from rclpy_ground.cyclonedds import entities, wakeup

wait, read = entities.WaitSet.wait, wakeup.os.read
hour = 3600 * 10**9

def note_step(fd, count):
    global hour
    hour = 0
    return read(fd, count)

def wait_an_hour_longer(wait_set, timeout):
    if 0 < timeout < 10**9:
        print("waits", flush=True)
        timeout += hour
    return wait(wait_set, timeout)

wakeup.open_watch = lambda: int(sys.argv[1])
wakeup.os.read = note_step
entities.WaitSet.wait = wait_an_hour_longer
rclpy.init(args=[])
node = rclpy.create_node("waiting")
node.create_timer(0.5, lambda: (print("fired", flush=True), rclpy.shutdown()))
rclpy.spin(node)
"""


def test_a_timer_fires_in_time_although_the_clock_is_set_back(domain_id: int) -> None:
    reading, writing = os.pipe()
    with running(STEP_BACK, str(reading), pass_fds=[reading]) as process:
        os.close(reading)
        assert process.stdout.readline() == "waits\n"
        while not is_asleep(process.pid):
            time.sleep(0.001)
        os.write(writing, b"step")
        assert process.wait(10) == 0
        assert process.stdout.read().endswith("fired\n")
    os.close(writing)


def test_the_kernel_watches_the_clock_and_reports_nothing_without_a_step() -> None:
    watch = wakeup.open_watch()
    try:
        assert select.select([watch], [], [], 0.0) == ([], [], [])
    finally:
        os.close(watch)


TWO_CONTEXTS = """
import os, signal
import rclpy
from rclpy.context import Context
rclpy.init(args=[])
other = Context()
other.init(args=[])
os.kill(os.getpid(), signal.SIGTERM)
print(rclpy.ok(), other.ok())
"""


def test_a_signal_shuts_down_each_context_however_it_was_initialized(domain_id: int) -> None:
    ended = subprocess.run(
        [sys.executable, "-c", TWO_CONTEXTS], capture_output=True, text=True, timeout=60, check=False
    )
    assert (ended.stdout, ended.stderr) == ("False False\n", "")


def test_process_ends_while_the_listening_thread_holds_its_lock(domain_id: int) -> None:
    with running(ENDS_WHILE_A_LOCK_IS_HELD) as process:
        assert process.communicate(timeout=20.0) == ("", "")
    assert process.returncode == 0
