"""What programs of others do besides rclpy: asyncio, terminals, locks, polled clocks; and what is refused."""

from __future__ import annotations

import asyncio
import datetime
import importlib.util
import os
import random
import select
import signal
import socket
import subprocess
import sys
import termios
import threading
import time
import tty
import uuid
from collections.abc import Callable
from itertools import pairwise
from typing import Any

import pytest
import rclpy
from std_msgs.msg import Int64

from rclpy_simulation import Delay, Process, Simulation

NOW = Delay(0.0, 0.0)


def run(simulation: Simulation, program: Callable[[], Any], seconds: float = 60.0) -> Process:
    process = simulation.start(program, delay=NOW)
    simulation.run(seconds)
    assert process.exit_code == 0, process.output.text
    return process


# asyncio


def test_loops_of_several_processes_sleep_in_virtual_time(simulation: Simulation) -> None:
    seen: list[Any] = []

    def program(name: str, period: float) -> Callable[[], None]:
        async def main() -> None:
            loop = asyncio.get_running_loop()
            for _ in range(2):
                await asyncio.sleep(period)
                seen.append((name, round(loop.time() - 1000.0, 3)))
                time.sleep(1.0)  # while it blocks its loop, the other loop runs
                assert asyncio.get_running_loop() is loop
                assert asyncio.current_task() is not None
            with pytest.raises(TimeoutError):
                await asyncio.wait_for(asyncio.Event().wait(), 1.0)
            seen.append(await asyncio.to_thread(lambda: time.sleep(5.0) or name))

        return lambda: asyncio.run(main())

    processes = [simulation.start(program(*it), delay=NOW, name=it[0]) for it in (("a", 1.0), ("b", 1.5))]
    simulation.run(60.0)
    assert [process.exit_code for process in processes] == [0, 0], processes[0].output.text
    assert seen == [("a", 1.0), ("b", 1.5), ("a", 3.0), ("b", 4.0), "a", "b"]


def test_a_node_spins_beside_a_loop(simulation: Simulation) -> None:
    heard: list[int] = []

    def program() -> None:
        rclpy.init()
        node = rclpy.create_node("both")
        publisher = node.create_publisher(Int64, "numbers", 10)
        node.create_subscription(Int64, "numbers", lambda message: heard.append(message.data), 10)

        async def main() -> None:
            spinning = asyncio.create_task(spin())
            for number in range(3):
                publisher.publish(Int64(data=number))
                await asyncio.sleep(1.0)
            spinning.cancel()

        async def spin() -> None:
            while True:
                rclpy.spin_once(node, timeout_sec=0.0)
                await asyncio.sleep(0.01)

        asyncio.run(main())

    run(simulation, program)
    assert heard == [0, 1, 2]


def test_a_loop_handles_signals_and_ctrl_c(simulation: Simulation) -> None:
    seen: list[str] = []

    async def with_handler() -> None:
        ended = asyncio.Event()
        asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)
        await ended.wait()
        seen.append("ended")

    async def forever() -> None:
        try:
            await asyncio.Event().wait()
        finally:
            seen.append("cancelled")

    handling = simulation.start(lambda: asyncio.run(with_handler()), delay=NOW, name="handling")
    other = simulation.start(lambda: asyncio.run(forever()), delay=NOW, name="other")
    simulation.run(1.0)
    handling.send_signal(signal.SIGTERM)
    simulation.run(1.0)
    other.send_signal(signal.SIGINT)
    simulation.run(1.0)
    assert seen == ["ended", "cancelled"]
    assert (handling.exit_code, other.exit_code) == (0, -signal.SIGINT)


def test_a_killed_loop_leaves_no_trace(simulation: Simulation) -> None:
    async def forever() -> None:
        time.sleep(1e6)

    process = simulation.start(lambda: asyncio.run(forever()), delay=NOW)
    simulation.run(1.0)
    process.kill()
    simulation.run(1.0)

    async def main() -> None:
        await asyncio.sleep(1.0)

    run(simulation, lambda: asyncio.run(main()))


def test_a_loop_is_closed_after_the_simulation() -> None:
    loops = []
    with Simulation() as simulation:
        run(simulation, lambda: loops.append(asyncio.new_event_loop()))
    loops[0].close()  # as the garbage collector does


