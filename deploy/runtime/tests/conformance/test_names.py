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

Validate = Callable[..., bool]
VALID = {
    validate_node_name: ["my_node", "_hidden", "Node1", "n" * 255],
    validate_namespace: ["/", "/my_ns", "/a/b/c"],
    validate_full_topic_name: ["/chatter", "/a/b_c/d1", "/_hidden", "/" + "t" * 246],
    validate_topic_name: [
        *("chatter", "{node}/chatter", "~/chatter", "~", "/chatter"),
        *("{ns}/x", "foo/{my_sub}", "a_{node}_b"),
    ],
}
# Each name, the reason of its error, and the index of the invalid character.
INVALID: dict[Validate, tuple[type[Exception], list[tuple[str, str, int]]]] = {
    validate_node_name: (
        InvalidNodeNameException,
        [
            ("", "must not be empty", 0),
            ("invalid_node?", "must not contain characters", 12),
            ("a/b", "must not contain characters", 1),
            ("naïve", "must not contain characters", 2),
            ("1node", "must not start with a number", 0),
            ("n" * 256, "should not exceed '255'", 254),
        ],
    ),
    validate_namespace: (
        InvalidNamespaceException,
        [
            ("", "must not be empty", 0),
            ("relative", "must be absolute", 0),
            ("/trailing/", "must not end with", 9),
            ("/invalid_ns?", "must not contain characters", 11),
            ("/a//b", "repeated", 3),
            ("/a/1b", "starts with a number", 3),
            ("/" + "n" * 245, "should not exceed", 244),
        ],
    ),
    validate_full_topic_name: (
        InvalidTopicNameException,
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
    ),
    validate_topic_name: (
        InvalidTopicNameException,
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
    ),
}


@pytest.mark.parametrize(("validate", "name"), [(of, name) for of, names in VALID.items() for name in names])
def test_valid_names(validate: Validate, name: str) -> None:
    assert validate(name) is True


@pytest.mark.parametrize(
    ("validate", "error", "name", "reason", "index"),
    [(of, error, *case) for of, (error, cases) in INVALID.items() for case in cases],
)
def test_errors_of_names_point_at_the_invalid_character(
    validate: Validate, error: type[Exception], name: str, reason: str, index: int
) -> None:
    with pytest.raises(error, match=reason) as caught:
        validate(name)
    _, quoted, caret = str(caught.value).splitlines()
    assert caret.index("^") - quoted.index("'") - 1 == index


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
