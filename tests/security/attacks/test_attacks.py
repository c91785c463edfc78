"""Who cannot move the engines of an arm that joins with keys; the rows of A2 in deploy/SAFETY.md."""

from __future__ import annotations

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing, contextmanager, suppress
from datetime import timedelta
from pathlib import Path

import pytest
from rclpy_ground.cyclonedds import security

from deploy.security import keystore as keystores
from deploy.security import rights
from deploy.security.keystore import Keystore
from deploy.supervision.manifest import VIRTUAL_JOINTS
from deploy.supervision.system import System
from tests.chaos import clock
from tests.chaos.faults import INJECTED
from tests.operator.page.clients import Hand
from tests.security.attacks.conftest import PROGRAMS, MakePeer, Peer, Refused, SecureSite, until
from tests.system.sites import Site

ATTEMPTS = 3.0  # s for which a stranger tries
HEARTBEAT, ENGINES, STATE = "operator_heartbeat", "engines", "engines/state"


@pytest.fixture
def watcher(make_peer: MakePeer) -> Peer:
    """A peer with the recorder's keys that hears the state of the engines."""
    return watching(make_peer)


@pytest.fixture
def open_watcher(make_open_peer: MakePeer) -> Peer:
    """A peer that hears the state of the engines of the arm without keys."""
    return watching(make_open_peer)


def watching(make_peer: MakePeer) -> Peer:
    watcher = make_peer("recorder_1", "recorder")
    watcher("read", STATE)
    until(lambda: "off" in watcher("heard", STATE))
    return watcher


def hold_switch_and_turn_on(peer: Peer, watcher: Peer, seconds: float = ATTEMPTS) -> list[str]:
    """Send heartbeats and `turn_on`; return the states of the engines meanwhile."""
    for name in (HEARTBEAT, ENGINES):
        peer("advertise", name)
    states: list[str] = []
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline and "on" not in states:
        peer("publish", HEARTBEAT, True)
        peer("publish", ENGINES, "turn_on")
        states += watcher("heard", STATE)
        time.sleep(0.05)
    return states


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


def permissions(keystore: Keystore, enclave: str) -> Path:
    return keystore.folder / "enclaves" / enclave / "permissions.p7s"


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


@pytest.fixture
def copy(secure_site: SecureSite, tmp_path: Path) -> Keystore:
    """A copy of the keys, to be damaged."""
    folder = tmp_path / "copy"
    shutil.copytree(secure_site.keystore.folder, folder, symlinks=True)
    return Keystore(folder)


def test_tampered_permissions_do_not_join(make_peer: MakePeer, copy: Keystore) -> None:
    path = copy.folder / "enclaves" / "velocity" / "permissions.p7s"
    path.write_text(path.read_text().replace("rt/effector/speed", "rt/engines"))
    with pytest.raises(Refused, match="cannot join DDS domain"):
        make_peer("velocity", ROS_SECURITY_KEYSTORE=str(copy.folder))


def test_permissions_of_another_enclave_do_not_join(make_peer: MakePeer, copy: Keystore) -> None:
    enclaves = copy.folder / "enclaves"
    shutil.copy(enclaves / "terminal" / "permissions.p7s", enclaves / "velocity" / "permissions.p7s")
    with pytest.raises(Refused, match="cannot join DDS domain"):
        make_peer("velocity", ROS_SECURITY_KEYSTORE=str(copy.folder))


def test_an_expired_certificate_does_not_join(make_peer: MakePeer, copy: Keystore, tmp_path: Path) -> None:
    folder = copy.folder / "enclaves" / "velocity"
    request, certificate, key = tmp_path / "request.pem", folder / "cert.pem", folder / "key.pem"
    ca, ca_key = copy.folder / "public" / "ca.cert.pem", copy.folder / "private" / "ca.key.pem"
    for words in (
        f"x509 -x509toreq -in {certificate} -signkey {key} -out {request}",
        f"x509 -req -in {request} -CA {ca} -CAkey {ca_key} -days -1 -set_serial 7 -out {certificate}",
    ):
        subprocess.run(["openssl", *words.split()], check=True)
    with pytest.raises(Refused, match=r"cannot join DDS domain [^\n]* expired"):
        make_peer("velocity", ROS_SECURITY_KEYSTORE=str(copy.folder))


@pytest.fixture
def late(tmp_path: Path) -> Iterator[dict[str, str]]:
    """The environment of a process whose clock is two hours behind."""
    if reason := clock.missing():
        pytest.skip(reason)
    offset = tmp_path / "offset"
    offset.write_text("-7200\n")
    path = os.pathsep.join(filter(None, [str(INJECTED), os.environ.get("PYTHONPATH")]))
    with clock.faked() as environment:
        yield environment | clock.Clock(offset).environment() | {"PYTHONPATH": path}


