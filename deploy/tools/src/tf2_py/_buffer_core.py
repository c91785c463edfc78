"""The buffer of transforms between coordinate frames, which form trees."""

from __future__ import annotations

import math
import threading

from builtin_interfaces.msg import Time as TimeMsg
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3
from rclpy.constants import S_TO_NS
from rclpy.logging import get_logger
from rclpy.time import Time
from std_msgs.msg import Header

from tf2_py import _frame_graph
from tf2_py._exceptions import InvalidArgumentException, LookupException, TransformException
from tf2_py._input import TimeLike, nanoseconds, problem_of, reason_against
from tf2_py._matrices import IDENTITY, Matrix, rotation_of, translation_of
from tf2_py._path import Path, find_path, latest_common_time
from tf2_py._time_cache import Sample, StaticCache, TimeCache, seconds
from tf2_py._velocity import Twist, average_velocity

_DEFAULT_CACHE_TIME = 10 * S_TO_NS
_LOGGER = get_logger("tf2")


class BufferCore:
    """Stores transforms between frames for some time, and computes those between any two connected frames.

    A transform from a frame ``source`` to a frame ``target`` turns coordinates in ``source`` into coordinates
    in ``target`` [m]. Between two received transforms it is interpolated; the time 0 asks for the latest time
    at which all needed transforms are known. All methods may be called from any thread.
    """

    def __init__(self, cache_time: TimeLike | None = None) -> None:
        """Create a buffer; transforms are kept for ``cache_time``, by default 10 s. Raises TypeError."""
        self._tf2_cache_time = (
            _DEFAULT_CACHE_TIME if cache_time is None else nanoseconds(cache_time, "duration")
        )
        self._tf2_frames: dict[str, TimeCache | StaticCache | None] = {}  # None: a frame without a parent
        self._tf2_authorities: dict[str, str] = {}
        self._tf2_lock = threading.RLock()

    # Input

    def set_transform(self, transform: TransformStamped, authority: str) -> None:
        """Add the transform from ``child_frame_id`` to ``header.frame_id`` at ``header.stamp``.

        An invalid transform, or one that is older than the cache, is logged and ignored.

        :param authority: who says so, for display.
        :raises TypeError: if the translation is no Vector3, or the stamp no time.
        """
        self._tf2_set(transform, authority, TimeCache)

    def set_transform_static(self, transform: TransformStamped, authority: str) -> None:
        """Add a transform that holds at all times; see :meth:`set_transform`."""
        self._tf2_set(transform, authority, StaticCache)

    def _tf2_set(
        self, transform: TransformStamped, authority: str, kind: type[TimeCache] | type[StaticCache]
    ) -> None:
        if not isinstance(transform.transform.translation, Vector3):
            raise TypeError("transform.translation must be of type Vector3")
        stamp = nanoseconds(transform.header.stamp)
        parent = transform.header.frame_id.removeprefix("/")
        child = transform.child_frame_id.removeprefix("/")
        t, r = transform.transform.translation, transform.transform.rotation
        translation = float(t.x), float(t.y), float(t.z)
        rotation = float(r.x), float(r.y), float(r.z), float(r.w)
        length = math.hypot(*rotation)
        if problem := problem_of(parent, child, authority, translation, rotation, length):
            _LOGGER.error(problem)
            return
        x, y, z, w = (component / length for component in rotation)
        sample = Sample(0 if kind is StaticCache else stamp, parent, translation, (x, y, z, w))
        with self._tf2_lock:
            cache = self._tf2_frames.get(child)
            if not isinstance(cache, kind):
                cache = StaticCache() if kind is StaticCache else TimeCache(self._tf2_cache_time)
                self._tf2_frames[child] = cache
            self._tf2_frames.setdefault(parent, None)
            if cache.insert(sample):
                self._tf2_authorities[child] = authority
                return
        _LOGGER.warning(
            f"TF_OLD_DATA ignoring data from the past for frame {child} at time {seconds(stamp)} according to"
            f" authority {authority}\nPossible reasons are listed at http://wiki.ros.org/tf/Errors%20explained"
        )

    def clear(self) -> None:
        """Remove all transforms but the static ones. The frames remain known."""
        with self._tf2_lock:
            for cache in self._tf2_frames.values():
                if cache is not None:
                    cache.clear()

    # Lookups

    def lookup_transform_core(self, target_frame: str, source_frame: str, time: TimeLike) -> TransformStamped:
        """Return the transform from ``source_frame`` to ``target_frame``.

        :raises InvalidArgumentException: if a frame ID is empty or begins with a slash.
        :raises LookupException: if a frame does not exist.
        :raises ConnectivityException: if nothing connects the frames.
        :raises ExtrapolationException: if the transform is not known at that time.
        """
        with self._tf2_lock:
            matrix, stamp = self._tf2_lookup(target_frame, source_frame, nanoseconds(time))
        return _message(target_frame, source_frame, stamp, matrix)

    def lookup_transform_full_core(
        self,
        target_frame: str,
        target_time: TimeLike,
        source_frame: str,
        source_time: TimeLike,
        fixed_frame: str,
    ) -> TransformStamped:
        """Return the transform from the source at one time to the target at another one.

        ``fixed_frame`` does not move between the two times. Errors are those of
        :meth:`lookup_transform_core`.
        """
        with self._tf2_lock:
            for name, frame in (("target", target_frame), ("source", source_frame), ("fixed", fixed_frame)):
                self._tf2_check_frame(frame, f"lookupTransform argument {name}_frame")
            to_fixed, _ = self._tf2_lookup(fixed_frame, source_frame, nanoseconds(source_time))
            to_target, stamp = self._tf2_lookup(target_frame, fixed_frame, nanoseconds(target_time))
        return _message(target_frame, source_frame, stamp, to_target @ to_fixed)

    def can_transform_core(self, target_frame: str, source_frame: str, time: TimeLike) -> tuple[bool, str]:
        """Return whether :meth:`lookup_transform_core` has a result, and the reason if not."""
        stamp = nanoseconds(time)
        if target_frame == source_frame:
            return True, ""
        with self._tf2_lock:
            return self._tf2_can(
                {"target": target_frame, "source": source_frame},
                (target_frame, source_frame, stamp),
            )

    def can_transform_full_core(
        self,
        target_frame: str,
        target_time: TimeLike,
        source_frame: str,
        source_time: TimeLike,
        fixed_frame: str,
    ) -> tuple[bool, str]:
        """Return whether :meth:`lookup_transform_full_core` has a result, and the reason if not."""
        with self._tf2_lock:
            return self._tf2_can(
                {"target": target_frame, "source": source_frame, "fixed": fixed_frame},
                (target_frame, fixed_frame, nanoseconds(target_time)),
                (fixed_frame, source_frame, nanoseconds(source_time)),
            )

    def get_latest_common_time(self, target_frame: str, source_frame: str) -> Time:
        """Return the latest time at which all transforms between the frames are known; 0 if all are static.

        :raises LookupException: if a frame does not exist.
        :raises TransformException: if nothing connects the frames.
        """
        with self._tf2_lock:
            for frame in (target_frame, source_frame):
                self._tf2_check_frame(frame, "get_latest_common_time")
            try:
                return Time(nanoseconds=latest_common_time(self._tf2_frames, target_frame, source_frame))
            except TransformException as error:
                raise TransformException(str(error)) from None  # of no subclass, as in tf2

    def lookupVelocityCore(
        self, tracking_frame: str, observation_frame: str, time: TimeLike, averaging_interval: TimeLike
    ) -> Twist:
        """Return the linear [m/s] and angular [rad/s] velocity of one frame as another one observes it.

        It is the mean over an interval around the time; the interval ends at the latest transform at the
        latest. Errors are those of :meth:`lookup_transform_core`.
        """
        return self.lookupVelocityFullCore(
            tracking_frame,
            observation_frame,
            observation_frame,
            (0.0, 0.0, 0.0),
            tracking_frame,
            time,
            averaging_interval,
        )

    def lookupVelocityFullCore(
        self,
        tracking_frame: str,
        observation_frame: str,
        reference_frame: str,
        reference_point: tuple[float, float, float],
        reference_point_frame: str,
        time: TimeLike,
        averaging_interval: TimeLike,
    ) -> Twist:
        """Return the velocity of the body of ``tracking_frame`` at ``reference_point``, see
        :meth:`lookupVelocityCore`.

        :param reference_frame: the frame whose axes the result uses.
        :param reference_point: a point in ``reference_point_frame`` [m].
        """
        with self._tf2_lock:
            self._tf2_check_frame(observation_frame, "lookupTransform argument target_frame")
            self._tf2_check_frame(tracking_frame, "lookupTransform argument source_frame")
            return average_velocity(
                lambda target, source, stamp: self._tf2_lookup(target, source, stamp)[0],
                tracking_frame,
                observation_frame,
                reference_frame,
                reference_point,
                reference_point_frame,
                nanoseconds(time),
                nanoseconds(averaging_interval, "duration"),
                latest_common_time(self._tf2_frames, observation_frame, tracking_frame),
            )

    # Display

    def all_frames_as_yaml(self) -> str:
        """Return the frames that have a parent, with statistics of their transforms, as YAML."""
        with self._tf2_lock:
            return _frame_graph.as_yaml(self._tf2_frames, self._tf2_authorities)

    def all_frames_as_string(self) -> str:
        """Return the frames and their parents, a line for each."""
        with self._tf2_lock:
            return _frame_graph.as_string(self._tf2_frames)

    def _frameExists(self, frame_id: str) -> bool:
        with self._tf2_lock:
            return frame_id in self._tf2_frames

    def _getFrameStrings(self) -> list[str]:
        with self._tf2_lock:
            return list(self._tf2_frames)

    def _chain(
        self,
        target_frame: str,
        target_time: TimeLike,
        source_frame: str,
        source_time: TimeLike,
        fixed_frame: str,
    ) -> list[str]:
        with self._tf2_lock:
            to_fixed = self._tf2_path(fixed_frame, source_frame, nanoseconds(source_time)).frames
            to_target = self._tf2_path(target_frame, fixed_frame, nanoseconds(target_time)).frames
        return [*to_fixed, *to_target[1:]]

    # The search; the caller holds the lock.

    def _tf2_check_frame(self, frame: str, function: str) -> None:
        """Raise InvalidArgumentException or LookupException if the frame cannot be looked up."""
        if reason := reason_against(frame):
            raise InvalidArgumentException(f'Invalid argument "{frame}" passed to {function} - {reason}')
        if frame not in self._tf2_frames:
            raise LookupException(f'"{frame}" passed to {function} does not exist. ')

    def _tf2_can(self, frames: dict[str, str], *paths: tuple[str, str, int]) -> tuple[bool, str]:
        """Return whether the frames exist and the paths from target to source, and the reason if not."""
        for name, frame in frames.items():
            if reason := reason_against(frame) or (
                "" if frame in self._tf2_frames else "frame does not exist"
            ):
                where = f"canTransform argument {name}_frame"
                return False, f'Invalid frame ID "{frame}" passed to {where} - {reason}'
        try:
            for target, source, stamp in paths:
                self._tf2_path(target, source, stamp)
        except TransformException as error:
            return False, str(error)
        return True, ""

    def _tf2_path(self, target: str, source: str, stamp: int) -> Path:
        """Return the path at a time, 0: at the latest common time."""
        stamp = stamp or latest_common_time(self._tf2_frames, target, source)
        return find_path(self._tf2_frames, target, source, stamp)

    def _tf2_lookup(self, target: str, source: str, stamp: int) -> tuple[Matrix, int]:
        """Return the transform, and its time, which is not 0 unless all transforms are static."""
        if target == source:
            cache = self._tf2_frames.get(target)
            return IDENTITY, cache.latest if stamp == 0 and cache is not None else stamp
        self._tf2_check_frame(target, "lookupTransform argument target_frame")
        self._tf2_check_frame(source, "lookupTransform argument source_frame")
        stamp = stamp or latest_common_time(self._tf2_frames, target, source)
        return find_path(self._tf2_frames, target, source, stamp).matrix, stamp


def _message(target: str, source: str, stamp: int, matrix: Matrix) -> TransformStamped:
    tx, ty, tz = translation_of(matrix)
    x, y, z, w = rotation_of(matrix)
    sec, nanosec = divmod(stamp, S_TO_NS)
    return TransformStamped(
        header=Header(stamp=TimeMsg(sec=sec, nanosec=nanosec), frame_id=target),
        child_frame_id=source,
        transform=Transform(translation=Vector3(x=tx, y=ty, z=tz), rotation=Quaternion(x=x, y=y, z=z, w=w)),
    )
