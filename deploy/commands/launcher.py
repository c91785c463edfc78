"""The commands behind `make run`, `start`, `console`, `status`, `logs` and `stop`."""

from __future__ import annotations

from deploy.commands import interruption  # isort: split

import argparse
import os
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import TYPE_CHECKING

from deploy.console.output import say
from deploy.supervision.system import NAMESPACE, Check, DeploymentError, Program, System

if TYPE_CHECKING:
    from deploy.commands.member import Member

START_LIMIT = 60.0  # s until all services have to report their health
STATUS_LIMIT = 1.5  # s that they have when they are up: they report at 1 Hz
START_ATTEMPTS = 3  # of a service, even where dying takes it so long that supervisord sees no early death
LOG_LINES = 15  # of a service that does not start
LOADER = ("PYTHONPATH", "LD_LIBRARY_PATH", "AMENT_PREFIX_PATH")  # where rclpy and its libraries are found

# rclpy takes its time to load: a command loads it when it is sure to need it.


def run(system: System, scenario: str, parameter_file: str) -> None:
    """Run the system in this terminal until the end is asked for."""
    with _started(system, scenario, parameter_file) as (member, epoch):
        _show(system, member, epoch, owner=True)
    _stop(system)


def start(system: System, scenario: str, parameter_file: str) -> None:
    """Start the system in the background; returns when all services are up."""
    with _started(system, scenario, parameter_file):
        print("It runs in the background: make console, make status, make logs, make stop.")


def console(system: System) -> None:
    """Show a running system in this terminal."""
    if not _adopt_environment(system):
        raise DeploymentError("Nothing runs: make start")
    from deploy.commands.member import Member
    from deploy.commands.parameters import epoch_of

    with Member() as member:
        _show(system, member, epoch_of(system))


def status(system: System) -> None:
    """Print a table of the services."""
    if not _adopt_environment(system):
        print("Nothing runs.")
        return
    from deploy.commands.member import Member
    from deploy.commands.status import of_services

    programs = system.programs()
    running = [program for program in programs if program.pid]
    deadline = time.monotonic() + STATUS_LIMIT
    with Member() as member:
        while not all(_reports(program, member) for program in running) and time.monotonic() < deadline:
            interruption.check()
            member.spin_once()
        print(of_services(programs, member.health))


def logs(system: System) -> None:
    """Follow the logs of all services, until Ctrl-C."""
    files = sorted(str(path.relative_to(system.run)) for path in system.logs.glob("*.log"))
    if not files:
        raise DeploymentError("There are no logs yet: make start")
    with subprocess.Popen(["tail", "-n", "10", "-F", *files], cwd=system.run) as tail:
        try:
            while tail.poll() is None:
                interruption.check()
                with suppress(subprocess.TimeoutExpired):
                    tail.wait(0.1)
        finally:
            tail.terminate()


@contextmanager
def _started(system: System, scenario: str, parameter_file: str) -> Iterator[tuple[Member, float]]:
    """Start the system and wait until all services are up; stop it when that, or what follows, fails."""
    began = time.monotonic()
    from deploy.commands import parameters
    from deploy.commands.member import Member

    parameters.check_environment()
    with Member() as member:
        loading = time.monotonic() - began
        given = parameters.of_system(scenario, parameter_file, loading, interruption.check)
        interruption.check()  # for the last time before anything lives that would have to be ended
        system.start(given, interruption.check)
        try:
            place = f"ROS domain {os.environ.get('ROS_DOMAIN_ID') or 0}"
            if namespace := os.environ.get(NAMESPACE):
                place += f", namespace {namespace}"
            print(f"Starting the services, scenario {scenario}, {place} ...", flush=True)
            _await_services(system, member)
            epoch = parameters.epoch_of(system)
            print(f"All services are up after {time.monotonic() - began:.1f} s.", flush=True)
            if (late := time.monotonic() - epoch) > 0:
                print(f"The scenario has begun {late:.1f} s ago: this machine is slow.", flush=True)
            yield member, epoch
        except BaseException:
            _stop(system)
            raise


