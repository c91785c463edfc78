"""``python -m rclpy_simulation replay``: a bag and your nodes in, a bag out."""

import sys
from importlib.util import find_spec

if find_spec("mcap_files") is None:
    sys.exit("replay needs ros2-python-tools: pip install ./deploy/tools in the checkout of this kit")

from rclpy_simulation.replay.command import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
