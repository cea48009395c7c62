#!/usr/bin/env bash
# Put ROS, the workspace and the project's environment in front of a command.
set -e

if [ -f "/opt/ros/${ROS_DISTRO:-jazzy}/setup.bash" ]; then
    # shellcheck disable=SC1090,SC1091
    . "/opt/ros/${ROS_DISTRO:-jazzy}/setup.bash"
else
    export AMENT_PREFIX_PATH=/opt/winding
    export CMAKE_PREFIX_PATH=/opt/winding
fi
if [ -f /opt/winding_ws/setup.bash ]; then
    # shellcheck disable=SC1091
    . /opt/winding_ws/setup.bash
    PATH="/opt/winding_ws/lib/winding_cli:${PATH}"
fi
export PATH="/opt/winding/bin:${PATH}"

exec "$@"
