"""Simulated processes: time, threads, signals, their start and their end."""

from __future__ import annotations

import _thread
import atexit
import gc
import os
import queue
import re
import signal
import sys
import threading
import time
import weakref
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from time import sleep
from typing import Any

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from std_msgs.msg import Int64

from rclpy_simulation import Delay, Process, Simulation

NOW = Delay(0.0, 0.0)


class OfThread(threading.local):
    """Values of a thread, as a library keeps them in a module."""

    def __init__(self) -> None:
        self.values: list[str] = []


OF_THREAD = OfThread()


def run(simulation: Simulation, program: Callable[[], Any]) -> Process:
    process = simulation.start(program, name="program", delay=NOW)
    simulation.run_until(lambda: process.ended, 7200.0)
    return process


# Time


def test_sleeping_takes_only_virtual_time(simulation: Simulation) -> None:
    times: list[float] = []

    def program() -> None:
        for pause in (3600.0, 0.5):
            time.sleep(pause)
            times.append(time.monotonic() - 1000.0)
        sleep(1.0)  # bound by name before the simulation
        times.append(time.perf_counter() - 1000.0)

    before = time.monotonic()
    run(simulation, program)
    assert times == [3600.0, 3600.5, 3601.5]
    assert time.monotonic() - before < 60.0


def test_loops_that_do_not_wait_let_time_pass(simulation: Simulation) -> None:
    def program() -> None:
        event = threading.Event()
        end = time.monotonic() + 0.01
        while time.monotonic() < end:
            time.sleep(0)
        end += 0.01
        while time.monotonic() < end:
            event.wait(0)
        rclpy.init()
        node = rclpy.create_node("busy")
        end = time.monotonic() + 0.01
        while time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0)

    run(simulation, program)


def test_a_program_that_floods_itself_lets_time_pass(simulation: Simulation) -> None:
    heard: list[str] = []

    def program() -> None:
        rclpy.init()
        node = rclpy.create_node("flood")
        publisher = node.create_publisher(Int64, "x", 10)
        node.create_subscription(Int64, "x", publisher.publish, 10)
        node.create_timer(0.01, lambda: heard.append("timer"))
        publisher.publish(Int64())
        rclpy.spin(node)

    simulation.start(program, delay=NOW)
    simulation.run(0.05)
    assert heard


def test_the_time_of_day_of_a_host_steps_and_drifts(simulation: Simulation) -> None:
    clocks: list[tuple[float, float]] = []

    def program() -> None:
        while True:
            clocks.append((round(time.monotonic() - 1000.0, 3), round(time.time(), 3)))
            assert time.gmtime() == time.gmtime(time.time())
            time.sleep(100.0)

    simulation.start(program, host="robot", delay=NOW)
    simulation.run(1.0)
    simulation.host("robot").step(-3600.0)
    simulation.run(100.0)
    simulation.set_drift(simulation.host("robot"), 0.01)
    simulation.run(150.0)
    (_, first), *_ = clocks
    differences = [(when, round(day - first - when, 6)) for when, day in clocks]
    assert differences == [(0.0, 0.0), (100.0, -3600.0), (200.0, -3599.01)]


# Threads


def test_threads_of_a_process_wait_for_each_other(simulation: Simulation) -> None:
    items: list[Any] = []

    def program() -> None:
        line: queue.Queue[int] = queue.Queue()
        done = threading.Event()

        def produce() -> None:
            for number in range(3):
                time.sleep(1.0)
                line.put(number)
            done.set()

        producer = threading.Thread(target=produce, name="producer")
        producer.start()
        assert producer.is_alive()
        for _ in range(3):
            items.append((line.get(timeout=5.0), round(time.monotonic() - 1000.0, 3)))
        assert done.wait(1.0)
        producer.join()
        assert not producer.is_alive()
        with pytest.raises(queue.Empty):
            line.get(timeout=2.5)
        with ThreadPoolExecutor(2) as pool:
            items.extend(pool.map(lambda number: time.sleep(number) or number, [2, 1]))
        items.append(round(time.monotonic() - 1000.0, 3))

    assert run(simulation, program).exit_code == 0
    assert items == [(0, 1.0), (1, 2.0), (2, 3.0), 2, 1, 7.5]


def test_each_thread_has_its_own_identity(simulation: Simulation) -> None:
    names: list[str] = []
    identities: set[int] = set()

    def note() -> None:
        time.sleep(1.0)
        names.append(threading.current_thread().name)
        identities.add(threading.get_ident())
        assert threading.get_ident() == threading.current_thread().ident

    def program() -> None:
        assert threading.current_thread() is threading.main_thread()
        other = threading.Thread(target=note, name="other")
        other.start()
        note()

    run(simulation, program)
    run(simulation, program)
    assert names == ["MainThread", "other"] * 2
    assert len(identities) == 4
    assert not identities & threading._active.keys()  # type: ignore[attr-defined]


