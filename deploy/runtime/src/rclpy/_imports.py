"""What rclpy's modules import for their own use, and ported code imports from them.

``from rclpy.node import Node, ParameterDescriptor, ReentrantCallbackGroup`` is common, and works with ROS 2.
Here such names are loaded when they are asked for. Type checkers are not told: they shall find typing errors,
and every name where it is at home.
"""

from __future__ import annotations

import importlib
import sys
from typing import Any, TypeVar

MsgType = TypeVar("MsgType")
SrvType = TypeVar("SrvType")
SrvTypeRequest = TypeVar("SrvTypeRequest")
SrvTypeResponse = TypeVar("SrvTypeResponse")
WaitableEntityType = TypeVar("WaitableEntityType")

# Where the names are at home.
_HOMES = {
    "collections": "defaultdict",
    "contextlib": "ExitStack",
    "inspect": "ismethod",
    "pathlib": "Path",
    "rcl_interfaces.msg": "FloatingPointRange IntegerRange ListParametersResult ParameterDescriptor"
    " ParameterType ParameterValue SetParametersResult",
    "rcl_interfaces.srv": "ListParameters",
    "rclpy._imports": "MsgType SrvType SrvTypeRequest SrvTypeResponse WaitableEntityType",
    "rclpy.callback_groups": "CallbackGroup ReentrantCallbackGroup",
    "rclpy.client": "Client",
    "rclpy.clock": "Clock",
    "rclpy.clock_type": "ClockType",
    "rclpy.context": "Context",
    "rclpy.event_handler": "EventHandler SubscriptionEventCallbacks",
    "rclpy.exceptions": "InvalidHandle InvalidParameterTypeException InvalidParameterValueException"
    " InvalidTopicNameException NodeNameNonExistentError ParameterAlreadyDeclaredException"
    " ParameterImmutableException ParameterNotDeclaredException ParameterUninitializedException"
    " UnsupportedEventTypeError",
    "rclpy.executors": "Executor",
    "rclpy.expand_topic_name": "expand_topic_name",
    "rclpy.logging": "get_logger",
    "rclpy.node": "Node",
    "rclpy.parameter": "Parameter ParameterMsg",
    "rclpy.publisher": "Publisher",
    "rclpy.qos": "QoSDurabilityPolicy QoSHistoryPolicy QoSLivelinessPolicy QoSReliabilityPolicy",
    "rclpy.qos_overriding_options": "QoSOverridingOptions",
    "rclpy.service": "Service",
    "rclpy.service_introspection": "ServiceIntrospectionState",
    "rclpy.signals": "SignalHandlerGuardCondition",
    "rclpy.subscription": "Subscription",
    "rclpy.task": "Future",
    "rclpy.timer": "Timer",
    "rclpy.topic_endpoint_info": "TopicEndpointInfo",
    "rclpy.type_support": "check_for_type_support",
    "rclpy.utilities": "get_default_context timeout_sec_to_nsec",
    "rclpy.validate_full_topic_name": "validate_full_topic_name",
    "rclpy.validate_parameter_name": "validate_parameter_name",
    "rclpy.waitable": "NumberOfEntities Waitable",
    "threading": "Condition Lock RLock",
    "types": "MethodType",
    "typing": "ContextManager Dict Generator List Optional Protocol Sequence Set Text Tuple Type TypeVar"
    " TypedDict Union",
    "weakref": "WeakMethod",
}
_HOME = {name: module for module, names in _HOMES.items() for name in names.split()}

# Which of them rclpy 7.1.3 has in which module, besides those that the module here has, too.
_IMPORTED = {
    "callback_groups": "Lock",
    "client": "Clock Context Dict Optional ServiceIntrospectionState SrvType SrvTypeRequest SrvTypeResponse"
    " TypeVar",
    "clock": "Context Optional Type TypedDict get_default_context",
    "context": "ContextManager List MethodType Optional Protocol Type Union WeakMethod ismethod",
    "duration": "Union",
    "event_handler": "List Optional UnsupportedEventTypeError get_logger",
    "exceptions": "List Optional Union",
    "executors": "Client Clock ClockType Condition Context ContextManager ExitStack Generator InvalidHandle"
    " List Lock NumberOfEntities Optional RLock Service Set SignalHandlerGuardCondition Subscription Timer"
    " Tuple Type TypeVar Union Waitable WaitableEntityType timeout_sec_to_nsec",
    "guard_condition": "get_default_context",
    "logging": "Path Union",
    "node": "Context Dict Executor FloatingPointRange IntegerRange InvalidHandle"
    " InvalidParameterTypeException InvalidParameterValueException InvalidTopicNameException List"
    " ListParameters ListParametersResult MsgType NodeNameNonExistentError Optional"
    " ParameterAlreadyDeclaredException ParameterDescriptor ParameterImmutableException ParameterMsg"
    " ParameterNotDeclaredException ParameterType ParameterUninitializedException ParameterValue"
    " ReentrantCallbackGroup Sequence SetParametersResult SrvType SrvTypeRequest SrvTypeResponse"
    " TopicEndpointInfo Tuple Type Union expand_topic_name validate_full_topic_name validate_parameter_name",
    "parameter": "Dict List Optional Tuple Union",
    "parameter_client": "CallbackGroup Future List Node Optional QoSOverridingOptions Subscription"
    " SubscriptionEventCallbacks Union",
    "parameter_event_handler": "CallbackGroup Dict List Lock Node Optional Parameter QoSOverridingOptions"
    " SubscriptionEventCallbacks Tuple defaultdict",
    "publisher": "EventHandler MsgType TypeVar Union",
    "qos": "Union",
    "qos_overriding_options": "List Optional Parameter Publisher QoSDurabilityPolicy QoSHistoryPolicy"
    " QoSLivelinessPolicy QoSReliabilityPolicy Subscription Text Type Union",
    "serialization": "check_for_type_support",
    "service": "Clock ServiceIntrospectionState SrvType SrvTypeRequest SrvTypeResponse TypeVar",
    "signals": "InvalidHandle",
    "subscription": "EventHandler MsgType TypeVar",
    "time": "Tuple Union",
    "timer": "Context Optional",
    "utilities": "List Optional Set",
    "wait_for_message": "Node SignalHandlerGuardCondition Union timeout_sec_to_nsec",
}


def offer(module: str) -> None:
    """Let a module of rclpy, given by its full name, have what rclpy's imports."""
    names = frozenset(_IMPORTED[module.removeprefix("rclpy.")].split())

    def load(name: str) -> Any:
        if name not in names:
            raise AttributeError(f"module {module!r} has no attribute {name!r}")
        return getattr(importlib.import_module(_HOME[name]), name)

    vars(sys.modules[module])["__getattr__"] = load
