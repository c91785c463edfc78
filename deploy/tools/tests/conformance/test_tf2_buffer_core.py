"""The buffer of transforms: search, interpolation, time, errors, invalid input, display."""

from __future__ import annotations

import math
import random
from typing import Any

import pytest
from builtin_interfaces.msg import Duration as DurationMsg
from builtin_interfaces.msg import Time as TimeMsg
from geometry_msgs.msg import Quaternion, TransformStamped, Vector3
from rclpy.duration import Duration
from rclpy.time import Time

from tf2_py import (
    BufferCore,
    ConnectivityException,
    ExtrapolationException,
    InvalidArgumentException,
    LookupException,
    TimeoutException,
    TransformException,
)

LATEST = Time()
Number4 = tuple[float, float, float, float]


def about_z(degrees: float) -> Number4:
    return 0.0, 0.0, math.sin(math.radians(degrees) / 2), math.cos(math.radians(degrees) / 2)


def transform(
    parent: str,
    child: str,
    seconds: float = 0.0,
    translation: tuple[float, float, float] = (0.0, 0.0, 0.0),
    rotation: Number4 = (0.0, 0.0, 0.0, 1.0),
) -> TransformStamped:
    message = TransformStamped()
    message.header.frame_id = parent
    message.header.stamp = at(seconds).to_msg()
    message.child_frame_id = child
    message.transform.translation = Vector3(**dict(zip("xyz", translation, strict=True)))
    message.transform.rotation = Quaternion(**dict(zip("xyzw", rotation, strict=True)))
    return message


def at(seconds: float) -> Time:
    return Time(nanoseconds=round(seconds * 1e9))


def translation(message: TransformStamped) -> tuple[float, float, float]:
    vector = message.transform.translation
    return vector.x, vector.y, vector.z


def rotation(message: TransformStamped) -> Number4:
    quaternion = message.transform.rotation
    return quaternion.x, quaternion.y, quaternion.z, quaternion.w


def seconds(message: TransformStamped) -> float:
    return float(message.header.stamp.sec + message.header.stamp.nanosec / 1e9)


@pytest.fixture
def buffer() -> BufferCore:
    return BufferCore()


def fill(buffer: BufferCore, *transforms: TransformStamped) -> None:
    for one in transforms:
        buffer.set_transform(one, "test")


def multiply(one: Number4, two: Number4) -> Number4:
    x1, y1, z1, w1 = one
    x2, y2, z2, w2 = two
    return (
        w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
        w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
        w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
    )


def apply(message: TransformStamped, point: tuple[float, ...]) -> tuple[float, ...]:
    quaternion = rotation(message)
    conjugate = (-quaternion[0], -quaternion[1], -quaternion[2], quaternion[3])
    rotated = multiply(multiply(quaternion, (*point, 0.0)), conjugate)  # type: ignore[arg-type]
    return tuple(a + b for a, b in zip(rotated[:3], translation(message), strict=True))


def test_the_transform_between_any_two_frames_composes_those_between(buffer: BufferCore) -> None:
    #     root          number: its transform to the parent
    #    /    \
    #   0      2
    #   |      |
    #   1      3
    generator = random.Random(3)
    tree = [("root", "0"), ("0", "1"), ("root", "2"), ("2", "3")]
    sent = {}
    for parent, child in tree:
        raw = [generator.gauss(0, 1) for _ in range(4)]
        length = math.hypot(*raw)
        x, y, z, w = (component / length for component in raw)
        offset = (generator.gauss(0, 2), generator.gauss(0, 2), generator.gauss(0, 2))
        sent[child] = transform(parent, child, 1.0, offset, (x, y, z, w))
    fill(buffer, *sent.values())
    points = {"3": (0.3, -0.7, 1.1)}  # one point, in the coordinates of every frame
    points["2"] = apply(sent["3"], points["3"])
    points["root"] = apply(sent["2"], points["2"])
    for parent, child in tree[:2]:
        inverse = buffer.lookup_transform_core(child, parent, at(1.0))
        points[child] = apply(inverse, points[parent])
        assert apply(sent[child], points[child]) == pytest.approx(points[parent], abs=1e-12)
    for source in points:
        for target in points:
            found = buffer.lookup_transform_core(target, source, at(1.0))
            assert apply(found, points[source]) == pytest.approx(points[target], abs=1e-12)
            assert (found.header.frame_id, found.child_frame_id) == (target, source)
            assert math.hypot(*rotation(found)) == pytest.approx(1.0, abs=1e-12)


