from __future__ import annotations

import gc
import threading
import weakref

import pytest
import reactivex as rx
from rclpy.exceptions import ParameterNotDeclaredException
from rclpy.parameter import Parameter

from reactive_node import ReactiveNode
from reactive_node.testing import SpinUntil


def test_parameter_observable_emits_present_and_new_values(node: ReactiveNode) -> None:
    node.declare_parameter("gain", 1.0)
    node.declare_parameter("other", 1.0)
    gains: list[float] = []
    subscription = node.create_parameter_observable("gain").subscribe(gains.append)

    node.set_parameters([Parameter("gain", value=2.0)])
    node.set_parameters([Parameter("other", value=9.0)])
    node.set_parameters_atomically([Parameter("other", value=8.0), Parameter("gain", value=3.0)])
    node.set_parameters([Parameter("gain", value="wrong type")])
    subscription.dispose()
    node.set_parameters([Parameter("gain", value=4.0)])

    assert gains == [1.0, 2.0, 3.0]


@pytest.mark.parametrize("name", ["gain", "undeclared"])
def test_observer_that_has_left_is_forgotten(node: ReactiveNode, spin_until: SpinUntil, name: str) -> None:
    node.declare_parameter("gain", 1.0)

    def take(value: float) -> None:
        pass

    left = weakref.ref(take)

    def is_forgotten() -> bool:
        gc.collect()
        return left() is None

    node.create_parameter_observable(name).subscribe(take, lambda _: None).dispose()
    del take
    spin_until(is_forgotten)


def test_observers_agree_when_one_of_them_sets_parameter(node: ReactiveNode) -> None:
    node.declare_parameter("speed", 1.0)
    seen: dict[str, list[float]] = {"obedient": [], "bounded": []}

    def bound(value: float) -> None:
        seen["bounded"].append(value)
        if value > 2.0:
            node.set_parameters([Parameter("speed", value=2.0)])

    speed = node.create_parameter_observable("speed")
    speed.subscribe(seen["obedient"].append)
    speed.subscribe(bound)
    node.set_parameters([Parameter("speed", value=5.0)])

    assert node.get_parameter("speed").value == 2.0
    assert [values[-1] for values in seen.values()] == [2.0, 2.0]


def test_disposing_during_a_change_hides_it_from_no_callback(node: ReactiveNode) -> None:
    node.declare_parameter("gain", 1.0)
    node.declare_parameter("on", True)
    changed: list[str] = []
    node.add_post_set_parameters_callback(lambda each: changed.extend(parameter.name for parameter in each))
    gain, on = (node.create_parameter_observable(name) for name in ("gain", "on"))
    on.switch_map(lambda on: gain if on else rx.never()).subscribe()

    node.set_parameters([Parameter("on", value=False)])

    assert changed == ["on"]


def test_observer_may_set_parameter_when_it_gets_present_value(node: ReactiveNode) -> None:
    node.declare_parameter("gain", 1.0)
    gains: list[float] = []

    def double(gain: float) -> None:
        gains.append(gain)
        if len(gains) == 1:
            node.set_parameters([Parameter("gain", value=2 * gain)])

    node.create_parameter_observable("gain").subscribe(double)

    assert gains == [1.0, 2.0]


def test_parameter_set_by_other_thread_while_subscribing_is_not_missed(
    node: ReactiveNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    node.declare_parameter("gain", 1.0)
    get = node.get_parameter
    setter = threading.Thread(target=lambda: node.set_parameters([Parameter("gain", value=2.0)]))
    notifying = threading.Event()

    def get_too_early(name: str) -> Parameter:
        monkeypatch.undo()  # the setter's thread gets the value too, and must not come here
        present = get(name)
        node.add_post_set_parameters_callback(lambda _: notifying.set())  # the last added is called first
        setter.start()
        assert notifying.wait(10)
        return present

    gains: list[float] = []
    monkeypatch.setattr(node, "get_parameter", get_too_early)
    node.create_parameter_observable("gain").subscribe(gains.append)
    setter.join(10)

    assert gains == [1.0, 2.0]


def test_undeclared_parameter_is_error_of_observable(node: ReactiveNode) -> None:
    errors: list[Exception] = []
    node.create_parameter_observable("gain").subscribe(on_error=errors.append)
    node.declare_parameter("gain", 1.0)
    node.set_parameters([Parameter("gain", value=2.0)])

    assert [type(error) for error in errors] == [ParameterNotDeclaredException]