def _await_services(system: System, member: Member) -> None:
    """Wait until every service has reported its health."""
    deadline = time.monotonic() + START_LIMIT
    while missing := [program for program in system.programs() if not _reports(program, member)]:
        for program in missing:
            if program.state in ("BACKOFF", "FATAL") or program.restarts >= START_ATTEMPTS:
                raise DeploymentError(f"{program.name} does not start:\n{_last_words(system, program)}")
        if time.monotonic() > deadline:
            names = ", ".join(program.name for program in missing)
            raise DeploymentError(f"No sign of life from {names}; see make logs")
        look_again = time.monotonic() + 0.2
        while time.monotonic() < look_again:
            interruption.check()
            member.spin_once()


def _last_words(system: System, program: Program) -> str:
    """What a program said at last; what supervisord says where it could not even be run."""
    log = system.logs / f"{program.name}.log"
    lines = log.read_text(errors="replace").splitlines() if log.exists() else []
    return "\n".join(lines[-LOG_LINES:]) or program.description


def _reports(program: Program, member: Member) -> bool:
    """Whether this very process, not one of another system in the domain, has reported its health."""
    return program.name in member.health and member.health[program.name].pid == program.pid


def _show(system: System, member: Member, epoch: float, *, owner: bool = False) -> None:
    """Be the operator's terminal until the end; the owner of the system revives a killed supervisord."""
    from deploy.console.console import HELP, Console

    console = Console(member.node, epoch)
    say(HELP)
    while not console.has_quit:
        interruption.check()
        member.spin_once()
        console.read_commands()
        if system.supervisor_has_ended():
            if not owner or not system.start_again(interruption.check):
                say(system.unattended() if system.is_wanted else "The system has ended.")
                return
            say("supervisord was killed: everything has been started anew.")


def _stop(system: System, check: Check = lambda: None) -> None:
    """Stop the system and say so, as far as there still is somebody to tell; `check` may end the waiting."""

    def tell(count: int) -> None:
        with suppress(OSError):
            say(f"Stopping {count} processes ..." if count else "Nothing runs.")

    if system.stop(check, tell):
        with suppress(OSError):
            say("All have ended.")


def _adopt_environment(system: System) -> bool:
    """Look where the running system does, with its rclpy, whatever this shell has. False if none runs."""
    environment = system.environment()
    if not environment:
        return False
    before = dict(os.environ)
    for name in (*before, *environment):
        if name.startswith((*LOADER, "ROS_", "RMW_", "CYCLONEDDS_", "FASTRTPS_", "FASTDDS_", NAMESPACE)):
            os.environ.pop(name, None)
            if name in environment:
                os.environ[name] = environment[name]
    if any(os.environ.get(name) != before.get(name) for name in LOADER):
        # Only a new process finds the rclpy that the system has: this shell may have sourced another one.
        interruption.check()  # it knows nothing of what was noted here
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    return True


def main(arguments: list[str]) -> int:
    """Obey one command; the exit code."""
    parser = argparse.ArgumentParser(prog="launcher")
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("run", "start"):
        command = commands.add_parser(name)
        command.add_argument("scenario")
        command.add_argument("parameter_file", nargs="?", default="")
    for name in ("console", "status", "logs", "stop"):
        commands.add_parser(name)
    options = parser.parse_args(arguments)

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    system = System()
    try:
        match options.command:
            case "run":
                run(system, options.scenario, options.parameter_file)
            case "start":
                start(system, options.scenario, options.parameter_file)
            case "console":
                console(system)
            case "status":
                status(system)
            case "logs":
                logs(system)
            case "stop":
                _stop(system, interruption.check)
    except interruption.Interrupted:
        return 0
    except DeploymentError as error:
        print(error, file=sys.stderr)
        return 1
    except BrokenPipeError:  # nobody reads our output any more, as in `make run | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except OSError as error:  # of files of the system: no space, no permission
        print(error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
