"""Definition files: those of this distribution against rosbags, and packages of users."""

from __future__ import annotations

import copy
import importlib
import itertools
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

import rosidl_runtime_embedded
from rosidl_runtime_embedded import InvalidDefinition, action_class, message_class, service_class, stubs
from rosidl_runtime_embedded.definition import FieldType
from rosidl_runtime_embedded.definition_files import message_definition
from rosidl_runtime_embedded.type_description import type_description

SOURCE = Path(rosidl_runtime_embedded.__file__).parents[1]
STORE = get_typestore(Stores.ROS2_JAZZY)
MESSAGES = sorted(name for name in STORE.fielddefs if not name.startswith("rosbag2_interfaces/"))
# rosbags hashes a char as char; rosidl converts it to uint8 first, as the recorded announcements show
WITH_CHAR = {
    "std_msgs/msg/Char",
    "service_msgs/msg/ServiceEventInfo",
    *(f"rmw_dds_common/msg/{name}" for name in ("Gid", "NodeEntitiesInfo", "ParticipantEntitiesInfo")),
}


@pytest.mark.parametrize("name", MESSAGES)
def test_hash_and_constants_are_those_of_rosbags(name: str) -> None:
    idl_names = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float", "float64": "double"}
    constants = [
        (name, idl_names.get(type_, type_), value) for name, type_, value in STORE.fielddefs[name][0]
    ]
    assert list(message_definition(name).constants) == constants
    if name not in WITH_CHAR:
        assert STORE.hash_rihs01(name) == message_class(name)._TYPE_HASH


_numbers = itertools.count()
Define = Callable[..., str]


@pytest.fixture
def define(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Define]:
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    packages = []

    def define(files: dict[str, str]) -> str:
        # a unique name for each package, because imports and definitions are cached
        package = f"user_msgs{next(_numbers)}"
        packages.append(package)
        for name, text in files.items():
            path = tmp_path / "share" / package / name.rpartition(".")[2] / name
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text.replace("PACKAGE", package), encoding="utf-8")
        return package

    yield define
    for name in [name for name in sys.modules if name.partition(".")[0] in packages]:
        del sys.modules[name]


def load(package: str, name: str, kind: str = "msg") -> Any:
    return getattr(importlib.import_module(f"{package}.{kind}"), name)


JOINT = """# a joint
uint8 REVOLUTE=0
uint8 PRISMATIC = 0x1  # of a gantry
string name
float64 angle 0.5
"""
ARM = """std_msgs/Header header
Joint[] joints
PACKAGE/Joint[2] ends
geometry_msgs/Point\tbase
"""
MOVE = """Joint[<=3] joints
---
bool success true
string message
"""


def test_a_users_package_is_imported_without_a_build_step(define: Define) -> None:
    package = define({"Joint.msg": JOINT, "Arm.msg": ARM, "Move.srv": MOVE})
    joint, arm, move = load(package, "Joint"), load(package, "Arm"), load(package, "Move", "srv")
    assert (joint.REVOLUTE, joint.PRISMATIC, joint().angle, joint.ANGLE__DEFAULT) == (0, 1, 0.5, 0.5)
    assert repr(joint(name="elbow")) == f"{package}.msg.Joint(name='elbow', angle=0.5)"
    message = arm(joints=[joint(name="elbow", angle=1.0)])
    assert message.ends == [joint(), joint()]
    assert message.ends[0] is not message.ends[1]
    assert arm._deserialize(arm._serialize(message)) == message
    assert f"{package}::msg::dds_::Arm_" == arm._DDS_TYPE_NAME
    assert arm.get_fields_and_field_types()["ends"] == f"{package}/Joint[2]"
    assert move.Response().success is True
    with pytest.raises(ValueError, match="4 elements"):
        move.Request._serialize(move.Request(joints=[joint()] * 4))
    assert dir(importlib.import_module(f"{package}.msg")) == ["Arm", "Joint"]


def test_a_users_package_has_its_modules_without_their_import(define: Define) -> None:
    package = importlib.import_module(define({"Joint.msg": JOINT}))
    assert package.msg.Joint().angle == 0.5
    assert not hasattr(package, "srv")


def test_the_first_import_of_a_process_finds_a_users_package(define: Define) -> None:
    package = define({"Joint.msg": JOINT})
    # as site does with the .pth file of an installed distribution
    code = f"import site; site.addsitedir({str(SOURCE)!r}); from {package}.msg import Joint; print(Joint())"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == f"{package}.msg.Joint(name='', angle=0.5)\n"


