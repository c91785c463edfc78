"""The promises of the design (§7), each with its checker."""

from __future__ import annotations

from collections.abc import Callable

from deploy.chaos import liveness, safety
from deploy.chaos.findings import Finding
from deploy.chaos.history import History

CHECKERS: dict[str, Callable[[History], Finding]] = {
    "S1": safety.engines_off_in_time,
    "S2": safety.stays_on,
    "S3": safety.turned_on_by_the_present,
    "S4": safety.speeds_and_positions_are_true,
    "S5": safety.never_two_alive,
    "L1": liveness.comes_back,
    "L2": liveness.others_flow_on,
    "L3": liveness.right_after_return,
    "L4": liveness.hung_is_replaced,
}


def meaning(promise: str) -> str:
    """What is promised, in one sentence."""
    sentence = (CHECKERS[promise].__doc__ or "").partition(": ")[2].strip().replace("`", "")
    return sentence[:1].upper() + sentence[1:]
