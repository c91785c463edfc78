"""Checks the value of a parameter against its descriptor."""

from __future__ import annotations

import math

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor
from rclpy.parameter import Parameter


def objection(parameter: Parameter, descriptor: ParameterDescriptor, rel_tol: float) -> str:
    """Return why type or range forbid a value, '' if they allow it; `rel_tol` is a double's tolerance."""
    if parameter.type_ is Parameter.Type.NOT_SET:
        return ""
    if not descriptor.dynamic_typing and parameter.type_.value != descriptor.type:
        expected = Parameter.Type(descriptor.type)
        return f"Wrong parameter type, expected '{expected}' got '{parameter.type_}'"
    if parameter.type_ is Parameter.Type.INTEGER and descriptor.integer_range:
        return _integer_objection(parameter, descriptor.integer_range[0])
    if parameter.type_ is Parameter.Type.DOUBLE and descriptor.floating_point_range:
        return _double_objection(parameter, descriptor.floating_point_range[0], rel_tol)
    return ""


def _integer_objection(parameter: Parameter, allowed: IntegerRange) -> str:
    low, high = sorted((allowed.from_value, allowed.to_value))
    value = parameter.value
    if not low <= value <= high:
        return f"Parameter {parameter.name} out of range. Min: {low}, Max: {high}, value: {value}"
    # The upper bound is valid even if no step meets it.
    if allowed.step and value != high and (value - low) % allowed.step:
        return (
            f"The parameter value for {parameter.name} is not a valid step. "
            f"Min: {low}, max: {high}, value: {value}, step: {allowed.step}"
        )
    return ""


def _double_objection(parameter: Parameter, allowed: FloatingPointRange, rel_tol: float) -> str:
    low, high = sorted((allowed.from_value, allowed.to_value))
    value = parameter.value
    if math.isclose(value, low, rel_tol=rel_tol) or math.isclose(value, high, rel_tol=rel_tol):
        return ""
    # Also true for NaN, which is in no range.
    if not low < value < high:
        return f"Parameter {parameter.name} out of range Min: {low}, Max: {high}, value: {value}"
    if allowed.step:
        nearest = low + round((value - low) / allowed.step) * allowed.step
        if not math.isclose(nearest, value, rel_tol=rel_tol):
            return (
                f"The parameter value for {parameter.name} is not close enough to a valid step. "
                f"Min: {low}, max: {high}, value: {value}, step: {allowed.step}"
            )
    return ""
