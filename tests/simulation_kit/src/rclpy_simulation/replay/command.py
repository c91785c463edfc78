"""The command line of a replay."""

from __future__ import annotations

import argparse
import shlex
import sys
import tempfile
from collections.abc import Callable, Container, Sequence
from decimal import Decimal, InvalidOperation
from pathlib import Path
from typing import TextIO

from mcap_files import UnreadableError

from rclpy_simulation.host import SECOND
from rclpy_simulation.network import Delay, Network
from rclpy_simulation.replay.bag import Bag
from rclpy_simulation.replay.comparison import Bounds, compare
from rclpy_simulation.replay.lives import Run
from rclpy_simulation.replay.player import constant_network
from rclpy_simulation.replay.replay import GRACE, Ending, Options, Outcome, replay

_Program = tuple[list[str], argparse.Namespace]
"""Its words, and the options of this command that concern it."""

_NAME = "python -m rclpy_simulation"
_OF_RUN = ("--host", "--start", "--kill")
_SHOWN = 8  # last lines of a program that failed

_EPILOG = """\
PROGRAM is a module, run as by `python -m`, or `module:function`. Words that follow it are its own, up to the
next option of this command; in quotes, they may be anything: --run "my_package.my_node --output x".

Exit codes: 0 if all is well, 1 if a program failed or the output differs from the recorded one, 2 if the
command line, a bag or a program cannot be read, 130 after Ctrl-C.
"""


def main(arguments: Sequence[str]) -> int:
    parser = _parser()
    words, runs = _split(arguments, parser._option_string_actions)
    given = parser.parse_args(words)
    if not runs:
        parser.error("which programs? --run PROGRAM")
    if given.output is None and not given.compare:
        parser.error("where to? --output FILE, or only --compare")
    try:
        with Bag(given.bag) as bag, tempfile.TemporaryDirectory() as temporary:
            output = given.output or Path(temporary, "output.mcap")
            programs = [_run(*each, bag.begin) for each in runs]
            outcome = replay(bag, programs, output, _options(given, bag))
            return _report(given, bag, output, outcome)
    except KeyboardInterrupt:
        return 130
    except (UnreadableError, ImportError) as error:
        print(error, file=sys.stderr)
    except OSError as error:
        print(f"{error.filename or given.output}: {error.strerror or error}", file=sys.stderr)
    return 2


def _run_parser() -> argparse.ArgumentParser:
    """Return the parser of the options that follow a program and concern it."""
    parser = argparse.ArgumentParser(prog=_NAME, add_help=False, allow_abbrev=False)
    add = parser.add_argument
    add("--host", default="localhost", metavar="NAME", help="of the last --run, default %(default)s")
    add("--start", type=_time, metavar="S", help="start the last --run so many seconds after the beginning")
    add("--kill", type=_time, metavar="S", help="kill the last --run so many seconds after the beginning")
    return parser


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        parents=[_run_parser()],
        prog=_NAME,
        usage="%(prog)s replay BAG ... --run PROGRAM [WORD ...] [--run ...] --output FILE [OPTION ...]",
        description="Feed recorded messages to unmodified rclpy programs in virtual time, and record what"
        " they publish: the same octets on every run. Programs get what they subscribe and do not publish.",
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        allow_abbrev=False,
    )
    add = parser.add_argument
    add("verb", choices=["replay"], help=argparse.SUPPRESS)
    add("bag", nargs="+", type=Path, metavar="BAG", help="a directory of rosbag2, or an MCAP file")
    add(
        "--run",
        metavar="PROGRAM [WORD ...]",
        help="a program and its command line, for example --ros-args -r a:=b",
    )
    add("--output", type=Path, metavar="FILE", help="the MCAP file to be written")
    add("--compare", action="store_true", help="say what differs from the same topics in the bag")
    add(
        "--within",
        type=float,
        default=Bounds().time,
        metavar="S",
        help="equal messages and stamps, default %(default)s",
    )
    add("--tolerance", type=float, default=0.0, metavar="X", help="of equal numbers, default %(default)s")
    add(
        "--from",
        dest="begin",
        type=_time,
        metavar="S",
        help="begin so many seconds after the beginning of the bag",
    )
    add("--until", type=_time, metavar="S", help="end so many seconds after the beginning of the bag")
    add(
        "--by",
        choices=["log", "stamp"],
        default="log",
        help="feed at the log time, or at the stamp of the header",
    )
    add("--feed", action="append", default=[], metavar="TOPIC", help="even if the programs publish it")
    add("--mute", action="append", default=[], metavar="TOPIC", help="do not feed it")
    add(
        "--lead",
        type=float,
        default=Options().lead,
        metavar="S",
        help="programs start before, default %(default)s",
    )
    add(
        "--epoch",
        type=_time,
        metavar="S",
        help="time of day of the programs at the beginning, default that of the bag",
    )
    add(
        "--env",
        action="append",
        default=[],
        type=_variable,
        metavar="NAME=VALUE",
        help="of the programs' environment",
    )
    add("--latency", type=float, metavar="MS", help="of every message, default 0.2")
    add("--loss", type=_part, default=0.0, metavar="PART", help="of messages that get lost, from 0 to 1")
    add("--seed", type=int, default=0, help="of all chance: of the programs, and of losses")
    add("--rosout", action="store_true", help="record /rosout and /parameter_events as well")
    add("--show", action="store_true", help="show what the programs print")
    return parser