# Terminals


def test_only_who_reads_waits_for_what_the_test_types(simulation: Simulation) -> None:
    seen: list[Any] = []

    def program() -> None:
        ticks: list[float] = []
        threading.Thread(
            target=lambda: [time.sleep(1.0) or ticks.append(1) for _ in range(100)], daemon=True
        ).start()
        seen.append(input("name? "))
        seen.append(len(ticks))
        seen.append(sys.stdin.read(2))
        seen.append(sys.stdin.readline())
        seen.append(os.read(sys.stdin.fileno(), 10))
        seen.extend(sys.stdin)

    process = simulation.start(program, delay=NOW)
    simulation.at(10.5, lambda: process.input.type("Karol\n"))
    simulation.at(20.0, lambda: process.input.type("ab"))
    simulation.at(30.0, lambda: process.input.type("cd\n"))
    simulation.at(40.0, lambda: process.input.type("xy"))
    simulation.at(50.0, lambda: process.input.type("one\ntwo"))
    simulation.at(55.0, process.input.end)
    simulation.run(60.0)
    assert process.exit_code == 0, process.output.text
    assert seen == ["Karol", 10, "ab", "cd\n", b"xy", "one\n", "two"]
    assert process.output.text == "name? "


def test_a_teleop_polls_its_keys(simulation: Simulation) -> None:
    keys: list[Any] = []

    def program() -> None:
        settings = termios.tcgetattr(sys.stdin)
        while "q" not in keys:
            tty.setraw(sys.stdin.fileno())
            ready, _, _ = select.select([sys.stdin], [], [], 0.5)
            keys.append(sys.stdin.read(1) if ready else "")
            termios.tcsetattr(sys.stdin, termios.TCSADRAIN, settings)

    process = simulation.start(program, delay=NOW)
    simulation.at(1.2, lambda: process.input.type("w"))
    simulation.at(2.0, lambda: process.input.type("q"))
    simulation.run(10.0)
    assert process.exit_code == 0, process.output.text
    assert keys == ["", "", "w", "", "q"]


# Clocks


def test_a_loop_that_polls_a_clock_ends_and_lets_others_run(simulation: Simulation) -> None:
    ticks: list[float] = []

    def poll() -> None:
        end = time.monotonic() + 1.0
        while time.monotonic() < end:
            pass

    def tick() -> None:
        while True:
            time.sleep(0.1)
            ticks.append(simulation.now)

    simulation.start(tick, delay=NOW)
    polling = simulation.start(poll, delay=NOW)
    simulation.run(0.9)
    assert not polling.ended
    simulation.run(0.2)
    assert polling.exit_code == 0
    assert ticks == pytest.approx([n / 10 for n in range(1, 12)][: len(ticks)], abs=0.001)
    assert len(ticks) >= 10


def test_no_duration_is_zero_and_periods_do_not_drift(simulation: Simulation) -> None:
    times: list[int] = []

    def program() -> None:
        rclpy.init()
        node = rclpy.create_node("timed")
        for clock in (
            time.time,
            time.monotonic,
            time.perf_counter,
            lambda: node.get_clock().now().nanoseconds,
        ):
            before = clock()
            assert clock() > before
        node.create_timer(1.0, lambda: times.append(round(simulation.now * 1e9)))
        rclpy.spin(node)

    simulation.start(program, delay=NOW)
    simulation.run(10.0)
    assert len(times) >= 9
    assert {after - before for before, after in pairwise(times)} == {10**9}


# Locks


def test_a_thread_waits_for_a_lock_in_virtual_time(simulation: Simulation) -> None:
    seen: list[Any] = []

    def program(make: Callable[[], Any]) -> None:
        lock = make()

        def hold() -> None:
            with lock:
                time.sleep(5.0)

        holder = threading.Thread(target=hold)
        holder.start()
        time.sleep(1.0)
        seen.append([lock.acquire(blocking=False), lock.acquire(timeout=1.0)])
        with lock:
            seen.append(round(time.monotonic() - 1000.0, 3))
        holder.join()
        assert not lock.acquire(False) or lock.release() is None

    for make in (threading.Lock, threading.RLock, threading.Condition):
        seen.clear()
        began = simulation.now
        run(simulation, lambda it=make: program(it), 10.0)
        assert seen == [[False, False], began + 5.0], make


