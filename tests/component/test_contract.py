"""The contract names those that publish and read each topic: the wiring of the real services agrees."""

from __future__ import annotations

import importlib
import runpy
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from rclpy.node import Node
from rclpy.parameter import Parameter

from deploy.operator.hand import Hand
from deploy.operator.terminal.terminal import Terminal
from deploy.supervision import manifest, processes
from interfaces import service, topics
from interfaces.service import ServiceNode
from reactive_node import ReactiveNode
from reactive_node.testing import MakeNode, SpinUntil

TOPICS = {topic.full_name("/"): topic for topic in topics.CONTRACT}
PROGRAMS = {program.name: program for program in manifest.programs() if program.name != manifest.PAGE}
MOVING = "".join(f"{joint}: {{center: 0, amplitude: 1, period: 9}}\n" for joint in ("theta1", "theta2"))


class Started(Exception):
    """Ends a program instead of its life as a process."""


def used(endpoints: Any) -> set[str]:
    return {TOPICS[each.topic_name].name for each in endpoints if each.topic_name in TOPICS}


def promised(node: str) -> tuple[set[str], set[str]]:
    return (
        {topic.name for topic in topics.CONTRACT if node in topic.subscribers},
        {topic.name for topic in topics.CONTRACT if {node, topics.EVERY_SERVICE} & set(topic.publishers)},
    )


@pytest.mark.parametrize("program", PROGRAMS.values(), ids=PROGRAMS)
def test_service_reads_and_publishes_what_the_contract_says(
    make_node: MakeNode,
    spin_until: SpinUntil,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
    program: manifest.Program,
) -> None:
    found: list[Callable[[ServiceNode], None]] = []

    def run(name: str, wire: Callable[[ServiceNode], None]) -> None:
        assert name == program.name
        found.append(wire)
        raise Started

    monkeypatch.setattr(service, "run", run)
    monkeypatch.setattr(sys, "argv", [program.module, *program.arguments])
    monkeypatch.setenv(processes.MARK, str(tmp_path))
    monkeypatch.setenv(manifest.HOST, manifest.ROBOT)  # of two hosts, each has a clock
    with pytest.raises(Started):
        runpy.run_path(importlib.import_module(program.module).__file__ or "", run_name="__main__")
    scenario = tmp_path / "scenario.yaml"
    scenario.write_text("drive: {}\nengines: [{at: 0.0, command: turn_on}]\n" + MOVING)
    played = [Parameter("scenario", value=str(scenario))]
    node: ServiceNode = make_node(program.name, kind=ServiceNode, parameter_overrides=played)
    found[0](node)
    viewer: Node = make_node("viewer", kind=Node)
    for topic in topics.CONTRACT:  # some services rest while nobody reads
        if topic.name in used(node.publishers):
            viewer.create_subscription(topic.type, topic.name, lambda _: None, topic.qos)

    spin_until(lambda: used(node.subscriptions) >= promised(program.name)[0])

    assert (used(node.subscriptions), used(node.publishers)) == promised(program.name)
    assert not list(node.clients)  # see topics.PARAMETER_CLIENTS


def test_terminal_reads_and_publishes_what_the_contract_says(
    make_node: MakeNode, spin_until: SpinUntil
) -> None:
    node: ReactiveNode = make_node("terminal", kind=ReactiveNode)
    Terminal(node, 0.0)
    Hand(node).press()

    reads, publishes = promised("terminal")
    spin_until(lambda: used(node.subscriptions) >= reads)

    assert used(node.subscriptions) == reads
    assert used(node.publishers) == publishes - {topics.DIAGNOSTICS.name}
    assert list(node.clients)  # the start of a system sets a parameter of every service, too
    assert topics.PARAMETER_CLIENTS["terminal"] == (topics.EVERY_SERVICE,)


def test_contract_names_only_programs_of_the_arm() -> None:
    known = {
        *PROGRAMS,
        *topics.OPERATOR_NODES,
        topics.FLEET,
        "RViz",
        "Foxglove",
        "sensor",
        topics.EVERY_SERVICE,
    }
    assert {name for topic in topics.CONTRACT for name in (*topic.publishers, *topic.subscribers)} <= known
