"""Virtual sources as nodes: their scenario, its origin, and what was set by hand."""

from __future__ import annotations

import errno
import os
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.msg import ParameterEvent
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import qos_profile_parameter_events
from reactivex import Observable

from deploy.supervision.run_directory import RunDirectory
from interfaces import topics
from interfaces.service import ServiceNode, UserError, parameter
from interfaces.service.epoch import EPOCH, Epoch
from interfaces.sources.player import Player
from interfaces.sources.settings import Settings
from interfaces.sources.settings_file import SettingsFile
from interfaces.sources.timeline import Events, Sweep
from reactive_node.testing import MakeNode, SpinFor, SpinUntil
from tests.users import NOBODY, needs_root

SHORT = 0.1  # [s] in which nothing must happen


@dataclass(frozen=True)
class Parameters:
    value: float = parameter(1.0, (0.0, 9.0), "m", "length", settable=True)
    pressed: bool = parameter(False, None, "", "whether the switch is pressed", settable=True)
    follow_scenario: bool = parameter(True, None, "", "whether the scenario sets the value", settable=True)


@pytest.fixture
def make_source(make_node: MakeNode) -> Callable[..., ServiceNode]:
    def make(**values: Any) -> ServiceNode:
        overrides = [Parameter(name, value=value) for name, value in values.items()]
        node: ServiceNode = make_node("source", kind=ServiceNode, parameter_overrides=overrides)
        node.declare(Parameters)
        return node

    return make


def emitted(node: ServiceNode, items: Observable[Any]) -> list[Any]:
    received: list[Any] = []
    items.subscribe(received.append, scheduler=node.scheduler)
    return received


class Source:
    """What a virtual source consists of: settings, and a player of its scenario."""

    def __init__(self, node: ServiceNode) -> None:
        epoch = Epoch(node)
        self.player, self.settings = Player(node, epoch), Settings(node, is_restart=epoch.is_past)

    def follow(self, name: str, timeline: Any = None, **keep: Any) -> Observable[Any]:
        self.kept = self.settings.keep(name, **keep)
        return self.kept.instead_of(self.player.state(timeline))


def set_to(node: ServiceNode, name: str, value: Any) -> bool:
    return bool(node.set_parameters([Parameter(name, value=value)])[0].successful)


# The scenario


def test_restarted_source_resumes_its_scenario(
    make_source: MakeNode, tmp_path: Path, spin_until: SpinUntil
) -> None:
    path = tmp_path / "scenario.yaml"
    path.write_text("l1: [{at: 0, value: 1}, {at: 100, value: 2}, {at: 101, value: 3}, {at: 999, value: 4}]")
    node = make_source(scenario=str(path), scenario_epoch=time.monotonic() - 100.5)
    source = Source(node)

    values = emitted(node, source.follow("value", source.player.scenario.configuration["l1"]))

    spin_until(lambda: values[-1:] == [3.0])
    assert values in ([2.0, 3.0], [3.0])  # a slow start skips what is over


def test_restarted_source_does_not_repeat_events(make_source: MakeNode, spin_until: SpinUntil) -> None:
    node = make_source(scenario_epoch=time.monotonic() - 100.5)
    source = Source(node)

    later = ((100.0 + number, "c") for number in range(1, 60))
    events = emitted(node, source.player.events(Events(((0.0, "a"), (100.0, "b"), *later))))

    spin_until(lambda: events)
    assert events[0] == "c"


# The origin


def test_source_without_an_origin_starts_its_scenario_at_once(
    make_source: MakeNode, spin_until: SpinUntil
) -> None:
    node = make_source()
    source = Source(node)

    values = emitted(node, source.follow("value", Events(((0.0, 2.0), (0.01, 3.0)))))
    events = emitted(node, source.player.events(Events(((0.0, "a"),))))

    spin_until(lambda: (values[-1:], events) == ([3.0], ["a"]))
    assert values in ([2.0, 3.0], [3.0])  # a slow start skips what is over