def test_each_thread_has_its_own_local_values(simulation: Simulation) -> None:
    seen: list[list[str]] = []

    def note(name: str) -> None:
        OF_THREAD.values.append(name)
        time.sleep(1.0)
        seen.append(OF_THREAD.values)

    def program() -> None:
        other = threading.Thread(target=note, args=["other"])
        other.start()
        note("main")
        other.join()

    OF_THREAD.values.append("test")
    first, second = (simulation.start(program, delay=NOW) for _ in range(2))
    simulation.run_until(lambda: first.ended and second.ended)
    assert seen == [["main"], ["main"], ["other"], ["other"]]
    assert OF_THREAD.values.pop() == "test"


def test_a_real_thread_keeps_its_identity_and_its_time(simulation: Simulation) -> None:
    """It belongs to no simulated process."""
    asked, answered = _thread.allocate_lock(), _thread.allocate_lock()
    asked.acquire()
    answered.acquire()
    seen: list[object] = []

    def answer() -> None:
        asked.acquire()
        begin = time.monotonic()
        waited = threading.Event().wait(0.05)
        seen.extend([threading.get_ident() == _thread.get_ident(), waited, time.monotonic() - begin >= 0.05])
        answered.release()

    _thread.start_new_thread(answer, ())

    def ask() -> None:
        asked.release()
        answered.acquire()  # a real wait, in which the simulated process stays the current one

    simulation.start(ask)
    simulation.run(1.0)
    assert seen == [True, False, True]


def test_an_error_in_a_second_thread_does_not_end_the_process(simulation: Simulation) -> None:
    def program() -> None:
        threading.Thread(target=[].pop, name="worker").start()
        threading.Thread(target=sys.exit).start()
        time.sleep(1.0)
        print("goes on")

    process = run(simulation, program)
    assert process.exit_code == 0
    assert process.output.text.startswith("Exception in thread worker:\nTraceback")
    assert process.output.text.endswith("IndexError: pop from empty list\ngoes on\n")
    assert process.output.text.count("Exception") == 1


def test_a_process_ends_with_its_last_thread_that_is_no_daemon(simulation: Simulation) -> None:
    def program() -> None:
        atexit.register(print, "last")
        threading.Thread(target=lambda: time.sleep(1.0) or print("thread")).start()
        threading.Thread(target=time.sleep, args=(99.0,), daemon=True).start()
        print("main")

    process = run(simulation, program)
    assert process.output.text == "main\nthread\nlast\n"
    assert simulation.now == 1.0


@pytest.fixture
def no_finalizer_yet(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(weakref.finalize, "_registered_with_atexit", False)
    monkeypatch.setattr(weakref.finalize, "_shutdown", False)


@pytest.mark.usefixtures("no_finalizer_yet")
def test_a_process_that_ends_does_not_end_the_finalizers_of_others(simulation: Simulation) -> None:
    run(simulation, lambda: weakref.finalize(lambda: None, int))
    finalized: list[str] = []
    weakref.finalize(lambda: None, finalized.append, "dropped at once")
    assert finalized == ["dropped at once"]


# Signals


def test_a_signal_handler_runs_on_the_waiting_main_thread(simulation: Simulation) -> None:
    heard: list[tuple[float, str]] = []

    def program() -> None:
        def handle(number: int, frame: object) -> None:
            heard.append((time.monotonic() - 1000.0, threading.current_thread().name))

        signal.signal(signal.SIGTERM, handle)
        os.kill(os.getpid(), signal.SIGTERM)
        threading.Thread(target=time.sleep, args=(9.0,)).start()
        time.sleep(3.0)

    process = simulation.start(program, delay=NOW)
    simulation.run(1.0)
    process.send_signal(signal.SIGTERM)
    simulation.run(20.0)
    assert heard == [(0.0, "MainThread"), (1.0, "MainThread")]
    assert process.exit_code == 0


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGKILL])
def test_a_signal_without_handler_ends_a_process_even_while_it_starts(
    simulation: Simulation, number: int
) -> None:
    began: list[str] = []
    process = simulation.start(lambda: began.append("began"), delay=Delay(1.0, 1.0), name="late")
    simulation.run(0.5)
    process.send_signal(number)
    assert process.exit_code == -number
    simulation.run(5.0)
    assert began == []


def test_an_interrupt_is_a_keyboard_interrupt(simulation: Simulation) -> None:
    process = simulation.start(lambda: time.sleep(9.0), delay=NOW, name="sleeper")
    simulation.run(1.0)
    process.send_signal(signal.SIGINT)
    simulation.run(0.0)
    assert process.exit_code == -signal.SIGINT
    assert process.output.text.endswith("KeyboardInterrupt\n")


