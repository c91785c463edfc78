"""Messages of sensor_msgs. Made by rosidl_runtime_embedded.stubs."""

from array import array
from collections.abc import Iterable
from typing import Final

import numpy
from numpy.typing import NDArray

import builtin_interfaces.msg
import geometry_msgs.msg
import std_msgs.msg
from rosidl_runtime_embedded import Message

class BatteryState(Message):
    header: std_msgs.msg.Header
    voltage: float
    temperature: float
    current: float
    charge: float
    capacity: float
    design_capacity: float
    percentage: float
    power_supply_status: int
    power_supply_health: int
    power_supply_technology: int
    present: bool
    @property
    def cell_voltage(self) -> array[float]: ...
    @cell_voltage.setter
    def cell_voltage(self, value: Iterable[float]) -> None: ...
    @property
    def cell_temperature(self) -> array[float]: ...
    @cell_temperature.setter
    def cell_temperature(self, value: Iterable[float]) -> None: ...
    location: str
    serial_number: str
    POWER_SUPPLY_STATUS_UNKNOWN: Final = 0
    POWER_SUPPLY_STATUS_CHARGING: Final = 1
    POWER_SUPPLY_STATUS_DISCHARGING: Final = 2
    POWER_SUPPLY_STATUS_NOT_CHARGING: Final = 3
    POWER_SUPPLY_STATUS_FULL: Final = 4
    POWER_SUPPLY_HEALTH_UNKNOWN: Final = 0
    POWER_SUPPLY_HEALTH_GOOD: Final = 1
    POWER_SUPPLY_HEALTH_OVERHEAT: Final = 2
    POWER_SUPPLY_HEALTH_DEAD: Final = 3
    POWER_SUPPLY_HEALTH_OVERVOLTAGE: Final = 4
    POWER_SUPPLY_HEALTH_UNSPEC_FAILURE: Final = 5
    POWER_SUPPLY_HEALTH_COLD: Final = 6
    POWER_SUPPLY_HEALTH_WATCHDOG_TIMER_EXPIRE: Final = 7
    POWER_SUPPLY_HEALTH_SAFETY_TIMER_EXPIRE: Final = 8
    POWER_SUPPLY_TECHNOLOGY_UNKNOWN: Final = 0
    POWER_SUPPLY_TECHNOLOGY_NIMH: Final = 1
    POWER_SUPPLY_TECHNOLOGY_LION: Final = 2
    POWER_SUPPLY_TECHNOLOGY_LIPO: Final = 3
    POWER_SUPPLY_TECHNOLOGY_LIFE: Final = 4
    POWER_SUPPLY_TECHNOLOGY_NICD: Final = 5
    POWER_SUPPLY_TECHNOLOGY_LIMN: Final = 6
    POWER_SUPPLY_TECHNOLOGY_TERNARY: Final = 7
    POWER_SUPPLY_TECHNOLOGY_VRLA: Final = 8
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        voltage: float = ...,
        temperature: float = ...,
        current: float = ...,
        charge: float = ...,
        capacity: float = ...,
        design_capacity: float = ...,
        percentage: float = ...,
        power_supply_status: int = ...,
        power_supply_health: int = ...,
        power_supply_technology: int = ...,
        present: bool = ...,
        cell_voltage: Iterable[float] = ...,
        cell_temperature: Iterable[float] = ...,
        location: str = ...,
        serial_number: str = ...,
        check_fields: bool = ...,
    ) -> None: ...

class CameraInfo(Message):
    header: std_msgs.msg.Header
    height: int
    width: int
    distortion_model: str
    @property
    def d(self) -> array[float]: ...
    @d.setter
    def d(self, value: Iterable[float]) -> None: ...
    @property
    def k(self) -> NDArray[numpy.float64]: ...
    @k.setter
    def k(self, value: Iterable[float]) -> None: ...
    @property
    def r(self) -> NDArray[numpy.float64]: ...
    @r.setter
    def r(self, value: Iterable[float]) -> None: ...
    @property
    def p(self) -> NDArray[numpy.float64]: ...
    @p.setter
    def p(self, value: Iterable[float]) -> None: ...
    binning_x: int
    binning_y: int
    roi: RegionOfInterest
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        height: int = ...,
        width: int = ...,
        distortion_model: str = ...,
        d: Iterable[float] = ...,
        k: Iterable[float] = ...,
        r: Iterable[float] = ...,
        p: Iterable[float] = ...,
        binning_x: int = ...,
        binning_y: int = ...,
        roi: RegionOfInterest = ...,
        check_fields: bool = ...,
    ) -> None: ...

