"""Replay: feeds a record through these services in virtual time, and compares what they publish.

The kit (:mod:`rclpy_simulation.replay`) lets programs live at their times and feeds them messages. It cannot
know what is the arm's own:

- ``record``: messages have the time of their sending, whatever the chaos monkey did to the time of day;
- ``chains``: some services hear the replayed output of each other, signals refuse late samples, and of the
  commands on one topic, some are the watchdog's;
- ``lives``: health reports show processes, parameters and phases, and events show faults; strikes and latch
  of before the record are concluded from what comes later;
- ``playback``: connects these with the kit;
- ``comparison``, ``job``: each topic has its bounds, and is not compared around restarts and faults;
- ``report``: the table of ``make replay``.
"""

import tests.simulation  # noqa: F401 (first: it chooses the ground of rclpy)
