"""The parameters of a node: declaring, reading, setting, ranges, callbacks and descriptors."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest

import rclpy.node
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    ParameterEvent,
    ParameterValue,
    SetParametersResult,
)
from rclpy.exceptions import (
    InvalidParameterException,
    InvalidParameterTypeException,
    InvalidParameterValueException,
    ParameterAlreadyDeclaredException,
    ParameterImmutableException,
    ParameterNotDeclaredException,
    ParameterUninitializedException,
)
from rclpy.parameter import Parameter
from rclpy.signals import SignalHandlerOptions


@pytest.fixture(scope="module", autouse=True)
def default_context(module_domain_id: int) -> Iterator[None]:
    rclpy.init(args=[], domain_id=module_domain_id, signal_handler_options=SignalHandlerOptions.NO)
    yield
    while Node.made:
        Node.made.pop().destroy_node()
    rclpy.shutdown()


class Node(rclpy.node.Node):
    """A node that collects its parameter events; ``values`` leaves out the parameters that every node has."""

    made: list[Node] = []

    def __init__(self, overrides: dict[str, Any] | None = None, **options: Any) -> None:
        self.events: list[ParameterEvent] = []
        self.made.append(self)
        parameters = [Parameter(name, value=value) for name, value in (overrides or {}).items()]
        super().__init__("node", namespace="/ns", parameter_overrides=parameters, **options)
        self._initial_names = {*self.list_parameters([], 0).names} - (overrides or {}).keys()
        self.events.clear()

    def create_publisher(self, msg_type: Any, *arguments: Any, **options: Any) -> Any:
        if msg_type is ParameterEvent:
            return SimpleNamespace(publish=self.events.append)
        return super().create_publisher(msg_type, *arguments, **options)

    def values(self) -> dict[str, Any]:
        names = self.own(self.list_parameters([], 0).names)
        return {parameter.name: parameter.value for parameter in self.get_parameters(names)}

    def own(self, names: Iterable[str]) -> list[str]:
        return [name for name in names if name not in self._initial_names]


def changes(event: ParameterEvent) -> tuple[list[str], list[str], list[str]]:
    return (
        [parameter.name for parameter in event.new_parameters],
        [parameter.name for parameter in event.changed_parameters],
        [parameter.name for parameter in event.deleted_parameters],
    )


# Declaring


def test_a_declared_parameter_has_its_default_and_publishes_an_event() -> None:
    node = Node()
    parameter = node.declare_parameter("rate", 10)
    assert (parameter.name, parameter.value) == ("rate", 10)
    assert node.get_parameter("rate").value == 10
    assert node.has_parameter("rate")
    event = node.events[0]
    assert event.node == "/ns/node"
    assert changes(event) == (["rate"], [], [])
    assert event.stamp.sec > 0


def test_an_override_replaces_the_default() -> None:
    node = Node({"rate": 20, "unused": 1})
    assert node.declare_parameter("rate", 10).value == 20
    assert not node.has_parameter("unused")
    assert Node({"rate": 20}).declare_parameter("rate", 10, ignore_override=True).value == 10


def test_an_override_of_another_type_is_an_error_that_names_both_types() -> None:
    node = Node({"rate": 2})
    with pytest.raises(InvalidParameterTypeException, match="'2' of type 'INTEGER', expecting type 'DOUBLE'"):
        node.declare_parameter("rate", 1.0)
    assert not node.has_parameter("rate")
    assert node.events == []


def test_declare_parameters_prefixes_the_namespace() -> None:
    node = Node()
    declared = node.declare_parameters(
        "arm", [("l1", 1.0, ParameterDescriptor()), ("l2", Parameter.Type.DOUBLE), ("name", "left")]
    )
    assert [parameter.name for parameter in declared] == ["arm.l1", "arm.l2", "arm.name"]
    assert [parameter.value for parameter in declared] == [1.0, None, "left"]
    assert len(node.events) == 3


def test_declaring_a_parameter_twice_is_an_error_and_declares_nothing() -> None:
    node = Node()
    node.declare_parameter("a", 1)
    with pytest.raises(ParameterAlreadyDeclaredException, match="a"):
        node.declare_parameters("", [("b", 1), ("a", 1)])
    assert not node.has_parameter("b")


@pytest.mark.parametrize(
    ("declaration", "error"),
    [
        ((), TypeError),
        (("a", 1, ParameterDescriptor(), 1), TypeError),
        ((1, 1), TypeError),
        (("a", 1, "described"), TypeError),
        (("a", {}), TypeError),
        (("", 1), InvalidParameterException),
        (("a", Parameter.Type.NOT_SET), ValueError),
        (("a", Parameter.Type.BOOL, ParameterDescriptor(dynamic_typing=True)), ValueError),
        (("a", None, ParameterDescriptor()), ValueError),
    ],
)
def test_an_invalid_declaration_is_an_error(declaration: tuple[Any, ...], error: type[Exception]) -> None:
    with pytest.raises(error):
        cast(Any, Node()).declare_parameters("", [declaration])


def test_declaring_only_a_name_is_dynamic_and_deprecated() -> None:
    node = Node({"b": 5})
    with pytest.warns(UserWarning, match="named 'a'.*deprecated"):
        assert node.declare_parameter("a").value is None
    assert node.get_parameter("a").type_ is Parameter.Type.NOT_SET
    assert node.describe_parameter("a").dynamic_typing
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert node.declare_parameter("b").value == 5


def test_a_parameter_declared_by_its_type_has_no_value_until_it_is_set() -> None:
    node = Node()
    node.declare_parameter("a", Parameter.Type.INTEGER)
    with pytest.raises(ParameterUninitializedException, match="'a' is not initialized"):
        node.get_parameter("a")
    assert node.get_parameter_or("a", Parameter("a", value=3)).value == 3
    assert not node.set_parameters([Parameter("a", value="text")])[0].successful
    assert node.set_parameters([Parameter("a", value=7)])[0].successful
    assert node.get_parameter("a").value == 7
    assert changes(node.events[-1]) == (["a"], [], [])


def test_declaring_all_overrides_gives_each_its_own_type() -> None:
    node = Node({"a": 1, "b": "x"}, automatically_declare_parameters_from_overrides=True)
    assert node.values() == {"a": 1, "b": "x"}
    assert not node.set_parameters([Parameter("a", value="text")])[0].successful


# Undeclaring


def test_undeclaring_a_parameter_publishes_no_event() -> None:
    node = Node()
    node.declare_parameter("a", 1)
    node.events.clear()
    node.undeclare_parameter("a")
    assert not node.has_parameter("a")
    assert node.events == []
    with pytest.raises(ParameterNotDeclaredException, match="a"):
        node.undeclare_parameter("a")


def test_a_read_only_parameter_can_only_be_overridden() -> None:
    node = Node({"a": 2})
    node.declare_parameter("a", 1, ParameterDescriptor(read_only=True))
    assert node.get_parameter("a").value == 2
    result = node.set_parameters([Parameter("a", value=3)])[0]
    assert (result.successful, result.reason) == (False, "Trying to set a read-only parameter: a.")
    for change in (
        lambda: node.undeclare_parameter("a"),
        lambda: node.set_descriptor("a", ParameterDescriptor()),
    ):
        with pytest.raises(ParameterImmutableException, match="a"):
            change()


# Reading


def test_undeclared_parameters_are_an_error_unless_allowed() -> None:
    node = Node()
    for read in (
        node.get_parameter,
        node.get_parameter_type,
        node.describe_parameter,
        lambda name: node.get_parameters([name]),
        lambda name: node.set_parameters([Parameter(name, value=1)]),
        lambda name: node.set_descriptor(name, ParameterDescriptor()),
    ):
        with pytest.raises(ParameterNotDeclaredException):
            read("unknown")

    node = Node(allow_undeclared_parameters=True)
    assert node.get_parameter("unknown").type_ is Parameter.Type.NOT_SET
    assert node.get_parameter_type("unknown") == Parameter.Type.NOT_SET
    assert node.describe_parameter("unknown") == ParameterDescriptor()
    assert node.set_descriptor("unknown", ParameterDescriptor()) == ParameterValue()
    assert node.set_parameters([Parameter("unknown", value=1)])[0].successful
    assert node.set_parameters([Parameter("unknown", value="text")])[0].successful
    assert node.describe_parameter("unknown").dynamic_typing


def test_types_are_numbers_as_in_rclpy() -> None:
    node = Node()
    node.declare_parameter("a", 1)
    node.declare_parameter("b", ["x"])
    assert list[object](node.get_parameter_types(["a", "b"])) == [2, 9]


def test_names_must_be_strings() -> None:
    for read in (Node().get_parameters, Node().get_parameter_types):
        with pytest.raises(TypeError, match="instances of type str"):
            read([1])  # type: ignore[list-item]


def test_parameters_by_prefix_are_named_without_the_prefix() -> None:
    node = Node()
    for name in ("foo.ping", "foo.pong.x", "foobar", "bar.baz"):
        node.declare_parameter(name, name)
    found = node.get_parameters_by_prefix("foo")
    assert {name: parameter.value for name, parameter in found.items()} == {
        "ping": "foo.ping",
        "pong.x": "foo.pong.x",
    }
    assert len(node.own(node.get_parameters_by_prefix(""))) == 4
    assert node.get_parameters_by_prefix("fo") == {}


@pytest.mark.parametrize(
    ("prefixes", "depth", "names", "found"),
    [
        ([], 0, ["a", "b.c", "b.d.e", "bc"], ["b", "b.d"]),
        ([], 1, ["a", "bc"], []),
        ([], 2, ["a", "b.c", "bc"], ["b"]),
        (["b"], 0, ["b.c", "b.d.e"], ["b", "b.d"]),
        (["b"], 1, ["b.c"], ["b"]),
        (["a", "b.d"], 0, ["a", "b.d.e"], ["b.d"]),
        (["x"], 0, [], []),
    ],
)
def test_names_are_listed_by_prefix_and_depth(
    prefixes: list[str], depth: int, names: list[str], found: list[str]
) -> None:
    node = Node()
    for name in ("a", "b.c", "b.d.e", "bc"):
        node.declare_parameter(name, 1)
    result = node.list_parameters(prefixes, depth)
    assert (node.own(result.names), result.prefixes) == (names, found)


def test_listing_names_needs_a_list_of_prefixes_and_an_integer_depth() -> None:
    for prefixes, depth, error in [("b", 0, TypeError), ([1], 0, TypeError), ([], 1.0, TypeError)]:
        with pytest.raises(error):
            Node().list_parameters(prefixes, depth)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="greater than or equal to zero"):
        Node().list_parameters([], -1)


# Setting


def test_parameters_are_set_individually_or_atomically() -> None:
    node = Node()
    node.declare_parameters("", [("a", 1), ("b", 1)])
    node.events.clear()
    wrong = [Parameter("a", value=2), Parameter("b", value="text")]
    assert not node.set_parameters_atomically(wrong).successful
    assert node.values() == {"a": 1, "b": 1}
    assert [result.successful for result in node.set_parameters(wrong)] == [True, False]
    assert node.values() == {"a": 2, "b": 1}
    assert node.set_parameters_atomically([Parameter("a", value=3), Parameter("b", value=3)]).successful
    assert [changes(event) for event in node.events] == [([], ["a"], []), ([], ["a", "b"], [])]


def test_setting_needs_parameter_objects() -> None:
    with pytest.raises(TypeError, match="Parameter"):
        Node().set_parameters([("a", 1)])  # type: ignore[list-item]


def test_only_a_dynamic_parameter_may_change_its_type() -> None:
    node = Node()
    node.declare_parameter("fixed", 1)
    node.declare_parameter("free", 1, ParameterDescriptor(dynamic_typing=True))
    result = node.set_parameters([Parameter("fixed", value=1.0)])[0]
    assert result.reason == "Wrong parameter type, expected 'Type.INTEGER' got 'Type.DOUBLE'"
    assert node.set_parameters([Parameter("free", value="text")])[0].successful
    assert node.describe_parameter("free").type == Parameter.Type.STRING.value


def test_setting_a_dynamic_parameter_to_not_set_undeclares_it() -> None:
    node = Node()
    node.declare_parameter("fixed", 1)
    node.declare_parameter("free", 1, ParameterDescriptor(dynamic_typing=True))
    assert node.set_parameters([Parameter("free")])[0].successful
    assert not node.has_parameter("free")
    assert changes(node.events[-1]) == ([], [], ["free"])
    result = node.set_parameters([Parameter("fixed")])[0]
    assert result.reason == "Static parameter cannot be undeclared"


# Ranges


@pytest.mark.parametrize(
    ("value", "valid"),
    [(-10, True), (-8, True), (-7, False), (0, True), (9, True), (8, True), (10, False), (-11, False)],
)
def test_an_integer_must_lie_on_a_step_or_at_the_end_of_its_range(value: int, valid: bool) -> None:
    node, allowed = Node(), IntegerRange(from_value=-10, to_value=9, step=2)
    node.declare_parameter("a", 0, ParameterDescriptor(integer_range=[allowed]))
    assert node.set_parameters([Parameter("a", value=value)])[0].successful is valid


@pytest.mark.parametrize(
    ("value", "valid"),
    [
        (0.0, True),
        (0.5, True),
        (0.5000001, True),
        (0.51, False),
        (1.2, True),
        (1.20001, False),
        (-0.001, False),
        (float("nan"), False),
        (float("inf"), False),
    ],
)
def test_a_double_must_lie_near_a_step_or_the_end_of_its_range(value: float, valid: bool) -> None:
    node, allowed = Node(), FloatingPointRange(from_value=0.0, to_value=1.2, step=0.5)
    node.declare_parameter("a", 1.0, ParameterDescriptor(floating_point_range=[allowed]))
    assert node.set_parameters([Parameter("a", value=value)])[0].successful is valid


def test_a_range_may_be_reversed_and_have_no_step() -> None:
    node, allowed = Node(), FloatingPointRange(from_value=1.0, to_value=-1.0)
    node.declare_parameter("a", 0.123, ParameterDescriptor(floating_point_range=[allowed]))
    result = node.set_parameters([Parameter("a", value=1.5)])[0]
    assert result.reason == "Parameter a out of range Min: -1.0, Max: 1.0, value: 1.5"


def test_a_default_or_override_out_of_range_is_an_error() -> None:
    descriptor = ParameterDescriptor(integer_range=[IntegerRange(from_value=0, to_value=5)])
    for node, default in ((Node(), 6), (Node({"a": 6}), 1)):
        with pytest.raises(InvalidParameterValueException, match="out of range"):
            node.declare_parameter("a", default, descriptor)
        assert not node.has_parameter("a")


def test_a_range_of_another_type_is_ignored() -> None:
    descriptor = ParameterDescriptor(integer_range=[IntegerRange(from_value=0, to_value=5)])
    assert Node().declare_parameter("a", 100.0, descriptor).value == 100.0


# Callbacks


def accept(parameters: list[Parameter]) -> SetParametersResult:
    return SetParametersResult(successful=True)


def test_a_rejecting_callback_keeps_all_parameters() -> None:
    node = Node()
    node.declare_parameter("a", 1)
    node.events.clear()

    def reject(parameters: list[Parameter]) -> SetParametersResult:
        return SetParametersResult(successful=False, reason=f"no {parameters[0].value}")

    node.add_on_set_parameters_callback(reject)
    assert node.set_parameters([Parameter("a", value=2)])[0].reason == "no 2"
    with pytest.raises(InvalidParameterValueException, match="Reason: no 5"):
        node.declare_parameter("b", 5)
    assert node.values() == {"a": 1}
    assert node.events == []
    node.remove_on_set_parameters_callback(reject)
    assert node.set_parameters([Parameter("a", value=2)])[0].successful


def test_on_set_callbacks_run_before_and_post_set_after_newest_first() -> None:
    node, calls = Node(), []
    node.declare_parameter("a", 1)

    def on_set(name: str) -> Any:
        def callback(parameters: list[Parameter]) -> SetParametersResult:
            calls.append((name, node.get_parameter("a").value))
            return SetParametersResult(successful=True)

        return callback

    def post_set(name: str) -> Any:
        return lambda parameters: calls.append((name, node.get_parameter("a").value))

    for name in ("on 1", "on 2"):
        node.add_on_set_parameters_callback(on_set(name))
    for name in ("post 1", "post 2"):
        node.add_post_set_parameters_callback(post_set(name))
    node.set_parameters([Parameter("a", value=2)])
    assert calls == [("on 2", 1), ("on 1", 1), ("post 2", 2), ("post 1", 2)]


def test_a_pre_set_callback_replaces_the_parameters() -> None:
    node = Node()
    node.declare_parameters("", [("l1", 1.0), ("l2", 1.0)])

    def both(parameters: list[Parameter]) -> list[Parameter]:
        return [Parameter(name, value=parameters[0].value) for name in ("l1", "l2")]

    node.add_pre_set_parameters_callback(both)
    node.set_parameters([Parameter("l1", value=2.0)])
    assert node.values() == {"l1": 2.0, "l2": 2.0}
    node.declare_parameter("l3", 3.0)
    assert node.values() == {"l1": 2.0, "l2": 2.0, "l3": 3.0}
    node.remove_pre_set_parameters_callback(both)

    node.add_pre_set_parameters_callback(lambda parameters: [])
    assert "cannot be empty" in node.set_parameters([Parameter("l1", value=1.0)])[0].reason


def test_a_callback_may_remove_itself_but_unknown_ones_are_an_error() -> None:
    node, calls = Node(), []

    def once(parameters: list[Parameter]) -> None:
        calls.append(parameters[0].value)
        node.remove_post_set_parameters_callback(once)

    node.add_post_set_parameters_callback(once)
    node.declare_parameter("a", 1)
    node.declare_parameter("b", 2)
    assert calls == [1]
    for remove in (node.remove_on_set_parameters_callback, node.remove_post_set_parameters_callback):
        with pytest.raises(ValueError, match="not in list"):
            cast(Any, remove)(accept)


# Descriptors


def test_a_new_descriptor_keeps_the_value_or_uses_the_alternative() -> None:
    node = Node()
    node.declare_parameter("a", 5)
    fits = ParameterDescriptor(type=2, integer_range=[IntegerRange(from_value=0, to_value=10)])
    assert node.set_descriptor("a", fits) == ParameterValue(type=2, integer_value=5)
    assert node.describe_parameter("a").integer_range[0].to_value == 10

    small = ParameterDescriptor(type=2, integer_range=[IntegerRange(from_value=0, to_value=3)])
    with pytest.raises(InvalidParameterValueException, match="out of range"):
        node.set_descriptor("a", small)
    with pytest.raises(InvalidParameterValueException, match="value: 7"):
        node.set_descriptor("a", small, ParameterValue(type=2, integer_value=7))
    assert node.describe_parameter("a").integer_range[0].to_value == 10
    alternative = ParameterValue(type=2, integer_value=3)
    assert node.set_descriptor("a", small, alternative) == alternative
    assert node.get_parameter("a").value == 3