class ChannelFloat32(Message):
    name: str
    @property
    def values(self) -> array[float]: ...
    @values.setter
    def values(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        name: str = ...,
        values: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class CompressedImage(Message):
    header: std_msgs.msg.Header
    format: str
    @property
    def data(self) -> array[int]: ...
    @data.setter
    def data(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        format: str = ...,
        data: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class FluidPressure(Message):
    header: std_msgs.msg.Header
    fluid_pressure: float
    variance: float
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        fluid_pressure: float = ...,
        variance: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Illuminance(Message):
    header: std_msgs.msg.Header
    illuminance: float
    variance: float
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        illuminance: float = ...,
        variance: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Image(Message):
    header: std_msgs.msg.Header
    height: int
    width: int
    encoding: str
    is_bigendian: int
    step: int
    @property
    def data(self) -> array[int]: ...
    @data.setter
    def data(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        height: int = ...,
        width: int = ...,
        encoding: str = ...,
        is_bigendian: int = ...,
        step: int = ...,
        data: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Imu(Message):
    header: std_msgs.msg.Header
    orientation: geometry_msgs.msg.Quaternion
    @property
    def orientation_covariance(self) -> NDArray[numpy.float64]: ...
    @orientation_covariance.setter
    def orientation_covariance(self, value: Iterable[float]) -> None: ...
    angular_velocity: geometry_msgs.msg.Vector3
    @property
    def angular_velocity_covariance(self) -> NDArray[numpy.float64]: ...
    @angular_velocity_covariance.setter
    def angular_velocity_covariance(self, value: Iterable[float]) -> None: ...
    linear_acceleration: geometry_msgs.msg.Vector3
    @property
    def linear_acceleration_covariance(self) -> NDArray[numpy.float64]: ...
    @linear_acceleration_covariance.setter
    def linear_acceleration_covariance(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        orientation: geometry_msgs.msg.Quaternion = ...,
        orientation_covariance: Iterable[float] = ...,
        angular_velocity: geometry_msgs.msg.Vector3 = ...,
        angular_velocity_covariance: Iterable[float] = ...,
        linear_acceleration: geometry_msgs.msg.Vector3 = ...,
        linear_acceleration_covariance: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class JointState(Message):
    header: std_msgs.msg.Header
    name: list[str]
    @property
    def position(self) -> array[float]: ...
    @position.setter
    def position(self, value: Iterable[float]) -> None: ...
    @property
    def velocity(self) -> array[float]: ...
    @velocity.setter
    def velocity(self, value: Iterable[float]) -> None: ...
    @property
    def effort(self) -> array[float]: ...
    @effort.setter
    def effort(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        name: list[str] = ...,
        position: Iterable[float] = ...,
        velocity: Iterable[float] = ...,
        effort: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Joy(Message):
    header: std_msgs.msg.Header
    @property
    def axes(self) -> array[float]: ...
    @axes.setter
    def axes(self, value: Iterable[float]) -> None: ...
    @property
    def buttons(self) -> array[int]: ...
    @buttons.setter
    def buttons(self, value: Iterable[int]) -> None: ...
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        axes: Iterable[float] = ...,
        buttons: Iterable[int] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class JoyFeedback(Message):
    type: int
    id: int
    intensity: float
    TYPE_LED: Final = 0
    TYPE_RUMBLE: Final = 1
    TYPE_BUZZER: Final = 2
    def __init__(
        self,
        *,
        type: int = ...,
        id: int = ...,
        intensity: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class JoyFeedbackArray(Message):
    array: list[JoyFeedback]
    def __init__(
        self,
        *,
        array: list[JoyFeedback] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class LaserEcho(Message):
    @property
    def echoes(self) -> array[float]: ...
    @echoes.setter
    def echoes(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        echoes: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class LaserScan(Message):
    header: std_msgs.msg.Header
    angle_min: float
    angle_max: float
    angle_increment: float
    time_increment: float
    scan_time: float
    range_min: float
    range_max: float
    @property
    def ranges(self) -> array[float]: ...
    @ranges.setter
    def ranges(self, value: Iterable[float]) -> None: ...
    @property
    def intensities(self) -> array[float]: ...
    @intensities.setter
    def intensities(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        angle_min: float = ...,
        angle_max: float = ...,
        angle_increment: float = ...,
        time_increment: float = ...,
        scan_time: float = ...,
        range_min: float = ...,
        range_max: float = ...,
        ranges: Iterable[float] = ...,
        intensities: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MagneticField(Message):
    header: std_msgs.msg.Header
    magnetic_field: geometry_msgs.msg.Vector3
    @property
    def magnetic_field_covariance(self) -> NDArray[numpy.float64]: ...
    @magnetic_field_covariance.setter
    def magnetic_field_covariance(self, value: Iterable[float]) -> None: ...
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        magnetic_field: geometry_msgs.msg.Vector3 = ...,
        magnetic_field_covariance: Iterable[float] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MultiDOFJointState(Message):
    header: std_msgs.msg.Header
    joint_names: list[str]
    transforms: list[geometry_msgs.msg.Transform]
    twist: list[geometry_msgs.msg.Twist]
    wrench: list[geometry_msgs.msg.Wrench]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        joint_names: list[str] = ...,
        transforms: list[geometry_msgs.msg.Transform] = ...,
        twist: list[geometry_msgs.msg.Twist] = ...,
        wrench: list[geometry_msgs.msg.Wrench] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class MultiEchoLaserScan(Message):
    header: std_msgs.msg.Header
    angle_min: float
    angle_max: float
    angle_increment: float
    time_increment: float
    scan_time: float
    range_min: float
    range_max: float
    ranges: list[LaserEcho]
    intensities: list[LaserEcho]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        angle_min: float = ...,
        angle_max: float = ...,
        angle_increment: float = ...,
        time_increment: float = ...,
        scan_time: float = ...,
        range_min: float = ...,
        range_max: float = ...,
        ranges: list[LaserEcho] = ...,
        intensities: list[LaserEcho] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class NavSatFix(Message):
    header: std_msgs.msg.Header
    status: NavSatStatus
    latitude: float
    longitude: float
    altitude: float
    @property
    def position_covariance(self) -> NDArray[numpy.float64]: ...
    @position_covariance.setter
    def position_covariance(self, value: Iterable[float]) -> None: ...
    position_covariance_type: int
    COVARIANCE_TYPE_UNKNOWN: Final = 0
    COVARIANCE_TYPE_APPROXIMATED: Final = 1
    COVARIANCE_TYPE_DIAGONAL_KNOWN: Final = 2
    COVARIANCE_TYPE_KNOWN: Final = 3
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        status: NavSatStatus = ...,
        latitude: float = ...,
        longitude: float = ...,
        altitude: float = ...,
        position_covariance: Iterable[float] = ...,
        position_covariance_type: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class NavSatStatus(Message):
    status: int
    service: int
    STATUS__DEFAULT: Final = -2
    STATUS_UNKNOWN: Final = -2
    STATUS_NO_FIX: Final = -1
    STATUS_FIX: Final = 0
    STATUS_SBAS_FIX: Final = 1
    STATUS_GBAS_FIX: Final = 2
    SERVICE_UNKNOWN: Final = 0
    SERVICE_GPS: Final = 1
    SERVICE_GLONASS: Final = 2
    SERVICE_COMPASS: Final = 4
    SERVICE_GALILEO: Final = 8
    def __init__(
        self,
        *,
        status: int = ...,
        service: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PointCloud(Message):
    header: std_msgs.msg.Header
    points: list[geometry_msgs.msg.Point32]
    channels: list[ChannelFloat32]
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        points: list[geometry_msgs.msg.Point32] = ...,
        channels: list[ChannelFloat32] = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PointCloud2(Message):
    header: std_msgs.msg.Header
    height: int
    width: int
    fields: list[PointField]
    is_bigendian: bool
    point_step: int
    row_step: int
    @property
    def data(self) -> array[int]: ...
    @data.setter
    def data(self, value: Iterable[int]) -> None: ...
    is_dense: bool
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        height: int = ...,
        width: int = ...,
        fields: list[PointField] = ...,
        is_bigendian: bool = ...,
        point_step: int = ...,
        row_step: int = ...,
        data: Iterable[int] = ...,
        is_dense: bool = ...,
        check_fields: bool = ...,
    ) -> None: ...

class PointField(Message):
    name: str
    offset: int
    datatype: int
    count: int
    INT8: Final = 1
    UINT8: Final = 2
    INT16: Final = 3
    UINT16: Final = 4
    INT32: Final = 5
    UINT32: Final = 6
    FLOAT32: Final = 7
    FLOAT64: Final = 8
    def __init__(
        self,
        *,
        name: str = ...,
        offset: int = ...,
        datatype: int = ...,
        count: int = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Range(Message):
    header: std_msgs.msg.Header
    radiation_type: int
    field_of_view: float
    min_range: float
    max_range: float
    range: float
    variance: float
    ULTRASOUND: Final = 0
    INFRARED: Final = 1
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        radiation_type: int = ...,
        field_of_view: float = ...,
        min_range: float = ...,
        max_range: float = ...,
        range: float = ...,
        variance: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class RegionOfInterest(Message):
    x_offset: int
    y_offset: int
    height: int
    width: int
    do_rectify: bool
    def __init__(
        self,
        *,
        x_offset: int = ...,
        y_offset: int = ...,
        height: int = ...,
        width: int = ...,
        do_rectify: bool = ...,
        check_fields: bool = ...,
    ) -> None: ...

class RelativeHumidity(Message):
    header: std_msgs.msg.Header
    relative_humidity: float
    variance: float
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        relative_humidity: float = ...,
        variance: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class Temperature(Message):
    header: std_msgs.msg.Header
    temperature: float
    variance: float
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        temperature: float = ...,
        variance: float = ...,
        check_fields: bool = ...,
    ) -> None: ...

class TimeReference(Message):
    header: std_msgs.msg.Header
    time_ref: builtin_interfaces.msg.Time
    source: str
    def __init__(
        self,
        *,
        header: std_msgs.msg.Header = ...,
        time_ref: builtin_interfaces.msg.Time = ...,
        source: str = ...,
        check_fields: bool = ...,
    ) -> None: ...