def test_a_transform_is_returned_as_it_was_set(buffer: BufferCore) -> None:
    sent = transform("base", "tool", 7.25, (1.5, -2.0, 0.1), (0.5, -0.5, 0.5, 0.5))
    fill(buffer, sent)
    found = buffer.lookup_transform_core(target_frame="base", source_frame="tool", time=at(7.25))
    assert found == sent


@pytest.mark.parametrize("degrees", [0.0, 60.0, 120.0, 150.0, 180.0, 210.0, 300.0])
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.6, 0.0, -0.8)])
def test_every_rotation_survives(
    buffer: BufferCore, axis: tuple[float, float, float], degrees: float
) -> None:
    half = math.radians(degrees) / 2
    x, y, z = (math.sin(half) * component for component in axis)
    fill(buffer, transform("base", "tool", 1.0, rotation=(x, y, z, math.cos(half))))
    found = rotation(buffer.lookup_transform_core("base", "tool", LATEST))
    cosine = sum(a * b for a, b in zip(found, (x, y, z, math.cos(half)), strict=True))
    assert abs(cosine) == pytest.approx(1.0, abs=1e-12)  # a quaternion and its negative are one rotation


def test_a_quaternion_is_normalized(buffer: BufferCore) -> None:
    fill(buffer, transform("base", "tool", 1.0, rotation=(0.0, 0.0, 3.0, 3.0)))
    found = buffer.lookup_transform_core("base", "tool", LATEST)
    assert rotation(found) == pytest.approx(about_z(90.0))


def test_a_leading_slash_of_a_set_frame_is_dropped(buffer: BufferCore) -> None:
    fill(buffer, transform("/base", "/tool", 1.0))
    assert buffer.can_transform_core("base", "tool", LATEST)[0]


# Time


def test_between_two_samples_a_transform_is_interpolated(buffer: BufferCore) -> None:
    fill(
        buffer,
        transform("base", "tool", 2.0, (1.0, 0.0, -1.0), about_z(10.0)),
        transform("base", "tool", 3.0, (5.0, 2.0, -1.0), about_z(90.0)),
    )
    found = buffer.lookup_transform_core("base", "tool", at(2.25))
    assert translation(found) == pytest.approx((2.0, 0.5, -1.0))
    assert rotation(found) == pytest.approx(about_z(30.0))
    assert seconds(found) == 2.25


def test_a_rotation_is_interpolated_on_the_shorter_way(buffer: BufferCore) -> None:
    fill(
        buffer,
        transform("base", "tool", 2.0, rotation=about_z(-10.0)),
        transform("base", "tool", 3.0, rotation=tuple(-part for part in about_z(50.0))),  # type: ignore[arg-type]
    )
    found = buffer.lookup_transform_core("base", "tool", at(2.5))
    assert rotation(found) == pytest.approx(about_z(20.0))


def test_samples_may_arrive_in_any_order(buffer: BufferCore) -> None:
    fill(buffer, *(transform("base", "tool", stamp, (stamp, 0.0, 0.0)) for stamp in (5.0, 3.0, 4.0, 2.0)))
    for stamp in (2.0, 2.5, 3.9, 4.0, 5.0):
        found = buffer.lookup_transform_core("base", "tool", at(stamp))
        assert translation(found) == pytest.approx((stamp, 0.0, 0.0))