def test_an_rlock_is_reentrant_and_a_lock_is_not_released_twice(simulation: Simulation) -> None:
    def program() -> None:
        lock = threading.RLock()
        with lock, lock:
            pass
        for each in (lock, threading.Lock()):
            with pytest.raises(RuntimeError):
                each.release()

    run(simulation, program)


def test_a_condition_of_a_program_is_notified_by_the_test(simulation: Simulation) -> None:
    made: list[threading.Condition] = []
    run(simulation, lambda: made.append(threading.Condition()))
    with made[0]:
        made[0].notify_all()


# Reality


def test_dates_are_those_of_the_host(simulation: Simulation) -> None:
    seen: list[Any] = []

    def program() -> None:
        now = datetime.datetime.now(datetime.UTC)
        seen.extend([now.isoformat(timespec="seconds"), isinstance(now, datetime.datetime)])
        seen.append((datetime.datetime.now(), datetime.date.today(), datetime.datetime.utcnow()))
        seen.append(datetime.datetime(2026, 1, 1) - datetime.datetime(2025, 12, 31))
        seen.append(time.strftime("%Y", time.gmtime()) + time.strftime("%Y"))
        assert time.asctime().endswith("2026")

    run(simulation, program)
    assert seen[:2] == ["2026-01-01T00:00:00+00:00", True]
    assert [(type(each).__name__, each.year) for each in seen[2]] == [
        ("datetime", 2026),
        ("date", 2026),
        ("datetime", 2026),
    ]
    assert seen[3] == datetime.timedelta(days=1)
    assert datetime.datetime.now().year >= 2026


def test_chance_comes_from_the_seed() -> None:
    def draw() -> list[Any]:
        found: list[Any] = []

        def program() -> None:
            found.extend([random.Random().random(), uuid.uuid1(), uuid.uuid1(), uuid.uuid4(), os.urandom(4)])
            found.append(random.SystemRandom().random())

        with Simulation(seed=3) as simulation:
            run(simulation, program)
        return found

    assert draw() == draw()
    assert random.Random().random() != random.Random().random()


@pytest.mark.parametrize(
    ("what", "use"),
    [
        ("curses.initscr", lambda: importlib.import_module("curses").wrapper(print)),
        ("os.fork", lambda: os.fork()),
        ("os.system", lambda: os.system("true")),
        ("signal.pause", lambda: signal.pause()),
        ("select.select for other files than sys.stdin", lambda: select.select([7], [], [])),
        ("socket.getaddrinfo", lambda: socket.create_connection(("127.0.0.1", 9))),
        ("socket.socket.recv", lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM).recv(1)),
        ("subprocess.Popen", lambda: subprocess.run(["true"])),
        *(
            [("tkinter.Tk", lambda: importlib.import_module("tkinter").Tk())]
            if importlib.util.find_spec("_tkinter")  # not every Python has it
            else []
        ),
    ],
)
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_what_is_not_simulated_is_refused_by_name(
    simulation: Simulation, what: str, use: Callable[[], Any]
) -> None:
    process = simulation.start(use, delay=NOW)
    simulation.run(1.0)
    assert process.exit_code == 1
    assert process.output.text.endswith(f"NotSimulatedError: rclpy_simulation does not simulate {what}\n")


@pytest.mark.parametrize(
    ("name", "line"),
    [
        (
            "tf2_elsewhere",
            "tf2_elsewhere is missing. Of ROS 2, PyPI has rclpy and common_interfaces only: install"
            " ros-$ROS_DISTRO-tf2-elsewhere, or build it in a workspace, and source that",
        ),
        ("elsewhere", "elsewhere is missing: install it, or source the ROS 2 or workspace that has it"),
    ],
)
def test_the_last_line_names_a_missing_package_and_its_origin(
    simulation: Simulation, name: str, line: str
) -> None:
    process = simulation.start(lambda: importlib.import_module(f"{name}.msg"), delay=NOW)
    simulation.run(1.0)
    assert process.exit_code == 1
    assert process.output.text.endswith(f"\nModuleNotFoundError: No module named '{name}'\n{line}\n")
