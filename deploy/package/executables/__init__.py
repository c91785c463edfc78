"""The executables of the package: the programs of the manifest, and ``arm``, the commands behind ``make``. ::

    ros2 run reactive_arm kinematics
    ros2 run reactive_arm arm status

This is installed as the Python package ``reactive_arm``.
"""

from __future__ import annotations

import importlib.util
import os
import runpy
import sys
from pathlib import Path

ARM = "arm"
NEEDED = ("prompt_toolkit", "reactivex", "supervisor", "websockets", "yaml")


def main() -> None:
    """Run what has the name of the executable, with the same arguments."""
    executable = Path(sys.argv[0]).absolute()  # PREFIX/lib/reactive_arm/NAME
    share = executable.parents[2] / "share" / "reactive_arm"
    if missing := [name for name in NEEDED if importlib.util.find_spec(name) is None]:
        requirements = share / "deploy" / "requirements" / "system.txt"
        sys.exit(f"{sys.executable} lacks {', '.join(missing)}: python3 -m pip install -r {requirements}")
    sys.path.insert(0, str(share))
    if executable.name == ARM:
        os.environ.setdefault("REACTIVE_ARM_RUN_DIR", str(_run_directory()))
        module = "deploy.commands.launcher"
    else:
        from deploy.supervision import manifest

        program = next(each for each in manifest.programs() if each.name == executable.name)
        module = program.module
        sys.argv[1:1] = program.arguments
    runpy.run_module(module, run_name="__main__", alter_sys=True)


def _run_directory() -> Path:
    """Return a directory of this user and of the arm's namespace: the installed files may be read-only."""
    home = Path(os.environ.get("ROS_HOME") or Path.home() / ".ros")
    namespace = os.environ.get("REACTIVE_ARM_NAMESPACE", "").strip("/")
    return home / "_".join(["reactive_arm", *filter(None, namespace.split("/"))])