@pytest.mark.parametrize("timeline", [Events(((0.0, 2.0),)), Sweep(2.0, 0.0, 1.0)])
def test_source_emits_nothing_before_its_origin_is_set(
    make_source: MakeNode, spin_for: SpinFor, spin_until: SpinUntil, timeline: Events[float] | Sweep
) -> None:
    node = make_source(scenario_epoch=-1.0)
    source = Source(node)
    values = emitted(node, source.follow("value", timeline))
    pressed = emitted(node, source.follow("pressed", Events(((0.0, True),))))
    heartbeats = emitted(node, source.kept.until_set(source.player.events(Events(((0.0, True),)))))

    spin_for(SHORT)
    assert (values, pressed, heartbeats) == ([], [], [])
    assert set_to(node, EPOCH, time.monotonic())

    spin_until(lambda: (values, pressed, heartbeats) == ([2.0], [True], [True]))


def test_no_event_is_lost_when_the_origin_is_set_late(make_source: MakeNode, spin_until: SpinUntil) -> None:
    node = make_source(scenario_epoch=-1.0)
    source = Source(node)
    events = emitted(node, source.player.events(Events(((0.0, "a"), (0.3, "b"), (0.7, "c")))))

    set_to(node, EPOCH, time.monotonic() - 0.5)

    spin_until(lambda: events == ["a", "b", "c"])


def test_source_waits_for_an_origin_to_come(
    make_source: MakeNode, spin_for: SpinFor, spin_until: SpinUntil
) -> None:
    node = make_source(scenario_epoch=-1.0)
    source = Source(node)
    values = emitted(node, source.follow("value", Sweep(2.0, 0.0, 1.0)))
    origin = time.monotonic() + 2 * SHORT

    set_to(node, EPOCH, origin)
    spin_for(SHORT)
    assert values == []

    spin_until(lambda: values == [2.0])
    assert time.monotonic() >= origin - 1e-3


def test_first_origin_is_final(make_source: MakeNode) -> None:
    waiting, running = make_source(scenario_epoch=-1.0), make_source(scenario_epoch=7.0)
    Epoch(waiting)
    Epoch(running)

    assert set_to(waiting, EPOCH, -1.0)
    assert set_to(waiting, EPOCH, 7.0)
    for node in (waiting, running):
        assert set_to(node, EPOCH, 7.0)
        assert not set_to(node, EPOCH, 8.0)
        assert not set_to(node, EPOCH, -1.0)


def test_only_a_source_that_starts_after_the_origin_resumes(make_source: MakeNode) -> None:
    now = time.monotonic()

    past = [Epoch(make_source(scenario_epoch=epoch)).is_past for epoch in (-1.0, 0.0, now - 0.1, now + 100.0)]

    assert past == [False, False, True, False]


# Settings: what was set by hand


def test_setting_survives_a_restart(make_source: MakeNode, spin_until: SpinUntil, tmp_path: Path) -> None:
    def source() -> tuple[ServiceNode, list[float]]:
        node = make_source(scenario_epoch=time.monotonic() - 1.0, settings=str(tmp_path / "settings"))
        return node, emitted(node, Source(node).follow("value", Events(((0.0, 2.0),))))

    first, values = source()
    spin_until(lambda: values == [2.0])
    assert not set_to(first, "value", -1.0)
    assert set_to(first, "value", 5.0)
    assert values == [2.0, 5.0]
    first.destroy_node()
    second, values = source()

    spin_until(lambda: values == [5.0])
    assert second.get_parameter("value").value == 5.0


def test_source_is_given_back_to_its_scenario(
    make_source: MakeNode, spin_until: SpinUntil, tmp_path: Path
) -> None:
    def source() -> tuple[ServiceNode, list[float]]:
        node = make_source(scenario_epoch=time.monotonic() - 1.0, settings=str(tmp_path))
        timeline = Events(((0.0, 2.0),))
        return node, emitted(node, Source(node).follow("value", timeline, given_back="follow_scenario"))

    node, values = source()
    spin_until(lambda: values == [2.0])
    set_to(node, "value", 5.0)
    set_to(node, "value", 6.0)
    assert values == [2.0, 5.0, 6.0]
    assert node.get_parameter("follow_scenario").value is False
    node.destroy_node()
    node, values = source()
    spin_until(lambda: values == [6.0])
    assert node.get_parameter("follow_scenario").value is False

    set_to(node, "follow_scenario", True)
    spin_until(lambda: values == [6.0, 2.0])
    node.destroy_node()
    node, values = source()
    spin_until(lambda: values == [2.0])
    assert node.get_parameter("follow_scenario").value is True