def test_time_zero_is_the_latest_time_that_all_links_have(buffer: BufferCore) -> None:
    fill(buffer, *(transform("map", "base", stamp, (stamp, 0.0, 0.0)) for stamp in (1.0, 2.0, 3.0)))
    fill(buffer, *(transform("base", "tool", stamp, (0.0, stamp, 0.0)) for stamp in (1.0, 2.0)))
    buffer.set_transform_static(transform("tool", "tip", 9.0, (0.0, 0.0, 4.0)), "test")
    found = buffer.lookup_transform_core("map", "tip", LATEST)
    assert translation(found) == pytest.approx((2.0, 2.0, 4.0))
    assert seconds(found) == 2.0
    assert seconds(buffer.lookup_transform_core("map", "base", LATEST)) == 3.0
    assert buffer.get_latest_common_time("map", "tip") == at(2.0)
    assert buffer.get_latest_common_time("tip", "map") == at(2.0)


def test_a_static_transform_holds_at_all_times(buffer: BufferCore) -> None:
    buffer.set_transform_static(transform("base", "camera", 5.0, (1.0, 2.0, 3.0)), "test")
    for stamp in (0.0, 1.0, 1e6):
        found = buffer.lookup_transform_core("base", "camera", at(stamp))
        assert translation(found) == (1.0, 2.0, 3.0)
        assert seconds(found) == stamp
    assert buffer.get_latest_common_time("base", "camera") == Time()


def test_a_static_transform_is_replaced(buffer: BufferCore) -> None:
    for x in (1.0, 2.0):
        buffer.set_transform_static(transform("base", "camera", 5.0, (x, 0.0, 0.0)), "test")
    assert translation(buffer.lookup_transform_core("base", "camera", LATEST)) == (2.0, 0.0, 0.0)


def test_a_frame_may_become_static_and_dynamic_again(buffer: BufferCore) -> None:
    fill(buffer, transform("base", "tool", 5.0))
    buffer.set_transform_static(transform("base", "tool", 6.0), "test")
    assert buffer.can_transform_core("base", "tool", at(1.0))[0]
    fill(buffer, transform("base", "tool", 7.0))
    assert buffer.can_transform_core("base", "tool", at(7.0))[0]
    assert not buffer.can_transform_core("base", "tool", at(5.0))[0]


def test_a_frame_may_change_its_parent(buffer: BufferCore) -> None:
    fill(
        buffer,
        transform("hand", "cup", 1.0, (1.0, 0.0, 0.0)),
        transform("table", "cup", 3.0, (5.0, 0.0, 0.0)),
    )
    assert translation(buffer.lookup_transform_core("table", "cup", at(3.0))) == (5.0, 0.0, 0.0)
    # in between, it is still where it was
    assert translation(buffer.lookup_transform_core("hand", "cup", at(2.0))) == (1.0, 0.0, 0.0)
    assert not buffer.can_transform_core("table", "cup", at(2.0))[0]


def test_transforms_are_kept_for_the_cache_time(capfd: pytest.CaptureFixture[str]) -> None:
    for buffer, kept in ((BufferCore(), 10.0), (BufferCore(Duration(seconds=2)), 2.0)):
        fill(buffer, *(transform("base", "tool", 20.0 + step / 2) for step in range(41)))
        fill(buffer, transform("base", "tool", 40.5))
        oldest = 40.0 - kept
        assert buffer.can_transform_core("base", "tool", at(oldest))[0]
        assert not buffer.can_transform_core("base", "tool", at(oldest - 0.1))[0]
        fill(buffer, transform("base", "tool", 20.0))
        assert "TF_OLD_DATA ignoring data from the past for frame tool" in capfd.readouterr().err
        assert not buffer.can_transform_core("base", "tool", at(25.0))[0]


def test_a_repeated_transform_is_stored_once(buffer: BufferCore) -> None:
    for _ in range(3):
        fill(buffer, transform("base", "tool", 1.0))
    assert "  rate: 10000.000\n" in buffer.all_frames_as_yaml()  # 1 / 100 µs


