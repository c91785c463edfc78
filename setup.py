"""Installs reactive-arm as a package of a ROS 2 workspace; colcon runs this (ament_python).

The packages `services`, `interfaces` and `deploy` go to share/reactive_arm: their names are too common for
the import path that all packages of a workspace share.
"""

import re
import sys
from collections import defaultdict
from pathlib import Path

from setuptools import setup

ROOT = Path(__file__).resolve().parent  # of the sources, even where colcon has linked this file
sys.path.insert(0, str(ROOT))

from deploy.package.executables import ARM  # noqa: E402
from deploy.supervision import manifest  # noqa: E402

PACKAGE = "reactive_arm"
EXECUTABLES = (*(program.name for program in manifest.programs()), ARM)
SHARE = f"share/{PACKAGE}"
ELSEWHERE = (
    "interfaces/reactive_node",
    "deploy/ground",
    "deploy/tools",
    "deploy/package",
)
"""Folders that are installed otherwise, or that an installed arm does not need."""


def version() -> str:
    """Return the version of the newest heading."""
    heading = re.search(r"(?m)^## ([\d.]+)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"))
    assert heading
    return heading[1]


def sources() -> dict[str, list[str]]:
    """Return the files of the arm by the directory into which they are installed."""
    files: dict[str, list[str]] = defaultdict(list)
    for folder in ("services", "interfaces", "deploy"):
        for path in sorted((ROOT / folder).rglob("*")):
            name = path.relative_to(ROOT)
            is_elsewhere = any(name.is_relative_to(other) for other in ELSEWHERE)
            if path.is_file() and not is_elsewhere and "__pycache__" not in name.parts:
                files[f"{SHARE}/{name.parent}"].append(str(name))
    return files


setup(
    name=PACKAGE,
    version=version(),
    packages=[PACKAGE, "reactive_node", "reactive_node.signals", "mcap_files", "ros_yaml"],
    package_dir={
        PACKAGE: "deploy/package/executables",
        "reactive_node": "interfaces/reactive_node/src/reactive_node",
        "mcap_files": "deploy/tools/src/mcap_files",
        "ros_yaml": "deploy/tools/src/ros_yaml",
    },
    package_data={"reactive_node": ["py.typed"], "mcap_files": ["py.typed"], "ros_yaml": ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"deploy/package/share/{PACKAGE}"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/launch", ["deploy/package/share/arm.launch.py"]),
        *sources().items(),
    ],
    entry_points={"console_scripts": [f"{name} = {PACKAGE}:main" for name in EXECUTABLES]},
    zip_safe=False,
)
