"""ROS 2's own rclpy, unmodified, on another ground than rcl.

A substitute for rclpy's C extension: it provides what communicates or waits, over the small interface of a
ground (:mod:`rclpy_ground.interface`); all else is the genuine extension's. ::

    import rclpy_ground

    rclpy_ground.install(MyGround())  # before rclpy is imported

    import rclpy
"""

from __future__ import annotations

import sys

from rclpy_ground.interface import Ground

__all__ = ["Ground", "install"]


def install(ground: Ground) -> None:
    """Choose the ground of this interpreter, before rclpy is imported.

    Raises ImportError if rclpy was imported before, has another seam, or stands on another ground.
    """
    from rclpy_ground import choice

    if (present := vars(choice).get("ground")) is not None:
        if present is not ground:
            raise ImportError(f"rclpy stands on {present.name} here: an interpreter has one ground")
        return
    if (hook := sys.modules.get("rclpy_ground.hook")) is not None:  # this choice wins over the environment's
        sys.meta_path[:] = [finder for finder in sys.meta_path if not isinstance(finder, hook.Chooser)]
    from rclpy_ground import changes, seam
    from rclpy_ground.genuine import NAME

    seam.check()
    choice.ground = ground
    sys.modules[f"rclpy.{NAME}"] = seam.module(own_logs=ground.has_processes)
    if ground.has_processes:  # only a simulation must be the same on every run
        changes.make()
