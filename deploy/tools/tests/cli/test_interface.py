from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

POINT_STAMPED = (
    "std_msgs/Header header\n\tbuiltin_interfaces/Time stamp\n\t\tint32 sec\n\t\tuint32 nanosec\n"
    "\tstring frame_id\nPoint point\n\tfloat64 x\n\tfloat64 y\n\tfloat64 z\n"
)


def test_show_prints_the_definition_with_those_of_its_fields(ros2: Any) -> None:
    done = ros2("interface", "show", "geometry_msgs/msg/PointStamped", "--no-comments")
    assert (done.stdout, done.returncode) == (POINT_STAMPED, 0)


def test_show_reads_the_type_from_a_pipe(ros2: Any) -> None:
    done = ros2("interface", "show", "-", "--no-comments", input="geometry_msgs/msg/PointStamped\n")
    assert done.stdout == POINT_STAMPED


@pytest.mark.own
def test_show_keeps_comments_as_asked(ros2: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    definition = tmp_path / "share" / "user_msgs" / "msg" / "Mixed.msg"
    definition.parent.mkdir(parents=True)
    definition.write_text('# title\n\nInner[<=3] inner  # nested\nstring text "a # b"\nint8 ONE=1  # one\n')
    definition.with_name("Inner.msg").write_text("# inner\nfloat64[2] value\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    show = ("interface", "show", "user_msgs/msg/Mixed")
    rest = '\tfloat64[2] value\nstring text "a # b"\n'
    commented = "# title\n\nInner[<=3] inner  # nested\n"
    assert ros2(*show).stdout == f"{commented}{rest}int8 ONE=1  # one\n"
    assert ros2(*show, "--all-comments").stdout == f"{commented}\t# inner\n{rest}int8 ONE=1  # one\n"
    assert ros2(*show, "--no-comments").stdout == f"Inner[<=3] inner\n{rest}int8 ONE=1\n"


def test_list_shows_interfaces_by_kind(ros2: Any) -> None:
    listed = ros2("interface", "list").stdout.splitlines()
    titles = [listed.index(title) for title in ("Messages:", "Services:", "Actions:")]
    assert titles == sorted(titles)
    assert titles[0] < listed.index("    std_msgs/msg/String") < titles[1]
    assert titles[1] < listed.index("    std_srvs/srv/SetBool") < titles[2]
    services = ros2("interface", "list", "-s").stdout.splitlines()
    assert services == listed[titles[1] : titles[2]]