def test_a_stopped_process_handles_signals_when_it_proceeds(simulation: Simulation) -> None:
    process = simulation.start(lambda: time.sleep(99.0), delay=NOW, name="sleeper")
    simulation.run(1.0)
    process.send_signal(signal.SIGSTOP)
    process.send_signal(signal.SIGTERM)
    simulation.run(1.0)
    assert not process.ended
    process.send_signal(signal.SIGCONT)
    assert process.exit_code == -signal.SIGTERM


def test_a_process_can_stop_and_kill_itself(simulation: Simulation) -> None:
    times: list[float] = []

    def program() -> None:
        os.kill(os.getpid(), signal.SIGSTOP)
        times.append(time.monotonic() - 1000.0)
        os.kill(os.getpid(), signal.SIGKILL)
        times.append(-1.0)

    process = simulation.start(program, delay=NOW)
    simulation.after(5.0, process.proceed)
    simulation.run(10.0)
    assert times == [5.0]
    assert process.exit_code == -signal.SIGKILL


@pytest.mark.parametrize(
    ("steps", "read"),
    [(1, [5.0, 5.0, 5.0]), (2, [0.0, 5.0, 5.0]), (3, [0.0, 0.0, 5.0]), (4, [0.0, 0.0, 0.0])],
)
def test_a_process_stops_between_two_readings_of_clocks(
    simulation: Simulation, steps: int, read: list[float]
) -> None:
    times: list[float] = []

    def program() -> None:
        process.stop_after(steps)
        times.append(time.monotonic() - 1000.0)
        begin = time.time()
        times.append(time.monotonic() - 1000.0)
        times[1:1] = [begin - began]
        process.stop_after(0)

    process = simulation.start(program, delay=NOW)
    began = process.host.time_of_day(process.kernel.now) / 1e9
    simulation.after(5.0, process.proceed)
    simulation.run(10.0)
    assert times == pytest.approx(read, abs=1e-5)


def test_a_process_stops_before_it_publishes_and_takes(simulation: Simulation) -> None:
    sent: list[float] = []
    taken: list[float] = []
    simulation.tap(lambda writer, sample: sent.append(simulation.now) if writer.topic == "rt/x" else None)

    def talk_to_itself() -> None:
        rclpy.init()
        node = rclpy.create_node("talker")
        publisher = node.create_publisher(Int64, "x", 10)
        node.create_subscription(Int64, "x", lambda _: taken.append(simulation.now), 10)
        publisher.publish(Int64())
        rclpy.spin(node)

    stops: list[float] = []
    for steps in range(1, 200):
        sent.clear()
        taken.clear()
        process = simulation.start(talk_to_itself, delay=NOW)
        process.stop_after(steps)
        begin = simulation.now
        simulation.after(5.0, process.proceed)
        simulation.run(6.0)
        process.kill()
        assert len(sent) == len(taken) == 1
        stops.append((sent[0] - begin > 4.0) + (taken[0] - begin > 4.0))
        if not stops[-1]:
            break
    assert set(stops) == {0, 1, 2}


# The end


def test_a_killed_process_neither_prints_nor_publishes_nor_runs_on(simulation: Simulation) -> None:
    seen: list[Any] = []
    simulation.tap(lambda writer, sample: seen.append(writer.topic) if writer.topic == "rt/x" else None)

    def program() -> None:
        rclpy.init()
        publisher = rclpy.create_node("stubborn").create_publisher(Int64, "x", 10)
        publisher.publish(Int64())
        try:
            time.sleep(99.0)
        finally:
            print("cleaning up")
            publisher.publish(Int64())
            time.sleep(1.0)
            seen.append("ran on")

    process = simulation.start(program, delay=NOW)
    simulation.run(1.0)
    process.kill()
    simulation.run(10.0)
    assert seen == ["rt/x"]
    assert process.output.text == ""


def test_a_process_that_catches_everything_can_be_killed(simulation: Simulation) -> None:
    def program() -> None:
        while True:
            try:
                time.sleep(1.0)
            except BaseException:
                continue

    process = simulation.start(program, delay=NOW)
    simulation.run(1.0)
    process.kill()
    simulation.run(10.0)
    assert process.exit_code == -signal.SIGKILL