def test_the_full_lookup_goes_through_a_frame_that_does_not_move(buffer: BufferCore) -> None:
    for stamp in (1.0, 2.0, 3.0):
        fill(buffer, transform("map", "robot", stamp, (10.0 * stamp, 0.0, 0.0), about_z(30.0 * stamp)))
    arguments: dict[str, Any] = {
        "target_frame": "robot",
        "target_time": at(3.0),
        "source_frame": "robot",
        "source_time": at(1.0),
        "fixed_frame": "map",
    }
    found = buffer.lookup_transform_full_core(**arguments)
    # 20 m behind the robot, which has turned by 60° and looks along y
    assert translation(found) == pytest.approx((0.0, 20.0, 0.0))
    assert rotation(found) == pytest.approx(about_z(-60.0))
    assert seconds(found) == 3.0
    assert (found.header.frame_id, found.child_frame_id) == ("robot", "robot")
    assert buffer.can_transform_full_core(**arguments) == (True, "")
    arguments["target_time"] = at(4.0)
    able, reason = buffer.can_transform_full_core(**arguments)
    assert not able
    assert "extrapolation into the future" in reason
    with pytest.raises(ExtrapolationException, match="extrapolation into the future"):
        buffer.lookup_transform_full_core(**arguments)


@pytest.mark.parametrize("time", [Time(seconds=3), TimeMsg(sec=3), Duration(seconds=3)])
def test_any_object_with_seconds_or_nanoseconds_is_a_time(buffer: BufferCore, time: Any) -> None:
    fill(buffer, transform("base", "tool", 3.0))
    assert seconds(buffer.lookup_transform_core("base", "tool", time)) == 3.0


def test_other_objects_are_no_times(buffer: BufferCore) -> None:
    with pytest.raises(TypeError, match="time must have sec and nanosec, or nanoseconds"):
        buffer.can_transform_core("base", "tool", 3.0)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="duration must have sec and nanosec, or nanoseconds"):
        BufferCore(3.0)  # type: ignore[arg-type]
    assert BufferCore(DurationMsg(sec=3))


# Errors


@pytest.mark.parametrize("cls", TransformException.__subclasses__())
def test_all_errors_are_transform_exceptions(cls: type[Exception]) -> None:
    assert cls in {
        ConnectivityException,
        ExtrapolationException,
        InvalidArgumentException,
        LookupException,
        TimeoutException,
    }
    assert cls.__base__ is TransformException
    assert TransformException.__base__ is Exception


@pytest.mark.parametrize(
    ("target", "source", "stamp", "error", "text", "reason"),
    [
        (
            "base",
            "nothing",
            2.0,
            LookupException,
            '"nothing" passed to lookupTransform argument source_frame does not exist. ',
            'Invalid frame ID "nothing" passed to canTransform argument source_frame - frame does not exist',
        ),
        (
            "",
            "tool",
            2.0,
            InvalidArgumentException,
            'Invalid argument "" passed to lookupTransform argument target_frame - '
            "in tf2 frame_ids cannot be empty",
            'Invalid frame ID "" passed to canTransform argument target_frame - '
            "in tf2 frame_ids cannot be empty",
        ),
        (
            "/base",
            "tool",
            2.0,
            InvalidArgumentException,
            'Invalid argument "/base" passed to lookupTransform argument target_frame - '
            "in tf2 frame_ids cannot start with a '/'",
            'Invalid frame ID "/base" passed to canTransform argument target_frame - '
            "in tf2 frame_ids cannot start with a '/'",
        ),
        (
            "base",
            "island",
            0.0,
            ConnectivityException,
            "Could not find a connection between 'base' and 'island' because they are not part of the same "
            "tree.Tf has two or more unconnected trees.",
            None,
        ),
        (
            "tool",
            "island",
            2.0,
            ConnectivityException,
            "Could not find a connection between 'tool' and 'island' because they are not part of the same "
            "tree.Tf has two or more unconnected trees.",
            None,
        ),
        (
            "base",
            "tool",
            3.5,
            ExtrapolationException,
            "Lookup would require extrapolation into the future.  Requested time 3.500000 but the latest "
            "data is at time 3.000000, when looking up transform from frame [tool] to frame [base]",
            None,
        ),
        (
            "tool",
            "base",
            0.5,
            ExtrapolationException,
            "Lookup would require extrapolation into the past.  Requested time 0.500000 but the earliest "
            "data is at time 1.000000, when looking up transform from frame [base] to frame [tool]",
            None,
        ),
        (
            "sea",
            "island",
            3.0,
            ExtrapolationException,
            "Lookup would require extrapolation at time 3.000000, but only time 2.000000 is in the buffer, "
            "when looking up transform from frame [island] to frame [sea]",
            None,
        ),
    ],
)
def test_a_failed_lookup_says_why(
    buffer: BufferCore,
    target: str,
    source: str,
    stamp: float,
    error: type[Exception],
    text: str,
    reason: str | None,
) -> None:
    fill(buffer, transform("base", "tool", 1.0), transform("base", "tool", 3.0))
    fill(buffer, transform("sea", "island", 2.0))
    with pytest.raises(error) as caught:
        buffer.lookup_transform_core(target, source, at(stamp))
    assert str(caught.value) == text
    assert type(caught.value) is error
    assert buffer.can_transform_core(target, source, at(stamp)) == (False, text if reason is None else reason)


