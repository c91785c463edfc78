"""Signals: values at every time, made from samples (the behaviours of functional reactive programming).

The thesis behind this repository names behaviours in 2.3.1 and wishes for them in chapter 6. Observables
stay the language of events; signals are the values between them. ``SIGNALS.md`` shows three problems.

Times are integers, nanoseconds since 1970. Durations are seconds.
"""

from reactive_node.signals.answers import CERTAIN, EXTRAPOLATED, HELD, UNKNOWN, Answer, Refused
from reactive_node.signals.replay import as_taken
from reactive_node.signals.samples import (
    Extrapolated,
    Held,
    Nothing,
    Silence,
    Unchanged,
    hold,
    interpolate,
    linear,
    slerp,
)
from reactive_node.signals.signal import Signal, constant, lift, of_time, switch

__all__ = [
    "Signal",
    "hold",
    "linear",
    "slerp",
    "interpolate",
    "constant",
    "of_time",
    "lift",
    "switch",
    "Silence",
    "Nothing",
    "Unchanged",
    "Held",
    "Extrapolated",
    "Answer",
    "CERTAIN",
    "HELD",
    "EXTRAPOLATED",
    "UNKNOWN",
    "Refused",
    "as_taken",
]
