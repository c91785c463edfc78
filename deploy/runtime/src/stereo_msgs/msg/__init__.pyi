"""Messages of stereo_msgs. Made by rosidl_runtime_embedded.stubs."""

import sensor_msgs.msg
import std_msgs.msg
from rosidl_runtime_embedded import Message

class DisparityImage(Message):
    header: std_msgs.msg.Header
    image: sensor_msgs.msg.Image
    f: float
    t: float
    valid_window: sensor_msgs.msg.RegionOfInterest
    min_disparity: float
    max_disparity: float
    delta_d: float
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        image: sensor_msgs.msg.Image = ...,
        f: float = ...,
        t: float = ...,
        valid_window: sensor_msgs.msg.RegionOfInterest = ...,
        min_disparity: float = ...,
        max_disparity: float = ...,
        delta_d: float = ...,
        check_fields: bool = ...,
    ) -> None: ...
