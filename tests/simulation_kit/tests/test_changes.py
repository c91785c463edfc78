"""What is changed in rclpy, in memory: the hashes of nodes and clocks, and the turns of an executor."""

from __future__ import annotations

import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Int64

from rclpy_ground.waiting import WaitSet
from rclpy_simulation import Simulation


def test_nodes_and_clocks_have_hashes_in_the_order_of_creation(simulation: Simulation) -> None:
    hashes: list[tuple[int, int]] = []

    def program() -> None:
        rclpy.init()
        for name in ("first", "second"):
            node = rclpy.create_node(name)
            hashes.append((hash(node), hash(node.get_clock())))
            assert hash(node) == hash(node)

    process = simulation.start(program)
    simulation.run_until(lambda: process.ended)
    assert process.exit_code == 0
    (node, clock), (later_node, later_clock) = hashes
    assert node < later_node
    assert clock < later_clock


def test_an_executor_waits_once_for_each_callback(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    waits: list[int] = []
    wait = WaitSet.wait
    monkeypatch.setattr(WaitSet, "wait", lambda self, limit: waits.append(limit) or wait(self, limit))
    calls: list[None] = []

    def program() -> None:
        rclpy.init()
        node = rclpy.create_node("ticker")
        node.create_timer(0.01, lambda: calls.append(None))
        rclpy.spin(node)

    simulation.start(program)
    simulation.run(10.0)
    assert len(calls) > 900
    assert len(waits) <= len(calls) + 5


def test_what_a_callback_starts_runs_in_the_next_turn(simulation: Simulation) -> None:
    """Futures, tasks, guard conditions and new entities: nothing waits for the next message."""
    seen: list[str] = []

    def program() -> None:
        rclpy.init()
        node = rclpy.create_node("starter")
        executor = SingleThreadedExecutor()
        guard = node.create_guard_condition(lambda: seen.append("guard condition"))

        async def task() -> None:
            seen.append("task")

        def once() -> None:
            timer.cancel()
            guard.trigger()
            executor.create_task(task)
            node.create_timer(0.0, lambda: seen.append("timer")).reset()
            node.create_subscription(Int64, "own", lambda _: seen.append("message"), 10)
            node.create_publisher(Int64, "own", 10).publish(Int64())

        timer = node.create_timer(1.0, once)
        executor.add_node(node)
        for _ in range(100):
            executor.spin_once(timeout_sec=0.05)

    simulation.start(program)
    simulation.run(20.0)
    assert {"guard condition", "task", "timer", "message"} == set(seen)
