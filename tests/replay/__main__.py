"""`make replay`: feed a record through these services in virtual time, and show what differs.

Exit codes: 0 if the replayed output equals the recorded one within the bounds of
:mod:`tests.replay.comparison`, 1 if it differs, 2 if nothing can be compared, or the record or the
command line has an error.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from heapq import merge
from pathlib import Path

import ros_yaml

from deploy.operator.output import use_plain_output
from deploy.supervision import interruption, parameter_file, processes
from deploy.supervision.errors import DeploymentError
from deploy.supervision.recorder import Recorder, qos_profiles
from interfaces import topics
from interfaces.service import UserError
from tests.replay import chains
from tests.replay.job import Job, Outcome, run_all
from tests.replay.record import Record, load
from tests.replay.report import report

REPLAYED = ".replayed.mcap"


def main(arguments: Sequence[str]) -> int:
    interruption.install()
    use_plain_output()
    options = _parse(arguments)
    try:
        if not options.record:
            options.record = newest(processes.run_directory())
            print(f"Record: {options.record}", flush=True)
        output = options.output or options.record.with_suffix(REPLAYED)
        record = load(options.record)
        interruption.check()
        with tempfile.TemporaryDirectory(prefix="reactive-arm-") as directory:
            jobs = _jobs(record, options, Path(directory))
            outcomes = run_all(record, jobs)
        _write(output, record, outcomes)
    except interruption.Interrupted:
        return 130
    except (DeploymentError, UserError) as error:
        print(error, file=sys.stderr)
        return 2
    except OSError as error:
        print(f"{error.filename or output}: {error.strerror or error}", file=sys.stderr)
        return 2
    lines, is_equal = report(record, outcomes)
    print("\n".join([*lines, f"Output: {output}"]))
    return 2 if is_equal is None else 0 if is_equal else 1


def _parse(arguments: Sequence[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        prog="make replay",
        usage='make replay [RECORD=FILE] [REPLAY="OPTION ..."]',
        description="Feed a record through these services in virtual time, and show what differs.",
    )
    add = parser.add_argument
    add(
        "record",
        nargs="?",
        type=Path,
        metavar="RECORD=FILE",
        help="an MCAP of `make record`, `make chaos` or `ros2 bag record -s mcap`; by default, the newest one"
        " of the first two",
    )
    add("--namespace", help="of the arm; by default, all arms of the record")
    add("--parameters", default="", metavar="FILE", help="a ROS parameter file for the services")
    add("--output", type=Path, metavar="FILE", help="for the replayed messages, default RECORD.replayed.mcap")
    return parser.parse_args(arguments)


def newest(run: Path) -> Path:
    """Return the newest record in a run directory. Raises DeploymentError if there is none."""
    found = [*run.glob("records/*.mcap"), *run.glob("chaos/*/record.mcap")]
    records = [path for path in found if not path.name.endswith(REPLAYED)]
    if not records:
        raise DeploymentError(f"There is no record in {run}: make record, or make replay RECORD=FILE")
    return max(records, key=lambda path: path.stat().st_mtime)


def _jobs(record: Record, options: argparse.Namespace, directory: Path) -> list[Job]:
    namespaces = record.namespaces()
    if options.namespace is not None:
        if options.namespace not in namespaces:
            raise DeploymentError(
                f"{options.record} has no arm {options.namespace}; it has {', '.join(namespaces)}"
            )
        namespaces = [options.namespace]
    jobs = []
    for number, namespace in enumerate(namespaces):
        parameters = None
        if options.parameters:
            parameters = directory / f"{number}.yaml"
            parameters.write_text(ros_yaml.dump(parameter_file.load(options.parameters, namespace)))
        jobs += [
            Job(namespace, chain, parameters)
            for chain in chains.CHAINS
            if chains.has_input(record, namespace, chain)
        ]
    if not jobs:
        raise DeploymentError(f"{options.record} contains nothing that a service hears")
    return jobs


def _write(path: Path, record: Record, outcomes: Sequence[Outcome]) -> None:
    new = path.with_name(f".{path.name}.new")
    new.unlink(missing_ok=True)
    recorder = Recorder(new, record.begin, record.begin)
    by_name = {topic.name: topic for topic in topics.CONTRACT}
    offered = {topic.name: qos_profiles(topic) for topic in topics.CONTRACT}
    streams = [
        [(sent, number, name, data) for sent, data in messages]
        for number, outcome in enumerate(outcomes)
        for name, messages in outcome.messages.items()
    ]
    try:
        for sent, number, name, data in merge(*streams, key=lambda each: each[:2]):
            interruption.check()
            topic = by_name[name]
            full = topic.full_name(outcomes[number].job.namespace)
            recorder.message(full, topic.type_name, offered[name], data, sent, sent)
        recorder.close()
        new.replace(path)
    finally:
        new.unlink(missing_ok=True)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
