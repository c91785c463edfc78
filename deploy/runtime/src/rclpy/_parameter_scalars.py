"""Parameter values without quotes, typed as `rcl_yaml_param_parser` types them: it accepts more than YAML."""

from __future__ import annotations

import math
import re

_TRUE = {"Y", "y", "yes", "Yes", "YES", "true", "True", "TRUE", "on", "On", "ON"}
_FALSE = {"N", "n", "no", "No", "NO", "false", "False", "FALSE", "off", "Off", "OFF"}
_INTEGER = re.compile(r"[+-]?(?:(?P<hexadecimal>0[xX][0-9a-fA-F]+)|(?P<octal>0[0-7]*)|[1-9][0-9]*)")
_FLOAT = re.compile(
    r"[+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]+)?|[+-]?\.?(?:inf|infinity|nan)", re.IGNORECASE
)


def plain_scalar(text: str) -> bool | int | float | str:
    """Type a scalar without quotes as C's strtoll and strtod do: an integer beyond 64 bits is a double."""
    if text in _TRUE:
        return True
    if text in _FALSE:
        return False
    # No 64 bit integer is longer than that, and Python refuses to convert thousands of digits.
    if len(text) <= 66 and (number := _INTEGER.fullmatch(text)):
        integer = int(text, 16 if number["hexadecimal"] else 8 if number["octal"] else 10)
        if -(2**63) <= integer < 2**63:
            return integer
    if _FLOAT.fullmatch(text):
        value = float(re.sub(r"\.(?=[in])", "", text.lower()))
        # A number too large for a double is none.
        if math.isfinite(value) or not text[-1].isdigit():
            return value
    return text
