"""An engine controller with a bug: it does not turn off on its own when it hears of no operator."""

from __future__ import annotations

from dataclasses import replace

from interfaces import service
from interfaces.latch import Event, Latch
from services import engine_controller
from services.engine_controller import Parameters

_step = engine_controller.step


def step(latch: Latch, event: Event, parameters: Parameters) -> Latch:
    """Take every presence for one that is still valid an hour later."""
    return _step(latch, event, replace(parameters, presence_timeout=3600.0))


if __name__ == "__main__":
    engine_controller.step = step  # type: ignore[assignment]  # nobody relies on its defaults here
    service.run("engine_controller", engine_controller.wire)