@pytest.mark.parametrize("fault", ["kill", "stop"])
def test_a_tap_can_kill_or_stop_the_writer_before_a_message(simulation: Simulation, fault: str) -> None:
    heard: list[int] = []
    ran_on: list[str] = []

    def talker() -> None:
        rclpy.init()
        publisher = rclpy.create_node("talker").create_publisher(Int64, "x", 10)
        while not publisher.get_subscription_count():
            time.sleep(0.1)
        time.sleep(1.0)
        publisher.publish(Int64(data=1))
        ran_on.append("ran on")
        time.sleep(99.0)

    def listener() -> None:
        rclpy.init()
        node = rclpy.create_node("listener")
        node.create_subscription(Int64, "x", lambda message: heard.append(message.data), 10)
        rclpy.spin(node)

    process = simulation.start(talker)
    simulation.start(listener)
    simulation.tap(lambda writer, sample: getattr(process, fault)() if writer.topic == "rt/x" else None)
    simulation.run(5.0)
    assert (heard, ran_on) == ([], [])
    process.proceed()
    simulation.run(5.0)
    assert (heard, ran_on) == (([], []) if fault == "kill" else ([1], ["ran on"]))


def test_an_uncaught_error_ends_a_process_with_its_traceback(simulation: Simulation) -> None:
    def program() -> None:
        raise ValueError("broken")

    process = run(simulation, program)
    assert process.exit_code == 1
    first, *_, last = process.output.text.splitlines()
    assert (first, last) == ("Traceback (most recent call last):", "ValueError: broken")
    assert "process.py" not in process.output.text
    assert simulation.ends[-1][:3] == ("program", process.pid, 1)


def test_a_traceback_has_no_frames_of_the_kit_as_rcl_has_none(simulation: Simulation) -> None:
    def program(executor: Any) -> None:
        rclpy.init()
        node = rclpy.create_node("failing")
        node.create_timer(1.0, fail)
        spinning = executor()
        spinning.add_node(node)
        spinning.spin()

    def fail() -> None:
        try:
            os.system("true")
        except RuntimeError as error:
            raise ExceptionGroup("broken", [error]) from error

    for executor in (SingleThreadedExecutor, EventsExecutor):
        text = run(simulation, lambda it=executor: program(it)).output.text
        assert not re.search("/rclpy_(ground|simulation)/", text), text
        assert text.count('os.system("true")') == 2  # the cause, and the member of the group
        assert "in program" in text


def test_a_traceback_has_the_frames_of_a_kit_that_fails(simulation: Simulation) -> None:
    text = run(simulation, lambda: Delay(1.0, 2.0).draw(None)).output.text  # type: ignore[arg-type]
    assert "/rclpy_simulation/network.py" in text


def test_each_process_has_its_own_arguments_and_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    def program() -> None:
        time.sleep(1.0)
        print(sys.argv, os.environ, os.getpid())

    monkeypatch.setenv("AMENT_PREFIX_PATH", "/opt/ros/jazzy")  # of the installed ROS 2: all have it
    monkeypatch.delenv("ROS_DISTRO", raising=False)
    with Simulation() as simulation:
        one = simulation.start(program, "1", environment={"A": "1"}, name="one", delay=NOW)
        two = simulation.start(program, "2", name="two", delay=NOW)
        simulation.run(2.0)
    installed = "'AMENT_PREFIX_PATH': '/opt/ros/jazzy'"
    assert one.output.text == f"['one', '1'] {{{installed}, 'A': '1'}} {one.pid}\n"
    assert two.output.text == f"['two', '2'] {{{installed}}} {two.pid}\n"
    assert sys.argv[0] != "two"


def test_actions_and_conditions_have_the_variables_of_the_test(simulation: Simulation) -> None:
    arguments = sys.argv
    found: list[Any] = []
    simulation.start(lambda: time.sleep(2.0), delay=NOW, name="other")
    simulation.after(1.0, lambda: found.append(sys.argv))
    simulation.run_until(lambda: sys.argv is arguments and found)
    assert found == [arguments]


def test_memory_stays_flat_over_many_restarts() -> None:
    with Simulation(seed=1) as simulation:

        def steady() -> None:
            rclpy.init()
            node = rclpy.create_node("steady")
            node.create_publisher(Int64, "x", 10)
            rclpy.spin(node)

        def restarting() -> None:
            rclpy.init()
            node = rclpy.create_node("restarting")
            node.create_subscription(Int64, "x", lambda message: None, 10)
            rclpy.spin(node)

        def objects(restarts: int) -> int:
            for _ in range(restarts):
                process = simulation.start(restarting, delay=NOW)
                simulation.run(simulation.random.uniform(0.0, 0.3))
                process.kill()
            simulation.run(2 * simulation.network.lease)
            while gc.collect():  # finalizers let objects of their process live until the next time
                pass
            return len(gc.get_objects())

        simulation.start(steady)
        before = objects(120)  # rclpy forgets dead peers when there are more than 100
        assert objects(240) - before < 120