def _split(arguments: Sequence[str], own: Container[str]) -> tuple[list[str], list[_Program]]:
    """Return the words of this command, whose options are ``own``, and the programs."""
    words: list[str] = []
    runs: list[tuple[list[str], list[str]]] = []
    rest = list(arguments)
    target = words
    while rest:
        word = rest.pop(0)
        name, has_value, value = word.partition("=")
        if name == "--run" and (has_value or rest):
            target = shlex.split(value if has_value else rest.pop(0))
            runs.append((target, []))
        elif name in _OF_RUN and runs and (has_value or rest):
            runs[-1][1].append(f"{name}={value if has_value else rest.pop(0)}")
        else:
            if name in own:
                target = words
            target.append(word)
    return words, [(program, _run_parser().parse_args(given)) for program, given in runs if program]


def _run(words: Sequence[str], given: argparse.Namespace, begin: int) -> Run:
    """Return a program to be run; its times count from a time [ns since 1970]."""
    begins, ends = (None if each is None else begin + each for each in (given.start, given.kill))
    return Run(words[0], words[1:], given.host, begins, ends)


def _time(text: str) -> int:
    """Return seconds as nanoseconds, exactly."""
    try:
        return int(Decimal(text) * SECOND)
    except InvalidOperation:
        raise argparse.ArgumentTypeError(f"{text!r} is no number") from None


def _part(text: str) -> float:
    try:
        return Network(loss=float(text)).loss
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def _variable(text: str) -> tuple[str, str]:
    name, is_set, value = text.partition("=")
    if not is_set:
        raise argparse.ArgumentTypeError(f"{text!r} is not NAME=VALUE")
    return name, value


def _options(given: argparse.Namespace, bag: Bag) -> Options:
    network = constant_network()
    network.loss = given.loss
    if given.latency is not None:
        network.latency = Delay(given.latency / 1000, given.latency / 1000)
    return Options(
        begin=None if given.begin is None else bag.begin + given.begin,
        end=None if given.until is None else bag.begin + given.until,
        by_stamp=given.by == "stamp",
        lead=given.lead,
        epoch=given.epoch,
        fed=frozenset(given.feed),
        muted=frozenset(given.mute),
        with_rosout=given.rosout,
        environment=dict(given.env),
        network=network,
        seed=given.seed,
        show=_shown(sys.stderr) if given.show else None,
    )


def _shown(stream: TextIO) -> Callable[[str, str], None]:
    return lambda name, line: print(f"[{name}] {line}", file=stream)


def _report(given: argparse.Namespace, bag: Bag, output: Path, outcome: Outcome) -> int:
    """Print what has happened; return the exit code."""
    code = 0
    for line in outcome.remarks:
        print(line)
    for ending in outcome.endings:
        if ending.is_early or ending.is_failure:
            print(f"{ending.name} {_manner(ending)} at {_seconds(ending.time - outcome.begin)}")
        if ending.is_failure:
            code = 1
            print(*(f"    {line}" for line in ending.output.splitlines()[-_SHOWN:]), sep="\n")
    if given.compare:
        code = code if _is_equal(given, bag, output, outcome) else 1
    else:
        print(f"{'topic':40} {'messages':>9}")
        for topic, count in sorted(outcome.topics.items()):
            print(f"{topic:40} {count:9}")
    print(f"Replayed: {_seconds(outcome.end - outcome.begin)}")
    if given.output:
        print(f"Output: {given.output}")
    return code


def _manner(ending: Ending) -> str:
    if ending.code is None:
        return f"did not end within {GRACE:.0f} s of SIGINT, and was killed"
    return f"ended with exit code {ending.code}"


def _is_equal(given: argparse.Namespace, bag: Bag, output: Path, outcome: Outcome) -> bool:
    """Print how the output differs from the recorded one; return whether it does not."""
    bounds = Bounds(given.within, given.tolerance)
    begin, end = outcome.begin, outcome.end
    with Bag([output]) as replayed:
        found = compare(bag, replayed, outcome.published & bag.topics.keys(), begin, end, bounds)
    print(f"{'topic':40} {'recorded':>9} {'replayed':>9} {'differ':>9}")
    for each in found:
        print(f"{each.topic:40} {each.recorded:9} {each.replayed:9} {each.differing:9}")
        if each.first is not None:
            print(f"    first at {_seconds(each.first.time - begin)}: {each.first.reason}")
    differing = [each.topic for each in found if each.differing]
    if not found:
        print("Nothing to compare: the bag has no topic that the programs publish")
        return False
    print(f"Different: {', '.join(differing)}" if differing else "Equal")
    return not differing


def _seconds(nanoseconds: int) -> str:
    return f"{nanoseconds / SECOND:.3f} s"
