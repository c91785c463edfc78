"""Starts the arm as `make run` does: `ros2 launch reactive_arm arm.launch.py`. Ctrl-C stops everything."""

from ament_index_python import get_package_prefix
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.substitutions import LaunchConfiguration

ARGUMENTS = {
    "scenario": ("demo", "demo, listing_5_9, none or a file"),
    "namespace": ("/", "ROS namespace of the arm, such as /arm1"),
    "parameters": ("", "ROS parameter file"),
    "manifest": ("", "file with programs of your own"),
    "web": ("", "port of the operator's page, or off"),
}


def generate_launch_description() -> LaunchDescription:
    """One process starts the supervisord of the arm, and shows what the arm does."""
    given = {name: LaunchConfiguration(name) for name in ARGUMENTS}
    arm = ExecuteProcess(
        cmd=[
            f"{get_package_prefix('reactive_arm')}/lib/reactive_arm/arm",
            "run",
            given["scenario"],
            given["parameters"],
        ],
        additional_env={
            "REACTIVE_ARM_NAMESPACE": given["namespace"],
            "MANIFEST": given["manifest"],
            "WEB": given["web"],
        },
        output="screen",
        name="arm",
    )
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=meaning)
        for name, (default, meaning) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, arm])
