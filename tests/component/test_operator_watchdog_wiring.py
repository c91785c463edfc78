from __future__ import annotations

import threading
import time
from typing import Any
from unittest import mock

import pytest
import reactivex as rx
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from reactivex import Observable
from std_msgs.msg import Bool

from interfaces.service import ServiceNode, UserError
from interfaces.topics import (
    ALIVE,
    ENGINES,
    INCAPACITATED,
    MISSED,
    OPERATOR_ACTIVITY,
    OPERATOR_HEARTBEAT,
    OPERATOR_PRESENCE,
    TURN_OFF,
)
from reactive_node import stamps
from reactive_node.testing import SpinFor, SpinUntil
from services import operator_watchdog
from services.operator_watchdog import wire
from tests.component.wiring import Connect, Wired

OUTPUTS = [OPERATOR_PRESENCE, OPERATOR_ACTIVITY, ENGINES]


@pytest.fixture
def wired(connect: Connect, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr("interfaces.service.health.PERIOD", 3600.0)

    def make(**parameters: Any) -> Wired:
        return connect(wire, inputs=[OPERATOR_HEARTBEAT], outputs=OUTPUTS, **parameters)

    return make


def data(wired: Wired, topic: Any) -> list[str]:
    return [message.data for message in wired.heard[topic.name]]


def test_presence_is_stamped_with_the_source_time_of_the_heartbeat(
    wired: Any, spin_for: SpinFor, spin_until: SpinUntil
) -> None:
    watchdog = wired(sampling=0.3)
    sources: list[Any] = []

    def note(_: Any, info: Any) -> None:
        sources.append(stamps.from_nanoseconds(info["source_timestamp"]))

    watchdog.peer.create_subscription(Bool, OPERATOR_HEARTBEAT.name, note, OPERATOR_HEARTBEAT.qos)
    spin_for(0.1)
    presences = watchdog.heard[OPERATOR_PRESENCE.name]
    while not presences or not sources:
        watchdog.publish(OPERATOR_HEARTBEAT, Bool(data=True))
        spin_for(0.1)

    assert stamps.from_message(presences[0].stamp) in sources
    assert presences[0].frame_id == ""
    spin_until(lambda: data(watchdog, OPERATOR_ACTIVITY) == [ALIVE] * len(presences))


def test_heartbeat_older_than_the_lifespan_is_dropped_and_counted(
    wired: Any, spin_until: SpinUntil, spin_for: SpinFor, monkeypatch: pytest.MonkeyPatch
) -> None:
    watchdog = wired(lifespan=0.4, sampling=0.01)
    monkeypatch.setattr(watchdog.service, "age", lambda _: 0.401)
    watchdog.publish(OPERATOR_HEARTBEAT, Bool(data=True))
    spin_until(lambda: watchdog.service.health.dropped)
    spin_for(0.1)

    assert data(watchdog, OPERATOR_ACTIVITY) == []
    assert watchdog.remarks() == ["operator_heartbeat: it is 0.401 s old"]
    assert watchdog.reports()[-1]["dropped"] == "1"


def test_of_a_burst_of_heartbeats_the_newest_is_judged(
    wired: Any, spin_until: SpinUntil, spin_for: SpinFor, monkeypatch: pytest.MonkeyPatch
) -> None:
    watchdog = wired()
    monkeypatch.setattr(watchdog.service, "age", lambda _: 0.501)
    for _ in range(50):
        watchdog.publish(OPERATOR_HEARTBEAT, Bool(data=True))
    spin_until(lambda: watchdog.service.health.dropped)
    spin_for(0.1)
    watchdog.remarks()
    assert int(watchdog.reports()[-1]["dropped"]) < 5


@pytest.mark.parametrize(
    ("sampling", "lifespan", "period"),
    [(0.5, 0.5, 0.1), (0.02, 0.5, 0.02), (0.5, 0.06, 0.5 / 17), (0.15, 0.5, 0.075)],
)
def test_heartbeats_are_read_by_the_clock_before_they_are_old(
    wired: Any, monkeypatch: pytest.MonkeyPatch, sampling: float, lifespan: float, period: float
) -> None:
    create = mock.Mock(wraps=ServiceNode.create_sampled_observable)
    monkeypatch.setattr(
        ServiceNode, "create_sampled_observable", lambda *given, **named: create(*given, **named)
    )
    wired(sampling=sampling, lifespan=lifespan)
    (call,) = create.mock_calls
    assert call.args[2:4] == (OPERATOR_HEARTBEAT.name, pytest.approx(period))


@pytest.mark.parametrize("sampling", [0.4, 0.5])
def test_silence_that_is_over_before_the_first_sample_is_refused(wired: Any, sampling: float) -> None:
    with pytest.raises(UserError, match=rf"^sampling: must be less than silence, 0.4 s, not {sampling}$"):
        wired(silence=0.4, sampling=sampling)


def test_silences_are_missed_then_incapacitated_then_turn_off(
    wired: Any, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = time.monotonic()
    repeat = 0.05  # s
    commands = mock.Mock(wraps=operator_watchdog.engine_commands)
    monkeypatch.setattr(operator_watchdog, "engine_commands", commands)
    watchdog = wired(silence=0.4, sampling=0.1, strikes=2, repeat=repeat)
    logged: list[str] = []
    threads: set[int] = set()
    logger = watchdog.service.get_logger()

    def warn(text: str) -> None:
        logged.append(text)
        threads.add(threading.get_ident())

    monkeypatch.setattr(logger, "warning", warn)
    monkeypatch.setattr(watchdog.service, "get_logger", lambda: logger)
    spin_until(lambda: len(watchdog.heard[ENGINES.name]) >= 5)
    took = time.monotonic() - begin

    assert data(watchdog, OPERATOR_ACTIVITY) == [MISSED, MISSED, INCAPACITATED]
    assert data(watchdog, ENGINES) == [TURN_OFF] * len(watchdog.heard[ENGINES.name])
    assert watchdog.heard[OPERATOR_PRESENCE.name] == []
    assert logged == [f"operator {MISSED}", f"operator {MISSED}", f"operator {INCAPACITATED}"]
    assert threads == {threading.get_ident()}, "that of the executor"
    assert took >= 2 * 0.4 + 3 * repeat
    assert commands.mock_calls == [mock.call(mock.ANY, repeat=repeat)]


def test_turn_off_does_not_wait_for_the_log(
    wired: Any, spin_until: SpinUntil, monkeypatch: pytest.MonkeyPatch
) -> None:
    order: list[str] = []
    publish = Publisher.publish

    def note(publisher: Publisher, message: Any) -> None:
        if publisher.topic == ENGINES.name:
            order.append(TURN_OFF)
        publish(publisher, message)

    monkeypatch.setattr(Publisher, "publish", note)
    monkeypatch.setattr(ServiceNode, "get_logger", lambda _: mock.Mock(warning=order.append))
    wired(silence=0.4, sampling=0.1, strikes=1)
    spin_until(lambda: len(order) >= 3)
    assert order[:3] == [f"operator {MISSED}", TURN_OFF, f"operator {INCAPACITATED}"]


def test_all_outputs_come_from_one_count_of_strikes(
    wired: Any, monkeypatch: pytest.MonkeyPatch, spin_until: SpinUntil
) -> None:
    recipe = operator_watchdog.operator_activity
    begun: list[float] = []

    def counted(*given: Any, **options: Any) -> Observable[Any]:
        def begin(_: Any) -> Observable[Any]:
            begun.append(time.monotonic())
            return recipe(*given, **options)

        return rx.defer(begin)

    monkeypatch.setattr(operator_watchdog, "operator_activity", counted)
    watchdog = wired(silence=0.1, sampling=0.05)
    spin_until(lambda: INCAPACITATED in data(watchdog, OPERATOR_ACTIVITY) and data(watchdog, ENGINES))
    assert len(begun) == 1


@pytest.mark.parametrize(("begin", "resumes"), [(-60.0, True), (60.0, False)])
def test_watchdog_resumes_a_running_scenario(
    wired: Any, monkeypatch: pytest.MonkeyPatch, begin: float, resumes: bool
) -> None:
    recipe = mock.Mock(wraps=operator_watchdog.operator_activity)  # its samples have tests in virtual time
    monkeypatch.setattr(operator_watchdog, "operator_activity", recipe)
    wired(scenario_epoch=time.monotonic() + begin)
    assert [call.kwargs["resumes"] for call in recipe.mock_calls] == [resumes]


def test_watchdog_samples_at_the_parameter_in_a_new_scenario(wired: Any, spin_for: SpinFor) -> None:
    began = time.monotonic()
    watchdog = wired(sampling=0.8)
    while not watchdog.heard[OPERATOR_PRESENCE.name]:
        watchdog.publish(OPERATOR_HEARTBEAT, Bool(data=True))
        spin_for(0.02)
    assert time.monotonic() - began >= 0.8


def test_no_operator_is_expected_before_the_scenario(
    wired: Any, spin_for: SpinFor, spin_until: SpinUntil
) -> None:
    watchdog = wired(silence=0.1, sampling=0.05, scenario_epoch=-1.0)
    spin_for(0.3)
    assert data(watchdog, OPERATOR_ACTIVITY) == []

    watchdog.service.set_parameters([Parameter("scenario_epoch", value=time.monotonic())])
    spin_until(lambda: data(watchdog, OPERATOR_ACTIVITY)[:1] == [MISSED])
