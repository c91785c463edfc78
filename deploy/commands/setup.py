"""Brings .venv up to date: what the system and its tests need and, without a sourced ROS 2, its rclpy.

ROS 2's own rclpy is installed from PyPI. Where the environment has RUNTIME=cyclonedds, it stands on the
ground of Cyclone DDS (deploy/ground).

It runs on the bare interpreter, before anything is installed. A stamp in .venv records its sources. Where the
right stamp is missing (older requirements, another interpreter, ROS 2 sourced since, an interrupted set-up),
.venv is made again: half an installation never counts as one.
"""

from __future__ import annotations

import fcntl
import hashlib
import importlib.util
import os
import platform
import shlex
import shutil
import signal
import subprocess
import sys
import sysconfig
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from types import FrameType

from deploy.supervision import interruption, variables
from deploy.supervision.processes import ROOT, RUN_DIRECTORY, run_directory, running, using
from deploy.supervision.rclpy_choice import CYCLONEDDS, GROUND, RUNTIME, sourced_rclpy

VENV = ROOT / ".venv"
PYTHON = VENV / "bin" / "python"
STAMP = VENV / "made-from"
LOG = VENV / "setup.log"
REQUIREMENTS = ROOT / "deploy" / "requirements"
_OPTIONS = ("--require-hashes", "--no-deps", "--no-input", "--progress-bar=off")
PIP = [str(PYTHON), "-m", "pip", "install", *_OPTIONS]
SOURCES = [
    ROOT / "interfaces" / "reactive_node" / "src",
    ROOT / "deploy" / "ground" / "src",
    ROOT / "tests" / "simulation_kit" / "src",
    ROOT / "deploy" / "tools" / "src",
]
"""Packages of this checkout that Python finds after those of an installed ROS 2."""
FAST_DDS = "rmw_fastrtps_cpp"
CYCLONEDDS_WHEELS = (3, 13)
"""The last Python for which PyPI has wheels of Cyclone DDS."""
BEHIND = (
    "import os, sys; [sys.path.append(sys.path.pop(sys.path.index(each)))"
    ' for each in map(os.path.abspath, filter(None, os.environ.get("PYTHONPATH", "").split(os.pathsep)))'
    f" if each in sys.path and not each.startswith({str(ROOT)!r})"
    ' and not os.path.exists(os.path.join(each, "sitecustomize.py"))]'
)
"""Moves the user's own modules behind those that the arm needs: a queue.py would hide Python's."""
SCRIPTS = {
    "supervisord": "-m supervisor.supervisord",
    "supervisorctl": "-m supervisor.supervisorctl",
    "ros2": '-c "import sys; from ros2cli.cli import main; sys.exit(main())"',  # ROS 2's has no `-m`
}
"""Commands in .venv/bin, by what Python runs for them; pip's own scripts fail in a path with quotes."""

ENOUGH_SPACE = 1e9  # bytes of the disk, for a set-up


class SetupError(Exception):
    """Why .venv could not be made; a message for the user."""


