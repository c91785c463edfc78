"""`ros2 bag info`."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

import click

from ros2cli import rosbag2
from ros2cli.options import bag_argument

_INDENT = " " * 19


@click.command
@bag_argument
@click.option("-t", "--topic-name", is_flag=True, help="Only display topic names.")
def info(bag_path: str, topic_name: bool) -> None:
    """Print information about a bag to the screen."""
    metadata = rosbag2.read(Path(bag_path))
    for remark in metadata.remarks:
        click.echo(remark, err=True)
    topics = [topic for topic in metadata.topics if not topic.is_service_event()]
    services = [topic for topic in metadata.topics if topic.is_service_event()]
    if topic_name:
        for topic in topics:
            click.echo(topic.name)
        return
    end = metadata.start + metadata.duration
    size = sum(path.stat().st_size for path in metadata.paths() if path.exists())
    click.echo()
    click.echo(f"Files:             {_block(metadata.files)}")
    click.echo(f"Bag size:          {_size(size)}")
    click.echo(f"Storage id:        {metadata.storage}")
    click.echo(f"ROS Distro:        {metadata.ros_distro or 'unknown'}")
    click.echo(f"Duration:          {_seconds(metadata.duration)}s")
    click.echo(f"Start:             {_date(metadata.start)}")
    click.echo(f"End:               {_date(end)}")
    click.echo(f"Messages:          {sum(topic.count for topic in topics)}")
    click.echo(
        "Topic information: "
        + _block(
            f"Topic: {topic.name} | Type: {topic.type or 'unknown'} | Count: {topic.count}"
            f" | Serialization Format: {topic.encoding}"
            for topic in topics
        )
    )
    click.echo(f"Service:           {len(services)}")
    click.echo(
        "Service information: "
        + _block(
            (
                f"Service: {service.name.removesuffix('/_service_event')}"
                f" | Type: {service.type.removesuffix('_Event')}"
                f" | Event Count: {service.count} | Serialization Format: {service.encoding}"
                for service in services
            ),
            f"{_INDENT}  ",
        )
    )
    click.echo()


def _block(lines: Iterable[str], indent: str = _INDENT) -> str:
    return f"\n{indent}".join(lines)


def _seconds(nanoseconds: int) -> str:
    return f"{nanoseconds // 10**9}.{nanoseconds % 10**9:09d}"


def _date(nanoseconds: int) -> str:
    """A point in time [ns] in local time, and as seconds."""
    local = time.strftime("%b %e %Y %H:%M:%S", time.localtime(nanoseconds // 10**9))
    return f"{local}.{nanoseconds % 10**9:09d} ({_seconds(nanoseconds)})"


def _size(size: float) -> str:
    if size < 1024:
        return f"{size:.0f} B"
    for unit in ("KiB", "MiB", "GiB"):
        size /= 1024
        if size < 1024:
            return f"{size:.1f} {unit}"
    return f"{size / 1024:.1f} TiB"
