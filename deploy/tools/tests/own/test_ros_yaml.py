"""YAML is read and written by the rules of ROS 2's own parser, and a hostile file costs nothing."""

from __future__ import annotations

import string
import tempfile
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st
from rclpy.context import Context
from rclpy.node import Node
from rclpy.parameter import PARAMETER_SEPARATOR_STRING

import ros_yaml

NODE = "/reader"
OWN = ("use_sim_time", "start_type_description_service")


def read_by_rcl(text: str) -> dict[str, Any]:
    """Return the parameters of a node that starts with a parameter file."""
    with tempfile.NamedTemporaryFile("w", suffix=".yaml", encoding="utf-8") as file:
        file.write(text)
        file.flush()
        context = Context()
        context.init(["--ros-args", "--params-file", file.name])
    try:
        node = Node(
            NODE[1:],
            context=context,
            start_parameter_services=False,
            enable_rosout=False,
            automatically_declare_parameters_from_overrides=True,
        )
        found = node.get_parameters_by_prefix("")
        node.destroy_node()
    finally:
        context.shutdown()
    return {name: each.value for name, each in found.items() if name not in OWN}


def flat(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in tree.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{name}{PARAMETER_SEPARATOR_STRING}")
        else:
            yield f"{prefix}{name}", value


def exact(parameters: Mapping[str, Any]) -> str:
    """Return a text in which equal types and values are equal, NaN and the sign of zero included."""
    return repr(
        {
            name: (
                list if isinstance(value, list | tuple) or hasattr(value, "tolist") else type(value),
                [*value] if not isinstance(value, str) and hasattr(value, "__iter__") else value,
            )
            for name, value in sorted(parameters.items())
        }
    )


DIALECTS = [
    *("y", "n", "N", "on", "No", "~", "null", "", "inf", "nan", ".inf", "+.nan", "1:30", "2024-01-01"),
    *("1e5", ".5e3", "0o17", "010", "08", "1_000", "0x1F", "0b11", "1e400", "5e-324"),
    *("=", "<<", "- a", "a: b", "#", "'", '"', "!x", "*a", "&a", "@", "`", "%", "? ", "---", "..."),
    *("a\nb", "\ta ", "\x1b", "\u2028", "\ufeff", "é", "😀"),
]
TEXTS = st.sampled_from(DIALECTS) | st.text(
    st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20
)
INTEGERS = st.integers(-(2**63), 2**63 - 1)
SCALARS = (st.booleans(), INTEGERS, st.floats(), TEXTS)
VALUES = st.one_of(*SCALARS, *(st.lists(each, min_size=1, max_size=4) for each in SCALARS))
NAMES = st.sampled_from(["y", "1e5", "inf", "on", "0", "~", "a b", "ros", "é"]) | st.text(
    string.ascii_letters + string.digits + "_-/: ", min_size=1, max_size=200
).filter(lambda name: not name.startswith("ros__parameters"))
TREES = st.dictionaries(NAMES, VALUES | st.dictionaries(NAMES, VALUES, min_size=1, max_size=2), max_size=4)


@settings(max_examples=60)
@given(TREES)
@example({"tiny": [5e-324, 2.3e-310, -1e-320], "least": 2.2250738585072014e-308, "zero": -0.0})
@example({name: name for name in DIALECTS if name})
def test_what_is_written_is_read_as_the_same_by_rcl_pyyaml_and_us(tree: dict[str, Any]) -> None:
    document = {NODE: {"ros__parameters": tree}}
    text = ros_yaml.dump(document)
    written = exact(dict(flat(tree)))
    assert exact(read_by_rcl(text)) == written
    for read in (ros_yaml.load, yaml.safe_load):
        assert exact(dict(flat(read(text)[NODE]["ros__parameters"]))) == written


PLAIN = [
    *("y", "N", "on", "No", "OFF", "True", "~", "null", "=", "<<", "é", "1 2", "2024-01-01", "1:30"),
    99 * "1:" + "1",
    *("1e5", "1E+2", ".5e3", "5.", ".5", "1e", ".", ".e1", "1.2.3", "1e400", "1e-400", "5e-324", "0x1.8p1"),
    *("inf", "Inf", "-Infinity", "nan", ".inf", "-.INF", "+.nan", ".NaN"),
    *("0o17", "010", "08", "1_000", "0b11"),
    *("0x", "0x1F", "-0x10", "0xffffffffffffffff", "0x" + 2000 * "f", "+", "+5", "-0", 400 * "1"),
    *("9223372036854775807", "9223372036854775808", "-9223372036854775808", "-9223372036854775809"),
]


@pytest.mark.parametrize("text", PLAIN, ids=lambda text: text[:20])
def test_a_scalar_without_quotes_is_what_rcl_takes_it_for(text: str) -> None:
    read = read_by_rcl(f"{NODE}:\n  ros__parameters:\n    x: {text}")
    assert exact({"x": ros_yaml.load(text)}) == exact(read)


@settings(max_examples=40)
@given(st.lists(st.from_regex(r"[+-]?(0x)?[0-9.]{1,4}([eE][+-]?[0-9]{1,3})?", fullmatch=True), max_size=30))
def test_text_that_looks_like_a_number_is_what_rcl_takes_it_for(texts: list[str]) -> None:
    named = {f"p{number}": text for number, text in enumerate(texts)}
    parameters = "\n".join(f"    {name}: {text}" for name, text in named.items())
    ours = {"p": 0} | {name: ros_yaml.load(text) for name, text in named.items()}
    assert exact(ours) == exact(read_by_rcl(f"{NODE}:\n  ros__parameters:\n    p: 0\n{parameters}"))


@pytest.mark.parametrize(
    ("text", "content"),
    [
        ("", None),
        ("# nothing", None),
        ("x: !meters 3.0", {"x": 3.0}),
        ("x: !!str 3.0", {"x": "3.0"}),
        ("x: !!python/object:os.system ls", {"x": "ls"}),
        ("x: |-\n  5", {"x": 5}),
        ("x: '5'", {"x": "5"}),
        ("x: &a 5", {"x": 5}),
        ("on: [y, 010]", {"on": [True, 8]}),
        ("1: {2.50: 3}", {"1": {"2.50": 3}}),
        ("<<: {a: 1}", {"<<": {"a": 1}}),
        ("x:", {"x": None}),
    ],
)
def test_empty_tagged_and_odd_texts(text: str, content: object) -> None:
    assert ros_yaml.load(text) == content


ALIASES = "[&a0 [x,x,x], " + ", ".join(f"&a{i} [{','.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10)) + "]"
MERGES = "x: &x0 {a: 1}\n" + "".join(f"y{i}: &x{i} {{<<: [*x{i - 1}, *x{i - 1}]}}\n" for i in range(1, 9))


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    ("text", "reason"),
    [
        (ALIASES, "line 1, column 20: the alias 'a0' is refused: write its content again"),
        (MERGES, "line 2, column 15: the alias 'x0' is refused: write its content again"),
        ("a: &a [*a]", "line 1, column 8: the alias 'a' is refused: write its content again"),
        ("a:\n  - " + 5000 * "[", "line 2, column 35: is nested more than 32 levels deep"),
        ("{a: " * 5000, "line 1, column 129: is nested more than 32 levels deep"),
        ("x: " + ros_yaml.MOST_OCTETS * "1", "is larger than 1048576 octets"),
        (b"a: 1\nb: \xff", "line 2: octet 0xff is no UTF-8"),
        ("a: \x07", "line 1: control characters are not allowed"),
        ('a: "b\\0"', "line 1, column 4: a string must not contain a NUL"),
        ("a: 1\na: 2", "line 2, column 1: the key 'a' appears twice"),
        ('"\\e[2J": 1\n"\\e[2J": 2', "line 2, column 1: the key '\\x1b[2J' appears twice"),
        ("? [a, b]\n: 1", "line 1, column 3: a key must be a word"),
        ("? \n: 1", "line 1, column 2: a key must be a word"),
        ("a: [1", "line 2, column 1: while parsing a flow sequence, did not find expected ',' or ']'"),
        ("a: 1\n---\nb: 2", "line 2, column 1: a second document begins"),
        ("a: !x!y 1", "line 1, column 4: while parsing a node, found undefined tag handle"),
    ],
    ids=lambda text: str(text)[:20],
)
def test_what_is_refused_is_one_line_with_its_position(text: str | bytes, reason: str) -> None:
    with pytest.raises(ros_yaml.YamlError) as raised:
        ros_yaml.load(text)
    assert str(raised.value) == reason


@pytest.mark.timeout(20)
@pytest.mark.parametrize(
    "text", ["[" + 260000 * "1, " + "1]", "\n".join(f"k{i}: 1" for i in range(80000))], ids=["list", "keys"]
)
def test_a_file_of_the_greatest_size_is_read_in_seconds(text: str) -> None:
    assert len(ros_yaml.load(text)) > 1000


def test_an_endless_file_is_refused() -> None:
    with pytest.raises(ros_yaml.YamlError, match="larger"):
        ros_yaml.read(Path("/dev/zero"))


@pytest.mark.parametrize("value", [None, 2**63, -(2**63) - 1, "a\0", "\udce9", {"a": [None]}])
def test_what_no_parameter_can_be_is_not_written(value: object) -> None:
    with pytest.raises(ros_yaml.YamlError, match="cannot be written: "):
        ros_yaml.dump({"x": value})


def test_a_value_in_two_places_is_written_twice() -> None:
    shared = {"a": [1.0]}
    assert ros_yaml.load(ros_yaml.dump({"x": shared, "y": shared})) == {"x": shared, "y": shared}
