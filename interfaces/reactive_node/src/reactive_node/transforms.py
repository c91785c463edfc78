"""Transforms between coordinate frames as observables."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from geometry_msgs.msg import TransformStamped
from rclpy.clock import Clock, JumpThreshold
from rclpy.duration import Duration
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.time import Time
from reactivex import Observable, abc
from reactivex.disposable import CompositeDisposable, Disposable
from tf2_ros import (
    BufferCore,
    ConnectivityException,
    ExtrapolationException,
    LookupException,
    TFMessage,
    TransformException,
)

_AUTHORITY = "default_authority"  # as of tf2_ros' listener
_QOS = QoSProfile(depth=100)
_STATIC_QOS = QoSProfile(depth=100, durability=DurabilityPolicy.TRANSIENT_LOCAL)
_LATEST = Time()
_NOT_KNOWN = (LookupException, ConnectivityException, ExtrapolationException)
_JUMP = JumpThreshold(min_forward=None, min_backward=Duration(seconds=-1), on_clock_change=True)


class Transforms:
    """The buffer of transforms that all observers of a node share; it is filled while there are any."""

    def __init__(self, create_observable: Callable[..., Observable[Any]], clock: Clock) -> None:
        self._create_observable = create_observable
        self._clock = clock
        self._buffer = BufferCore()
        self._changes: Observable[Any] = Observable(self._fill).share()

    def between(self, target_frame: str, source_frame: str) -> Observable[TransformStamped]:
        """Emit the latest transform when it becomes known and when it changes."""

        def subscribe(
            observer: abc.ObserverBase[TransformStamped], scheduler: abc.SchedulerBase | None = None
        ) -> abc.DisposableBase:
            lock = threading.RLock()  # another thread may receive a transform meanwhile

            def look_up(_: Any = None) -> None:
                with lock:
                    try:
                        transform = self._buffer.lookup_transform_core(target_frame, source_frame, _LATEST)
                    except _NOT_KNOWN:
                        return
                    except TransformException as error:
                        observer.on_error(error)
                    else:
                        observer.on_next(transform)

            subscription = self._changes.subscribe(
                look_up, observer.on_error, observer.on_completed, scheduler=scheduler
            )
            look_up()
            return subscription

        return Observable(subscribe).distinct_until_changed()

    def _fill(
        self, observer: abc.ObserverBase[Any], scheduler: abc.SchedulerBase | None = None
    ) -> abc.DisposableBase:
        buffer = self._buffer = BufferCore()

        def listen(
            topic: str, qos: QoSProfile, put: Callable[[TransformStamped, str], None]
        ) -> abc.DisposableBase:
            def receive(message: TFMessage) -> None:
                for transform in message.transforms:
                    put(transform, _AUTHORITY)
                observer.on_next(None)

            return self._create_observable(TFMessage, topic, qos).subscribe(
                receive, observer.on_error, observer.on_completed, scheduler=scheduler
            )

        # When simulated time starts again, transforms of the future would hide those that come.
        jumps = self._clock.create_jump_callback(_JUMP, post_callback=lambda _: buffer.clear())
        return CompositeDisposable(
            listen("/tf", _QOS, buffer.set_transform),
            listen("/tf_static", _STATIC_QOS, buffer.set_transform_static),
            Disposable(jumps.unregister),
        )
