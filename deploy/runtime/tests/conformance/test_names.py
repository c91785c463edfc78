"""Names of nodes, namespaces, topics and services: validation and expansion."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from rclpy.exceptions import (
    InvalidNamespaceException,
    InvalidNodeNameException,
    InvalidServiceNameException,
    InvalidTopicNameException,
)
from rclpy.expand_topic_name import expand_topic_name
from rclpy.validate_full_topic_name import validate_full_topic_name
from rclpy.validate_namespace import validate_namespace
from rclpy.validate_node_name import validate_node_name
from rclpy.validate_topic_name import validate_topic_name


def caret_index(error: BaseException) -> int:
    """Return the index that the caret in an error's message points at."""
    lines = str(error).splitlines()
    return lines[2].index("^") - lines[1].index("'") - 1


@pytest.mark.parametrize("name", ["my_node", "_hidden", "Node1", "n" * 255])
def test_valid_node_names(name: str) -> None:
    assert validate_node_name(name) is True


@pytest.mark.parametrize(
    ("name", "reason", "index"),
    [
        ("", "must not be empty", 0),
        ("invalid_node?", "must not contain characters", 12),
        ("a/b", "must not contain characters", 1),
        ("naïve", "must not contain characters", 2),
        ("1node", "must not start with a number", 0),
        ("n" * 256, "should not exceed '255'", 254),
    ],
)
def test_errors_of_node_names_point_at_the_invalid_character(name: str, reason: str, index: int) -> None:
    with pytest.raises(InvalidNodeNameException, match=reason) as caught:
        validate_node_name(name)
    assert caret_index(caught.value) == index


@pytest.mark.parametrize("namespace", ["/", "/my_ns", "/a/b/c"])
def test_valid_namespaces(namespace: str) -> None:
    assert validate_namespace(namespace) is True


@pytest.mark.parametrize(
    ("namespace", "reason", "index"),
    [
        ("", "must not be empty", 0),
        ("relative", "must be absolute", 0),
        ("/trailing/", "must not end with", 9),
        ("/invalid_ns?", "must not contain characters", 11),
        ("/a//b", "repeated", 3),
        ("/a/1b", "starts with a number", 3),
        ("/" + "n" * 245, "should not exceed", 244),
    ],
)
def test_errors_of_namespaces_point_at_the_invalid_character(namespace: str, reason: str, index: int) -> None:
    with pytest.raises(InvalidNamespaceException, match=reason) as caught:
        validate_namespace(namespace)
    assert caret_index(caught.value) == index


@pytest.mark.parametrize("name", ["/chatter", "/a/b_c/d1", "/_hidden", "/" + "t" * 246])
def test_valid_full_topic_names(name: str) -> None:
    assert validate_full_topic_name(name) is True


@pytest.mark.parametrize(
    ("name", "reason", "index"),
    [
        ("", "must not be empty", 0),
        ("chatter", "must be absolute", 0),
        ("/", "must not end with", 0),
        ("/invalid_topic?", "must not contain characters", 14),
        ("/a/{node}", "must not contain characters", 3),
        ("/a//b", "repeated", 3),
        ("/a/1b", "starts with a number", 3),
        ("/" + "t" * 247, "should not exceed", 246),
    ],
)
def test_errors_of_full_topic_names_point_at_the_invalid_character(
    name: str, reason: str, index: int
) -> None:
    with pytest.raises(InvalidTopicNameException, match=reason) as caught:
        validate_full_topic_name(name)
    assert caret_index(caught.value) == index


@pytest.mark.parametrize(
    "name",
    ["chatter", "{node}/chatter", "~/chatter", "~", "/chatter", "{ns}/x", "foo/{my_sub}", "a_{node}_b"],
)
def test_valid_topic_names_before_expansion(name: str) -> None:
    assert validate_topic_name(name) is True


@pytest.mark.parametrize(
    ("name", "reason", "index"),
    [
        ("", "must not be empty", 0),
        ("/", "must not end with", 0),
        ("foo/", "must not end with", 3),
        ("7foo", "must not start with a number", 0),
        ("foo/7bar", "must not start with a number", 4),
        ("foo?", "must not contain characters", 3),
        ("foo/~", "tilde '~' unless", 4),
        ("~foo", "not followed by a forward slash", 1),
        ("foo/{bar", "unmatched", 4),
        ("foo/bar}", "unmatched", 7),
        ("foo/{bar/baz}", "substitution name must not contain", 8),
        ("foo/{{bar}_baz}", "substitution name must not contain", 5),
        ("foo/{4bar}", "substitution name must not start", 5),
    ],
)
def test_errors_of_topic_names_point_at_the_invalid_character(name: str, reason: str, index: int) -> None:
    with pytest.raises(InvalidTopicNameException, match=reason) as caught:
        validate_topic_name(name)
    assert caret_index(caught.value) == index


@pytest.mark.parametrize("validate", [validate_topic_name, validate_full_topic_name])
def test_invalid_service_names_have_their_own_error(validate: Callable[..., bool]) -> None:
    with pytest.raises(InvalidServiceNameException, match="Invalid service name"):
        validate("/bad?", is_service=True)


@pytest.mark.parametrize(
    ("name", "namespace", "expanded"),
    [
        ("chatter", "/ns", "/ns/chatter"),
        ("chatter", "/", "/chatter"),
        ("/chatter", "/ns", "/chatter"),
        ("~/chatter", "/ns", "/ns/node/chatter"),
        ("~", "/ns", "/ns/node"),
        ("~/chatter", "/", "/node/chatter"),
        ("{node}/chatter", "/ns", "/ns/node/chatter"),
        ("{ns}/chatter", "/ns", "/ns/chatter"),
        ("/other/{node}{node}", "/ns", "/other/nodenode"),
        ("{namespace}/{node}/x", "/a/b", "/a/b/node/x"),
    ],
)
def test_a_name_expands_relative_to_its_node(name: str, namespace: str, expanded: str) -> None:
    assert expand_topic_name(name, "node", namespace) == expanded


@pytest.mark.parametrize(
    ("name", "node", "namespace", "reason"),
    [
        ("chatter?", "node", "/ns", "topic name 'chatter\\?' is invalid"),
        ("chatter", "node?", "/ns", "node name 'node\\?' is invalid"),
        ("chatter", "node", "ns", "node namespace 'ns' is invalid"),
        ("{unknown}", "node", "/ns", "unknown substitution: {unknown}"),
    ],
)
def test_invalid_names_and_substitutions_do_not_expand(
    name: str, node: str, namespace: str, reason: str
) -> None:
    with pytest.raises(ValueError, match=reason):
        expand_topic_name(name, node, namespace)
