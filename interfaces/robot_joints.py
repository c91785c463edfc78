"""What a robot says about its joints: several nodes may publish sensor_msgs/JointState, each for its own."""

from __future__ import annotations

from collections.abc import Callable, Collection

import reactivex as rx
from reactivex import Observable
from sensor_msgs.msg import JointState

SILENCE = 1.0  # s without an angle, after which health says so
Layouts = frozenset[frozenset[str]]
"""The sets of names that states have had: that of each publisher."""
_MOST_LAYOUTS = 20  # that are remembered: others choose their number
_MOST_NAMES, _LONGEST_NAME = 8, 40  # in a reason


def complaints(
    angles: Observable[float],
    states: Observable[JointState],
    joint: str,
    publishers: Callable[[], Collection[str]],
) -> Observable[str]:
    """Emit that no angle of a joint comes, twice a second, and who else publishes the joint, every second.

    :param angles: the good ones.
    :param publishers: returns the nodes that publish states.
    """
    known = layouts(states)
    silences = angles.start_with(0.0).switch_map(lambda _: rx.timer(SILENCE, SILENCE / 2))
    silent = silences.with_latest_from(known).map(lambda pair: missing(joint, pair[1]))
    looks = rx.interval(SILENCE).with_latest_from(known)
    return rx.merge(silent, looks.map(lambda pair: rivals(joint, pair[1], publishers())).filter(bool))


def layouts(states: Observable[JointState]) -> Observable[Layouts]:
    """Emit the sets of names so far, first that there are none."""

    def add(known: Layouts, state: JointState) -> Layouts:
        without = "" if len(state.position) else " (without position)"
        names = frozenset(f"{name}{without}" for name in state.name)
        return known if len(known) >= _MOST_LAYOUTS else known | {names}

    none: Layouts = frozenset()
    return states.scan(add, none).start_with(none)


def missing(joint: str, known: Layouts) -> str:
    """Return that a joint has no angle, and which joints the states have instead."""
    names = sorted({name for layout in known for name in layout})
    reason = f"no angle for {SILENCE:g} s"
    if joint in names or not known:
        return reason
    if not names:
        return f"{reason}: the states have no names"
    # Drivers put a prefix before the names of the description, as "left/elbow" or "ur_elbow".
    similar = [name for name in names if name.endswith(joint)]
    return f"{reason}: the states have {_listed(names)}" + (f"; is it {_listed(similar)}?" if similar else "")


def rivals(joint: str, known: Layouts, nodes: Collection[str]) -> str:
    """Return which nodes publish a joint; empty unless more than one does.

    A state does not name its publisher. Each other publisher of good states shows names without the joint.
    """
    others = sum(joint not in layout for layout in known)
    if others == len(known) or len(nodes) - others < 2:
        return ""
    return f"{_listed(sorted(nodes))} publish states, and more than one has this joint"


def _listed(names: Collection[str]) -> str:
    shown = [name[:_LONGEST_NAME] for name in [*names][:_MOST_NAMES]]
    more = len(names) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")
