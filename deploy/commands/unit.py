"""The unit with which systemd starts the system at each boot: `make unit`."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path

from deploy.commands.parameters import WEB
from deploy.supervision.environment import KEYSTORE, NAMESPACE, is_adopted, namespace_of
from deploy.supervision.errors import DeploymentError
from deploy.supervision.extension import SENTINEL_START_TIMEOUT
from deploy.supervision.processes import ROOT, RUN_DIRECTORY

MANIFEST = "MANIFEST"  # environment variable: the file with the user's own programs
KEPT = (RUN_DIRECTORY, WEB, MANIFEST)
"""The variables of `make unit` that the unit takes over, besides those that belong to an arm."""
START_LIMIT = 90  # s until all services are up
WATCHDOG = SENTINEL_START_TIMEOUT + 10.0  # s without the sentinel: it has to start, and to see the others
ESCAPES = str.maketrans({"\\": "\\\\", "%": "%%", "\n": "\\n", "\r": "\\r"})
"""The escape of each character (systemd.syntax(7)); a newline in a value would end its setting."""

UNIT = """\
# Written by `make unit` in {root}.
[Unit]
Description=reactive-arm in {root}
After=network.target
StartLimitIntervalSec=0

[Service]
Type=notify
# The main process is supervisord; the sentinel notifies.
NotifyAccess=all
ExecStart={command}
{environment}
Restart=on-failure
RestartSec=1
TimeoutStartSec={start_limit}
WatchdogSec={watchdog:.0f}
WatchdogSignal=SIGKILL
# supervisord ends the services in order; what is left after that is killed.
KillMode=mixed
TimeoutStopSec=10

[Install]
WantedBy=default.target
"""


def text(scenario: str, parameter_file: str, environment: Mapping[str, str]) -> str:
    """Return the content of the unit (systemd.service(5)); the parameter file may be ''."""
    scenario, parameter_file = (
        os.path.abspath(it) if Path(it).is_file() else it for it in (scenario, parameter_file)
    )
    become = ["-m", "deploy.commands.launcher", "become", scenario, parameter_file]
    # By the shell: systemd allows fewer characters in the path of a program than in arguments.
    command = ["/bin/sh", str(ROOT / "deploy" / "commands" / "venv.sh"), *become]
    kept = {
        name: value for name, value in environment.items() if value and (is_adopted(name) or name in KEPT)
    }
    for name in {MANIFEST, KEYSTORE} & kept.keys():
        kept[name] = os.path.abspath(kept[name])
    return UNIT.format(
        root=_escaped(str(ROOT)),
        command=" ".join(_quoted(word).replace("$", "$$") for word in command),
        environment="\n".join(f"Environment={_quoted(f'{name}={value}')}" for name, value in kept.items()),
        start_limit=START_LIMIT,
        watchdog=WATCHDOG,
    )


def write(content: str, environment: Mapping[str, str]) -> Path:
    """Write the unit where the user's systemd finds it. Raises DeploymentError."""
    home = environment.get("XDG_CONFIG_HOME") or "~/.config"
    name = f"reactive-arm{namespace_of(environment).rstrip('/').replace('/', '-')}.service"
    path = Path(home).expanduser() / "systemd" / "user" / name
    try:
        if path.exists() and _arm(path.read_text(errors="replace")) != _arm(content):
            another = f"{path} is the unit of another arm: give this one a namespace"
            raise DeploymentError(f"{another} ({NAMESPACE}=/arm2), or remove the file")
        path.parent.mkdir(parents=True, exist_ok=True)
        new = path.with_suffix(".new")
        new.write_text(content, encoding="utf-8")
        os.replace(new, path)  # systemd reads the old or the new one, even if the disk is full
    except OSError as error:
        raise DeploymentError(f"{path}: {error.strerror}") from None
    return path


def _arm(unit: str) -> list[str]:
    """Return the lines that say whose unit it is: the checkout and the run directory."""
    of_arm = ("# Written by", f'Environment="{RUN_DIRECTORY}=')
    return [line for line in unit.splitlines() if line.startswith(of_arm)]


def _quoted(word: str) -> str:
    return '"' + _escaped(word).replace('"', '\\"') + '"'


def _escaped(word: str) -> str:
    return word.translate(ESCAPES)
