"""The survey of programs of others, with two of our own."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

SURVEY = Path(__file__).parents[1] / "survey.py"

ECHO = """
import rclpy
from std_msgs.msg import Int64

rclpy.init()
node = rclpy.create_node("echo")
assert input() == "go"
publisher = node.create_publisher(Int64, "out", 10)
node.create_subscription(Int64, "in", publisher.publish, 10)
rclpy.spin(node)
"""

BROKEN = """
def main():
    import absent_msgs

def group():
    raise ExceptionGroup("many", [ValueError("one")])
"""

LIST = """
[[set]]
name = "echo"
paths = ["one"]
run = ["echo"]
keys = ["go\\n"]
feed = [{ topic = "in", type = "std_msgs/msg/Int64", fields = { data = 7 } }]

[[set]]
name = "hashes"
paths = ["one"]
run = ["hashes {folder}"]

[[set]]
name = "broken"
paths = ["one"]
run = ["broken:main"]

[[set]]
name = "group"
paths = ["one"]
run = ["broken:group"]
"""


def test_a_row_says_what_runs_and_why_the_rest_ends(tmp_path: Path) -> None:
    (tmp_path / "one").mkdir()
    (tmp_path / "one" / "echo.py").write_text(ECHO)
    (tmp_path / "one" / "hashes.py").write_text("import sys; print(sys.argv[1:], hash('x'))")
    (tmp_path / "one" / "broken.py").write_text(BROKEN)
    (tmp_path / "list.toml").write_text(LIST)
    command = [sys.executable, SURVEY, tmp_path, "--list", tmp_path / "list.toml", "--seconds", "20"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    head, line, echo, hashes, broken, group, _, last = done.stdout.splitlines()
    assert head.count("|") == line.count("|") == echo.count("|")
    found = re.fullmatch(r"\| echo \| runs \| (\d+) \| [\d.]+ \| yes \|", echo)
    assert found
    assert 300 < int(found[1]) < 400
    assert re.fullmatch(r"\| hashes \| ends \| 0 \| [\d.]+ \| no \|", hashes)
    assert re.match(r"\| broken \| fails: absent_msgs is missing \| 0 \| [\d.]+ \| yes \|", broken)
    assert group.startswith("| group | fails: ValueError: one | 0 |")
    assert last == "4 sets: 1 run, 1 end in order, 2 fail for a named reason, 0 break the simulation."
