"""Definition files: those of this distribution against rosbags, and a user's own packages."""

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
from rosidl_runtime_embedded import InvalidDefinition, message_class, service_class, stubs
from rosidl_runtime_embedded.definition import FieldType
from rosidl_runtime_embedded.definition_files import interface_names, message_definition
from rosidl_runtime_embedded.type_description import type_description

SOURCE = Path(rosidl_runtime_embedded.__file__).parents[1]
PACKAGES = sorted(
    {path.parents[1].name for path in SOURCE.glob("*/*/*.msg")} | {"std_srvs", "composition_interfaces"}
)
MESSAGES = [f"{package}/msg/{name}" for package in PACKAGES for name in interface_names(package, "msg")]
STORE = get_typestore(Stores.ROS2_JAZZY)
NOT_OURS = ("rosbag2_interfaces/", "tf2_msgs/")
# rosbags hashes a char as a char; rosidl makes it a uint8 first, as the recorded announcements show
WITH_CHAR = {
    "std_msgs/msg/Char",
    "service_msgs/msg/ServiceEventInfo",
    *(f"rmw_dds_common/msg/{name}" for name in ("Gid", "NodeEntitiesInfo", "ParticipantEntitiesInfo")),
}


def test_all_messages_of_jazzy_that_rosbags_knows_are_defined() -> None:
    assert sorted(MESSAGES) == sorted(name for name in STORE.fielddefs if not name.startswith(NOT_OURS))


@pytest.mark.parametrize("name", MESSAGES)
def test_hash_and_constants_are_those_of_rosbags(name: str) -> None:
    idl_names = {"bool": "boolean", "byte": "octet", "char": "uint8", "float32": "float", "float64": "double"}
    constants = [
        (name, idl_names.get(type_, type_), value) for name, type_, value in STORE.fielddefs[name][0]
    ]
    assert list(message_definition(name).constants) == constants
    if name not in WITH_CHAR:
        assert STORE.hash_rihs01(name) == message_class(name)._TYPE_HASH


@pytest.mark.parametrize("package", PACKAGES)
def test_the_committed_stubs_of_a_package_are_up_to_date(package: str, tmp_path: Path) -> None:
    stubs.write_stubs(package, tmp_path)
    written = {path.relative_to(tmp_path): path.read_text() for path in tmp_path.rglob("*.pyi")}
    assert written == {
        path.relative_to(SOURCE): path.read_text() for path in (SOURCE / package).rglob("*.pyi")
    }
    assert written


_numbers = itertools.count()
Define = Callable[..., str]


