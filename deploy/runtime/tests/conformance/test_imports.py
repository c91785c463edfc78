"""Names that can be imported from rclpy's modules, besides those that they define."""

from __future__ import annotations

import importlib

import pytest

# Public programs import these. Most are defined elsewhere: the modules import them for their own use.
NAMES = {
    "rclpy.client": "Future SrvType SrvTypeRequest SrvTypeResponse",
    "rclpy.clock": "ClockType Duration JumpHandlePreCallbackType Time",
    "rclpy.duration": "Infinite",
    "rclpy.event_handler": "IncompatibleTypeInfo QoSLivelinessChangedInfo QoSLivelinessLostInfo"
    " QoSMessageLostInfo QoSOfferedDeadlineMissedInfo QoSOfferedIncompatibleQoSInfo QoSPublisherEventType"
    " QoSPublisherMatchedInfo QoSRequestedDeadlineMissedInfo QoSRequestedIncompatibleQoSInfo"
    " QoSSubscriptionEventType QoSSubscriptionMatchedInfo UnsupportedEventTypeError",
    "rclpy.exceptions": "InvalidHandle",
    "rclpy.executors": "Client Future GuardCondition InvalidHandle Task",
    "rclpy.logging": "LoggingSeverity RcutilsLogger",
    "rclpy.node": "Callable Client Context Dict Executor FloatingPointRange IntegerRange InvalidHandle List"
    " MsgType MutuallyExclusiveCallbackGroup NodeNameNonExistentError Optional Parameter ParameterDescriptor"
    " ParameterNotDeclaredException ParameterType ParameterValue Publisher QoSProfile Rate"
    " ReentrantCallbackGroup Service SetParametersResult SrvType SrvTypeRequest SrvTypeResponse Subscription"
    " Timer Union",
    "rclpy.parameter": "ParameterMsg ParameterType ParameterValue",
    "rclpy.publisher": "MsgType",
    "rclpy.qos": "DeadlineBestAvailable Duration LivelinessLeaseDurationeBestAvailable QoSCompatibility",
    "rclpy.qos_overriding_options": "QoSProfile QosCallbackResult QosCallbackType",
    "rclpy.service": "ServiceIntrospectionState SrvType SrvTypeRequest SrvTypeResponse",
    "rclpy.signals": "SignalHandlerOptions",
    "rclpy.subscription": "MsgType",
    "rclpy.time": "ClockType Duration",
    "rclpy.waitable": "NumberOfEntities Waitable",
}


@pytest.mark.parametrize("module", NAMES)
def test_names_that_programs_import_are_there(module: str) -> None:
    here = importlib.import_module(module)
    assert [name for name in NAMES[module].split() if not hasattr(here, name)] == []


def test_imported_name_is_the_original() -> None:
    from rcl_interfaces.msg import Parameter, ParameterDescriptor
    from rclpy import callback_groups, executors, guard_condition, node, parameter

    assert node.ParameterDescriptor is ParameterDescriptor
    assert node.ReentrantCallbackGroup is callback_groups.ReentrantCallbackGroup
    assert node.Executor is executors.Executor
    assert parameter.ParameterMsg is Parameter
    assert executors.GuardCondition is guard_condition.GuardCondition


def test_interface_is_importable_from_its_module_of_ros_2() -> None:
    from geometry_msgs.msg._pose import Pose as FromModule
    from std_srvs.srv._set_bool import SetBool as FromServiceModule

    from geometry_msgs.msg import Pose, _pose
    from std_srvs.srv import SetBool

    assert Pose is _pose.Pose is FromModule
    assert SetBool is FromServiceModule
    with pytest.raises(ImportError):
        importlib.import_module("geometry_msgs.msg._nothing")


def test_unknown_name_cannot_be_imported() -> None:
    with pytest.raises(ImportError, match="cannot import name 'Nod'"):
        exec("from rclpy.node import Nod")
