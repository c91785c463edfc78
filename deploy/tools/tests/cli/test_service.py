from __future__ import annotations

from typing import Any

import pytest
from rclpy.node import Node
from std_srvs.srv import Trigger


def test_list_shows_services_with_types(lab: Any, ros2: Any) -> None:
    names = ros2("service", "list", "--no-daemon").stdout.splitlines()
    assert names[-1] == "/arm/switch"
    assert names[0] == "/arm/lab/describe_parameters"
    assert ros2("service", "list", "-c", "--no-daemon").stdout == f"{len(names)}\n"
    typed = ros2("service", "list", "-t", "--no-daemon").stdout.splitlines()
    assert typed[-1] == "/arm/switch [std_srvs/srv/SetBool]"


def test_call_prints_request_and_response(lab: Any, ros2: Any) -> None:
    done = ros2("service", "call", "/arm/switch", "std_srvs/srv/SetBool", "{data: true}")
    waiting = "waiting for service to become available...\n"
    assert done.stdout.removeprefix(waiting) == (
        "requester: making request: std_srvs.srv.SetBool_Request(data=True)\n\n"
        "response:\nstd_srvs.srv.SetBool_Response(success=True, message='switched')\n\n"
    )
    assert done.returncode == 0


def test_call_waits_for_the_service(lab: Any, start: Any) -> None:
    process = start("service", "call", "/later", "std_srvs/Trigger")
    assert process.stdout.readline() == "waiting for service to become available...\n"
    node = Node("late", context=lab.context)
    lab.executor.add_node(node)
    node.create_service(Trigger, "/later", lambda request, response: response)
    assert process.stdout.readline() == "requester: making request: std_srvs.srv.Trigger_Request()\n"
    assert process.wait(30) == 0
    node.destroy_node()


@pytest.mark.own
def test_type_prints_the_type_or_only_ends_with_1(lab: Any, ros2: Any) -> None:
    assert ros2("service", "type", "/arm/switch").stdout == "std_srvs/srv/SetBool\n"
    done = ros2("service", "type", "/nothing")
    assert (done.stdout, done.stderr, done.returncode) == ("", "", 1)
