"""The commands behind `make run`, `start`, `unit`, `terminal`, `status`, `logs`, `record` and `keystore`."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, suppress
from typing import TYPE_CHECKING, NoReturn

from deploy.commands.status import health_of, of_services
from deploy.commands.stop import stop
from deploy.operator.output import say, use_plain_output
from deploy.supervision import interruption, manifest, messages, rclpy_choice, vulnerabilities
from deploy.supervision.environment import (
    NAMESPACE,
    RANGE,
    is_adopted,
    is_alone,
    namespace_of,
    set_middleware,
)
from deploy.supervision.errors import DeploymentError
from deploy.supervision.run_directory import ALL, KEY, LEAD, MANIFEST, RECORDS, RUN
from deploy.supervision.supervisord import Program
from deploy.supervision.system import System
from interfaces.loopback import LOOPBACK_DOWN, loopback_is_up

if TYPE_CHECKING:
    from deploy.commands.member import Member
    from interfaces.service.health import Health

START_LIMIT = 60.0  # s until all services have to report their health
BEGIN_LEAD = 0.3  # s from the choice of the scenario's origin to the origin: all services know it by then
BEGIN_LIMIT = 5.0  # s that the services have to confirm the origin of the scenario
STATUS_LIMIT = 3.0  # s for the health of services: the sentinel takes one without for hung after 2.7 s
LOOK_PERIOD = 0.2  # s between two looks at the states of programs that start
START_ATTEMPTS = 3  # of a service that dies so slowly that supervisord does not count it as an early death
MOST_MINUTES = 1440  # of a ring: a day in files of a minute
LOG_LINES = 15  # of a service that does not start
LIBRARIES_ARE_KNOWN = "_ROS_WHEELS_BOOTSTRAP_COMPLETE"
"""Environment variable: the wheels of ROS 2 leave the environment of this interpreter as it is."""

# rclpy takes its time to load: each command imports it when it surely needs it.


def place(environment: Mapping[str, str]) -> str:
    """Return where the nodes of an environment are: the domain, and what is not as ever."""
    words = [f"ROS domain {environment.get('ROS_DOMAIN_ID') or 0}"]
    if namespace := environment.get(NAMESPACE):
        words.append(f"namespace {namespace}")
    if host := environment.get(manifest.HOST):
        words.append(f"host {host}")
    if (reach := environment.get(RANGE, "LOCALHOST")) != "LOCALHOST":
        words.append(f"discovery range {reach}")
    return ", ".join(words)


def run(system: System, scenario: str, parameter_file: str) -> None:
    """Run the system in this terminal until the user ends it."""
    with _started(system, scenario, parameter_file) as member:
        _show(system, member, owner=True)
        _end(system)  # first: to leave the ROS graph takes its time, and may fail


def start(system: System, scenario: str, parameter_file: str) -> None:
    """Start the system in the background; returns when all services are up."""
    with _started(system, scenario, parameter_file):
        print("It runs in the background: make terminal, make status, make logs, make stop.")


def unit(system: System, scenario: str, parameter_file: str) -> None:
    """Write the unit with which systemd starts the system."""
    from deploy.commands import parameters
    from deploy.commands import unit as writer

    environment = dict(os.environ)
    with _chosen(scenario):
        parameters.of_system(scenario, parameter_file)  # reports errors in them now
    path = writer.write(writer.text(scenario, parameter_file, environment), environment)
    enable = f"systemctl --user daemon-reload && systemctl --user enable --now {path.stem}"
    print(f"Wrote {path}. Start it now and at each boot: {enable} && loginctl enable-linger")


def become(system: System, scenario: str, parameter_file: str) -> NoReturn:
    """Become the supervisord of the system: the command of its unit."""
    from deploy.commands import hosts, parameters
    from deploy.commands.member import Member

    with _chosen(scenario):
        parameters.check_environment(system)
        given = parameters.of_system(scenario, parameter_file)
        _warn()
        if not is_alone(os.environ):
            with Member() as member, hosts.checked(member, system):
                pass
        given[ALL][KEY]["scenario_epoch"] = time.monotonic() + LEAD
        signal.signal(signal.SIGTERM, signal.SIG_DFL)  # supervisord would not know of a noted one
        interruption.check()
        path = manifest.PATH if manifest.path() == manifest.PATH else system.run / MANIFEST
        system.become_supervisord(given, ["--nodaemon", "--configuration", str(path)])


def attach(system: System) -> None:
    if not _adopt_environment(system):
        raise DeploymentError("Nothing runs: make start")
    from deploy.commands.member import Member

    with Member() as member:
        if page := system.page:
            say(page)
        _show(system, member)


def status(system: System) -> None:
    """Print what the system runs on, the address of its page, and a table of the services."""
    if not _adopt_environment(system):
        print("Nothing runs.")
        return
    from deploy.commands import hosts
    from deploy.commands.member import Member
    from deploy.operator.glance import Glance

    programs = system.programs()
    running = [program for program in programs if program.pid]
    print(f"{rclpy_choice.words()}, {place(os.environ)}")
    print(_bound(system))
    if page := system.page:
        print(page)
    if not loopback_is_up():  # so no health can be heard, not even that of the sentinel, which reports it
        print(f"loopback: {LOOPBACK_DOWN}")
        print(of_services(programs, {}))
        return
    host_of = {each.name: each.host for each in manifest.everywhere()}
    elsewhere = host_of.keys() - {program.name for program in programs}
    try:
        with Member() as member, hosts.heard(member.node) as heard:
            deadline = time.monotonic() + STATUS_LIMIT
            glance = Glance(member.node)
            _listen(member, running, heard.healths, STATUS_LIMIT)
            while time.monotonic() < deadline and not (
                glance.is_complete
                and all(
                    name in heard.processes and health_of(heard.processes[name], heard.healths)
                    for name in elsewhere
                )
            ):
                member.spin_once()
    except DeploymentError:  # for example, its keys have ended; supervisord reports its part
        print(of_services(programs, {}))
        raise
    print(glance.words)
    print(heard.clocks(), end="")
    programs += [heard.processes[name] for name in host_of if name in elsewhere & heard.processes.keys()]
    print(of_services(programs, heard.healths, host_of if elsewhere else {}))


def logs(system: System) -> None:
    """Follow the logs of all services until Ctrl-C or the end of the system."""
    if system.supervisor_has_ended():
        nothing = f"Nothing runs: make start. The logs of the last run are in {system.logs}"
        raise DeploymentError(messages.unattended(system.run) if system.members() else nothing)
    files = [system.run / "supervisord.log", *sorted(system.logs.glob("*.log"))]
    from deploy.commands.logs import follow, readable

    with closing(follow(files)) as lines:
        for line in lines:
            interruption.check()
            if line is not None:
                print(readable(line).decode(errors="replace"), flush=True)
            elif system.supervisor_has_ended():
                print(messages.how_it_ended(system.run))
                break


def record(system: System, minutes: str) -> None:
    """Record the messages of a running system until Ctrl-C or its end; keep all, or only the last minutes."""
    if minutes and (not minutes.isdecimal() or not 1 <= int(minutes) <= MOST_MINUTES):
        raise DeploymentError(f"LAST={minutes}: it is a number of minutes, from 1 to {MOST_MINUTES}")
    if not _adopt_environment(system):
        raise DeploymentError("Nothing runs: make start")
    if system.supervisor_has_ended():
        raise DeploymentError(messages.unattended(system.run))
    from deploy.commands import record
    from deploy.commands.member import Member
    from deploy.security.rights import RECORDER

    with Member(RECORDER) as member:
        record.write(system.run / RECORDS, member, system, int(minutes or 0))


def keystore(_: System, export: str, enclaves: str) -> None:
    from deploy.commands import keystore as writer

    with manifest.chosen(os.environ.get("MANIFEST", "")):
        writer.write(export, enclaves)


def _warn() -> None:
    from interfaces.service import middleware

    if warning := vulnerabilities.warning(os.environ):
        print(warning, flush=True)
    if why := middleware.shared_memory():
        print(
            f"WARNING: Fast DDS uses shared memory, because {why}: a killed process stops others for seconds,"
            " and leaves half a MB in /dev/shm (deploy/SAFETY.md)",
            flush=True,
        )


def _chosen(scenario: str) -> AbstractContextManager[None]:
    from deploy.commands.parameters import NONE

    without = manifest.VIRTUAL_JOINTS if scenario == NONE else ()
    return manifest.chosen(os.environ.get("MANIFEST", ""), without, os.environ.get(manifest.HOST, ""))


@contextmanager
def _started(system: System, scenario: str, parameter_file: str) -> Iterator[Member]:
    """Start the system and its scenario; stop it when that fails, or the block."""
    began = time.monotonic()
    from deploy.commands import hosts, parameters
    from deploy.commands.member import Member

    with ExitStack() as stack:
        stack.enter_context(_chosen(scenario))
        parameters.check_environment(system)
        given = parameters.of_system(scenario, parameter_file)
        _warn()
        member = stack.enter_context(Member())
        check_again = stack.enter_context(hosts.checked(member, system))
        log_sizes = {path.stem: path.stat().st_size for path in system.logs.glob("*.log")}
        interruption.check()  # the last time before there is anything to stop
        system.start(given)
        try:
            print(f"Starting the services, scenario {scenario}, {place(os.environ)} ...", flush=True)
            _await_services(system, member, log_sizes)
            check_again()
            origin = time.monotonic() + BEGIN_LEAD
            system.keep_origin(origin)
            member.set_everywhere("scenario_epoch", origin, BEGIN_LIMIT)
            print(f"All services are up after {time.monotonic() - began:.1f} s.", flush=True)
            if page := system.page:
                print(page, flush=True)
            yield member
        except BaseException:
            _end(system)
            raise


def _end(system: System) -> None:
    """Stop the system, whatever signals come meanwhile."""
    interruption.ignore()
    stop(system)


def _await_services(system: System, member: Member, log_sizes: dict[str, int]) -> None:
    from interfaces.service.health import heard_healths

    deadline = time.monotonic() + START_LIMIT
    with heard_healths(member.node) as health:
        later = [program.name for program in manifest.programs() if not program.starts]
        while missing := [
            program
            for program in system.programs()
            if program.name not in later and not health_of(program, health)
        ]:
            for program in missing:
                if program.state in ("BACKOFF", "FATAL") or program.restarts >= START_ATTEMPTS:
                    words = _last_words(system, program, log_sizes.get(program.name, 0))
                    words = words or messages.silent_end(system.run)
                    raise DeploymentError(f"{program.name} does not start:\n{words}")
            if time.monotonic() > deadline:
                names = ", ".join(program.name for program in missing)
                raise DeploymentError(f"No sign of life from {names}; see {system.logs}")
            _listen(member, missing, health, LOOK_PERIOD)


def _listen(
    member: Member, programs: list[Program], health: Mapping[tuple[str, str], Health], limit: float
) -> None:
    deadline = time.monotonic() + limit
    while not all(health_of(program, health) for program in programs) and time.monotonic() < deadline:
        member.spin_once()


def _last_words(system: System, program: Program, begin: int) -> str:
    """The last lines of a program's log after `begin` [bytes], each once; supervisord's words without any."""
    with suppress(OSError), (system.logs / f"{program.name}.log").open("rb") as log:
        log.seek(begin)
        lines = dict.fromkeys(log.read().decode(errors="replace").splitlines())  # each attempt says the same
        lines = {line: None for line in lines if not line.startswith(RUN)}
        return "\n".join(list(lines)[-LOG_LINES:]) or program.error
    return program.error


def _show(system: System, member: Member, *, owner: bool = False) -> None:
    """Be the operator's terminal until the end; the owner of the system revives a killed supervisord."""
    from deploy.operator.terminal.terminal import HELP, Terminal

    # In the background, reading the terminal fails and does not stop the process.
    signal.signal(signal.SIGTTIN, signal.SIG_IGN)
    parent = os.getppid()
    with Terminal(member.node, system.origin(), is_new=owner) as terminal:
        say(_bound(system))
        say(HELP)
        is_connected = True
        while not terminal.has_quit:
            member.spin_some()
            terminal.refresh()
            if loopback_is_up() != is_connected:
                is_connected = not is_connected
                say("loopback: it is up again." if is_connected else f"loopback: {LOOPBACK_DOWN}")
            if owner and os.getppid() != parent:  # make was killed
                return
            if system.supervisor_has_ended():
                if not owner or not system.start_again():
                    say(messages.how_it_ended(system.run))
                    return
                say("supervisord was killed: everything has started again.")
        member.spin_some()  # sends what was typed just before `quit`


