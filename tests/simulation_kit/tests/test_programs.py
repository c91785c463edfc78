"""Unmodified programs on the substitute, with each executor: topics, timers, services and parameters."""

from __future__ import annotations

import pytest
import rclpy
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.experimental import EventsExecutor
from std_msgs.msg import Int64
from std_srvs.srv import SetBool

from rclpy_simulation import Simulation


def spin(node: rclpy.node.Node, executor: type) -> None:
    spinning = executor()
    spinning.add_node(node)
    spinning.spin()


def talker(executor: type) -> None:
    rclpy.init()
    node = rclpy.create_node("talker")
    node.declare_parameter("step", 1)
    publisher = node.create_publisher(Int64, "numbers", 10)
    count = 0

    def tick() -> None:
        nonlocal count
        count += node.get_parameter("step").value
        publisher.publish(Int64(data=count))

    def answer(request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success, response.message = request.data, f"count is {count}"
        return response

    node.create_timer(1.0, tick)
    node.create_service(SetBool, "ask", answer)
    spin(node, executor)


@pytest.mark.parametrize("executor", [SingleThreadedExecutor, EventsExecutor])
def test_a_talker_and_a_listener_meet(simulation: Simulation, executor: type) -> None:
    heard: list[int] = []
    answers: list[object] = []

    def listener() -> None:
        rclpy.init()
        node = rclpy.create_node("listener")
        node.create_subscription(Int64, "numbers", lambda message: heard.append(message.data), 10)
        ask = node.create_client(SetBool, "ask")
        change = node.create_client(SetParameters, "talker/set_parameters")

        def once() -> None:
            timer.cancel()
            ask.call_async(SetBool.Request(data=True)).add_done_callback(answered)

        def answered(future: rclpy.task.Future) -> None:
            answers.append(future.result().message)
            value = ParameterValue(type=ParameterType.PARAMETER_INTEGER, integer_value=10)
            request = SetParameters.Request(parameters=[Parameter(name="step", value=value)])
            change.call_async(request).add_done_callback(
                lambda done: answers.append(done.result().results[0].successful)
            )

        timer = node.create_timer(10.5, once)
        spin(node, executor)

    simulation.start(lambda: talker(executor), name="talker")
    simulation.start(listener)
    simulation.run(21.0)
    before = int(str(answers[0]).removeprefix("count is "))
    assert answers == [f"count is {before}", True]
    assert heard == [*range(heard[0], before + 1), *range(before + 10, heard[-1] + 1, 10)]
    assert len(heard) >= 19
