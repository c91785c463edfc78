"""Who cannot move the engines of an arm that joins with keys; the rows of A2 in deploy/SAFETY.md."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import closing
from pathlib import Path

import pytest
from rclpy_ground.cyclonedds import security

from deploy.security import rights
from deploy.security.keystore import Keystore
from deploy.supervision.manifest import VIRTUAL_JOINTS
from deploy.supervision.system import System
from tests.operator.page.clients import Hand
from tests.security.attacks.conftest import (
    ATTEMPTS,
    ENGINES,
    HEARTBEAT,
    PROGRAMS,
    STATE,
    MakePeer,
    Peer,
    Refused,
    SecureSite,
    hold_switch_and_turn_on,
    permissions,
    until,
)


def test_the_operator_with_keys_turns_the_engines_on(make_peer: MakePeer, watcher: Peer) -> None:
    operator = make_peer("terminal_1", "terminal")
    assert "on" in hold_switch_and_turn_on(operator, watcher, 30.0)
    operator("publish", ENGINES, "turn_off")
    until(lambda: watcher("heard", STATE)[-1:] == ["off"])


def test_commands_join_with_their_own_keys(secure_site: SecureSite) -> None:
    code, shown = secure_site.do("status")
    assert code == 0, shown
    assert len(re.findall(r"RUNNING .*(?:ago|never)", shown)) == len(PROGRAMS) - len(VIRTUAL_JOINTS), shown
    record = secure_site.begin("record")
    record.await_line("Recording to")
    until(lambda: next((secure_site.run / "records").glob("*.mcap")).stat().st_size > 10_000)
    record.signal(signal.SIGINT)
    assert record.wait() == 0
    assert record.await_line(r"(\d+) messages")[1] != "0"


def test_the_page_holds_the_switch_and_sets_the_arm(secure_site: SecureSite, watcher: Peer) -> None:
    watcher("read", "l1")
    with closing(Hand(System(secure_site.run).page)) as hand:

        def shown() -> bool:
            if hand.shown.get("switch", {}).get("by") != "this_page":
                hand.press()
            hand.say("engines", command="turn_on")
            hand.say("set", name="l1", value=1.25)
            time.sleep(0.5)
            return "on" in watcher("heard", STATE) and 1.25 in watcher("heard", "l1")

        until(lambda: "processes" in hand.shown)
        until(shown)
        hand.say("engines", command="turn_off")
        until(lambda: watcher("heard", STATE)[-1:] == ["off"])


def test_the_fleet_sees_an_arm_with_an_enclave_of_its_own(
    secure_site: SecureSite, make_peer: MakePeer
) -> None:
    operator = make_peer("terminal_4", "terminal")
    operator("advertise", HEARTBEAT)
    fleet = secure_site.begin_command(sys.executable, "-m", "deploy.commands.fleet")
    line = re.compile(rf"/ +{secure_site.domain} +[^- ]\S* +alive +off ")

    def shown() -> bool:
        operator("publish", HEARTBEAT, True)
        return any(line.match(text) for _, text in fleet.lines)

    until(shown)
    fleet.signal(signal.SIGINT)
    assert fleet.wait() == 0


def test_ros2_reads_as_a_tool_and_commands_as_the_terminal(secure_site: SecureSite, watcher: Peer) -> None:
    def ros2(*words: str, enclave: str) -> subprocess.CompletedProcess[str]:
        environment = secure_site.environment | {"ROS_SECURITY_ENCLAVE_OVERRIDE": enclave}
        command = [sys.executable, "-c", "import sys; from ros2cli.cli import main; sys.exit(main())", *words]
        return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=60)

    assert ros2("topic", "echo", "--once", "/engines/state", enclave="/tools").stdout == "data: 'off'\n---\n"
    turn_off = ("topic", "pub", "--once", "/engines", "std_msgs/msg/String", "{data: turn_off}")
    refused = ros2(*turn_off, enclave="/tools")
    assert refused.returncode != 0
    assert "Not Allowed By Security" in refused.stderr
    watcher("read", ENGINES)
    assert ros2(*turn_off, enclave="/terminal").returncode == 0
    until(lambda: watcher("heard", ENGINES) == ["turn_off"])


def test_services_give_way_to_a_process_that_joins(secure_site: SecureSite) -> None:
    tasks = Path(f"/proc/{secure_site.members['kinematics']}/task")

    def niceness() -> dict[str, int]:
        threads = ((it / "comm", os.getpriority(os.PRIO_PROCESS, int(it.name))) for it in tasks.iterdir())
        return {name.read_text().strip(): nice for name, nice in threads}

    until(lambda: {"fsm": 10, "dq.builtins": 10, "tev": 0}.items() <= niceness().items())


@pytest.fixture(params=["no keys", "keys of another CA"])
def stranger(
    request: pytest.FixtureRequest, secure_site: SecureSite, make_peer: MakePeer, tmp_path: Path
) -> Peer:
    """A peer in the arm's domain with keys that are not the arm's."""
    if request.param == "no keys":
        return make_peer("terminal_2", "terminal", ROS_SECURITY_ENABLE=None)
    other = Keystore(tmp_path / "other")
    other.write(rights.of_arm("/", ["dead_mans_switch"]), [secure_site.domain])
    return make_peer("terminal_2", "terminal", ROS_SECURITY_KEYSTORE=str(other.folder))


def test_a_stranger_moves_nothing_and_hears_nothing(stranger: Peer, watcher: Peer) -> None:
    stranger("read", STATE)
    states = hold_switch_and_turn_on(stranger, watcher)
    assert states
    assert set(states) == {"off"}
    assert not stranger("set_parameter", "dead_mans_switch", "pressed", True, ATTEMPTS)
    assert set(watcher("heard", STATE)) == {"off"}
    assert stranger("nodes") == ["terminal_2"]
    assert stranger("writers", STATE) == 0
    assert stranger("publish", ENGINES, "turn_on") == 0
    assert stranger("heard", STATE) == []
    assert "terminal_2" not in watcher("nodes")


def test_the_same_stranger_moves_an_arm_without_keys(make_open_peer: MakePeer, open_watcher: Peer) -> None:
    stranger = make_open_peer("terminal_2", "terminal")
    stranger("read", STATE)
    assert "on" in hold_switch_and_turn_on(stranger, open_watcher)
    assert stranger("set_parameter", "dead_mans_switch", "pressed", False, ATTEMPTS)
    assert "engine_controller" in stranger("nodes")
    assert stranger("writers", STATE) == 1
    assert stranger("publish", ENGINES, "turn_off") > 0
    until(lambda: open_watcher("heard", STATE)[-1:] == ["off"])
    assert "on" in stranger("heard", STATE)
    assert "terminal_2" in open_watcher("nodes")


@pytest.mark.parametrize("topic", [HEARTBEAT, "operator_presence", ENGINES, STATE])
def test_a_valid_enclave_is_refused_on_a_topic_of_others(make_peer: MakePeer, topic: str) -> None:
    velocity = make_peer("velocity")
    with pytest.raises(Refused, match="Not Allowed By Security"):
        velocity("advertise", topic)


@pytest.fixture(scope="module")
def unchecked(tmp_path_factory: pytest.TempPathFactory) -> str:
    """A Cyclone DDS whose access control does not check its own process."""
    if not shutil.which("cc") or not Path("/usr/include/dds/security/dds_security_api.h").exists():
        pytest.skip("apt-get install gcc libc6-dev cyclonedds-dev")
    library = security.library({})
    plugins = security.plugins_of(library) if library else None
    assert library is not None
    assert plugins is not None
    folder = tmp_path_factory.mktemp("unchecked")
    for path in (library, plugins / "libdds_security_auth.so", plugins / "libdds_security_crypto.so"):
        (folder / path.name).symlink_to(path)
    own = f'-DPLUGIN="{plugins / "libdds_security_ac.so"}"'
    source = Path(__file__).with_name("no_own_checks.c")
    output = folder / "libdds_security_ac.so"
    subprocess.run(["cc", "-shared", "-fPIC", own, "-o", str(output), str(source), "-ldl"], check=True)
    return str(folder / library.name)


def test_others_refuse_a_valid_enclave_that_skips_its_own_checks(
    make_peer: MakePeer, watcher: Peer, unchecked: str
) -> None:
    velocity = make_peer("velocity", CYCLONEDDS_LIBRARY=unchecked)
    states = hold_switch_and_turn_on(velocity, watcher)
    assert set(states) == {"off"}
    assert velocity("publish", ENGINES, "turn_on") == 0
    until(lambda: "kinematics" in velocity("nodes"))  # it has joined, with valid keys
    velocity("read", "effector/position")
    until(lambda: velocity("writers", "effector/position") == 1)


def test_others_refuse_permissions_that_a_valid_enclave_must_not_show(
    secure_site: SecureSite, make_peer: MakePeer, watcher: Peer, unchecked: str, tmp_path: Path
) -> None:
    own = permissions(secure_site.keystore, "velocity")
    tampered = tmp_path / "permissions.p7s"
    tampered.write_text(own.read_text().replace("rt/effector/speed", "rt/engines"))

    def show(node: str, shown: Path) -> Peer:
        return make_peer(node, "velocity", CYCLONEDDS_LIBRARY=unchecked, SHOWN_PERMISSIONS=str(shown))

    show("velocity_1", own)
    until(lambda: "velocity_1" in watcher("nodes"))  # this way of showing permissions works
    refused = {
        "velocity_2": show("velocity_2", tampered),
        "velocity_3": show("velocity_3", permissions(secure_site.keystore, "terminal")),
    }
    time.sleep(ATTEMPTS)
    assert {name: peer("nodes") for name, peer in refused.items()} == {name: [name] for name in refused}
    assert refused.keys().isdisjoint(watcher("nodes"))
