"""The network model: what the kit decides by chance, and what takes too long to show for real."""

from __future__ import annotations

from collections.abc import Callable
from statistics import median
from typing import Any

import pytest
import rclpy
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import Int64

from rclpy_simulation import Delay, Network, Process, Simulation

BEST_EFFORT = QoSProfile(depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
LATCHED = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
EXACT = Delay(0.001, 0.001)


class Talker:
    """A program that publishes numbers whenever the test asks for it."""

    def __init__(self, profile: QoSProfile | int = 10) -> None:
        self.profile = profile
        self.publisher: Any = None

    def __call__(self) -> None:
        rclpy.init()
        node = rclpy.create_node("talker")
        self.publisher = node.create_publisher(Int64, "numbers", self.profile)
        rclpy.spin(node)


class Listener:
    """A program that keeps the numbers, and the events of matching and liveliness."""

    def __init__(self, profile: QoSProfile | int = 10) -> None:
        self.profile = profile
        self.received: list[int] = []
        self.times: list[float] = []
        self.matched: list[tuple[float, int]] = []
        self.alive: list[tuple[float, int]] = []
        self.missed: list[float] = []

    def __call__(self) -> None:
        import time

        def on_message(message: Int64) -> None:
            self.received.append(message.data)
            self.times.append(time.monotonic() - 1000.0)

        def note(log: list[tuple[float, int]], count: int) -> None:
            log.append((round(time.monotonic() - 1000.0, 3), count))

        rclpy.init()
        node = rclpy.create_node("listener")
        events = SubscriptionEventCallbacks(
            matched=lambda info: note(self.matched, info.current_count),
            liveliness=lambda info: note(self.alive, info.alive_count),
            deadline=lambda info: self.missed.append(round(time.monotonic() - 1000.0, 3)),
        )
        node.create_subscription(Int64, "numbers", on_message, self.profile, event_callbacks=events)
        rclpy.spin(node)


Pair = tuple[Talker, Process, Listener, Process]
Start = Callable[..., Pair]


def publish(simulation: Simulation, process: Process, talker: Talker, *numbers: int) -> None:
    process.interrupt(lambda: [talker.publisher.publish(Int64(data=each)) for each in numbers])
    simulation.run(0.0)


@pytest.fixture
def start(simulation: Simulation) -> Start:
    """Starts a talker and a listener on two hosts, and waits until they have met."""

    def start(offered: QoSProfile | int = 10, requested: QoSProfile | int | None = None) -> Pair:
        talker, listener = Talker(offered), Listener(offered if requested is None else requested)
        talking = simulation.start(talker, host="left", name="talker")
        listening = simulation.start(listener, host="right", name="listener")
        simulation.run_until(lambda: listener.matched and talker.publisher.get_subscription_count())
        return talker, talking, listener, listening

    return start


@pytest.mark.simulation(seed=1, network=Network(latency=Delay(0.010, 0.050)))
def test_latency_has_the_given_median_and_percentile(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, _ = start(BEST_EFFORT)
    latencies = []
    for number in range(400):
        sent = simulation.now
        publish(simulation, talking, talker, number)
        simulation.run(1.0)
        latencies.append(listener.times[-1] - sent)
    assert median(latencies) == pytest.approx(0.010, rel=0.1)
    assert sum(latency > 0.050 for latency in latencies) <= 10


@pytest.mark.simulation(seed=1, network=Network(latency=EXACT))
def test_samples_of_a_held_topic_arrive_together(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, _ = start(BEST_EFFORT)
    begin = simulation.now
    simulation.hold(talker.publisher.topic_name.replace("/", "rt/", 1), 2.0)
    simulation.hold(talker.publisher.topic_name.replace("/", "rt/", 1), 1.5)  # the longer one counts
    simulation.hold("rt/other", 9.0)
    publish(simulation, talking, talker, 1)
    simulation.run(1.0)
    publish(simulation, talking, talker, 2)
    simulation.run(2.0)
    publish(simulation, talking, talker, 3)
    simulation.run(1.0)
    assert listener.received == [1, 2, 3]
    assert [time - begin for time in listener.times] == pytest.approx([2.0, 2.0, 3.0], abs=0.1)


@pytest.mark.simulation(seed=1, network=Network(latency=EXACT))
def test_samples_of_a_lost_topic_never_arrive(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, _ = start(10)
    simulation.lose(talker.publisher.topic_name.replace("/", "rt/", 1), 2.0)
    simulation.lose(talker.publisher.topic_name.replace("/", "rt/", 1), 1.5)  # the longer one counts
    simulation.lose("rt/other", 9.0)
    for number in (1, 2, 3):
        publish(simulation, talking, talker, number)
        simulation.run(1.01)
    assert listener.received == [3]


@pytest.mark.simulation(seed=1)
@pytest.mark.parametrize("offered", [BEST_EFFORT, 1000], ids=["best effort", "reliable"])
def test_a_best_effort_reader_loses_samples_at_the_given_rate(
    simulation: Simulation, start: Start, offered: QoSProfile | int
) -> None:
    talker, talking, listener, _ = start(offered, BEST_EFFORT)
    simulation.network.loss = 0.2
    publish(simulation, talking, talker, *range(1000))
    simulation.run(10.0)
    assert len(listener.received) == pytest.approx(800, abs=40)
    assert listener.received == sorted(listener.received)


@pytest.mark.simulation(seed=1, network=Network(latency=EXACT, retransmission=Delay(0.05, 0.05)))
def test_reliable_samples_arrive_late_instead_and_in_order(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, _ = start(1000)
    simulation.network.loss = 0.5
    sent = simulation.now
    publish(simulation, talking, talker, *range(200))
    simulation.run(10.0)
    assert listener.received == list(range(200))
    assert listener.times[-1] - sent > 0.05


@pytest.mark.simulation(seed=3, network=Network(latency=EXACT, retransmission=Delay(0.05, 0.05)))
def test_a_short_history_drops_lost_samples_for_newer_ones(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, _ = start(1)
    simulation.network.loss = 0.5
    for number in range(100):
        publish(simulation, talking, talker, number)
        simulation.run(0.02)
    simulation.run(5.0)
    assert listener.received[-1] == 99
    assert len(listener.received) < 90
    assert listener.received == sorted(set(listener.received))


@pytest.mark.parametrize("part", [1.0, 5.0, -0.1])
def test_a_loss_that_is_no_part_is_refused(part: float) -> None:
    with pytest.raises(ValueError, match="no part of the packets"):
        Network(loss=part)
    with pytest.raises(ValueError, match="no part of the packets"):
        Network().loss = part


@pytest.mark.simulation(seed=1, network=Network(loss=0.5))
def test_discovery_survives_loss(simulation: Simulation, start: Start) -> None:
    *_, listener, _ = start(10)
    assert listener.matched[0][1] == 1


def test_samples_within_a_process_are_not_lost(simulation: Simulation) -> None:
    received: list[int] = []

    def program() -> None:
        rclpy.init()
        node = rclpy.create_node("both")
        publisher = node.create_publisher(Int64, "numbers", BEST_EFFORT)
        node.create_subscription(Int64, "numbers", lambda message: received.append(message.data), BEST_EFFORT)
        for number in range(50):
            publisher.publish(Int64(data=number))
        rclpy.spin(node)

    simulation.network.loss = 0.9
    simulation.start(program)
    simulation.run(1.0)
    assert received == list(range(50))


@pytest.mark.simulation(seed=2)
def test_reliable_samples_survive_a_short_partition(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, _ = start(3)
    simulation.cut("left", "right")
    publish(simulation, talking, talker, 1, 2, 3, 4, 5)
    simulation.run(5.0)
    assert listener.received == []
    simulation.heal("left", "right")
    publish(simulation, talking, talker, 6)
    simulation.run(1.0)
    assert listener.received == [3, 4, 5, 6]


@pytest.mark.simulation(seed=2)
def test_a_partition_loses_best_effort_samples(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, _ = start(BEST_EFFORT)
    simulation.cut("left", "right")
    publish(simulation, talking, talker, 1)
    simulation.run(5.0)
    simulation.heal("left", "right")
    publish(simulation, talking, talker, 2)
    simulation.run(1.0)
    assert listener.received == [2]


@pytest.mark.simulation(seed=2)
def test_a_long_partition_ends_the_match_and_its_end_renews_it(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, _ = start(LATCHED)
    publish(simulation, talking, talker, 1)
    simulation.run(1.0)
    cut = simulation.now
    simulation.cut("left", "right")
    simulation.run(30.0)
    lost = listener.matched[1]
    assert lost == (pytest.approx(cut + simulation.network.lease, abs=0.002), 0)
    assert talker.publisher.get_subscription_count() == 0
    publish(simulation, talking, talker, 2)
    healed = simulation.now
    simulation.heal("left", "right")
    simulation.run(simulation.network.announcement + 1.0)
    assert listener.matched[2][1] == 1
    assert healed < listener.matched[2][0] < healed + simulation.network.announcement + 0.5
    assert listener.received == [1, 2]


@pytest.mark.simulation(seed=2)
def test_an_endpoint_made_during_a_partition_is_found_after_it(simulation: Simulation, start: Start) -> None:
    _, talking, _, listening = start()
    late: list[int] = []

    def subscribe() -> None:
        node = rclpy.create_node("late")
        rclpy.get_global_executor().add_node(node)
        node.create_subscription(Int64, "late", lambda message: late.append(message.data), LATCHED)

    def offer() -> None:
        node = rclpy.create_node("offer")
        rclpy.get_global_executor().add_node(node)
        node.create_publisher(Int64, "late", LATCHED).publish(Int64(data=1))

    simulation.cut("left", "right")
    listening.interrupt(subscribe)
    talking.interrupt(offer)
    simulation.run(5.0)
    assert late == []
    simulation.heal("left", "right")
    simulation.run(1.0)
    assert late == [1]


@pytest.mark.simulation(seed=2)
def test_a_goodbye_during_a_partition_is_noticed_by_the_lease(simulation: Simulation, start: Start) -> None:
    _, talking, listener, _ = start()
    simulation.cut("left", "right")
    talking.send_signal(15)
    simulation.run(1.0)
    assert talking.exit_code is not None
    simulation.heal("left", "right")
    simulation.run(5.0)
    assert listener.matched[-1][1] == 1
    simulation.run(5.0)
    assert listener.matched[-1][1] == 0


@pytest.mark.simulation(seed=2)
def test_a_killed_writer_stays_matched_until_its_lease_ends(simulation: Simulation, start: Start) -> None:
    _, talking, listener, _ = start()
    killed = simulation.now
    talking.kill()
    simulation.run(20.0)
    assert listener.matched[-1] == (pytest.approx(killed + 10.0, abs=0.002), 0)


@pytest.mark.simulation(seed=2)
@pytest.mark.parametrize("fault", ["stop", "kill", "cut"])
def test_a_silent_participant_loses_its_automatic_liveliness(
    simulation: Simulation, start: Start, fault: str
) -> None:
    talker, talking, listener, _ = start(QoSProfile(depth=1, liveliness_lease_duration=Duration(seconds=0.5)))
    simulation.run(5.0)
    assert [count for _, count in listener.alive] == [1]
    silent = simulation.now
    simulation.cut("left", "right") if fault == "cut" else getattr(talking, fault)()
    simulation.run(2.0)
    assert listener.alive[-1] == (pytest.approx(silent + 0.5, abs=0.002), 0)
    if fault != "kill":
        talking.proceed()
        simulation.heal("left", "right")
        publish(simulation, talking, talker, 1)
        simulation.run(0.5)
        assert listener.alive[-1][1] == 1


@pytest.mark.simulation(seed=2, network=Network(latency=EXACT))
def test_a_reader_misses_a_deadline_in_each_period_of_silence(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, _ = start(QoSProfile(depth=1, deadline=Duration(seconds=0.1)))
    simulation.run(1.0)
    assert listener.missed == []
    sent = simulation.now
    publish(simulation, talking, talker, 1)
    simulation.run(0.25)
    publish(simulation, talking, talker, 2)
    simulation.run(0.15)
    expected = [sent + 0.101, sent + 0.201, sent + 0.351]
    assert listener.missed == pytest.approx(expected, abs=0.002)


@pytest.mark.simulation(seed=2)
def test_a_stopped_reader_gets_the_last_samples_when_it_proceeds(
    simulation: Simulation, start: Start
) -> None:
    talker, talking, listener, listening = start(2)
    listening.stop()
    publish(simulation, talking, talker, 1, 2, 3)
    simulation.run(1.0)
    assert listener.received == []
    listening.proceed()
    simulation.run(1.0)
    assert listener.received == [2, 3]


@pytest.mark.simulation(seed=2)
@pytest.mark.parametrize(("seconds", "counts"), [(9.0, [1]), (15.0, [1, 0, 1])])
def test_a_stop_longer_than_the_lease_ends_the_match_for_a_while(
    simulation: Simulation, start: Start, seconds: float, counts: list[int]
) -> None:
    _, talking, listener, _ = start()
    talking.stop()
    simulation.run(seconds)
    talking.proceed()
    simulation.run(20.0)
    assert [count for _, count in listener.matched] == counts


@pytest.mark.simulation(seed=2)
def test_a_reader_that_was_stopped_for_longer_than_the_lease_hears_again(
    simulation: Simulation, start: Start
) -> None:
    talker, talking, listener, listening = start()
    listening.stop()
    simulation.run(15.0)
    assert talker.publisher.get_subscription_count() == 0
    listening.proceed()
    simulation.run(20.0)
    publish(simulation, talking, talker, 1)
    simulation.run(1.0)
    assert listener.received == [1]


@pytest.mark.simulation(seed=2)
def test_a_hung_reader_is_alive_for_dds(simulation: Simulation, start: Start) -> None:
    talker, talking, listener, listening = start()
    listening.hang()
    publish(simulation, talking, talker, 1)
    simulation.run(30.0)
    assert listener.received == []
    assert talker.publisher.get_subscription_count() == 1


@pytest.mark.simulation(seed=2)
@pytest.mark.parametrize(("fault", "answer"), [("", True), ("stop", False), ("kill", False)])
def test_waiting_for_acknowledgements_notices_an_absent_reader(
    simulation: Simulation, start: Start, fault: str, answer: bool
) -> None:
    talker, talking, _, listening = start()
    if fault:
        getattr(listening, fault)()
    answers: list[bool] = []

    def ask() -> None:
        talker.publisher.publish(Int64(data=1))
        answers.append(talker.publisher.wait_for_all_acked(Duration(seconds=1)))

    talking.interrupt(ask)
    simulation.run(2.0)
    assert answers == [answer]