def test_what_is_above_the_common_frame_does_not_matter(buffer: BufferCore) -> None:
    fill(buffer, transform("map", "base", 1.0))
    fill(buffer, transform("base", "left", 5.0, (0.0, 1.0, 0.0)), transform("base", "right", 5.0))
    found = buffer.lookup_transform_core("right", "left", at(5.0))
    assert translation(found) == pytest.approx((0.0, 1.0, 0.0))


def test_a_frame_is_the_same_as_itself(buffer: BufferCore) -> None:
    fill(buffer, transform("base", "tool", 4.0))
    for frame, stamp, found_stamp in (("tool", 0.0, 4.0), ("tool", 1.0, 1.0), ("unknown", 2.0, 2.0)):
        found = buffer.lookup_transform_core(frame, frame, at(stamp))
        assert (translation(found), rotation(found)) == ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
        assert seconds(found) == found_stamp
        assert buffer.can_transform_core(frame, frame, at(stamp)) == (True, "")


@pytest.mark.parametrize("stamp", [0.0, 1.0])
def test_a_loop_of_frames_is_an_error(buffer: BufferCore, stamp: float) -> None:
    fill(buffer, transform("a", "b", 1.0), transform("b", "a", 1.0), transform("c", "d", 1.0))
    for target, source in (("c", "a"), ("a", "c")):
        with pytest.raises(LookupException, match="The tf tree is invalid because it contains a loop"):
            buffer.lookup_transform_core(target, source, at(stamp))


def test_the_latest_common_time_needs_connected_frames(buffer: BufferCore) -> None:
    fill(buffer, transform("base", "tool", 1.0), transform("sea", "island", 1.0))
    with pytest.raises(LookupException, match='"nothing" passed to get_latest_common_time does not exist'):
        buffer.get_latest_common_time("base", "nothing")
    with pytest.raises(TransformException, match="not part of the same tree") as caught:
        buffer.get_latest_common_time("base", "island")
    assert type(caught.value) is TransformException


@pytest.mark.parametrize(
    ("message", "problem"),
    [
        (transform("tool", "tool", 1.0), "TF_SELF_TRANSFORM"),
        (transform("base", "", 1.0), "TF_NO_CHILD_FRAME_ID"),
        (transform("", "tool", 1.0), "TF_NO_FRAME_ID"),
        (transform("base", "tool", 1.0, (0.0, math.nan, 0.0)), "TF_NAN_INPUT"),
        (transform("base", "tool", 1.0, rotation=(0.0, 0.0, 0.0, math.nan)), "TF_NAN_INPUT"),
        (transform("base", "tool", 1.0, rotation=(0.0, 0.0, 0.0, 0.0)), "TF_DENORMALIZED_QUATERNION"),
    ],
)
def test_an_invalid_transform_is_logged_and_ignored(
    buffer: BufferCore, message: TransformStamped, problem: str, capfd: pytest.CaptureFixture[str]
) -> None:
    buffer.set_transform(message, "someone")
    buffer.set_transform_static(message, "someone")
    assert capfd.readouterr().err.count(problem) == 2
    assert buffer.all_frames_as_yaml() == "[]"


