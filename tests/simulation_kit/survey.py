"""Runs programs of others for a simulated hour each, and prints a table: what runs, and why the rest ends.

It fetches nothing. ``survey.toml`` lists the sets of programs and their repositories. Check these out into
one folder, each under the last part of its name, and give the folder::

    python tests/simulation_kit/survey.py FOLDER > table.md

Each set runs in two interpreters, with different hash seeds. With names of sets, only these run, and their
output is shown.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import tomllib
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from itertools import cycle
from pathlib import Path
from typing import Any

import rclpy_simulation
from rclpy_simulation.process import Process

_LIST = Path(__file__).with_suffix(".toml")
_OF_ALL_NODES = ("rt/rosout", "rt/parameter_events")
_ENVIRONMENT = {"ROS_DISTRO": "jazzy", "TURTLEBOT3_MODEL": "burger"}
_LIMIT = 600  # s of real time for a set
_HEAD = "| programs | result of an hour | messages | CPU s | same |\n|---|---|---:|---:|---|"


def main() -> None:
    parser = argparse.ArgumentParser(description="Run programs of others for a simulated hour each.")
    parser.add_argument("folder", type=Path, help="has the checkouts")
    parser.add_argument("set", nargs="*", help="only these, by name; shows what they print")
    parser.add_argument("--list", type=Path, default=_LIST, help="default %(default)s")
    parser.add_argument("--seconds", type=float, default=3600.0, help="simulated, default %(default)s")
    parser.add_argument("--into", type=Path, help=argparse.SUPPRESS)  # run one set here; result as JSON
    given = parser.parse_intermixed_args()
    sets = {each["name"]: each for each in tomllib.loads(given.list.read_text())["set"]}
    if given.into:
        given.into.write_text(json.dumps(_run(sets[given.set[0]], given.folder, given.seconds)))
        return
    print(_HEAD)
    results = Counter[str]()
    for name in given.set or sets:
        runs = [_in_interpreter(name, given, seed) for seed in "12"]
        results[runs[0]["result"].partition(":")[0]] += 1
        print(_row(name, runs), flush=True)
    print(
        f"\n{results.total()} sets: {results['runs']} run, {results['ends']} end in order,"
        f" {results['fails']} fail for a named reason, {results['FAULT']} break the simulation."
    )


def _in_interpreter(name: str, given: argparse.Namespace, seed: str) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as temporary:
        result = Path(temporary, "result.json")
        options = ["--list", given.list, "--seconds", str(given.seconds), "--into", result]
        try:
            done = subprocess.run(
                [sys.executable, __file__, given.folder, name, *options],
                env={**os.environ, "PYTHONHASHSEED": seed},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=None if given.set else subprocess.DEVNULL,
                timeout=_LIMIT,
            )
        except subprocess.TimeoutExpired:
            return {"result": f"FAULT: not done within {_LIMIT} s"}
        if done.returncode:
            return {"result": f"FAULT: the simulation ends with exit code {done.returncode}"}
        found: dict[str, Any] = json.loads(result.read_text())
    if given.set:
        print(found["output"], file=sys.stderr)
    return found


def _row(name: str, runs: list[dict[str, Any]]) -> str:
    first, second = runs
    same = "yes" if first.get("digest") and first["digest"] == second.get("digest") else "no"
    cells = [name, first["result"], first.get("messages", ""), first.get("cpu", ""), same]
    return f"| {' | '.join(map(str, cells))} |"


def _run(programs: Mapping[str, Any], folder: Path, seconds: float) -> dict[str, Any]:
    """Run a set; return what has become of it."""
    sys.path[:0] = [str(folder / path) for path in programs["paths"]]
    sys.argv = sys.argv[:1]
    environment = _ENVIRONMENT | programs.get("environment", {})
    digest, messages = hashlib.sha256(), 0
    began = time.process_time()
    with rclpy_simulation.Simulation(seed=7) as simulation:

        def note(writer: Any, sample: Any) -> None:
            nonlocal messages
            messages += writer.topic not in _OF_ALL_NODES
            digest.update(f"{simulation.now!r} {writer.topic} ".encode() + bytes(sample.data))

        simulation.tap(note)
        lines = (line.replace("{folder}", str(folder)).split() for line in programs["run"])
        processes = [
            simulation.start(_program(name), *arguments, environment=environment, name=name)
            for name, *arguments in lines
        ]
        if feed := programs.get("feed"):
            simulation.start(_feeder(feed), name="feeder")
        keys = cycle(programs.get("keys", []))
        for at, key in zip(range(1, int(seconds)), keys):  # noqa: B905  # ends with the hour
            simulation.at(float(at), lambda key=key: [process.input.type(key) for process in processes])
        with suppress(TimeoutError):
            simulation.run_until(lambda: all(process.ended for process in processes), seconds)
        result = _result(processes)
        for process in simulation.processes:
            process.send_signal(signal.SIGINT)
        simulation.run(10.0)
    output = "\n".join(f"--- {it.name}: {it.exit_code}\n{it.output.text[-3000:]}" for it in processes)
    digest.update(re.sub(r" at 0x[0-9a-f]+", "", output).encode())  # addresses differ, as in Python
    return {
        "result": result,
        "messages": messages,
        "cpu": round(time.process_time() - began, 1),
        "digest": digest.hexdigest(),
        "output": output,
    }


def _program(name: str) -> str | Callable[[], Any]:
    module, _, function = name.partition(":")
    return (lambda: getattr(importlib.import_module(module), function)()) if function else name


def _result(processes: list[Process]) -> str:
    for process in processes:
        if process.exit_code:
            output = process.output.text.partition("Exception ignored in")[0]  # that came afterwards
            texts = [line.lstrip(" |+-") for line in output.splitlines()]  # without the lines of a group
            last = [f"exit code {process.exit_code}", *filter(None, texts)][-1]
            reason = re.sub(r"( is missing)[.:].*", r"\1", last)  # without where it comes from
            return f"fails: {reason}"
    return "ends" if all(process.ended for process in processes) else "runs"


def _feeder(feed: list[dict[str, Any]]) -> Callable[[], None]:
    """Return a program that publishes the same messages ten times a second."""

    def program() -> None:
        import rclpy

        rclpy.init()
        node = rclpy.create_node("feeder")
        for each in feed:
            package, _, kind = each["type"].split("/")
            message = getattr(importlib.import_module(f"{package}.msg"), kind)()
            _fill(message, each.get("fields", {}))
            publisher = node.create_publisher(type(message), each["topic"], each.get("depth", 10))
            node.create_timer(0.1, lambda publisher=publisher, message=message: publisher.publish(message))
        rclpy.spin(node)

    return program


def _fill(message: Any, fields: Mapping[str, Any]) -> None:
    for name, value in fields.items():
        if isinstance(value, dict):
            _fill(getattr(message, name), value)
        else:
            setattr(message, name, value)


if __name__ == "__main__":
    main()
