"""The arm as a robot model: its frames, their transforms, and its URDF.

The chain is ``base`` → ``link1`` → ``link2`` → ``effector``. The joints turn about the axis z, and each link
lies on the axis x of its frame. Arms share ``/tf``, so frames carry the namespace: ``arm1/base`` is the frame
``base`` of the arm in ``/arm1``.
"""

from __future__ import annotations

import math
from collections.abc import Iterator

from geometry_msgs.msg import Quaternion, Transform, Vector3

from interfaces.topics import FRAME, THETA1, THETA2

BASE, LINK1, LINK2, EFFECTOR = FRAME, "link1", "link2", "effector"
JOINTS = (THETA1.name, THETA2.name)
"""The joints have the names of the topics of their angles."""
THICKNESS = 0.1  # m, of the links in a picture


def frame_id(frame: str, namespace: str) -> str:
    """Return the name of a frame of the arm in a namespace."""
    return f"{namespace}/{frame}".strip("/")


def forward_kinematics(l1: float, l2: float, theta1: float, theta2: float) -> tuple[float, float]:
    """Return the position x, y [m] of the effector (thesis equation 5.1).

    :param l1, l2: lengths of the links [m].
    :param theta1, theta2: angles of the joints [rad], the second relative to the first link.
    """
    heading = theta1 + theta2
    if math.isinf(heading):  # of angles beyond 8e307 rad
        return math.nan, math.nan
    x = l1 * math.cos(theta1) + l2 * math.cos(heading)
    y = l1 * math.sin(theta1) + l2 * math.sin(heading)
    return x, y


def transforms(l1: float, l2: float, theta1: float, theta2: float) -> Iterator[tuple[str, str, Transform]]:
    """Yield parent, child and transform of each frame but the first; see :func:`forward_kinematics`."""
    yield BASE, LINK1, _transform(0.0, theta1)
    yield LINK1, LINK2, _transform(l1, theta2)
    yield LINK2, EFFECTOR, _transform(l2, 0.0)


def _transform(x: float, yaw: float) -> Transform:
    rotation = Quaternion(z=math.sin(yaw / 2), w=math.cos(yaw / 2))
    return Transform(translation=Vector3(x=x), rotation=rotation)


def urdf(l1: float, l2: float, namespace: str = "/") -> str:
    """Return the URDF of the arm in a namespace; its links have the names of the frames. Lengths in m."""
    base, link1, link2, effector = (frame_id(frame, namespace) for frame in (BASE, LINK1, LINK2, EFFECTOR))
    theta1, theta2 = JOINTS
    half = THICKNESS / 2
    return f"""\
<?xml version="1.0"?>
<robot name="reactive_arm">
  {_link(base, f'<cylinder radius="{2 * THICKNESS}" length="{half}"/>', "0.6 0.63 0.67", z=-half)}
  {_link(link1, f'<box size="{l1} {THICKNESS} {half}"/>', "0.2 0.4 0.8", x=l1 / 2)}
  {_link(link2, f'<box size="{l2} {THICKNESS} {half}"/>', "0.2 0.6 0.9", x=l2 / 2)}
  {_link(effector, f'<sphere radius="{THICKNESS}"/>', "0.9 0.5 0.1")}
  {_joint(theta1, "continuous", base, link1, 0.0)}
  {_joint(theta2, "continuous", link1, link2, l1)}
  {_joint(effector, "fixed", link2, effector, l2)}
</robot>
"""


def _link(name: str, geometry: str, color: str, x: float = 0.0, z: float = 0.0) -> str:
    material = f'<material name="{name}"><color rgba="{color} 1.0"/></material>'
    visual = f'<origin xyz="{x} 0.0 {z}"/><geometry>{geometry}</geometry>{material}'
    return f'<link name="{name}"><visual>{visual}</visual></link>'


def _joint(name: str, kind: str, parent: str, child: str, x: float) -> str:
    axis = "" if kind == "fixed" else '<axis xyz="0 0 1"/>'
    links = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{links}<origin xyz="{x} 0.0 0.0"/>{axis}</joint>'
