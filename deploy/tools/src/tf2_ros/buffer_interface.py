"""What all buffers of transforms offer, and the registry of the types that they can transform."""

from __future__ import annotations

from collections.abc import Callable
from copy import deepcopy
from typing import Any, ClassVar

from builtin_interfaces.msg import Time as TimeMsg
from geometry_msgs.msg import TransformStamped
from rclpy.duration import Duration
from rclpy.time import Time
from std_msgs.msg import Header

NO_WAIT = Duration()

_DoTransform = Callable[[Any, TransformStamped], Any]
_Convert = Callable[[Any], Any]


class TypeException(Exception):
    """A type is not registered; import the package that registers it, such as tf2_geometry_msgs."""

    def __init__(self, errstr: str) -> None:
        super().__init__(errstr)
        self.errstr = errstr


class NotImplementedException(Exception):
    """A buffer lacks a method that every buffer must have."""

    def __init__(self) -> None:
        self.errstr = "CanTransform or LookupTransform not implemented"
        super().__init__(self.errstr)


class BufferInterface:
    """Base of buffers, which look transforms up between frames.

    The time 0 asks for the latest transform. Errors are subclasses of ``tf2_py.TransformException``.
    """

    def __init__(self) -> None:
        self.registration = TransformRegistration()

    def transform(
        self,
        object_stamped: Any,
        target_frame: str,
        timeout: Duration = NO_WAIT,
        new_type: type | None = None,
    ) -> Any:
        """Return an object in another frame, at the time of its header.

        :param timeout: how long to wait for the transform.
        :param new_type: a type to convert the result to, see :func:`convert`.
        :raises TypeException: if its type is not registered.
        """
        do_transform = self.registration.get(type(object_stamped))
        header = object_stamped.header
        transform = self.lookup_transform(target_frame, header.frame_id, header.stamp, timeout)
        result = do_transform(object_stamped, transform)
        return result if new_type is None else convert(result, new_type)

    def transform_full(
        self,
        object_stamped: Any,
        target_frame: str,
        target_time: Time,
        fixed_frame: str,
        timeout: Duration = NO_WAIT,
        new_type: type | None = None,
    ) -> Any:
        """Return an object in another frame at another time; ``fixed_frame`` does not move in between."""
        do_transform = self.registration.get(type(object_stamped))
        header = object_stamped.header
        transform = self.lookup_transform_full(
            target_frame, target_time, header.frame_id, header.stamp, fixed_frame, timeout
        )
        result = do_transform(object_stamped, transform)
        return result if new_type is None else convert(result, new_type)

    def lookup_transform(
        self, target_frame: str, source_frame: str, time: Time | TimeMsg, timeout: Duration = NO_WAIT
    ) -> TransformStamped:
        """Return the transform from ``source_frame`` to ``target_frame``."""
        raise NotImplementedException

    def lookup_transform_full(
        self,
        target_frame: str,
        target_time: Time | TimeMsg,
        source_frame: str,
        source_time: Time | TimeMsg,
        fixed_frame: str,
        timeout: Duration = NO_WAIT,
    ) -> TransformStamped:
        """Return the transform from the source at one time to the target at another one."""
        raise NotImplementedException

    def can_transform(
        self, target_frame: str, source_frame: str, time: Time | TimeMsg, timeout: Duration = NO_WAIT
    ) -> Any:
        raise NotImplementedException

    def can_transform_full(
        self,
        target_frame: str,
        target_time: Time | TimeMsg,
        source_frame: str,
        source_time: Time | TimeMsg,
        fixed_frame: str,
        timeout: Duration = NO_WAIT,
    ) -> Any:
        raise NotImplementedException


def Stamped(obj: Any, stamp: TimeMsg, frame_id: str) -> Any:
    """Give an object a header, and return it."""
    obj.header = Header(frame_id=frame_id, stamp=stamp)
    return obj


class TransformRegistration:
    """The functions that transform objects, by type; all instances share them."""

    _tf2_functions: ClassVar[dict[type, _DoTransform]] = {}

    def print_me(self) -> None:
        print(self._tf2_functions)

    def add(self, key: type, callback: _DoTransform) -> None:
        """Register ``callback(object, transform) -> object`` for a type."""
        self._tf2_functions[key] = callback

    def get(self, key: type) -> _DoTransform:
        """Return the function of a type. Raises TypeException."""
        return _registered(self._tf2_functions, key)


class ConvertRegistration:
    """The functions that convert types to and from messages, and to each other; all instances share them."""

    _tf2_to_msg: ClassVar[dict[type, _Convert]] = {}
    _tf2_from_msg: ClassVar[dict[type, _Convert]] = {}
    _tf2_direct: ClassVar[dict[tuple[type, type], _Convert]] = {}

    def add_from_msg(self, key: type, callback: _Convert) -> None:
        """Register a function that makes an object of a type from a message."""
        self._tf2_from_msg[key] = callback

    def add_to_msg(self, key: type, callback: _Convert) -> None:
        """Register a function that makes a message from an object of a type."""
        self._tf2_to_msg[key] = callback

    def add_convert(self, key: tuple[type, type], callback: _Convert) -> None:
        """Register a function that converts from a type to another one."""
        self._tf2_direct[key] = callback

    def get_from_msg(self, key: type) -> _Convert:
        """Return the function that makes an object of a type from a message. Raises TypeException."""
        return _registered(self._tf2_from_msg, key)

    def get_to_msg(self, key: type) -> _Convert:
        """Return the function that makes a message from an object of a type. Raises TypeException."""
        return _registered(self._tf2_to_msg, key)

    def get_convert(self, key: tuple[type, type]) -> _Convert:
        """Return the function that converts from a type to another one. Raises TypeException."""
        return _registered(self._tf2_direct, key)


def _registered(functions: dict[Any, Callable[..., Any]], key: Any) -> Callable[..., Any]:
    if key not in functions:
        raise TypeException(f"Type {key} is not loaded or supported")
    return functions[key]


def convert(a: Any, b_type: type) -> Any:
    """Return an object as another type: directly if possible, otherwise through a message.

    An object that has the type already is copied.

    :raises TypeException: if no conversion is registered.
    """
    registration = ConvertRegistration()
    try:
        direct = registration.get_convert((type(a), b_type))
    except TypeException:
        if type(a) is b_type:
            return deepcopy(a)
        return registration.get_from_msg(b_type)(registration.get_to_msg(type(a))(a))
    return direct(a)
