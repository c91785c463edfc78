"""The sender of the heartbeats: ``operator_hand`` names it, as the Bool of the thesis cannot."""

from __future__ import annotations

from typing import Any

from reactivex import Observable
from std_msgs.msg import Header

from reactive_node import stamps

PERIOD = 0.2  # s between two headers


def header(node: str) -> Header:
    return Header(stamp=stamps.to_message(stamps.now()), frame_id=node)


def headers(heartbeats: Observable[Any], node: str) -> Observable[Header]:
    """Emit whose heartbeats these are: with the first, and at most every ``PERIOD``."""
    return heartbeats.throttle_first(PERIOD).map(lambda _: header(node))