def _bound(system: System) -> str:
    """The line that says how soon the engines stop."""
    from deploy.supervision.parameter_file import reaction_to

    try:
        return reaction_to(system.written_parameters(), namespace_of(os.environ)).words
    except DeploymentError as error:
        return str(error)


def _adopt_environment(system: System) -> bool:
    """Run this command in the environment of the running system, with its rclpy. False if none runs."""
    running = system.environment()
    if not running:
        return False
    kept = {name: value for name, value in os.environ.items() if not is_adopted(name)}
    adopted = {name: value for name, value in running.items() if is_adopted(name)}
    wanted = kept | adopted | {LIBRARIES_ARE_KNOWN: "1"}
    if wanted != os.environ:
        # Only a new process finds another rclpy and its libraries: this shell may have sourced another ROS.
        interruption.hand_over()
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], wanted)
    return True


def main(arguments: list[str]) -> int:
    interruption.install()
    use_plain_output()
    os.umask(0o077)  # as supervisord: what is in the run directory is its user's
    parser = argparse.ArgumentParser(prog="launcher")
    commands = parser.add_subparsers(required=True)
    for name, starts in (("run", run), ("start", start), ("unit", unit), ("become", become)):
        command = commands.add_parser(name)
        command.set_defaults(obey=starts)
        command.add_argument("scenario")
        command.add_argument("parameter_file", nargs="?", default="")
    for name, joins in (("terminal", attach), ("status", status), ("logs", logs)):
        commands.add_parser(name).set_defaults(obey=joins)
    recording = commands.add_parser("record")
    recording.set_defaults(obey=record)
    recording.add_argument("minutes", nargs="?", default="")
    keys = commands.add_parser("keystore")
    keys.set_defaults(obey=keystore)
    keys.add_argument("export", nargs="?", default="")
    keys.add_argument("enclaves", nargs="?", default="")
    options = vars(parser.parse_args(arguments))

    set_middleware(os.environ)
    obey = options.pop("obey")
    try:
        obey(System(), **options)
    except interruption.Interrupted:
        return 0
    except BrokenPipeError:  # the reader has gone, as in `make run | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except DeploymentError as error:
        print(error, file=sys.stderr)
        return 1
    except OSError as error:  # a file of the system cannot be written or read
        print(f"{error.filename}: {error.strerror}" if error.filename else error, file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
