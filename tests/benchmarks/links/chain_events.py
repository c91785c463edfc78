"""The arm's own chain in plain callbacks on ROS 2's EventsExecutor."""

from __future__ import annotations

from tests.benchmarks.links import callbacks_events, chain


class Connection(chain.Connection):
    make_executor = callbacks_events.Connection.make_executor
