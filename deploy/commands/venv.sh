#!/bin/sh
# Runs Python of .venv with the libraries of the rclpy that it uses. Without this, the wheels of ROS 2 start each
# interpreter twice: once to find out where their libraries are.
set -eu
CDPATH="" cd -- "$(dirname -- "$0")/../.."
. deploy/commands/entry.sh
if [ -e .venv/lib/librcl.so ]; then
    libraries=$PWD/.venv/lib
    for directory in "$PWD"/.venv/lib/python3.*/site-packages/ros_*.libs; do
        libraries=$libraries:$directory
    done
    case ${LD_LIBRARY_PATH-} in
    "$libraries"*) ;; # a command of make runs make
    *) export LD_LIBRARY_PATH="$libraries${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" ;;
    esac
fi
export _ROS_WHEELS_BOOTSTRAP_COMPLETE=1
exec .venv/bin/python "$@"
