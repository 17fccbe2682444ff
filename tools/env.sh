# Copyright 2026 The nfo_sinus_driver authors
# SPDX-License-Identifier: Apache-2.0

# Source this in bash (`. tools/env.sh`) to have the environment that tools/setup made: rclpy,
# nfo_sinus_msgs, and the commands of the driver. tools/run does it for a single command.

nfo_sinus_root=$(cd -P "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)

if [ ! -e "$nfo_sinus_root/install/setup.bash" ]; then
  echo 'tools/env.sh: nothing is set up yet: make setup' >&2
  unset nfo_sinus_root
  return 1
fi
if [ -d "$nfo_sinus_root/.venv/share/ament_index" ]; then
  # ROS from wheels: nothing of another ROS may shine through.
  unset PYTHONPATH COLCON_PREFIX_PATH
  export AMENT_PREFIX_PATH=$nfo_sinus_root/.venv
  export CMAKE_PREFIX_PATH=$nfo_sinus_root/.venv
elif [ "${ROS_DISTRO-}" != jazzy ]; then
  echo 'tools/env.sh: .venv was made for a sourced Jazzy: source /opt/ros/jazzy/setup.bash' >&2
  unset nfo_sinus_root
  return 1
fi
export PATH=$nfo_sinus_root/install/nfo_sinus_driver/lib/nfo_sinus_driver:$PATH
export PATH=$nfo_sinus_root/.venv/bin:$PATH
# Nothing outside the clone is changed, so the logs of nodes stay in it too, and so does the list
# of fonts that matplotlib keeps.
export ROS_LOG_DIR=${ROS_LOG_DIR:-$nfo_sinus_root/.venv/log/ros}
export MPLCONFIGDIR=${MPLCONFIGDIR:-$nfo_sinus_root/.venv/matplotlib}

. "$nfo_sinus_root/install/setup.bash"
unset nfo_sinus_root