def test_source_without_a_timeline_is_given_back_to_its_first_value(
    make_source: MakeNode, spin_until: SpinUntil
) -> None:
    node = make_source(value=3.0)
    values = emitted(node, Source(node).follow("value", given_back="follow_scenario"))
    spin_until(lambda: values == [3.0])

    set_to(node, "value", 5.0)
    set_to(node, "follow_scenario", True)

    spin_until(lambda: values == [3.0, 5.0, 3.0])


def test_source_that_leaves_its_scenario_keeps_its_parameter(
    make_source: MakeNode, spin_until: SpinUntil, tmp_path: Path
) -> None:
    node = make_source(scenario_epoch=time.monotonic() - 1.0, settings=str(tmp_path))
    timeline = Events(((0.0, 2.0),))
    values = emitted(node, Source(node).follow("value", timeline, given_back="follow_scenario"))
    spin_until(lambda: values == [2.0])

    set_to(node, "follow_scenario", False)

    assert values == [2.0, 1.0]
    assert (tmp_path / "source.yaml").read_text() == "value: 1.0\n"


def test_restart_sets_no_parameter(
    make_source: MakeNode, make_node: MakeNode, spin_until: SpinUntil, spin_for: SpinFor, tmp_path: Path
) -> None:
    (tmp_path / "source.yaml").write_text("pressed: true")
    events: list[Any] = []
    peer = make_node("peer", kind=Node)
    peer.create_subscription(ParameterEvent, "/parameter_events", events.append, qos_profile_parameter_events)
    node = make_source(settings=str(tmp_path))
    spin_until(lambda: peer.count_publishers("/parameter_events") > 1)
    spin_for(SHORT)

    pressed = emitted(node, Source(node).follow("pressed"))
    set_to(node, "value", 2.0)
    spin_until(lambda: any(each.name == "value" for event in events for each in event.changed_parameters))

    assert pressed == [True]
    assert not any(each.name == "pressed" for event in events for each in event.changed_parameters)


def test_setting_replaces_a_scenario_that_has_not_begun(make_source: MakeNode, spin_for: SpinFor) -> None:
    node = make_source(scenario_epoch=-1.0)
    pressed = emitted(node, Source(node).follow("pressed", Events(((0.0, True),))))

    set_to(node, "pressed", False)
    set_to(node, EPOCH, time.monotonic())
    spin_for(SHORT)

    assert pressed == [False]