def test_others_refuse_a_certificate_that_has_expired(
    secure_site: SecureSite,
    make_peer: MakePeer,
    watcher: Peer,
    copy: Keystore,
    late: dict[str, str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Its own library takes it, because its clock is behind."""
    valid = make_peer("terminal_5", "terminal", **late)
    until(lambda: "terminal_5" in watcher("nodes"))  # such a clock keeps nobody out
    valid.close()  # by its clock, the other is valid
    (copy.folder / "enclaves" / "terminal" / "cert.pem").unlink()
    monkeypatch.setattr(keystores, "AFTER", -timedelta(hours=1))
    copy.write({"/terminal": rights.of_arm("/", PROGRAMS)["/terminal"]}, [secure_site.domain])
    shutil.copy(permissions(secure_site.keystore, "terminal"), permissions(copy, "terminal"))

    expired = make_peer("terminal_6", "terminal", ROS_SECURITY_KEYSTORE=str(copy.folder), **late)

    time.sleep(ATTEMPTS)
    assert expired("nodes") == ["terminal_6"]
    assert "terminal_6" not in watcher("nodes")


def test_keys_that_end_stop_their_own_service_until_they_are_renewed(
    secure_site: SecureSite, watcher: Peer, monkeypatch: pytest.MonkeyPatch
) -> None:
    name, keystore = "velocity", secure_site.keystore
    own = {f"/{name}": rights.of_arm("/", PROGRAMS)[f"/{name}"]}
    (keystore.folder / "enclaves" / name / "cert.pem").unlink()
    with monkeypatch.context() as patch:
        patch.setattr(keystores, "AFTER", timedelta(seconds=10))
        keystore.write(own, [secure_site.domain])
    os.kill(secure_site.members[name], signal.SIGKILL)

    log = secure_site.run / "logs" / f"{name}.log"
    until(lambda: f"{name}: the keys of /{name} have ended at " in log.read_text())
    watcher("heard", STATE)
    until(lambda: watcher("heard", STATE))  # the others go on
    keystore.write(own, [secure_site.domain])

    until(lambda: re.search(rf"{name} +RUNNING .*(?:ago|never)", secure_site.do("status")[1]))


def test_status_shows_the_processes_though_its_keys_have_ended(secure_site: SecureSite) -> None:
    permissions = secure_site.keystore.folder / "enclaves" / "terminal" / "permissions.p7s"
    whole = permissions.read_bytes()
    permissions.write_bytes(re.sub(rb"<not_after>\d+", b"<not_after>2001", whole))
    code, shown = secure_site.do("status")
    permissions.write_bytes(whole)
    assert code == 1
    assert re.search("^kinematics +[A-Z]+ .* (no report|-)$", shown, re.MULTILINE), shown
    assert re.search("^Cannot join the ROS graph: the keys of /terminal have ended", shown, re.MULTILINE)


def test_no_keys_at_all_do_not_join(make_peer: MakePeer) -> None:
    with pytest.raises(Refused, match=r"^ROS_SECURITY_ENABLE is true, but there is no [^\n]*nobody/[^\n]*$"):
        make_peer("nobody")


class Wire:
    """The UDP packets on loopback: recorded, and sent again as they were."""

    def __init__(self) -> None:
        try:
            self._sender = socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_RAW)
        except PermissionError:
            pytest.skip("platform: this user may not record packets")
        self.packets: list[tuple[float, bytes]] = []
        """Each with the time since the one before [s]."""

    @contextmanager
    def recording(self, ports: range) -> Iterator[None]:
        """Record meanwhile what is sent to some ports."""
        ended = threading.Event()
        with socket.socket(socket.AF_INET, socket.SOCK_RAW, socket.IPPROTO_UDP) as receiver:
            receiver.setsockopt(
                socket.SOL_SOCKET, socket.SO_RCVBUF, 1 << 22
            )  # bursts come faster than Python reads
            receiver.setsockopt(socket.SOL_SOCKET, socket.SO_BINDTODEVICE, b"lo")
            receiver.settimeout(0.05)
            recorder = threading.Thread(target=self._record, args=[receiver, ports, ended])
            recorder.start()
            try:
                yield
            finally:
                ended.set()
                recorder.join()

    def _record(self, receiver: socket.socket, ports: range, ended: threading.Event) -> None:
        before = time.monotonic()
        while not ended.is_set():
            with suppress(TimeoutError):
                packet = receiver.recv(65536)
                at = _udp(packet) + 2
                if int.from_bytes(packet[at : at + 2]) in ports:
                    now = time.monotonic()
                    self.packets.append((now - before, packet))
                    before = now

    def repeat(self) -> None:
        """Send all packets again, at the pace at which they came."""
        for pause, packet in self.packets:
            time.sleep(pause)
            self._sender.sendto(_without_checksum(packet), ("127.0.0.1", 0))

    def close(self) -> None:
        self._sender.close()


def _udp(packet: bytes) -> int:
    """Return where the header of UDP begins, after that of IPv4."""
    return 4 * (packet[0] & 15)


def _without_checksum(packet: bytes) -> bytes:
    """Return a packet of UDP without its checksum, which the kernel does not complete on loopback."""
    at = _udp(packet) + 6
    return packet[:at] + bytes(2) + packet[at + 2 :]


@pytest.fixture
def wire() -> Iterator[Wire]:
    with closing(Wire()) as wire:
        yield wire


Heard = dict[str, list[object]]
"""What a watcher heard, by topic."""


def repeat(wire: Wire, watcher: Peer) -> Heard:
    """Send the recorded packets twice; return what the watcher hears until a second later."""
    heard: Heard = {name: [] for name in (HEARTBEAT, ENGINES, STATE)}

    def listen() -> None:
        for name, values in heard.items():
            values += watcher("heard", name)

    listen()
    for values in heard.values():
        values.clear()
    with ThreadPoolExecutor() as threads:
        for work in (wire.repeat, wire.repeat, lambda: time.sleep(1.0)):
            done = threads.submit(work)
            while not done.done():
                listen()
            done.result()
    return heard


def ports_of(domain: int) -> range:
    """Return the ports of DDS in a domain."""
    return range(7400 + 250 * domain, 7650 + 250 * domain)


def repeat_an_operator(make_peer: MakePeer, watcher: Peer, wire: Wire, domain: int) -> tuple[Heard, Heard]:
    """Record all packets of a domain, from before an operator joins until it has gone, and repeat them.

    Return what the watcher hears again while the operator lives, and after its end.
    """
    for name in (HEARTBEAT, ENGINES):
        watcher("read", name)
    until(lambda: watcher("writers", HEARTBEAT) == 2)  # the virtual switch and the page
    ports = ports_of(domain)
    with wire.recording(ports):
        operator = make_peer("terminal_3", "terminal")
        assert "on" in hold_switch_and_turn_on(operator, watcher, 30.0)
        for _ in range(20):  # an operator's usual packets
            operator("publish", HEARTBEAT, True)
            operator("publish", ENGINES, "turn_on")
            time.sleep(0.05)
        operator("publish", ENGINES, "turn_off")
        until(lambda: watcher("heard", STATE)[-1:] == ["off"])
    alive = repeat(wire, watcher)
    with wire.recording(ports):
        operator.close()
        until(lambda: watcher("writers", HEARTBEAT) == 2)
    return alive, repeat(wire, watcher)


def test_keys_hide_messages_but_no_enclaves_and_permissions(
    secure_site: SecureSite, make_peer: MakePeer, watcher: Peer, wire: Wire
) -> None:
    with wire.recording(ports_of(secure_site.domain)):
        operator = make_peer("terminal_3", "terminal")
        assert "on" in hold_switch_and_turn_on(operator, watcher, 30.0)
        operator("publish", ENGINES, "turn_off")
        until(lambda: watcher("heard", STATE)[-1:] == ["off"])
    recorded = b"".join(packet for _, packet in wire.packets)
    assert b"turn_on" not in recorded
    for shown in (b"/terminal", b"BEGIN CERTIFICATE", b"<allow_rule>", b"rt/engines"):
        assert shown in recorded


def test_repeated_packets_move_nothing(
    secure_site: SecureSite, make_peer: MakePeer, watcher: Peer, wire: Wire
) -> None:
    for heard in repeat_an_operator(make_peer, watcher, wire, secure_site.domain):
        assert set(heard[STATE]) == {"off"}
        assert "turn_on" not in heard[ENGINES]
        assert True not in heard[HEARTBEAT]


def test_repeated_packets_are_heard_without_keys(
    open_site: Site, make_open_peer: MakePeer, open_watcher: Peer, wire: Wire
) -> None:
    """Only the services refuse them there, because a heartbeat and a `turn_on` of that time are old."""
    _, heard = repeat_an_operator(make_open_peer, open_watcher, wire, open_site.domain)
    assert "turn_on" in heard[ENGINES]
    assert True in heard[HEARTBEAT]