@pytest.fixture
def define(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Define]:
    """Makes a package of definition files, named ``<Name>.msg`` or ``<Name>.srv``, in AMENT_PREFIX_PATH."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"/nowhere:{tmp_path}")
    packages = []

    def define(files: dict[str, str]) -> str:
        # a name of its own for each package: Python and we remember what was imported
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


def test_a_users_package_is_found_in_a_process_that_imports_it_first(define: Define) -> None:
    package = define({"Joint.msg": JOINT})
    # what site does with the .pth file of an installed distribution
    code = f"import site; site.addsitedir({str(SOURCE)!r}); from {package}.msg import Joint; print(Joint())"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == f"{package}.msg.Joint(name='', angle=0.5)\n"


def test_a_users_package_wins_over_a_mere_directory_of_its_name(
    define: Define, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = define({"Joint.msg": JOINT})
    (tmp_path / "src" / package / "msg").mkdir(parents=True)
    monkeypatch.chdir(tmp_path / "src")
    code = f"from {package}.msg import Joint; print(Joint())"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == f"{package}.msg.Joint(name='', angle=0.5)\n"


def test_a_users_package_yields_to_what_python_finds_by_itself(
    define: Define, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package, module = define({"Joint.msg": JOINT}), define({"Joint.msg": JOINT})
    (tmp_path / "src" / package).mkdir(parents=True)
    (tmp_path / "src" / package / "__init__.py").write_text("msg = 'mine'\n")
    (tmp_path / "src" / f"{module}.py").write_text("msg = 'mine'\n")
    monkeypatch.syspath_prepend(tmp_path / "src")
    assert importlib.import_module(package).msg == "mine"
    assert importlib.import_module(module).msg == "mine"


def test_every_kind_of_type_is_understood(define: Define) -> None:
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
def test_escapes_in_a_string_mean_what_ros_2_makes_of_them(
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
        ("float64", "'' is no field name"),
        ("float64 X", "'X' is no field name"),
        ("float64 a__b", "'a__b' is no field name"),
        ("float64 a_", "'a_' is no field name"),
        ("float64 " + "x" * 40 + "-", "is no field name"),
        ("float64 class", "keyword of Python"),
        ("float64 x one", "'one' is no double"),
        ("uint8 x 256", r"256 is no uint8: it must be in \[0, 255\]"),
        ("int8 x 1.5", "'1.5' is no int8"),
        ("bool x maybe", "'maybe' is no bool"),
        ("float64[] x 1", "written in brackets"),
        ("float64[2] x [1]", r"1 default values are given for 'x', which is double\[2\]"),
        ("float64[<=2] x [1, 2, 3]", "3 default values"),
        ("float64[0] x", "greater than 0"),
        ("float64[<=] x", "bound .* is missing"),
        ("float64<=3 x", "only strings"),
        ("float64[ x", r"'float64\[' is no type"),
        ("string<=2 x abc", "longer than 2 characters"),
        ('string x "a"b"', "must be escaped"),
        (r'string<=1 x "\t"', "longer than 1 characters"),
        (r'string x "\x4"', r'"\\x4" is no string: .*truncated \\xXX escape'),
        (r'string[] x ["\x4"]', r'"\\x4" is no string: .*truncated \\xXX escape'),
        (r'string X="\xe9"', "is no string: 'utf-8' codec can't decode"),
        (r'string x "\u017c"', "is no string: .*can't encode"),
        ("string x a\\", r"is no string: .* \\ at end of string"),
        (r"string x a\\", "by fours"),
        (r"string x a\\\"b", "by fours"),
        (r'string x "\n"', "no end of a line"),
        (r'string x "C:\\new"', "no end of a line"),
        (r'string[] x ["\0"]', "no NUL"),
        (r'string[] x ["\udcff"]', "surrogates not allowed"),
        ("uint8 lower=1", "'lower' is no constant name"),
        ("uint8 TWO__=1", "'TWO__' is no constant name"),
        ("uint8 " + "X" * 40 + "-=1", "is no constant name"),
        ("std_msgs/Header ONE=1", "a constant cannot have the type"),
        ("std_msgs/Header x 1", "can have no default value"),
        ("std_msgs/Missing x", "there is no definition of std_msgs/msg/Missing"),
        ("std_msgs/msg/Header x", "unknown type 'std_msgs/msg/Header'"),
        ("time stamp", "unknown type 'time'"),
        ("float64 good", "field 'good' is defined twice"),
        ("uint8 ONE=1", "constant 'ONE' is defined twice"),
    ],
)
def test_a_mistake_is_one_line_with_file_line_and_reason(define: Define, line: str, reason: str) -> None:
    package = define({"Wrong.msg": f"# first\nuint8 ONE=0\nfloat64 good\n{line}\n"})
    with pytest.raises(InvalidDefinition, match=rf"/share/{package}/msg/Wrong\.msg:4: .*{reason}") as caught:
        load(package, "Wrong")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("text", "line"), [("", 1), ("bool a\nbool b\n", 2), ("---\nbool a\n---\n", 3)])
def test_a_service_needs_exactly_one_separator(define: Define, text: str, line: int) -> None:
    package = define({"Wrong.srv": text})
    with pytest.raises(InvalidDefinition, match=rf"Wrong\.srv:{line}: a service has exactly one line '---'"):
        load(package, "Wrong", "srv")


def test_a_mistake_in_a_response_is_reported_with_the_line_of_the_file(define: Define) -> None:
    package = define({"Wrong.srv": "bool a\n---\nbool b\nbool b\n"})
    with pytest.raises(InvalidDefinition, match=r"Wrong\.srv:4: field 'b' is defined twice"):
        load(package, "Wrong", "srv")


def test_a_file_that_is_not_utf8_is_reported(define: Define, tmp_path: Path) -> None:
    package = define({"Wrong.msg": "bool a"})
    (tmp_path / "share" / package / "msg" / "Wrong.msg").write_bytes(b"bool a # \xff")
    with pytest.raises(InvalidDefinition, match=r"Wrong\.msg:1: the file is not UTF-8"):
        load(package, "Wrong")


def test_what_nobody_defines_cannot_be_imported(define: Define) -> None:
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


def test_actions_are_said_to_be_missing(define: Define) -> None:
    package = define({"Move.action": "---\n---\n"})
    with pytest.raises(ImportError, match=rf"{package}\.action: the embedded runtime has no actions"):
        importlib.import_module(f"{package}.action")


def test_the_packages_of_the_distribution_win_over_a_users(define: Define, tmp_path: Path) -> None:
    define({})
    path = tmp_path / "share" / "std_msgs" / "msg" / "Float64.msg"
    path.parent.mkdir(parents=True)
    path.write_text("string other\n")
    assert message_class("std_msgs/msg/Float64").get_fields_and_field_types() == {"data": "double"}
    message_definition.cache_clear()
    assert message_definition("std_msgs/msg/Float64").fields[0].type == FieldType("double")


def test_a_type_description_has_all_nested_types_and_the_defaults(define: Define) -> None:
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
    package = define({"Joint.msg": "float64[] angles\n", "Move.srv": "Joint[] joints\n---\n"})
    monkeypatch.setattr(sys, "argv", ["stubs", package, "--output", str(tmp_path / "typings")])
    stubs.main()
    text = (tmp_path / "typings" / package / "srv" / "__init__.pyi").read_text()
    assert f"    joints: list[{package}.msg.Joint]\n" in text
    assert "    Response: TypeAlias = Move_Response\n" in text
    assert (
        "def angles(self) -> array[float]: ..."
        in (tmp_path / "typings" / package / "msg" / "__init__.pyi").read_text()
    )

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
def test_a_field_may_be_named_as_what_a_message_needs_itself(
    define: Define, tmp_path: Path, name: str
) -> None:
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
