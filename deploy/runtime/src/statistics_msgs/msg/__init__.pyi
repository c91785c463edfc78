"""Messages of statistics_msgs. Made by rosidl_runtime_embedded.stubs."""

from typing import Final

import builtin_interfaces.msg
from rosidl_runtime_embedded import Message

class MetricsMessage(Message):
    measurement_source_name: str
    metrics_source: str
    unit: str
    window_start: builtin_interfaces.msg.Time
    window_stop: builtin_interfaces.msg.Time
    statistics: list[StatisticDataPoint]
    def __init__(
        self,
        *,
        measurement_source_name: str = ...,
        metrics_source: str = ...,
        unit: str = ...,
        window_start: builtin_interfaces.msg.Time = ...,
        window_stop: builtin_interfaces.msg.Time = ...,
        statistics: list[StatisticDataPoint] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class StatisticDataPoint(Message):
    data_type: int
    data: float
    def __init__(
        self,
        *,
        data_type: int = ...,
        data: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class StatisticDataType(Message):
    STATISTICS_DATA_TYPE_UNINITIALIZED: Final = 0
    STATISTICS_DATA_TYPE_AVERAGE: Final = 1
    STATISTICS_DATA_TYPE_MINIMUM: Final = 2
    STATISTICS_DATA_TYPE_MAXIMUM: Final = 3
    STATISTICS_DATA_TYPE_STDDEV: Final = 4
    STATISTICS_DATA_TYPE_SAMPLE_COUNT: Final = 5
    def __init__(
        self,
        *,
        check_fields: bool = ...,
    ) -> None: ...
