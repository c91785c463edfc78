"""`make mutants`: change the safety path in every small way, and count the changes that no test notices.

Exit code 1 if a mutant survives that `equivalent.toml` does not list, or if a listed one does not survive.
"""

from __future__ import annotations

import argparse
import json
import os
import queue
import sys
import tempfile
import threading
import time
import tomllib
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from deploy.supervision import interruption
from deploy.supervision.processes import ROOT
from tests.mutants.checkout import CheckoutCopy
from tests.mutants.guards import GUARDS, SIMULATION
from tests.mutants.mutations import Mutant, mutants

EQUIVALENT = Path(__file__).with_name("equivalent.toml")
_BENCHES = 2 * (os.cpu_count() or 1)  # many tests wait
_LOOK = 0.2  # s between two looks for an interruption or a failure
_CLEAR = "\r\x1b[K" if sys.stdout.isatty() else ""


@dataclass
class Score:
    """What became of the mutants of a module."""

    mutants: int = 0
    killed: int = 0
    """by component tests"""
    killed_by_simulation: int = 0
    survivors: list[Mutant] = field(default_factory=list)


def main(arguments: Sequence[str]) -> int:
    usage = 'make mutants [MODULES="MODULE ..."]'
    parser = argparse.ArgumentParser(prog="make mutants", usage=usage, description=__doc__)
    parser.add_argument("modules", nargs="*", help="paths of modules; all if there are none")
    modules = parser.parse_args(arguments).modules or list(GUARDS)
    if unknown := [module for module in modules if module not in GUARDS]:
        print(f"No tests guard {', '.join(unknown)}. Modules: {', '.join(GUARDS)}", file=sys.stderr)
        return 2
    equivalent = tomllib.loads(EQUIVALENT.read_text(encoding="utf-8"))
    interruption.install()
    scores = {module: Score() for module in modules}
    try:
        test(scores, equivalent)
    except interruption.Interrupted:
        print(f"{_CLEAR}Interrupted. Nothing in this checkout has changed. So far:")
        report(scores, {})
        return 130
    except RuntimeError as error:
        print(f"{_CLEAR}{error}", file=sys.stderr)
        return 1
    return report(scores, equivalent)


def test(scores: dict[str, Score], equivalent: dict[str, dict[str, str]]) -> None:
    """Test all mutants of modules, several at a time; print each survivor that is not listed."""
    work: queue.Queue[Mutant | None] = queue.Queue(maxsize=100)
    failures: list[Exception] = []
    lock = threading.Lock()
    began = time.monotonic()

    def run(copy: CheckoutCopy) -> None:
        while (mutant := work.get()) is not None:
            if failures:
                continue
            try:
                score, killed_by_simulation = scores[mutant.module], False
                killed = copy.kills(mutant, GUARDS[mutant.module])
                if not killed:
                    killed_by_simulation = copy.kills(mutant, SIMULATION)
            except Exception as error:
                failures.append(error)
                continue
            with lock:
                score.mutants += 1
                score.killed += killed
                score.killed_by_simulation += killed_by_simulation
                if not killed and not killed_by_simulation:
                    score.survivors.append(mutant)
                    if mutant.change not in equivalent.get(mutant.module, {}):
                        print(f"{_CLEAR}{mutant.module}:{mutant.line} survives: {_quoted(mutant.change)}")
                _show(scores, mutant.module, began)

    def hand_out(mutant: Mutant | None) -> None:
        while True:
            interruption.check()
            if failures:
                raise failures[0]
            with suppress(queue.Full):
                return work.put(mutant, timeout=_LOOK)

    copies: list[CheckoutCopy] = []
    threads: list[threading.Thread] = []
    with tempfile.TemporaryDirectory(prefix="mutants-", ignore_cleanup_errors=True) as directory:
        try:
            for number in range(_BENCHES):
                copies.append(CheckoutCopy(ROOT, Path(directory, str(number))))
                threads.append(threading.Thread(target=run, args=(copies[-1],)))
                threads[-1].start()
            for module in scores:
                for mutant in mutants(ROOT, module):
                    hand_out(mutant)
            for _ in threads:
                hand_out(None)
            for thread in threads:
                while thread.is_alive():
                    interruption.check()
                    thread.join(_LOOK)
            if failures:
                raise failures[0]
        finally:
            failures.append(RuntimeError("the end"))  # the threads take no further mutant
            for copy in copies:
                copy.close()
            for _ in threads:
                work.put(None)
            for thread in threads:
                thread.join()


def _show(scores: dict[str, Score], module: str, began: float) -> None:
    """Print the progress: on a terminal in one line, elsewhere every hundred mutants."""
    done = sum(score.mutants for score in scores.values())
    survivors = sum(len(score.survivors) for score in scores.values())
    minutes, seconds = divmod(round(time.monotonic() - began), 60)
    text = f"{done} mutants, {survivors} survive, {minutes}:{seconds:02} min: {module}"
    if sys.stdout.isatty():
        print(f"{_CLEAR}{text}", end="", flush=True)
    elif done % 100 == 0:
        print(text, flush=True)


def report(scores: dict[str, Score], equivalent: dict[str, dict[str, str]]) -> int:
    """Print the table, and each listed mutant that does not survive; return the exit code."""
    width = max(map(len, scores))
    print(f"{_CLEAR}\n{'':{width}}  mutants  killed  only by simulation  survivors  not listed")
    failed = False
    for module, score in scores.items():
        listed = equivalent.get(module, {})
        survivors = {mutant.change for mutant in score.survivors}
        failed = failed or survivors != listed.keys()
        print(
            f"{module:{width}}  {score.mutants:7}  {score.killed:6}"
            f"  {score.killed_by_simulation:18}"
            f"  {len(score.survivors):9}  {len(survivors - listed.keys()):10}"
        )
    for module, score in scores.items():
        survivors = {mutant.change for mutant in score.survivors}
        for change in sorted(equivalent.get(module, {}).keys() - survivors):
            print(f"{module}: listed as equivalent, but killed or gone: {_quoted(change)}")
    return int(failed)


def _quoted(change: str) -> str:
    return json.dumps(change, ensure_ascii=False)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
