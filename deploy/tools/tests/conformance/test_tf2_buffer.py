"""The buffer of a node: waiting for transforms, futures, time jumps, registered types."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
from deploy.runtime.tests.nodes import Call, SpinUntil

pytest.importorskip("tf2_msgs.msg", reason="platform: no tf2_msgs here, as with ROS 2's wheels")

from deploy.tools.tests.transforms import transform
from geometry_msgs.msg import PointStamped, TransformStamped
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.time import Time
from std_msgs.msg import Header
from tf2_msgs.srv import FrameGraph

from tf2_ros import (
    Buffer,
    BufferCore,
    BufferInterface,
    ConvertRegistration,
    ExtrapolationException,
    LookupException,
    NotImplementedException,
    Stamped,
    TransformException,
    TransformRegistration,
    TypeException,
    convert,
)


@pytest.fixture
def buffer() -> Buffer:
    return Buffer()


@pytest.fixture
def later() -> Iterator[Callable[..., None]]:
    threads: list[threading.Thread] = []

    def start(function: Callable[..., Any], *args: Any) -> None:
        def run() -> None:
            time.sleep(0.05)
            function(*args)

        threads.append(threading.Thread(target=run))
        threads[-1].start()

    yield start
    for thread in threads:
        thread.join()


def test_a_buffer_is_a_core_with_the_interface() -> None:
    assert issubclass(Buffer, BufferCore)
    assert issubclass(Buffer, BufferInterface)


def test_a_lookup_waits_for_the_transform(buffer: Buffer, later: Callable[..., None]) -> None:
    later(buffer.set_transform, transform("base", "tool", x=4.0), "test")
    found = buffer.lookup_transform("base", "tool", Time(), timeout=Duration(seconds=10))
    assert found.transform.translation.x == 4.0


def test_a_full_lookup_waits_for_the_transform(buffer: Buffer, later: Callable[..., None]) -> None:
    buffer.set_transform(transform("map", "robot", 1.0, 1), "test")
    later(buffer.set_transform, transform("map", "robot", 5.0, 3), "test")
    found = buffer.lookup_transform_full(
        "robot", Time(seconds=3), "robot", Time(seconds=1), "map", Duration(seconds=10)
    )
    assert found.transform.translation.x == -4.0


def test_waiting_ends_with_the_timeout(buffer: Buffer) -> None:
    begin = time.monotonic()
    assert not buffer.can_transform("base", "tool", Time(), Duration(seconds=0.1))
    assert time.monotonic() - begin >= 0.09
    with pytest.raises(LookupException):
        buffer.lookup_transform("base", "tool", Time(), Duration(seconds=0.01))


def test_without_a_timeout_nothing_waits(buffer: Buffer) -> None:
    buffer.set_transform(transform("base", "tool"), "test")
    assert buffer.can_transform("base", "tool", Time())
    assert not buffer.can_transform("base", "tool", Time(seconds=2))
    with pytest.raises(ExtrapolationException):
        buffer.lookup_transform("base", "tool", Time(seconds=2))


def test_the_debug_tuple_has_the_reason(buffer: Buffer) -> None:
    able, reason = buffer.can_transform("base", "tool", Time(), return_debug_tuple=True)
    assert not able
    assert reason.endswith("frame does not exist")
    arguments = "base", Time(), "tool", Time(), "base"
    assert buffer.can_transform_full(*arguments, return_debug_tuple=True) == (False, reason)
    buffer.set_transform_static(transform("base", "tool"), "test")
    assert buffer.can_transform("base", "tool", Time(), return_debug_tuple=True) == (True, "")
    assert buffer.can_transform_full(*arguments, return_debug_tuple=True) == (True, "")


def test_a_future_gets_a_known_transform_at_once(buffer: Buffer) -> None:
    sent = transform("base", "tool")
    buffer.set_transform(sent, "test")
    assert buffer.wait_for_transform_async("base", "tool", Time()).result() == sent
    stamp = Time(seconds=1)
    future = buffer.wait_for_transform_full_async("base", stamp, "tool", stamp, "base")
    assert future.result() == sent


def test_a_future_gets_the_transform_when_it_arrives(buffer: Buffer) -> None:
    future = buffer.wait_for_transform_async("map", "tool", Time(seconds=2))
    full = buffer.wait_for_transform_full_async("map", Time(seconds=2), "tool", Time(seconds=2), "base")
    buffer.set_transform_static(transform("map", "base", x=1.0), "test")
    buffer.set_transform(transform("base", "tool"), "test")
    assert not future.done()
    buffer.set_transform(transform("base", "tool", 4.0, 3), "test")
    assert future.done()
    assert full.done()
    assert future.result().transform.translation.x == 3.0
    assert full.result().transform.translation.x == 3.0


def test_a_done_callback_may_use_the_buffer(buffer: Buffer) -> None:
    found = []
    future = buffer.wait_for_transform_async("base", "tool", Time())
    future.add_done_callback(lambda _: found.append(buffer.can_transform("base", "tool", Time())))
    buffer.set_transform(transform("base", "tool"), "test")
    assert found == [True]


def test_a_coroutine_awaits_a_transform(
    buffer: Buffer, node: Node, executor: SingleThreadedExecutor, spin_until: SpinUntil
) -> None:
    async def look_up() -> tuple[float, float]:
        one = await buffer.lookup_transform_async("base", "tool", Time())
        full = await buffer.lookup_transform_full_async("base", Time(), "tool", Time(), "base")
        return one.transform.translation.x, full.transform.translation.x

    task = executor.create_task(look_up)
    timer = node.create_timer(0.02, lambda: buffer.set_transform(transform("base", "tool", x=4.0), "test"))
    spin_until(task.done)
    timer.destroy()
    assert task.result() == (4.0, 4.0)


def test_a_change_of_the_source_of_time_clears_the_buffer(
    node: Node, capfd: pytest.CaptureFixture[str]
) -> None:
    buffer = Buffer(node=node)
    buffer.set_transform(transform("base", "tool"), "test")
    buffer.set_transform_static(transform("base", "camera"), "test")
    node.set_parameters([Parameter("use_sim_time", value=True)])
    assert "Detected jump back in time. Clearing tf buffer." in capfd.readouterr().err
    assert not buffer.can_transform("base", "tool", Time())
    assert buffer.can_transform("base", "camera", Time())


def test_a_buffer_of_a_node_has_a_service_with_all_frames(node: Node, call: Call) -> None:
    buffer = Buffer(Duration(seconds=5), node)
    buffer.set_transform(transform("base", "tool"), "someone")
    frames = call(FrameGraph, "tf2_frames").frame_yaml
    assert frames == buffer.all_frames_as_yaml()
    assert "broadcaster: 'someone'" in frames


class Marker:
    header: Header
    x: float = 0.0


def move(marker: Marker, by: TransformStamped) -> Marker:
    moved = Marker()
    moved.header = by.header
    moved.x = marker.x + by.transform.translation.x
    return moved


def marker(x: float, frame: str, seconds: int) -> Marker:
    found = Marker()
    found.x = x
    stamped: Marker = Stamped(found, Time(seconds=seconds).to_msg(), frame)
    return stamped


def test_an_object_of_a_registered_type_is_transformed(buffer: Buffer) -> None:
    TransformRegistration().add(Marker, move)
    for second, x in ((1, 10.0), (3, 30.0)):
        buffer.set_transform(transform("map", "robot", x, second), "test")
    moved = buffer.transform(marker(0.5, "robot", 2), "map")
    assert (moved.x, moved.header.frame_id, moved.header.stamp.sec) == (20.5, "map", 2)
    moved = buffer.transform_full(marker(0.5, "robot", 1), "robot", Time(seconds=3), "map")
    assert (moved.x, moved.header.stamp.sec) == (-19.5, 3)
    with pytest.raises(TransformException):
        buffer.transform(marker(0.5, "robot", 4), "map")


def test_an_object_of_another_type_is_not(buffer: Buffer) -> None:
    with pytest.raises(TypeException) as caught:
        buffer.transform(Header(), "map")
    assert caught.value.errstr == f"Type {Header} is not loaded or supported"


def test_objects_are_converted_directly_or_through_a_message() -> None:
    registration = ConvertRegistration()
    registration.add_to_msg(Marker, lambda marker: PointStamped(header=marker.header))
    registration.add_from_msg(Header, lambda message: message.header)
    registration.add_convert((Marker, float), lambda marker: marker.x)
    original = marker(0.5, "robot", 7)
    assert convert(original, float) == 0.5
    assert convert(original, Header) == original.header
    copy = convert(original, Marker)
    assert copy is not original
    assert copy.x == 0.5
    with pytest.raises(TypeException):
        convert(original, str)


def test_the_interface_itself_has_no_transforms() -> None:
    interface = BufferInterface()
    for function, arguments in (
        (interface.can_transform, ("a", "b", Time())),
        (interface.lookup_transform, ("a", "b", Time())),
        (interface.can_transform_full, ("a", Time(), "b", Time(), "c")),
        (interface.lookup_transform_full, ("a", Time(), "b", Time(), "c")),
    ):
        with pytest.raises(NotImplementedException) as caught:
            function(*arguments)  # type: ignore[operator]
        assert caught.value.errstr == "CanTransform or LookupTransform not implemented"


def test_a_buffer_without_a_node_uses_system_time(buffer: Buffer) -> None:
    assert isinstance(buffer.clock, Clock)
    assert buffer.clock.clock_type == ClockType.SYSTEM_TIME


def test_a_subclass_may_use_any_private_name() -> None:
    class Mine(Buffer):
        def __init__(self) -> None:
            super().__init__()
            self._pending, self._lock, self._frames, self._path = [], None, None, None

        def _wait(self) -> Any:
            return self.lookup_transform("a", "b", Time(), Duration(seconds=0.1))

        def _set(self, *arguments: Any) -> None:
            raise AssertionError("tf2_ros calls a private method of a user's class")

        _can = _lookup = _set

    buffer = Mine()
    buffer.set_transform(transform("a", "b", x=1.0), "test")
    assert buffer._wait().transform.translation.x == 1.0
