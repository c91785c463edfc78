"""`make chaos`: inject faults into an arm, and judge the record.

Exit code 1 if the record violates a promise, or if it confirms none.
"""

from __future__ import annotations

import argparse
import fcntl
import os
import shutil
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from deploy.operator.output import use_plain_output
from deploy.supervision import interruption, processes
from deploy.supervision.environment import set_middleware
from deploy.supervision.errors import DeploymentError
from deploy.supervision.run_directory import make_directory
from deploy.supervision.system import System
from interfaces.service import UserError
from tests.chaos import plan
from tests.chaos.arm import file_suffix
from tests.chaos.cost import Cost
from tests.promises import observations
from tests.promises.charts import framed, timeline
from tests.promises.findings import HOLDS, count, overall
from tests.promises.html_report import html, verdict
from tests.promises.promises import checked, overloads
from tests.promises.text_report import text

KEPT = 10  # records


def main(arguments: Sequence[str]) -> int:
    interruption.install()
    use_plain_output()
    set_middleware(os.environ)
    options = plan.parse(arguments)
    try:
        if options.replay:
            return judge(options.replay, f"Record {options.replay}", "replay")
        return unleash(options)
    except interruption.Interrupted:
        print("Interrupted: all processes have been stopped.")
        return 130
    except (DeploymentError, UserError, OSError) as error:
        print(error, file=sys.stderr)
        return 1


def unleash(options: argparse.Namespace) -> int:
    """Start the arms, inject the faults, and judge the record; return the exit code."""
    planned = plan.plan(options)
    title, schedules, length, new_testbed = planned
    if options.loss:
        title += f", {options.loss:g} % packet loss"
    print(title, flush=True)

    def say(line: str) -> None:
        print(line, flush=True)

    with _directory() as directory:
        with new_testbed(directory, say=say, loss=options.loss, steps_clock=planned.steps_clock) as testbed:
            before = Cost.now(testbed.arms)
            try:
                testbed.inject(schedules, length)
            except interruption.Interrupted:  # the testbed completes the record
                say(f'To judge the record so far: make chaos CHAOS="--replay {testbed.record}"')
                raise
            cost = Cost.now(testbed.arms).since(before)
        print(f"\n{cost}")
        return judge(testbed.record, f"{title}, {cost}")


def judge(path: Path, title: str, name: str = "report") -> int:
    """Check the promises for each arm of a record, and write the reports; return the exit code."""
    namespaces = observations.namespaces(path)
    if not namespaces:
        raise DeploymentError(f"{path} contains no arm")
    if remark := observations.remark(path):
        print(remark)
    broken = [namespace for namespace in namespaces if not _holds(path, title, namespace, name)]
    if len(namespaces) > 1:
        result = f", but not for {', '.join(broken)}" if broken else ""
        print(f"\n{len(namespaces)} arms: promises hold{result}")
    return int(bool(broken))


def _holds(path: Path, title: str, namespace: str, name: str) -> bool:
    """Report on one arm; return whether promises hold, and none is violated."""
    interruption.check()
    history = observations.load(path, namespace)
    findings = []
    for finding in checked(history):
        interruption.check()
        findings.append(finding)
    overloaded = overloads(history, findings)
    title = f"{namespace}\n" if namespace != "/" else ""
    print(f"\n{title}{overloaded}\n\n{text(findings, history)}")
    faults = count(len(history.faults), "fault")
    messages = count(sum(map(len, history.streams.values())), "message")
    recorded = time.strftime("%Y-%m-%d %H:%M", time.localtime(path.stat().st_mtime))
    remarks = [
        f"{title} · {faults} · {messages} in {history.end:.0f} s",
        f"{recorded} · {count(os.cpu_count() or 1, 'core')} · {path.name}",
        overloaded,
    ]
    report = path.with_name(f"{name}{file_suffix(namespace)}.html")
    report.write_text(html(title, remarks, findings, history), encoding="utf-8")
    heading = f"{faults} in {history.end:.0f} s: {verdict(findings).lower()}"
    picture = framed(*timeline(history, findings), heading)
    report.with_suffix(".svg").write_text(picture, encoding="utf-8")
    print(f"\n{verdict(findings)}\nReport: {report}\nRecord: {path}")
    return overall(findings) == HOLDS


@contextmanager
def _directory() -> Iterator[Path]:
    """Create the directory of a record, and keep the last ten. Only one chaos monkey runs at a time."""
    base = processes.run_directory() / "chaos"
    make_directory(base)
    descriptor = os.open(base, os.O_RDONLY)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise DeploymentError(f"Another make chaos runs in {base}") from None
        old = sorted(base.glob("????????-??????"))
        for directory in old:
            for run in directory.glob("run*"):
                System(run).stop()  # left behind by a killed chaos monkey
        for directory in old[: 1 - KEPT]:
            shutil.rmtree(directory)
        directory = base / time.strftime("%Y%m%d-%H%M%S")
        try:
            yield directory
        finally:
            if not (directory / "record.mcap").exists():
                shutil.rmtree(directory, ignore_errors=True)
    finally:
        os.close(descriptor)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
