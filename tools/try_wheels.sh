#!/usr/bin/env bash
# In a folder with wheels/, on a computer without a compiler: installs them for its python3, with
# what they need from PyPI, and runs what a newcomer runs. Prints the seconds since the beginning.
set -euo pipefail

say() { echo "== $SECONDS s: $*" >&2; }

! command -v c++ g++ cc gcc || { echo "there is a compiler" >&2; exit 1; }
rm -rf venv chosen
python3 -m venv venv
pip() { venv/bin/python -m pip -qq --disable-pip-version-check "$@"; }
# those for this Python, of our folder and no other
names=(o80 o80-mujoco o80-pam o80-arms o80-devices o80-ros2 o80-table-tennis)
pip download --no-index --no-deps --find-links=wheels --dest=chosen "${names[@]}"
say "$(venv/bin/python -V), $(ldd --version | head -n 1)"
pip install --only-binary=:all: chosen/o80-[0-9]*.whl
say "installed o80"
venv/bin/o80 demo
say "played \`o80 demo\`"

# the other packages, except lerobot_robot_o80, which brings LeRobot and torch
pip install --only-binary=:all: chosen/*.whl
pip check
say "installed all packages: $(du -sm venv | cut -f 1) MB"
for robot in two_joints mujoco pam so101 koch; do venv/bin/o80 run "$robot" --help > /dev/null; done
venv/bin/python -c 'import o80_devices, o80_ros2'
venv/bin/o80 demo table_tennis --episodes 2 --real-time-episodes 1
say "played \`o80 demo table_tennis\`"
