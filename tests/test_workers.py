from __future__ import annotations

import signal

import pytest

from deploy.supervision.errors import DeploymentError
from tests.workers import done


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_results_come_in_order(method: str) -> None:
    assert [*done(abs, [-3, 2, -1], bool, (), method=method)] == [3, 2, 1]


@pytest.mark.parametrize("method", ["spawn", "fork"])
def test_worker_that_is_killed_is_an_error(method: str) -> None:
    with pytest.raises(DeploymentError, match="A worker process was killed"):
        [*done(signal.raise_signal, [signal.SIGKILL, signal.SIGTERM], bool, (), method=method)]


def test_error_of_the_work_is_passed_on() -> None:
    with pytest.raises(ZeroDivisionError):
        [*done(divmod_by_zero, [1], bool, (), method="fork")]


def divmod_by_zero(number: int) -> None:
    divmod(number, 0)
