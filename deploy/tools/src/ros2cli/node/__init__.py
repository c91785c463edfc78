"""The nodes of tools."""

from ros2cli.graph import NODE_NAME_PREFIX as NODE_NAME_PREFIX
