"""The command line `ros2` for machines without ROS 2, with the options and output of Jazzy's ros2cli."""