def test_number_that_could_not_be_kept_is_not_taken_for_kept(
    make_source: MakeNode, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    source = Source(make_source(settings=str(tmp_path / "settings")))

    def fails(_: SettingsFile) -> None:
        raise UserError("the disk is full")

    assert source.settings.remember("time", 1.0)
    with monkeypatch.context() as patch:
        patch.setattr(SettingsFile, "save", fails)
        assert [source.settings.remember("time", 2.0) for _ in range(2)] == [False, False]
    assert source.settings.remember("time", 2.0)


def test_setting_ends_single_heartbeats_for_good(
    make_source: MakeNode, spin_until: SpinUntil, spin_for: SpinFor, tmp_path: Path
) -> None:
    def source() -> tuple[ServiceNode, list[int]]:
        node = make_source(settings=str(tmp_path / "settings"))
        source = Source(node)
        emitted(node, source.follow("pressed"))
        played = source.player.events(Events(((0.0, 1), (SHORT, 2))))
        return node, emitted(node, source.kept.until_set(played))

    node, heartbeats = source()
    spin_until(lambda: heartbeats == [1])
    set_to(node, "pressed", False)
    spin_for(2 * SHORT)
    assert heartbeats == [1]
    node.destroy_node()
    _, heartbeats = source()
    spin_for(2 * SHORT)

    assert heartbeats == []


@pytest.fixture
def messages(make_node: MakeNode) -> list[str]:
    heard: list[str] = []
    topic = topics.DIAGNOSTICS
    make_node("peer", kind=Node).create_subscription(
        topic.type, topic.name, lambda it: heard.append(it.status[0].message), topic.qos
    )
    return heard


def test_setting_that_cannot_be_kept_is_reported(
    make_source: MakeNode, messages: list[str], spin_until: SpinUntil, tmp_path: Path
) -> None:
    (tmp_path / "file").touch()
    node = make_source(settings=str(tmp_path / "file" / "settings"))
    values = emitted(node, Source(node).follow("value"))
    spin_until(lambda: messages)

    set_to(node, "value", 5.0)

    assert values == [1.0, 5.0]
    spin_until(lambda: messages[-1].startswith("value: a restart would forget the setting: "))
    assert messages[-1].endswith("settings/source.yaml: Not a directory")


@pytest.fixture
def restart(make_source: MakeNode, tmp_path: Path, spin_for: SpinFor) -> Callable[[], list[bool]]:
    """Starts a switch that its scenario presses, as the successor of one that died; what it emits."""

    def start() -> list[bool]:
        node = make_source(settings=str(tmp_path / "settings"), scenario_epoch=time.monotonic() - 1.0)
        source = Source(node)
        emits = emitted(node, source.follow("pressed", Events(((0.0, True),)), if_lost=False))
        emitted(node, source.kept.until_set(source.player.events(Events(((SHORT / 2, True),)))))
        spin_for(SHORT)
        node.destroy_node()
        return emits

    return start


def test_restart_presses_a_switch_that_nobody_has_set(
    make_source: MakeNode, restart: Callable[[], list[bool]], tmp_path: Path
) -> None:
    first = make_source(settings=str(tmp_path / "settings"), scenario_epoch=time.monotonic() + 100.0)
    Source(first).follow("pressed", if_lost=False)
    first.destroy_node()

    assert [restart(), restart()] == [[True], [True]]


def test_restart_without_its_settings_presses_no_switch(
    restart: Callable[[], list[bool]], tmp_path: Path
) -> None:
    assert [restart(), restart()] == [[False], [False]]
    assert (tmp_path / "settings" / "source.yaml").read_text() == "pressed: false\n"


def test_late_first_start_is_no_restart(restart: Callable[[], list[bool]], tmp_path: Path) -> None:
    run = RunDirectory(tmp_path)
    run.forget_settings(["source"])
    started = restart()
    run.remove_settings()

    assert started == [True]  # as the scenario says


def test_setting_that_cannot_be_kept_leaves_no_old_one(
    make_source: MakeNode, restart: Callable[[], list[bool]], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node = make_source(settings=str(tmp_path / "settings"))
    emitted(node, Source(node).follow("pressed"))
    set_to(node, "pressed", True)
    with monkeypatch.context() as patch:
        patch.setattr(os, "replace", full_disk)
        set_to(node, "pressed", False)
    node.destroy_node()

    assert restart() == [False]


@needs_root
def test_settings_of_another_user_are_refused(make_source: MakeNode, tmp_path: Path) -> None:
    node = make_source(settings=str(tmp_path / "settings"))
    (tmp_path / "settings").mkdir()
    (tmp_path / "settings" / "source.yaml").write_text("pressed: true\n")
    os.chown(tmp_path / "settings", NOBODY, NOBODY)

    with pytest.raises(UserError, match="belongs to another user"):
        Source(node)


def full_disk(*arguments: Any) -> None:
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_lost_settings_are_reported(
    make_source: MakeNode, messages: list[str], spin_until: SpinUntil, tmp_path: Path
) -> None:
    node = make_source(settings=str(tmp_path), scenario_epoch=time.monotonic() - 1.0)

    Source(node)

    spin_until(lambda: "settings: they are lost, with what was set by hand" in messages)


@pytest.mark.parametrize("text", ["", "- 1", "value: [", "value: -1.0", "value: long"])
def test_bad_setting_is_an_error_and_not_forgotten(make_source: MakeNode, tmp_path: Path, text: str) -> None:
    node = make_source(settings=str(tmp_path))
    (tmp_path / "source.yaml").write_text(text)

    with pytest.raises(UserError, match=r"value was set to|\.yaml: "):
        Source(node).follow("value")
