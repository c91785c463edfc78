"""Type variables that ported code imports from the modules of rclpy, for its own annotations."""

from __future__ import annotations

from typing import TypeVar

MsgType = TypeVar("MsgType")
SrvType = TypeVar("SrvType")
SrvTypeRequest = TypeVar("SrvTypeRequest")
SrvTypeResponse = TypeVar("SrvTypeResponse")
