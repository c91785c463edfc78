"""The rights of the enclaves are those of the contract."""

from __future__ import annotations

from fnmatch import fnmatchcase

import pytest

from deploy.security import rights
from deploy.security.rights import Rights
from deploy.supervision import manifest
from interfaces import topics

PROGRAMS = [program.name for program in manifest.programs(manifest.PATH)]
ARM = rights.of_arm("/arm1", [*PROGRAMS, "my_gripper"])
SAFETY = ("operator_heartbeat", "operator_presence", "engines", "engines/state")


def may(each: Rights, way: str, topic: str) -> bool:
    named = (rule.allows for rule in each if any(fnmatchcase(topic, it) for it in getattr(rule, way)))
    return next(named, False)


def those_who(way: str, topic: str) -> set[str]:
    return {path.removeprefix("/arm1/") for path, each in ARM.items() if may(each, way, topic)}


def test_each_program_and_each_tool_has_an_enclave() -> None:
    tools = {"terminal", "recorder", "tools"}
    assert {path.removeprefix("/arm1/") for path in ARM} == {*PROGRAMS, "my_gripper", *tools, "/fleet"}
    own = ["/kinematics", "/terminal", "/recorder", "/tools"]
    assert [*rights.of_arm("/", ["kinematics"])] == [*own, "/fleet"]


@pytest.mark.parametrize("topic", topics.ROWS, ids=lambda topic: topic.name)
def test_a_topic_is_published_and_read_as_the_contract_says(topic: topics.Topic) -> None:
    name = f"rt{topic.full_name('/arm1')}"
    nodes = {*PROGRAMS, *topics.OPERATOR_NODES}
    publishers = {*PROGRAMS} if topics.EVERY_SERVICE in topic.publishers else {*topic.publishers} & nodes
    guests: set[str] = set()
    if topic.name == topics.TF.name:
        guests = {"my_gripper", "tools"}
    elif topic.name in (topics.DIAGNOSTICS.name, *topics.CONFIGURATION):
        guests = {"my_gripper"}
    assert those_who("publish", name) == publishers | guests
    readers = {*topic.subscribers} & nodes
    if topics.FLEET in topic.subscribers:
        readers.add("/fleet")
    assert those_who("subscribe", name) == readers | {"recorder", "my_gripper", "tools"}


def test_the_fleet_reads_what_it_shows_of_each_arm_and_nothing_else() -> None:
    fleet = ARM["/fleet"]
    assert fleet == rights.of_arm("/arm2", [])["/fleet"]
    own = {f"rq/fleet_*/{service}Request" for service in rights._SERVICES}
    assert {name for rule in fleet for name in rule.subscribe} - own == {
        "rt*/engines/state",
        "rt*/operator_activity",
        "rt/diagnostics",
        "rt/clock",
        "rt/parameter_events",
    }
    assert {name for rule in fleet for name in rule.publish} - {"rt/rosout", "rt/parameter_events"} == {
        f"rr/fleet_*/{service}Reply" for service in rights._SERVICES
    }
    assert all(may(fleet, "subscribe", f"rt{arm}/engines/state") for arm in ("", "/arm1", "/site/arm2"))


@pytest.mark.parametrize("name", SAFETY)
def test_nobody_of_another_arm_publishes_what_moves_this_one(name: str) -> None:
    assert those_who("publish", f"rt/arm2/{name}") == set()
    assert those_who("publish", f"rt/{name}") == set()


def test_only_terminal_and_page_set_parameters() -> None:
    def clients(node: str, service: str) -> set[str]:
        called = f"/arm1/{node}/{service}"
        may_ask = those_who("publish", f"rq{called}Request")
        assert may_ask <= those_who("subscribe", f"rr{called}Reply")
        return may_ask

    for service in ("set_parameters", "set_parameters_atomically"):
        assert clients("operator_watchdog", service) == {"terminal"}
        for node in ("config_l1", "config_l2", "config_theta1", "config_theta2", "dead_mans_switch"):
            assert clients(node, service) == {"terminal", "operator_page"}
    assert clients("operator_watchdog", "get_parameters") == {"terminal", "tools", "my_gripper"}


@pytest.mark.parametrize("node", ["kinematics", "my_gripper"])
def test_only_a_node_itself_answers_its_services(node: str) -> None:
    service = f"/arm1/{node}/get_parameters"
    assert those_who("publish", f"rr{service}Reply") == {node}
    assert those_who("subscribe", f"rq{service}Request") == {node}


def test_each_node_has_what_ros_2_needs() -> None:
    everybody = {path.removeprefix("/arm1/") for path in ARM}
    for topic in ("rt/rosout", "rt/parameter_events"):
        assert those_who("publish", topic) == everybody
    for topic in ("rt/clock", "rt/parameter_events"):
        assert those_who("subscribe", topic) == everybody
    assert may(ARM["/arm1/terminal"], "publish", "rr/arm1/terminal_17/get_parametersReply")
    assert may(ARM["/arm1/terminal"], "publish", "rr/_ros2cli_17/get_parametersReply")
    assert may(ARM["/arm1/recorder"], "subscribe", "rq/arm1/recorder_17/get_parametersRequest")


@pytest.mark.parametrize("guest", ["tools", "my_gripper"])
def test_what_a_guest_may_use_one_way_comes_first(guest: str) -> None:
    for topic in ("rt/arm1/engines", "rq/arm1/kinematics/get_parametersRequest"):
        first = next(
            rule
            for rule in ARM[f"/arm1/{guest}"]
            if any(fnmatchcase(topic, it) for it in (*rule.publish, *rule.subscribe))
        )
        assert first.allows


def test_guests_use_what_is_not_the_arms() -> None:
    assert those_who("publish", "rt/cmd_vel_in") == {"my_gripper", "tools"}
    assert those_who("subscribe", "rt/cmd_vel") == {"my_gripper", "tools"}
    assert those_who("publish", "rq/ur/motorRequest") == {"my_gripper", "tools"}


def test_sentinel_of_each_of_two_hosts_has_the_rights_of_one() -> None:
    both = rights.of_arm("/", [*PROGRAMS, *manifest.sentinels()])
    for name in ("sentinel_operator", "sentinel_robot"):
        each = both[f"/{name}"]
        assert may(each, "subscribe", "rt/diagnostics")
        assert may(each, "publish", "rt/diagnostics")
        assert may(each, "subscribe", f"rq/{name}/set_parametersRequest")
        assert not may(each, "publish", "rt/engines")
        assert may(both["/terminal"], "publish", f"rq/{name}/set_parametersRequest")
