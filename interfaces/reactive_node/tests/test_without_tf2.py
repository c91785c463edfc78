from __future__ import annotations

import subprocess
import sys

import pytest

from reactive_node.testing import MakeNode


@pytest.mark.parametrize("package", ["tf2", "rclpy.action"])
def test_node_without_transforms_and_actions_imports_neither(package: str) -> None:
    program = f"import reactive_node, sys; print([name for name in sys.modules if '{package}' in name])"

    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)

    assert run.stdout == "[]\n"


def test_transforms_without_tf2_msgs_are_an_error_that_names_it(
    make_node: MakeNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if "tf2" in name or name == "reactive_node.transforms"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "tf2_msgs", None)

    with pytest.raises(ModuleNotFoundError, match="tf2_msgs"):
        make_node().create_transform_observable("map", "base")
