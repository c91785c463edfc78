"""The distribution builds, and installs into another project."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

PROJECT = Path(__file__).parents[1]


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory with the wheel and the source distribution."""
    directory = tmp_path_factory.mktemp("dist")
    _run("-m", "hatchling", "build", "--directory", str(directory), cwd=PROJECT)
    return directory


def test_wheel_holds_typed_package_only(built: Path) -> None:
    sources = PROJECT / "src"
    expected = {str(path.relative_to(sources)) for path in sources.rglob("*.py")} | {"reactive_node/py.typed"}
    (wheel,) = built.glob("*.whl")

    with ZipFile(wheel) as archive:
        names = {name for name in archive.namelist() if ".dist-info/" not in name}

    assert names == expected


@pytest.mark.parametrize("pattern", ["*.whl", "*.tar.gz"])
def test_distribution_installs_without_network(built: Path, tmp_path: Path, pattern: str) -> None:
    (distribution,) = built.glob(pattern)
    options = [
        "--no-index",
        "--no-deps",
        "--no-build-isolation",
        "--no-compile",
        "--disable-pip-version-check",
    ]
    _run("-m", "pip", "install", *options, "--target", str(tmp_path), str(distribution), cwd=tmp_path)

    program = "import reactive_node.testing; print(reactive_node.__file__)"
    imported = _run("-c", program, cwd=tmp_path)

    assert Path(imported.strip()) == tmp_path / "reactive_node" / "__init__.py"


def _run(*arguments: str, cwd: Path) -> str:
    path = os.pathsep.join(filter(None, [str(cwd), os.environ.get("PYTHONPATH")]))
    run = subprocess.run(
        [sys.executable, *arguments],
        cwd=cwd,
        env=os.environ | {"PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    return run.stdout
