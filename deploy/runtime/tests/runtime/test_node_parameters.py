"""Parameters of a node where rclpy changes its arguments, accepts less or reports less."""

from __future__ import annotations

import pytest
from deploy.runtime.tests.nodes import MakeNode

from rcl_interfaces.msg import ParameterDescriptor, ParameterValue
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter


def test_a_default_may_be_a_parameter_value_message(make_node: MakeNode) -> None:
    assert make_node().declare_parameter("a", ParameterValue(type=2, integer_value=3)).value == 3


def test_a_shared_descriptor_is_not_changed(make_node: MakeNode) -> None:
    node, shared = make_node(), ParameterDescriptor(description="a length [m]")
    node.declare_parameter("l1", 1.0, shared)
    node.declare_parameter("l2", 2, shared)
    assert shared == ParameterDescriptor(description="a length [m]")
    described = node.describe_parameters(["l1", "l2"])
    assert [(d.name, d.type, d.description) for d in described] == [
        ("l1", Parameter.Type.DOUBLE.value, "a length [m]"),
        ("l2", Parameter.Type.INTEGER.value, "a length [m]"),
    ]


def test_an_error_names_all_undeclared_parameters(make_node: MakeNode) -> None:
    node = make_node()
    node.declare_parameter("a", 1)
    with pytest.raises(ParameterNotDeclaredException, match=r"\['b', 'c'\]"):
        node.set_parameters_atomically([Parameter(name, value=2) for name in "abc"])
    assert node.get_parameter("a").value == 1


def test_the_deprecation_warning_names_the_file_of_the_caller(
    make_node: MakeNode,
) -> None:
    node = make_node()
    with pytest.warns(UserWarning, match="named 'a'.*deprecated") as caught:
        node.declare_parameter("a")
    assert caught[0].filename == __file__


def test_an_error_names_the_undeclared_parameter(make_node: MakeNode) -> None:
    node = make_node()
    for read in (node.get_parameter, node.get_parameter_type, lambda name: node.get_parameters([name])):
        with pytest.raises(ParameterNotDeclaredException, match="unknown"):
            read("unknown")