def test_a_users_package_wins_over_a_plain_directory(
    define: Define, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = define({"Joint.msg": JOINT})
    (tmp_path / "src" / package / "msg").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "src")
    code = f"from {package}.msg import Joint; print(Joint())"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == f"{package}.msg.Joint(name='', angle=0.5)\n"


def test_a_users_package_yields_to_an_ordinary_python_module(
    define: Define, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, module = define({"Joint.msg": JOINT}), define({"Joint.msg": JOINT})
    (tmp_path / "src" / package).mkdir(parents=True)
    (tmp_path / "src" / package / "__init__.py").write_text("msg = 'module'\n")
    (tmp_path / "src" / f"{module}.py").write_text("msg = 'module'\n")
    monkeypatch.syspath_prepend(tmp_path / "src")
    assert importlib.import_module(package).msg == "module"
    assert importlib.import_module(module).msg == "module"


def test_a_package_that_ros_2_has_built_keeps_its_own_classes(
    define: Define, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = define({"Joint.msg": "string name"})
    built = tmp_path / "python" / package / "msg"
    built.mkdir(parents=True)
    (built.parent / "__init__.py").touch()
    (built / "__init__.py").write_text(f"from {package}.msg._joint import Joint")
    (built / "_joint.py").write_text("class Joint: built = True")
    monkeypatch.syspath_prepend(tmp_path / "python")
    assert load(package, "Joint").built


def test_every_kind_of_type_is_supported(define: Define) -> None:
    package = define(
        {
            "All.msg": """
            bool[] flags [true, False, 1]
            byte[2] octets [1, 255]
            char letter 97
            int8 small -0x80
            uint64 great 18446744073709551615
            float32[<=3] few [0.5, -1, 1e3]
            float64[2] pair [1, 2]
            string text "it's me"  # it is
            string<=5 short 'a b'
            string[] words ["a, b", 'c', d]
            wstring wide
            wstring<=3 bounded 'abc'
            string LABEL= some words
            byte MASK=0x0f
            float32 HALF=.5
            bool YES=true
            string QUOTED="it's"
            """
        }
    )
    cls = load(package, "All")
    assert cls.get_fields_and_field_types() == {
        "flags": "sequence<boolean>",
        "octets": "octet[2]",
        "letter": "uint8",
        "small": "int8",
        "great": "uint64",
        "few": "sequence<float, 3>",
        "pair": "double[2]",
        "text": "string",
        "short": "string<5>",
        "words": "sequence<string>",
        "wide": "wstring",
        "bounded": "wstring<3>",
    }
    message = cls()
    assert (message.flags, message.octets, message.letter) == ([True, False, True], [b"\1", b"\xff"], 97)
    assert (message.small, message.great, message.few.tolist()) == (-128, (1 << 64) - 1, [0.5, -1.0, 1000.0])
    assert (message.pair.tolist(), message.text, message.short) == ([1.0, 2.0], "it's me", "a b")
    assert (message.words, message.wide, message.bounded) == (["a, b", "c", "d"], "", "abc")
    assert (cls.LABEL, cls.MASK, cls.HALF, cls.YES, cls.QUOTED) == ("some words", b"\x0f", 0.5, True, "it's")
    assert cls._deserialize(cls._serialize(message)) == message
    message.words.append("e")
    assert cls().words == ["a, b", "c", "d"]
    message.few = [1.0] * 3
    for field, value in {
        "few": [1.0] * 4,
        "short": "123456",
        "bounded": "abcd",
        "flags": [1],
        "octets": [b"a"],
    }.items():
        with pytest.raises((TypeError, ValueError), match=f"{package}/msg/All: field '{field}"):
            cls._serialize(cls(**{field: value}))


@pytest.mark.parametrize(
    ("text", "value", "element"),
    [
        (r"\t", "\t", "\t"),
        (r"\x41\101\u0041", "AAA", "AAA"),
        (r"C:\\dir", r"C:\dir", r"C:\dir"),
        (r"a\\\\b", r"a\b", r"a\\b"),
        (r"\q\?", r"\q\?", r"\q\?"),
        (r"\\t", "\t", r"\t"),
        (r"\\\\t", r"\t", r"\\t"),
        (r"\\x41\\101\\u0041", r"AA\u0041", r"\x41\101\u0041"),
        (r"\\\\\\x41", r"\A", r"\\\x41"),
        (r"it\'s", "it's", "it's"),
        ("ż\\t", "ż\t", "ż\t"),
        (r"\xc3\xa9", "é", "Ã©"),
    ],
)
def test_string_escapes_have_the_meaning_of_ros_2(
    define: Define, text: str, value: str, element: str
) -> None:
    fields = f'string text "{text}"\nwstring wide "{text}"\nstring[] all ["{text}", b]\n'
    package = define({"Text.msg": f'string TEXT="{text}"\n{fields}'})
    cls = load(package, "Text")
    message = cls()
    assert (cls.TEXT, message.text, message.wide, message.all) == (value, value, value, [element, "b"])
    assert cls._deserialize(cls._serialize(message)) == message


@pytest.mark.parametrize(
    ("line", "reason"),
    [
        ("flot64 x", r"unknown type 'flot64'"),
        ("float64", "'' is not a field name"),
        ("float64 X", "'X' is not a field name"),
        ("float64 a__b", "'a__b' is not a field name"),
        ("float64 a_", "'a_' is not a field name"),
        ("float64 " + "x" * 40 + "-", "is not a field name"),
        ("float64 class", "keyword of Python"),
        ("float64 x one", "'one' is not a valid double"),
        ("uint8 x 256", r"256 is not a valid uint8: it must be in \[0, 255\]"),
        ("int8 x 1.5", "'1.5' is not a valid int8"),
        ("bool x maybe", "'maybe' is not a valid bool"),
        ("float64[] x 1", "in brackets"),
        ("float64[2] x [1]", r"'x' is double\[2\], but has 1 default values"),
        ("float64[<=2] x [1, 2, 3]", "3 default values"),
        ("float64[0] x", "greater than 0"),
        ("float64[<=] x", "bound .* is missing"),
        ("float64<=3 x", "only strings"),
        ("float64[ x", r"'float64\[' is not a type"),
        ("string<=2 x abc", "longer than 2 characters"),
        ('string x "a"b"', "must be escaped"),
        (r'string<=1 x "\t"', "longer than 1 characters"),
        (r'string x "\x4"', r'"\\x4" is not a valid string: .*truncated \\xXX escape'),
        (r'string[] x ["\x4"]', r'"\\x4" is not a valid string: .*truncated \\xXX escape'),
        (r'string X="\xe9"', "is not a valid string: 'utf-8' codec can't decode"),
        (r'string x "\u017c"', "is not a valid string: .*can't encode"),
        ("string x a\\", r"is not a valid string: .* \\ at end of string"),
        (r"string x a\\", "in groups of four"),
        (r"string x a\\\"b", "in groups of four"),
        (r'string x "\n"', "neither NUL nor line breaks"),
        (r'string x "C:\\new"', "neither NUL nor line breaks"),
        (r'string[] x ["\0"]', "neither NUL nor line breaks"),
        (r'string[] x ["\udcff"]', "surrogates not allowed"),
        ("uint8 lower=1", "'lower' is not a constant name"),
        ("uint8 TWO__=1", "'TWO__' is not a constant name"),
        ("uint8 " + "X" * 40 + "-=1", "is not a constant name"),
        ("std_msgs/Header ONE=1", "a constant cannot have the type"),
        ("std_msgs/Header x 1", "cannot have a default value"),
        ("std_msgs/Missing x", "there is no definition of std_msgs/msg/Missing"),
        ("std_msgs/msg/Header x", "unknown type 'std_msgs/msg/Header'"),
        ("time stamp", "unknown type 'time'"),
        ("float64 good", "field 'good' is defined twice"),
        ("uint8 ONE=1", "constant 'ONE' is defined twice"),
    ],
)
def test_an_error_is_one_line_with_file_line_and_reason(define: Define, line: str, reason: str) -> None:
    package = define({"Wrong.msg": f"# first\nuint8 ONE=0\nfloat64 good\n{line}\n"})
    with pytest.raises(InvalidDefinition, match=rf"/share/{package}/msg/Wrong\.msg:4: .*{reason}") as caught:
        load(package, "Wrong")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("text", "line"), [("", 1), ("bool a\nbool b\n", 2), ("---\nbool a\n---\n", 3)])
def test_a_service_needs_exactly_one_separator(define: Define, text: str, line: int) -> None:
    package = define({"Wrong.srv": text})
    with pytest.raises(InvalidDefinition, match=rf"Wrong\.srv:{line}: .* exactly one line '---'"):
        load(package, "Wrong", "srv")


def test_an_error_in_a_response_has_the_line_of_the_file(define: Define) -> None:
    package = define({"Wrong.srv": "bool a\n---\nbool b\nbool b\n"})
    with pytest.raises(InvalidDefinition, match=r"Wrong\.srv:4: field 'b' is defined twice"):
        load(package, "Wrong", "srv")


def test_a_file_that_is_not_utf8_is_reported(define: Define, tmp_path: Path) -> None:
    package = define({"Wrong.msg": "bool a"})
    (tmp_path / "share" / package / "msg" / "Wrong.msg").write_bytes(b"bool a # \xff")
    with pytest.raises(InvalidDefinition, match=r"Wrong\.msg:1: the file is not UTF-8"):
        load(package, "Wrong")


def test_undefined_packages_and_messages_cannot_be_imported(define: Define) -> None:
    package = define({"Here.msg": ""})
    with pytest.raises(ModuleNotFoundError, match="user_msgs_nowhere"):
        importlib.import_module("user_msgs_nowhere.msg")
    with pytest.raises(ModuleNotFoundError):
        importlib.import_module(f"{package}.srv")
    with pytest.raises(AttributeError, match="has no attribute 'Gone'"):
        load(package, "Gone")
    with pytest.raises(LookupError):
        message_class("std_msgs/msg/Gone")
    with pytest.raises(LookupError):
        message_class("std_srvs/srv/Trigger")
    with pytest.raises(LookupError):
        service_class("std_srvs/srv/Gone")


def test_an_action_of_a_user_is_imported_without_a_build_step(define: Define) -> None:
    package = define(
        {
            "Joint.msg": JOINT,
            "Move.action": "uint8 FAST=1\nJoint[<=3] joints\n---\nbool success true\n---\nfloat64 angle\n",
        }
    )
    move = load(package, "Move", "action")
    assert (move.Goal.FAST, move.Result().success, move.Feedback().angle) == (1, True, 0.0)
    request = move.Impl.SendGoalService.Request(goal=move.Goal(joints=[load(package, "Joint")()]))
    assert type(request)._deserialize(type(request)._serialize(request)) == request
    assert f"{package}::action::dds_::Move_SendGoal_Request_" == type(request)._DDS_TYPE_NAME
    assert load(package, "Move_FeedbackMessage", "action") is move.Impl.FeedbackMessage
    module = importlib.import_module(f"{package}.action._move")
    assert module.Move is move
    assert module.Metaclass_Move_SendGoal is move.Impl.SendGoalService.__class__
    for cls in (move, move.Goal, move.Impl, move.Impl.SendGoalService.Request):
        assert cls.__module__ == f"{package}.action._move"
    assert action_class(f"{package}/action/Move") is move


@pytest.mark.parametrize(
    ("text", "line", "reason"),
    [
        ("", 1, "an action needs exactly 2 lines '---', not 0"),
        ("bool a\n---\nbool b\n", 3, "an action needs exactly 2 lines '---', not 1"),
        ("---\n---\nbool a\n---\n", 4, "an action needs exactly 2 lines '---', not 3"),
        ("---\n---\n\nbool A\n", 4, "'A' is not a field name"),
    ],
)
def test_an_invalid_action_is_reported_with_its_line(
    define: Define, text: str, line: int, reason: str
) -> None:
    package = define({"Wrong.action": text})
    with pytest.raises(InvalidDefinition, match=rf"Wrong\.action:{line}: {reason}"):
        load(package, "Wrong", "action")


def test_names_that_an_action_does_not_define_are_no_attributes(define: Define) -> None:
    package = define({"Move.action": "---\n---\n"})
    for name in ("Gone", "Move_Request", "Move_Goal_Event", "Gone_Goal"):
        with pytest.raises(AttributeError, match=f"has no attribute '{name}'"):
            load(package, name, "action")
    for make, name in ((service_class, "Move_Goal"), (message_class, "Move"), (action_class, "Gone")):
        with pytest.raises(LookupError):
            make(f"{package}/action/{name}")


def test_included_packages_win_over_a_users_package(define: Define, tmp_path: Path) -> None:
    define({})
    path = tmp_path / "share" / "std_msgs" / "msg" / "Float64.msg"
    path.parent.mkdir(parents=True)
    path.write_text("string other\n")
    assert message_class("std_msgs/msg/Float64").get_fields_and_field_types() == {"data": "double"}
    message_definition.cache_clear()
    assert message_definition("std_msgs/msg/Float64").fields[0].type == FieldType("double")


def test_a_type_description_has_nested_types_and_defaults(define: Define) -> None:
    package = define(
        {
            "A.msg": "PACKAGE/B b\nfloat64[2] pair [1, 2]\nstring<=4 name x\n",
            "B.msg": "std_msgs/Header[<=2] h\n",
        }
    )
    description: Any = type_description(f"{package}/msg/A")
    a = description.type_description
    assert (a.type_name, [field.name for field in a.fields]) == (f"{package}/msg/A", ["b", "pair", "name"])
    assert [field.default_value for field in a.fields] == ["", "(1.0, 2.0)", "x"]
    b, pair, name = (field.type for field in a.fields)
    assert (b.type_id, b.nested_type_name) == (1, f"{package}/msg/B")
    assert (pair.type_id, pair.capacity) == (11 + 48, 2)
    assert (name.type_id, name.string_capacity) == (21, 4)
    names = [nested.type_name for nested in description.referenced_type_descriptions]
    assert names == ["builtin_interfaces/msg/Time", "std_msgs/msg/Header", f"{package}/msg/B"]
    (headers,) = description.referenced_type_descriptions[2].fields
    assert (headers.type.type_id, headers.type.capacity) == (1 + 96, 2)
    assert type(description)._deserialize(type(description)._serialize(description)) == description


def test_a_service_is_described_as_its_three_messages() -> None:
    description: Any = type_description("std_srvs/srv/Trigger")
    fields = [(field.name, field.type.nested_type_name) for field in description.type_description.fields]
    assert fields == [
        (f"{part.lower()}_message", f"std_srvs/srv/Trigger_{part}")
        for part in ("Request", "Response", "Event")
    ]


def test_stubs_of_a_users_package_can_be_written(
    define: Define, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    package = define(
        {
            "Joint.msg": "float64[] angles\n",
            "Move.srv": "Joint[] joints\n---\n",
            "Go.action": "Joint to\n---\n---\n",
        }
    )
    monkeypatch.setattr(sys, "argv", ["stubs", package, "--output", str(tmp_path / "typings")])
    stubs.main()
    text = (tmp_path / "typings" / package / "srv" / "__init__.pyi").read_text()
    assert f"    joints: list[{package}.msg.Joint]\n" in text
    assert "    Response: TypeAlias = Move_Response\n" in text
    assert (
        "def angles(self) -> array[float]: ..."
        in (tmp_path / "typings" / package / "msg" / "__init__.pyi").read_text()
    )
    action = (tmp_path / "typings" / package / "action" / "__init__.pyi").read_text()
    assert f"class Go_Goal(Message):\n    to: {package}.msg.Joint\n" in action
    assert "class Go(Action):\n    Goal: TypeAlias = Go_Goal\n" in action
    assert "        GetResultService: TypeAlias = Go_GetResult\n" in action
    assert "        CancelGoalService: TypeAlias = action_msgs.srv.CancelGoal\n" in action

    monkeypatch.setattr(sys, "argv", ["stubs", "user_msgs_nowhere", "--output", str(tmp_path)])
    with pytest.raises(SystemExit):
        stubs.main()
    assert "there is no message package 'user_msgs_nowhere'" in capsys.readouterr().err


def test_a_field_may_have_any_name(define: Define) -> None:
    names = "cls", "data", "default", "end", "error", "initial_pose", "m", "new", "p", "pose", "unset"
    text = "".join(f"geometry_msgs/Pose {name}\nuint8[] numbers_{name}\n" for name in names)
    arm = load(define({"Arm.msg": text}), "Arm")
    message = arm()
    message.initial_pose.position.x = 2.0
    again = arm(**{name: getattr(message, name) for name in names})
    assert arm._deserialize(arm._serialize(again)) == message


@pytest.mark.parametrize("name", ["self", "check_fields", "serialize", "fields_and_field_types"])
def test_a_field_may_have_the_name_of_a_message_attribute(define: Define, tmp_path: Path, name: str) -> None:
    package = define({"Plain.msg": f"string {name}\n", "Numbers.msg": f"float64[2] {name}\n"})
    for cls, value in ((load(package, "Plain"), "a"), (load(package, "Numbers"), [1.0, 2.0])):
        message = cls(**{name: value})
        assert list(getattr(message, name)) == list(value)
        assert cls._deserialize(cls._serialize(message)) == message != cls()
        assert copy.copy(message) == message
        for slot in message.__slots__:
            getattr(message, slot)
    stubs.write_stubs(package, tmp_path)
    compile((tmp_path / package / "msg" / "__init__.pyi").read_text(), "stub", "exec")
