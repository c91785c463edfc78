from __future__ import annotations

from typing import Any

from rclpy.node import Node

INFO = """\
/arm/lab
  Subscribers:
    /arm/speed: std_msgs/msg/Float64
  Publishers:
    /arm/chatter: std_msgs/msg/String
    /arm/point: geometry_msgs/msg/PointStamped
    /parameter_events: rcl_interfaces/msg/ParameterEvent
    /rosout: rcl_interfaces/msg/Log
  Service Servers:
    /arm/lab/describe_parameters: rcl_interfaces/srv/DescribeParameters
    /arm/lab/get_parameter_types: rcl_interfaces/srv/GetParameterTypes
    /arm/lab/get_parameters: rcl_interfaces/srv/GetParameters
    /arm/lab/get_type_description: type_description_interfaces/srv/GetTypeDescription
    /arm/lab/list_parameters: rcl_interfaces/srv/ListParameters
    /arm/lab/set_parameters: rcl_interfaces/srv/SetParameters
    /arm/lab/set_parameters_atomically: rcl_interfaces/srv/SetParametersAtomically
    /arm/switch: std_srvs/srv/SetBool
  Service Clients:

  Action Servers:

  Action Clients:

"""


def test_list_hides_hidden_nodes_and_counts(lab: Any, ros2: Any) -> None:
    hidden = Node("_hidden", context=lab.context)
    try:
        assert ros2("node", "list", "--no-daemon").stdout == "/arm/lab\n"
        assert "/_hidden\n" in ros2("node", "list", "-a", "--no-daemon").stdout
        assert ros2("node", "list", "-c", "--no-daemon").stdout == "1\n"
    finally:
        hidden.destroy_node()


def test_info_shows_everything_that_a_node_has(lab: Any, ros2: Any) -> None:
    done = ros2("node", "info", "/arm/lab", "--no-daemon")
    assert done.stdout == INFO
    assert (done.stderr, done.returncode) == ("", 0)
    hidden = "    /arm/_hidden: std_msgs/msg/Float64\n"
    assert hidden in ros2("node", "info", "/arm/lab", "--include-hidden", "--no-daemon").stdout


def test_nodes_with_the_same_name_are_a_warning(lab: Any, ros2: Any) -> None:
    twin = Node("lab", namespace="/arm", context=lab.context)
    try:
        listed = ros2("node", "list", "--no-daemon")
        described = ros2("node", "info", "/arm/lab", "--no-daemon")
    finally:
        twin.destroy_node()
    assert listed.stdout == "/arm/lab\n/arm/lab\n"
    assert listed.stderr == (
        "WARNING: Be aware that there are nodes in the graph that share an exact name,"
        " which can have unintended side effects.\n"
    )
    assert described.stderr == (
        'There are 2 nodes in the graph with the exact name "/arm/lab".'
        " You are seeing information about only one of them.\n"
    )
