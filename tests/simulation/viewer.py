"""A tool that shows the arm: while nobody looks, robot_state and twist rest."""

from __future__ import annotations

import os
import time

import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.signals import SignalHandlerOptions

from deploy.supervision.environment import namespace_of
from interfaces import topics


def view() -> None:
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = Node("viewer", namespace=namespace_of(os.environ))
    newest = QoSProfile(depth=1, reliability=ReliabilityPolicy.BEST_EFFORT)
    shown = (topics.JOINT_STATES, topics.TF, topics.EFFECTOR_TWIST)
    for topic in (each for each in shown if each in topics.CONTRACT):  # /tf needs tf2_msgs
        node.create_subscription(topic.type, topic.name, lambda _: None, newest)
    while True:
        time.sleep(3600.0)  # nothing is taken from DDS, which is what costs