def main() -> int:
    """Make .venv unless it is up to date; the exit code."""
    signal.signal(signal.SIGTERM, _interrupt)
    if signal.getsignal(signal.SIGHUP) != signal.SIG_IGN:  # nohup asks for this
        signal.signal(signal.SIGHUP, _interrupt)
    try:
        signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})  # make blocks it until here
        with alone():
            began = time.monotonic()
            ros = sourced_rclpy()
            check_runtime(os.environ, ros)
            if not STAMP.exists() or STAMP.read_text() != fingerprint(ros):
                make(ros)
                STAMP.write_text(fingerprint(ros))
                print(f"Set up in {time.monotonic() - began:.0f} s.", flush=True)
    except SetupError as error:
        print(error, file=sys.stderr)
        return 1
    except OSError as error:  # no space, no permission
        print(f"Set-up failed: {error}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print("\nSet-up interrupted; the next make starts it again.", file=sys.stderr)
        return 130
    finally:
        signal.signal(signal.SIGINT, signal.SIG_DFL)  # no traceback from an interpreter that ends
    return 0


def check_runtime(environment: Mapping[str, str], ros: str) -> None:
    """Raise SetupError if `ros`, the rclpy of a sourced ROS 2, rules out the wanted runtime."""
    runtime = environment.get(RUNTIME, "")
    if runtime not in ("", CYCLONEDDS):
        raise SetupError(f"RUNTIME={runtime}: it is empty for the middleware of ROS 2, or {CYCLONEDDS}")
    if runtime and ros:
        raise SetupError(
            f"RUNTIME={runtime}: ROS 2 is sourced, and its rclpy wins ({ros}); use another shell"
        )
    if not ros and not has_wheels():
        raise SetupError(
            f"PyPI has ROS 2's rclpy for x86_64 with glibc 2.28 or newer, not for this machine"
            f" ({platform.machine()}, {' '.join(filter(None, platform.libc_ver())) or 'no glibc'}):"
            " source an installed ROS 2"
        )
    if not runtime and not ros and environment.get("ROS_SECURITY_ENABLE") == "true":
        raise SetupError(
            "ROS_SECURITY_ENABLE=true: PyPI has ROS 2's rclpy without DDS security: use RUNTIME=cyclonedds"
            " with `apt-get install libddsc0t64` (on Debian 12, libddsc0debian), or source an installed ROS 2"
        )
    rmw = environment.get("RMW_IMPLEMENTATION") or FAST_DDS
    if not runtime and not ros and rmw != FAST_DDS:
        raise SetupError(
            f"RMW_IMPLEMENTATION={rmw}: PyPI has ROS 2's rclpy with {FAST_DDS} only: unset it,"
            " source an installed ROS 2, or use RUNTIME=cyclonedds"
        )


def has_wheels() -> bool:
    """Whether PyPI has ROS 2's rclpy for this machine."""
    library, version = platform.libc_ver()
    has_library = library == "glibc" and tuple(map(int, version.split("."))) >= (2, 28)
    return platform.machine() == "x86_64" and has_library


def fingerprint(ros: str) -> str:
    """The digest of everything that .venv is made from; `ros` is the file of ROS 2's rclpy."""
    words = (sys.version, os.path.realpath(sys.executable), str(VENV), ros)
    digest = hashlib.sha256(repr(words).encode())
    for file in (*sorted(REQUIREMENTS.glob("*.txt")), Path(__file__)):
        content = file.read_bytes()
        digest.update(f"{file.relative_to(ROOT)} {len(content)} ".encode())
        digest.update(content)
    return digest.hexdigest()


def make(ros: str) -> None:
    """Make .venv from nothing; with ROS 2 (the file of its rclpy) it includes the system's packages."""
    _refuse_while_running()
    version = ".".join(map(str, sys.version_info[:3]))
    if importlib.util.find_spec("ensurepip") is None:  # a separate package on Debian and Ubuntu
        package = f"python{sys.version_info[0]}.{sys.version_info[1]}-venv"
        raise SetupError(f"Python {version} ({sys.executable}) lacks ensurepip: apt-get install {package}")
    import ensurepip

    if ros:
        messages = ("diagnostic_msgs", "geometry_msgs", "sensor_msgs", "std_msgs")
        needed = f"import rclpy, {', '.join(f'{package}.msg' for package in messages)}"
        check = subprocess.run([sys.executable, "-c", needed], capture_output=True, text=True)
        if check.returncode:
            raise SetupError(
                f"ROS 2 is sourced, but its rclpy ({ros}) or message packages do not work with"
                f" {sys.executable}: {check.stderr.strip().splitlines()[-1]}\n"
                "Choose its interpreter (make setup PYTHON=/usr/bin/python3), install what is missing, or"
                " use a shell without ROS 2"
            )
    print(f"Setting up .venv with Python {version}, once; this takes up to three minutes.", flush=True)
    STAMP.unlink(missing_ok=True)  # no sooner: a refused set-up leaves the old .venv usable
    venv = [sys.executable, "-m", "venv", "--clear", *(["--system-site-packages"] if ros else []), str(VENV)]
    step(f"a virtual environment with pip {ensurepip.version()}", venv, log=None)
    step("packages from PyPI", [*PIP, *_requirements("system.txt", "build.txt", "develop.txt")])
    if ros:
        print(f"  rclpy of ROS 2: {Path(ros).parent}")
    else:
        step("ROS 2's rclpy from PyPI", [*PIP, *_requirements("ros.txt")])
        step("Cyclone DDS from PyPI", [*PIP, *_of_cyclonedds(), *_requirements("cyclonedds.txt")])
    _write_pth(behind=not ros)
    if subprocess.run([PYTHON, "-Ec", "import supervisor"], capture_output=True).returncode:
        raise SetupError(
            "pip has not installed into .venv: do its settings (pip config list) lead elsewhere?"
        )
    for name, program in SCRIPTS.items():
        script = VENV / "bin" / name
        script.write_text(f'#!/bin/sh\nexec "${{0%/*}}/python" {program} "$@"\n')
        script.chmod(0o755)


def _of_cyclonedds() -> list[str]:
    """Return pip's options for Cyclone DDS: its C library alone is used, which fits any Python."""
    if sys.version_info[:2] <= CYCLONEDDS_WHEELS:
        return []
    version = ".".join(map(str, CYCLONEDDS_WHEELS))
    return [f"--python-version={version}", "--only-binary=:all:", f"--target={_site_packages()}"]


def _site_packages() -> str:
    return sysconfig.get_path("purelib", "venv", {"base": str(VENV)})


def _requirements(*names: str) -> list[str]:
    return [word for name in names for word in ("-r", str(REQUIREMENTS / name))]


def _write_pth(behind: bool) -> None:
    """Write where the packages of this checkout are, and what chooses the ground of rclpy.

    :param behind: whether the modules of PYTHONPATH come behind all others; a sourced ROS 2 is in it.
    """
    chosen = f'import os; "{RUNTIME}" in os.environ and os.environ.update({GROUND}=os.environ["{RUNTIME}"])'
    hook = f'import os; os.environ.get("{GROUND}") and __import__("rclpy_ground.hook")'
    lines = (*SOURCES, *([BEHIND] if behind else []), chosen, hook)
    Path(_site_packages(), "reactive_arm.pth").write_text("".join(f"{line}\n" for line in lines))


def _refuse_while_running() -> None:
    for run in using(PYTHON.parent):
        elsewhere = "" if run == run_directory() else f"{RUN_DIRECTORY}={shlex.quote(str(run))} "
        raise SetupError(f"A running system uses this .venv. Stop it before the set-up: {elsewhere}make stop")
    for pid, words in running(PYTHON.parent):
        raise SetupError(f"Process {pid} uses this .venv. Await its end before the set-up: {words:.100}")


def step(title: str, command: list[str], log: Path | None = LOG) -> None:
    """Run a command; show its title and, on a terminal, pip's progress. Raises SetupError with its errors."""
    live = sys.stdout.isatty()
    print(f"  {title}", end="" if live else "\n", flush=True)
    lines: list[str] = []
    environment = variables.kept(os.environ) | {"PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    environment.pop("PYTHONPATH", None)  # what is there is not in .venv
    # A signal waits until the command can be ended.
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    process = subprocess.Popen(
        command,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        close_fds=False,  # it inherits the lock
        start_new_session=True,  # the children of venv and pip end with it
        preexec_fn=partial(signal.pthread_sigmask, signal.SIG_SETMASK, mask),
    )
    try:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        assert process.stdout is not None
        for line in process.stdout:
            lines.append(line)
            words = line.split()
            if live and words[:1] in (["Collecting"], ["Installing"], ["Building"]):
                print(f"\r\x1b[K  {title}: {words[0].lower()} {words[1]}", end="", flush=True)
        process.communicate()  # closes the pipe, too
    except BaseException:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGTERM)
        process.communicate()  # returns when the last child has ended
        raise
    finally:
        if live:
            print(f"\r\x1b[K  {title}", flush=True)
        if log is not None and log.parent.exists():
            with log.open("a") as file:
                file.writelines(lines)
    if process.returncode:
        reasons = [line for line in lines if line.startswith("ERROR")] or lines[-5:]
        if any("Retrying" in line for line in lines):  # pip then blames the requirement
            reasons.append("The package index was not reached: network, proxy, PIP_INDEX_URL?")
        if (free := shutil.disk_usage(ROOT).free) < ENOUGH_SPACE:  # venv does not report a full disk
            reasons.append(f"{free / 1e6:.0f} MB are free on the disk of {ROOT}")
        where = f" (full log: {log.relative_to(ROOT)})" if log is not None else ""
        raise SetupError(f"Set-up failed at {title}{where}:\n{''.join(reasons).rstrip()}")


@contextmanager
def alone() -> Iterator[None]:
    """Hold the lock of this checkout's set-up: a second make waits for the first."""
    directory = os.open(ROOT, os.O_RDONLY)
    os.set_inheritable(directory, True)  # a step that outlives a killed set-up still writes into .venv
    try:
        try:
            fcntl.flock(directory, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            print("Waiting for another make to finish its set-up.", flush=True)
            fcntl.flock(directory, fcntl.LOCK_EX)
        yield
    finally:
        os.close(directory)


def _interrupt(number: int, frame: FrameType | None) -> None:
    interruption.end_make()
    raise KeyboardInterrupt


if __name__ == "__main__":
    sys.exit(main())
