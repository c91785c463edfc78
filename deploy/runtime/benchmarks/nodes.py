"""The measured nodes, in plain rclpy, so they run on every rclpy.

``python nodes.py echo|ping|sink|flood|publish|timer|idle|start`` runs one node, which prints its figures as a
line of JSON. Each measurement needs a ``ROS_DOMAIN_ID`` that nothing else uses.
"""

from __future__ import annotations

import time

STARTED = time.perf_counter()  # before the imports, which are part of the start

import json  # noqa: E402
import os  # noqa: E402
import sys  # noqa: E402

import rclpy  # noqa: E402
from rclpy.node import Node  # noqa: E402
from rclpy.qos import DurabilityPolicy, QoSProfile  # noqa: E402
from rclpy.task import Future  # noqa: E402
from std_msgs.msg import Float64  # noqa: E402

PINGS = 3000
FLOOD = 60_000
SECONDS = 5.0  # of a measurement
WARM_UP = 2.0  # [s]; discovery is over by then
_QUEUE = QoSProfile(depth=1000)
_LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def report(**figures: float) -> None:
    print(json.dumps(figures), flush=True)


def spin(node: Node, end: Future, seconds: float | None = None) -> None:
    rclpy.spin_until_future_complete(node, end, timeout_sec=seconds)


def echo(node: Node) -> None:
    """Send every message back until a ``stop`` arrives."""
    stop = Future()
    publisher = node.create_publisher(Float64, "pong", _QUEUE)
    node.create_subscription(Float64, "ping", publisher.publish, _QUEUE)
    node.create_subscription(Float64, "stop", lambda _: stop.set_result(None), _LATCHED)
    spin(node, stop)


def ping(node: Node) -> None:
    """Measure round trips [µs] to ``echo``."""
    times: list[float] = []
    sent = 0.0
    done = Future()
    publisher = node.create_publisher(Float64, "ping", _QUEUE)

    def on_pong(_: Float64) -> None:
        nonlocal sent
        now = time.perf_counter()
        times.append(now - sent)
        if len(times) == PINGS:
            done.set_result(None)
        sent = time.perf_counter()
        publisher.publish(Float64(data=1.0))

    node.create_subscription(Float64, "pong", on_pong, _QUEUE)
    stop = node.create_publisher(Float64, "stop", _LATCHED)
    while not (publisher.get_subscription_count() and node.count_publishers("pong")):
        rclpy.spin_once(node, timeout_sec=0.01)
    time.sleep(0.5)  # until both directions are matched on both sides
    sent = time.perf_counter()
    publisher.publish(Float64(data=1.0))
    spin(node, done)
    stop.publish(Float64())
    time.sleep(0.2)
    ordered = sorted(times[100:])
    report(p50=1e6 * ordered[len(ordered) // 2], p99=1e6 * ordered[len(ordered) * 99 // 100])


def sink(node: Node) -> None:
    """Measure the reception of a flood: messages/s, and CPU time per message [µs]."""
    count = 0
    began = Future()

    def on_message(_: Float64) -> None:
        nonlocal count
        count += 1
        if not began.done():
            began.set_result(None)

    node.create_subscription(Float64, "flood", on_message, _QUEUE)
    spin(node, began)
    count, first, cpu = 0, time.perf_counter(), time.process_time()
    spin(node, Future(), SECONDS)
    seconds = time.perf_counter() - first
    report(messages_per_second=count / seconds, cpu_us=1e6 * (time.process_time() - cpu) / count)


def flood(node: Node) -> None:
    """Publish as fast as possible while there is a subscription: messages/s."""
    publisher = node.create_publisher(Float64, "flood", _QUEUE)
    while not publisher.get_subscription_count():
        time.sleep(0.01)
    message, count, began = Float64(data=1.0), 0, time.perf_counter()
    while publisher.get_subscription_count():
        for _ in range(100):
            publisher.publish(message)
        count += 100
    report(messages_per_second=count / (time.perf_counter() - began))


def publish(node: Node) -> None:
    """Publish without a subscription: messages/s, and CPU time per message [µs]."""
    publisher = node.create_publisher(Float64, "unread", _QUEUE)
    message = Float64(data=1.0)
    began, cpu = time.perf_counter(), time.process_time()
    for _ in range(FLOOD):
        publisher.publish(message)
    seconds = time.perf_counter() - began
    report(messages_per_second=FLOOD / seconds, cpu_us=1e6 * (time.process_time() - cpu) / FLOOD)


def timer(node: Node) -> None:
    """Measure a 100 Hz timer: share of a core [%]."""
    calls = 0

    def tick() -> None:
        nonlocal calls
        calls += 1

    node.create_timer(0.01, tick)
    spin(node, Future(), WARM_UP)
    calls = 0
    cpu, began = time.process_time(), time.perf_counter()
    spin(node, Future(), SECONDS)
    report(cpu_percent=100 * (time.process_time() - cpu) / (time.perf_counter() - began), calls=calls)


def idle(node: Node) -> None:
    """Measure an idle node that spins: share of a core [%]."""
    spin(node, Future(), WARM_UP)
    cpu, began = time.process_time(), time.perf_counter()
    spin(node, Future(), SECONDS)
    report(cpu_percent=100 * (time.process_time() - cpu) / (time.perf_counter() - began))


def start(node: Node) -> None:
    """Measure the start of a node: seconds from the first line to the node, memory [MB], threads."""
    seconds = time.perf_counter() - STARTED
    with open("/proc/self/status", encoding="ascii") as file:
        status = dict(line.split(":", 1) for line in file)
    report(seconds=seconds, megabytes=int(status["VmRSS"].split()[0]) / 1024, threads=int(status["Threads"]))


def main() -> None:
    role = sys.argv[1]
    rclpy.init(args=[])
    node = rclpy.create_node(f"{role}_{os.getpid()}")
    try:
        globals()[role](node)
    finally:
        node.destroy_node()
        rclpy.shutdown()


if __name__ == "__main__":
    main()
