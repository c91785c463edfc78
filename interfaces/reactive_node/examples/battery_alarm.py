"""Publishes whether the battery is low, once it has been so for two seconds."""

import rclpy
from rclpy.executors import ExternalShutdownException
from reactivex import Observable
from std_msgs.msg import Bool, Float64

from reactive_node import ReactiveNode


def battery_low(
    voltages: Observable[float], *, limit: float = 11.0, patience: float = 2.0
) -> Observable[bool]:
    """Emit whether the voltage is below the limit [V], when it has been so for `patience` [s]."""
    return (
        voltages.map(lambda volts: volts < limit)
        .distinct_until_changed()
        .debounce(patience)
        .distinct_until_changed()
    )


def wire(node: ReactiveNode) -> None:
    """Connect the recipe with its topics."""
    voltages = node.create_observable(Float64, "voltage").map(lambda message: message.data)
    alarms = battery_low(voltages).map(lambda low: Bool(data=low))
    node.publish_observable(alarms, Bool, "battery_low")


def main() -> None:
    """Run until Ctrl-C or SIGTERM."""
    rclpy.init()
    node = ReactiveNode("battery_alarm")
    try:
        wire(node)
        rclpy.spin(node)
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except RuntimeError:
        if rclpy.ok():  # otherwise a signal came just before rclpy began to wait
            raise
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


if __name__ == "__main__":
    main()
