"""The environment variables by which the processes of an arm know it; no import, so everybody may read it."""

SYSTEM = "REACTIVE_ARM_SYSTEM"
"""The directory of the arm's runtime files: it marks the processes of the arm."""
HOST = "REACTIVE_ARM_HOST"
"""The host whose programs run here; '' where one host runs all."""
NAMESPACE = "REACTIVE_ARM_NAMESPACE"
"""The ROS namespace of the arm."""
