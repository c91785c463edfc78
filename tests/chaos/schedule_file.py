"""Schedule files: what happens to an arm, in YAML. `make simulate` and `make chaos` run them.

.. code-block:: yaml

    seed: 7 shift 12
    length: 45.0                                          # s
    parameters: {}                                        # as in a parameter file, nodes by full names
    scenario: {l1: {...}, operator: {...}, engines: ...}  # as in a scenario file
    second: {operator: ...}                               # of an arm on another host, if there is one
    faults:
      - {at: 5.0, kind: kill, target: kinematics, duration: 0.0}
"""

from __future__ import annotations

import math
import reprlib
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ros_yaml

from deploy.supervision.errors import DeploymentError
from tests.chaos.schedule import PlannedFault, Schedule


@dataclass(frozen=True)
class Experiment:
    """What happens to an arm. In a simulation, equal experiments give equal records."""

    seed: str
    """Of all chance in a simulation: in the network and the processes."""
    length: float
    """[s] of the scenario."""
    scenario: Mapping[str, Any]
    faults: Schedule
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """The content of a parameter file of the services."""
    second: Mapping[str, Any] | None = None
    """The scenario of a second arm on another host, if there is one (`make simulate` with --two-hosts)."""


def save(experiment: Experiment, path: Path) -> None:
    document = {
        "seed": experiment.seed,
        "length": experiment.length,
        "parameters": dict(experiment.parameters),
        "scenario": dict(experiment.scenario),
        **({"second": dict(experiment.second)} if experiment.second else {}),
        "faults": [each._asdict() for each in experiment.faults],
    }
    path.write_text(ros_yaml.dump(document, default_flow_style=None), encoding="utf-8")


def load(path: Path) -> Experiment:
    """Read an experiment from a file. Raises DeploymentError: one line with the file and the reason."""
    try:
        document: Any = ros_yaml.read(path)
        scenario = _checked(document, "scenario", dict, "mapping")
        faults = [_fault(each) for each in _checked(document, "faults", list, "list")]
        length = _seconds("length", document["length"])
        parameters = _checked({"parameters": {}} | document, "parameters", dict, "mapping")
        second = _checked(document, "second", dict, "mapping") if "second" in document else None
        return Experiment(str(document["seed"]), length, scenario, faults, parameters, second)
    except OSError as error:
        raise DeploymentError(f"{path}: {error.strerror}") from None
    except (KeyError, TypeError, ValueError) as error:
        reason = " ".join(str(error).split())
        raise DeploymentError(f"{path} is no schedule: {reason}") from None


def _fault(content: Any) -> PlannedFault:
    fault = PlannedFault(**content)
    for key in ("kind", "target"):
        _checked(content, key, str, "name")
    return fault._replace(at=_seconds("at", fault.at), duration=_seconds("duration", fault.duration))


def _checked(content: Any, key: str, kind: type, name: str) -> Any:
    """Return a value of a type. Raises ValueError."""
    value = content[key]
    if not isinstance(value, kind):
        raise ValueError(f"{key}: {reprlib.repr(value)} is no {name}")
    return value


def _seconds(key: str, value: Any) -> float:
    """Return a time [s]. Raises ValueError unless it is finite and not negative."""
    with suppress(TypeError, ValueError, OverflowError):
        if 0.0 <= (seconds := float(value)) < math.inf:
            return seconds
    raise ValueError(f"{key}: {reprlib.repr(value)} is no time in s")
