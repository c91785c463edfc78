"""Worked example: a service whose server crashes during a call, and a client that tries again."""

from __future__ import annotations

import time
from typing import Any

import pytest
import rclpy
from rclpy.node import Node
from std_srvs.srv import Trigger

from rclpy_simulation import Process, Simulation

WORK = 0.5  # s that the server needs for an answer
PATIENCE = 2.0  # s that the client waits for it


def serve() -> None:
    rclpy.init()
    node = Node("server")

    def answer(request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        time.sleep(WORK)
        response.success = True
        return response

    node.create_service(Trigger, "work", answer)
    rclpy.spin(node)


def ask() -> None:
    """Call the service until it answers; exit with the number of failed calls."""
    rclpy.init()
    node = Node("client")
    client = node.create_client(Trigger, "work")
    failures = 0
    while True:
        client.wait_for_service()
        future = client.call_async(Trigger.Request())
        rclpy.spin_until_future_complete(node, future, timeout_sec=PATIENCE)
        if future.done():
            raise SystemExit(failures)
        client.remove_pending_request(future)
        failures += 1


def start(simulation: Simulation) -> tuple[Process, Process]:
    """Start both; return when the server works on the first call."""
    server = simulation.start(serve)
    client = simulation.start(ask)
    calls: list[str] = []

    def note(writer: Any, sample: Any) -> None:
        if "workRequest" in writer.topic:
            calls.append(writer.topic)

    simulation.tap(note)
    simulation.run_until(lambda: calls)
    simulation.run(WORK / 2)
    return server, client


@pytest.mark.simulation(seed=7)
def test_a_client_gets_an_answer_from_a_server_that_lives(simulation: Simulation) -> None:
    _, client = start(simulation)
    simulation.run_until(lambda: client.ended, seconds=WORK)
    assert client.exit_code == 0


@pytest.mark.simulation(seed=7)
def test_a_client_calls_again_after_the_server_has_crashed(simulation: Simulation) -> None:
    server, client = start(simulation)
    server.kill()
    simulation.start(serve)
    simulation.run_until(lambda: client.ended)
    assert client.exit_code == 1


@pytest.mark.simulation(seed=7)
def test_a_client_waits_while_there_is_no_server(simulation: Simulation) -> None:
    server, client = start(simulation)
    server.kill()
    simulation.run(3600.0)
    assert not client.ended
    simulation.start(serve)
    simulation.run_until(lambda: client.ended, seconds=20.0)
    assert client.exit_code is not None
    assert client.exit_code > 0