def test_clear_keeps_static_transforms(buffer: BufferCore) -> None:
    fill(buffer, transform("base", "tool", 1.0))
    buffer.set_transform_static(transform("base", "camera"), "test")
    buffer.clear()
    assert buffer.can_transform_core("base", "camera", at(1.0))[0]
    assert not buffer.can_transform_core("base", "tool", LATEST)[0]
    with pytest.raises(ConnectivityException):
        buffer.lookup_transform_core("base", "tool", LATEST)
    with pytest.raises(ExtrapolationException):
        buffer.lookup_transform_core("base", "tool", at(1.0))
    fill(buffer, transform("base", "tool", 0.5))
    assert buffer.can_transform_core("base", "tool", at(0.5))[0]


# Display


def test_all_frames_are_shown_as_yaml_and_as_text(buffer: BufferCore) -> None:
    assert buffer.all_frames_as_yaml() == "[]"
    assert buffer.all_frames_as_string() == ""
    fill(buffer, *(transform("base", "tool", stamp) for stamp in (1.0, 1.5, 3.0)))
    buffer.set_transform_static(transform("tool", "tip", 1.0), "other")
    assert buffer.all_frames_as_yaml() == (
        "tool: \n"
        "  parent: 'base'\n"
        "  broadcaster: 'test'\n"
        "  rate: 1.500\n"
        "  most_recent_transform: 3.000000\n"
        "  oldest_transform: 1.000000\n"
        "  buffer_length: 2.000\n"
        "tip: \n"
        "  parent: 'tool'\n"
        "  broadcaster: 'other'\n"
        "  rate: 10000.000\n"
        "  most_recent_transform: 0.000000\n"
        "  oldest_transform: 0.000000\n"
        "  buffer_length: 0.000\n"
    )
    assert buffer.all_frames_as_string() == (
        "Frame tool exists with parent base.\nFrame tip exists with parent tool.\n"
    )
    assert buffer._getFrameStrings() == ["tool", "base", "tip"]
    assert buffer._frameExists("base")
    assert not buffer._frameExists("nothing")


# Velocity


@pytest.mark.parametrize(
    ("speed", "turn", "linear", "angular"),
    [
        (2.0, 0.0, (2.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
        (0.0, 90.0, (0.0, 0.0, 0.0), (0.0, 0.0, math.radians(90.0))),
    ],
)
@pytest.mark.parametrize("middle", [1.5, 2.0])
def test_a_velocity_is_a_mean_over_an_interval(
    buffer: BufferCore,
    middle: float,
    speed: float,
    turn: float,
    linear: tuple[float, ...],
    angular: tuple[float, ...],
) -> None:
    for step in range(11):
        place, heading = (step / 10 * speed, 0.0, 0.5), about_z(step / 10 * turn)
        fill(buffer, transform("map", "robot", 1.0 + step / 10, place, heading))
    buffer.set_transform_static(transform("map", "door", translation=(-5.0, 0.0, 0.0)), "test")
    time = at(middle)
    twist = buffer.lookupVelocityCore("robot", "map", time, Duration(seconds=0.4))
    assert twist == (pytest.approx(linear, abs=1e-9), pytest.approx(angular, abs=1e-9))
    arguments = "robot", "map", "door", (0.0, 0.0, 0.0), "robot", time, Duration(seconds=0.4)
    assert buffer.lookupVelocityFullCore(*arguments)[1] == pytest.approx(angular, abs=1e-9)
    with pytest.raises(LookupException):
        buffer.lookupVelocityCore("nothing", "map", time, Duration(seconds=0.4))


def test_the_interval_of_a_velocity_does_not_begin_before_time_itself(buffer: BufferCore) -> None:
    for second in range(5):
        fill(buffer, transform("map", "robot", second, (3.0 * second, 0.0, 0.0)))
    linear, _ = buffer.lookupVelocityCore("robot", "map", Time(), Duration(seconds=4.001))
    assert linear == pytest.approx((3.0, 0.0, 0.0), abs=1e-3)
