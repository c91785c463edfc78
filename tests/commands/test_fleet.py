"""Which arms `make fleet` watches, and the tag that keeps the arms of a ROS domain apart."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Collection, Iterator
from contextlib import ExitStack, closing
from pathlib import Path

import pytest
from std_msgs.msg import String

from deploy.commands import fleet
from deploy.commands.fleet import Domain, Place, places
from deploy.security import rights
from deploy.security.keystore import Keystore
from deploy.supervision import interruption, processes
from deploy.supervision.environment import CYCLONEDDS, RANGE, set_middleware
from deploy.supervision.errors import DeploymentError
from reactive_node.domains import reserved_domain
from tests.chaos.partition import CONTROL, ROBOT, missing, namespaces
from tests.environment import user_environment
from tests.system.sites import Command, Site

LIMIT = 30.0  # s


def surroundings(namespace: str, domain: int, **given: str) -> dict[str, str]:
    environment = {"RUNTIME": "cyclonedds", "REACTIVE_ARM_NAMESPACE": namespace, "ROS_DOMAIN_ID": str(domain)}
    environment |= given
    set_middleware(environment)
    return environment


@pytest.fixture
def domain() -> Iterator[int]:
    with reserved_domain() as domain:
        yield domain


@pytest.mark.parametrize("reach", ["LOCALHOST", "SUBNET"])
def test_processes_of_one_arm_meet_and_those_of_another_do_not(reach: str, domain: int) -> None:
    names = ("/arm1", "/arm1", "/arm2")
    with ExitStack() as stack:
        nodes = [
            stack.enter_context(
                fleet.joined(
                    fleet.place(surroundings(name, domain, ROS_AUTOMATIC_DISCOVERY_RANGE=reach)).domain,
                    number,
                )
            )
            for number, name in enumerate(names)
        ]
        readers = [node.create_subscription(String, "words", lambda _: None, 1) for node in nodes]
        writer = nodes[0].create_publisher(String, "words", 1)
        deadline = time.monotonic() + LIMIT
        while writer.get_subscription_count() < 2 and time.monotonic() < deadline:
            time.sleep(0.02)
        assert writer.get_subscription_count() == 2
        assert nodes[2].count_publishers("words") == 0
        assert len(readers) == 3


@pytest.fixture
def two_arms(monkeypatch: pytest.MonkeyPatch) -> None:
    """This host has /arm1, without keys, and /arm2, with keys."""
    arms = [surroundings("/arm1", 7), surroundings("/arm2", 7, ROS_SECURITY_ENABLE="true")]
    arms[1]["ROS_SECURITY_KEYSTORE"] = "/keys"
    monkeypatch.setattr(processes, "systems", lambda: dict(enumerate(arms)))


@pytest.mark.usefixtures("two_arms")
@pytest.mark.parametrize(
    ("secured", "shown", "hidden"),
    [
        ("", "/arm1", "/arm2, with keys: make fleet SECURE=yes"),
        ("true", "/arm2", "/arm1, without keys: make fleet"),
    ],
)
def test_arms_with_keys_and_without_them_are_shown_apart(
    secured: str, shown: str, hidden: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROS_SECURITY_ENABLE", secured)
    (found,) = places([])
    assert found.namespace == shown
    assert dict(found.domain.variables).get("ROS_SECURITY_KEYSTORE") == ("/keys" if secured else None)
    assert fleet.hidden_arms() == hidden


def test_named_arm_with_keys_has_no_tag(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "systems", dict)
    monkeypatch.setenv("ROS_SECURITY_ENABLE", "true")
    monkeypatch.setenv("ROS_SECURITY_KEYSTORE", "keys")
    (found,) = places(["/arm2=5"])
    assert CYCLONEDDS not in dict(found.domain.variables)


def test_domains_keep_their_number_within_the_process() -> None:
    domains = [Domain(0, ()), Domain(0, (("x", "tag"),)), Domain(1, ()), Domain(5, ())]
    assert [fleet.numbers_of(domains)[domain] for domain in domains] == [0, 2, 1, 5]


def test_domain_that_cannot_be_joined_hides_no_other(domain: int, capfd: pytest.CaptureFixture[str]) -> None:
    good, bad = (
        Domain(domain, (("ROS_AUTOMATIC_DISCOVERY_RANGE", reach),)) for reach in ("LOCALHOST", "NOWHERE")
    )
    with ExitStack() as stack:
        assert [*fleet.join(stack, [good, bad])] == [good]
        assert "NOWHERE" in capfd.readouterr().out
        with pytest.raises(DeploymentError, match=f"^Cannot join ROS domain {domain}: .*NOWHERE"):
            fleet.join(stack, [bad])


def test_arm_that_says_it_has_no_keys_needs_none(domain: int) -> None:
    where = Domain(domain, (("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST"), ("ROS_SECURITY_ENABLE", "false")))
    with ExitStack() as stack:
        assert [*fleet.join(stack, [where])] == [where]


def test_arm_whose_keystore_has_no_fleet_is_reported(tmp_path: Path) -> None:
    keystore = tmp_path / "keys"
    where = Domain(5, (("ROS_SECURITY_ENABLE", "true"), ("ROS_SECURITY_KEYSTORE", str(keystore))))
    with ExitStack() as stack:
        with pytest.raises(
            DeploymentError, match=f"^Cannot join ROS domain 5: {keystore} is no keystore: make"
        ):
            fleet.join(stack, [where])
        Keystore(keystore).write({"/terminal": rights.observer("/", "terminal")}, [5])
        with pytest.raises(DeploymentError, match=f"{keystore} has no keys for /fleet: make keystore$"):
            fleet.join(stack, [where])


def test_arms_of_this_host_and_named_ones_are_found(monkeypatch: pytest.MonkeyPatch) -> None:
    here = surroundings("/arm1", 7)
    monkeypatch.setattr(processes, "systems", lambda: {Path("/run"): here, Path("/same"): here})
    monkeypatch.setenv("ROS_DOMAIN_ID", "3")
    found = places(["/arm2=5", "/arm3"])
    assert sorted({(place.namespace, place.domain.number) for place in found}) == [
        ("/arm1", 7),
        ("/arm2", 5),
        ("/arm3", 3),
    ]
    # The rclpy of an arm on another host is not known: with a tag, or without.
    tags = [dict(place.domain.variables).get(CYCLONEDDS, "") for place in found if place.namespace == "/arm2"]
    assert sorted("<Tag>/arm2</Tag>" in tag for tag in tags) == [False, True]
    assert places([]) == {Place("/arm1", Domain(7, fleet.place(here).domain.variables))}


def test_other_dds_than_cyclone_joins_each_domain_once_under_its_number(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(fleet, "get_rmw_implementation_identifier", lambda: "rmw_fastrtps_cpp")
    monkeypatch.setattr(processes, "systems", lambda: {Path("/run"): surroundings("/arm1", 5)})
    monkeypatch.setenv(RANGE, "LOCALHOST")
    found = places(["/arm1=5", "/arm2=5"])
    assert {place.namespace for place in found} == {"/arm1", "/arm2"}
    (domain,) = {place.domain for place in found}
    assert (domain.number, CYCLONEDDS in dict(domain.variables)) == (5, False)
    elsewhere = Domain(5, ((RANGE, "SUBNET"),))
    assert fleet.numbers_of([domain, elsewhere]) == {domain: 5, elsewhere: 5}


@pytest.mark.parametrize(
    ("named", "given", "reach"),
    [
        (["/arm2"], {}, "SUBNET"),
        ([], {}, None),
        (["/arm2"], {RANGE: "LOCALHOST"}, "LOCALHOST"),
        (["/arm2"], {"ROS_STATIC_PEERS": "robot.example"}, None),
    ],
)
def test_named_arms_are_looked_for_in_the_network_unless_the_user_says_where(
    named: list[str], given: dict[str, str], reach: str | None
) -> None:
    environment = {**given}
    fleet.set_reach(environment, named)
    assert environment.get(RANGE) == reach


def test_arm_of_another_host_is_heard(tmp_path: Path, domain: int) -> None:
    if reason := missing():
        pytest.skip(f"platform: {reason}")
    given = {name: value for name, value in user_environment().items() if name != RANGE}
    given["ROS_DOMAIN_ID"] = str(domain)
    arm = given | {RANGE: "SUBNET", "REACTIVE_ARM_NAMESPACE": "/arm7"}
    set_middleware(arm)
    with namespaces() as full, closing(Site(tmp_path / "run", domain)) as site:

        def begin(host: str, environment: dict[str, str], module: str, *arguments: str) -> Command:
            command = ["ip", "netns", "exec", full(host), sys.executable, "-m", module, *arguments]
            return site.begin_alone(command, environment)

        begin(ROBOT, arm, "services.kinematics")
        shown = begin(CONTROL, given, "deploy.commands.fleet", "/arm7")
        shown.await_line(rf"^/arm7 +{domain} .* 1 ok ")


@pytest.mark.parametrize("name", ["arm1", "/arm1=x", "=5"])
def test_wrong_name_of_an_arm_is_one_line(name: str) -> None:
    with pytest.raises(DeploymentError, match=f"^ARMS: {name} is no arm such as /arm1"):
        places([name])


def test_arm_that_is_seen_once_only_ends_no_watch(monkeypatch: pytest.MonkeyPatch) -> None:
    lasting, short = (Place(name, Domain(7, ())) for name in ("/lasting", "/short"))
    seen = iter([{lasting}, {lasting}, {lasting, short}])
    monkeypatch.setattr(fleet, "places", lambda _: next(seen, {lasting}))
    watched: list[set[Place]] = []

    def watch(found: set[Place], more: Callable[[], bool], _: object) -> None:
        watched.append({*found})
        if len(watched) > 1:
            raise interruption.Interrupted
        assert more()

    monkeypatch.setattr(fleet, "watch", watch)
    with pytest.raises(interruption.Interrupted):
        fleet.run([])
    assert watched[0] == {lasting}


def test_host_without_an_arm_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "systems", dict)
    with pytest.raises(DeploymentError, match=r"^No arm runs on this host\."):
        fleet.run([])


def test_arms_that_ended_last_stay_in_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    arms = [Place(f"/arm{number}", Domain(7, ())) for number in range(100)]
    running = iter(
        [{arms[0], each} for each in arms[1:] for _ in range(2)]
    )  # looked at by `more`, and by `run`
    monkeypatch.setattr(fleet, "places", lambda _: next(running))
    watched: set[Place] = set()

    def watch(found: Collection[Place], more: Callable[[], bool], _: object) -> None:
        watched.clear()
        watched.update(found)
        assert more()

    monkeypatch.setattr(fleet, "watch", watch)
    with pytest.raises(StopIteration):
        fleet.run([])
    assert watched == {arms[0], *arms[-1 - fleet.MOST_ENDED :]}
