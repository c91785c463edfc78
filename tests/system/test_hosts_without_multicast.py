"""Two hosts whose network has no multicast: they meet by the names of peers, or by a discovery server."""

from __future__ import annotations

import os
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest

from deploy.running.environment import set_middleware
from deploy.running.processes import ROOT
from deploy.running.rclpy_choice import sourced_rclpy
from deploy.trials.chaos.partition import BRIDGE, CONTROL, NETWORK, ROBOT, missing, namespaces
from tests.system.sites import Site

NODE = """
import sys, threading
import rclpy
from interfaces.service import middleware
from rclpy.node import Node
from std_msgs.msg import String

name = sys.argv[1]
with middleware.without_shared_memory():
    rclpy.init(args=[])
    node = Node(name)
publisher = node.create_publisher(String, "names", 10)
node.create_timer(0.1, lambda: publisher.publish(String(data=name)))
node.create_subscription(String, "names", lambda m: m.data != name and print(m.data, flush=True), 10)
while True:
    rclpy.spin_once(node, timeout_sec=0.1)
"""
NAMES = f"127.0.0.1 localhost\n{NETWORK}.1 {ROBOT}.example\n{NETWORK}.2 {CONTROL}.example\n"
WITH_NAMES = ["unshare", "--mount", "sh", "-c", 'mount --bind "$0" /etc/hosts && exec "$@"']
SERVER = ROOT / ".venv" / "bin" / "fast-discovery-server"
PORT = 11811
WAYS = {
    "peers": {
        ROBOT: {"ROS_STATIC_PEERS": f"{CONTROL}.example"},
        CONTROL: {"ROS_STATIC_PEERS": f"{ROBOT}.example"},
    },
    "discovery server": {host: {"ROS_DISCOVERY_SERVER": f"{NETWORK}.1:{PORT}"} for host in (ROBOT, CONTROL)},
}
OF_THIS_RCLPY = ["peers"] if os.environ.get("RUNTIME") or sourced_rclpy() else [*WAYS]


@pytest.mark.parametrize("way", OF_THIS_RCLPY)
def test_hosts_meet_without_multicast(way: str, tmp_path: Path, domain_id: int) -> None:
    if reason := missing():
        pytest.skip(reason)
    with namespaces() as full, closing(Site(tmp_path / "run", domain_id)) as site:
        for host in (ROBOT, CONTROL):
            port = ["dev", host, "type", "bridge_slave", "mcast_flood", "off"]
            subprocess.run(["ip", "-n", full(BRIDGE), "link", "set", *port], check=True)
        names = tmp_path / "hosts"
        names.write_text(NAMES)
        environment = site.environment | {"ROS_AUTOMATIC_DISCOVERY_RANGE": "SUBNET"}
        set_middleware(environment)
        if way == "discovery server":
            server = [str(SERVER), "-i", "0", "-l", f"{NETWORK}.1", "-p", str(PORT)]
            begun = site.begin_alone(["ip", "netns", "exec", full(ROBOT), *server], environment)
            begun.await_line("Server is running")
        nodes = {
            host: site.begin_alone(
                [
                    "ip",
                    "netns",
                    "exec",
                    full(host),
                    *WITH_NAMES,
                    str(names),
                    sys.executable,
                    "-c",
                    NODE,
                    host,
                ],
                environment | WAYS[way][host] | {"PYTHONPATH": os.pathsep.join([str(ROOT), *sys.path])},
            )
            for host in (ROBOT, CONTROL)
        }
        nodes[ROBOT].await_line(f"^{CONTROL}$")
        nodes[CONTROL].await_line(f"^{ROBOT}$")
