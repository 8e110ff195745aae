#!/usr/bin/env bash
# Sets up what a make target needs: tools/setup.sh PURPOSE, of
#   setup         Debian's packages for demo and test, and nothing else
#   environment   an empty .venv, and Debian's packages for test
#   tools         what testing needs but the packages of this repository, which C++ tests do not use
#   test, check   what testing and checking needs
#   demo, learn, bench, wheels, site, systemd, debian13
# Nothing is done twice; stamps of what was done lie in .venv/stamps. Each message begins with the
# seconds since the start, or since O80_SINCE (seconds of the epoch) if that is set.
set -euo pipefail
cd "$(dirname "$0")/.."
PATH=$PATH:/usr/sbin:/sbin # ldconfig, for users whose path lacks them
purpose=${1:?setup, environment, demo, learn, tools, test, check, wheels, site, bench, systemd or debian13}
since=${O80_SINCE:-$(date +%s)}

say() { printf '== %3d s: %s\n' $(($(date +%s) - since)) "$*" >&2; }

# the Python to use: the first on the PATH that is recent enough, else the Debian package that brings it
find_python() {
  for python in python3 python3.{11..14}; do
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2> /dev/null && return
  done
  python=python3
  command -v python3 > /dev/null || return 0
  for python in python3.{13..11}; do
    apt-cache show "$python" > /dev/null 2>&1 && return
  done
  say "Python 3.11 or later is needed, $(python3 -V 2>&1) is too old: use Debian 12 or later"
  return 1
}

has_environment() { .venv/bin/python -c 'import pip' 2> /dev/null; }
has_headers() {
  "$1" -c 'import os, sysconfig; os.stat(sysconfig.get_path("include") + "/Python.h")' 2> /dev/null
}
is_installed() {
  [ "$(dpkg-query -W -f '${Status}' "$1" 2> /dev/null)" = "install ok installed" ]
}

# Debian packages that are missing: the named ones, and those that every purpose needs. A compiler
# or a Python from elsewhere will do, so these are checked themselves.
find_missing() {
  local package interpreter
  missing=()
  find_python || return 1
  interpreter=$python
  command -v ${CXX:-c++} > /dev/null || missing+=(g++)
  command -v "$python" > /dev/null || missing+=("$python")
  if has_environment; then
    interpreter=.venv/bin/python
  else
    "$python" -c 'import ensurepip' 2> /dev/null || missing+=("$python-venv")
  fi
  has_headers "$interpreter" || missing+=("$python-dev")
  for package in "${missing[@]}"; do
    if [ "$package" != g++ ] && is_installed "$package"; then
      say "$("$interpreter" -c 'import sys; print(sys.base_prefix)')/bin/$python does not use Debian's" \
        "$package: install its own headers and venv, or put /usr/bin before it in the PATH"
      return 1
    fi
  done
  for package in "$@"; do
    is_installed "$package" || [[ " ${missing[*]} " = *" $package "* ]] || missing+=("$package")
  done
}

install_missing() {
  # another process may be installing: wait for it
  local apt=("$@" env DEBIAN_FRONTEND=noninteractive apt-get -qq -o DPkg::Lock::Timeout=600)
  local install=(install -y --no-install-recommends "${missing[@]}")
  "${apt[@]}" "${install[@]}" 2> /dev/null || { "${apt[@]}" update && "${apt[@]}" "${install[@]}"; }
}

# Debian packages that are missing: installed as root and by `make setup`, named otherwise
need_packages() {
  local as_root
  find_missing "$@" || return 1
  [ ${#missing[@]} -eq 0 ] && return
  case $(id -u)-$purpose in
    0-*) as_root=env ;;
    *-setup) as_root=$(command -v sudo) || as_root= ;;
    *) as_root= ;;
  esac
  if [ -z "$as_root" ] || ! command -v apt-get > /dev/null; then
    [ "$purpose" = setup ] || local setup="run \`make setup\`, or "
    say "Debian packages are missing: ${setup-}as root: apt-get install ${missing[*]}"
    return 1
  fi
  say "installing ${missing[*]}"
  if [ "$purpose" = setup ]; then # leaves no file: build may be made by root otherwise
    install_missing "$as_root" || return 1
  else
    mkdir -p build
    install_missing "$as_root" > build/apt.log 2>&1 || { tail -n 20 build/apt.log >&2; return 1; }
  fi
  find_missing
}

# runs the command only if what it depends on has changed since it last succeeded
once() {
  local stamp=.venv/stamps/$1 state=$2
  shift 2
  [ "$(cat "$stamp" 2> /dev/null)" = "$state" ] && return
  "$@"
  mkdir -p .venv/stamps
  echo "$state" > "$stamp"
}

state_of() { find "$@" -type f ! -name '*.pyc' -print0 | sort -z | xargs -0 sha256sum | sha256sum; }
package_state() { state_of $(find "$1" -mindepth 1 -maxdepth 1 ! -name tests); }

pip() { .venv/bin/python -m pip -qq --disable-pip-version-check "$@"; }

make_environment() {
  say "making .venv"
  "$python" -m venv --clear .venv
}

# what building needs is small: packages are compiled while the rest is installed
install_build_tools() {
  say "installing what building needs"
  pip install 'pip>=25.1'
  .venv/bin/python tools/build_requirements.py build > build/build_requirements.txt
  pip install -r build/build_requirements.txt --group build
}

install_tools() {
  say "installing what running ${1:+and testing }needs"
  .venv/bin/python tools/build_requirements.py run record $extras > build/requirements.txt
  # conflicts: with packages that are being installed meanwhile
  pip install --no-warn-conflicts -r build/requirements.txt --group build ${1:+--group "$1"}
  say "installed what running ${1:+and testing }needs"
}

# LeRobot with what it requires: an environment of its own that also sees .venv
install_lerobot() {
  say "installing LeRobot and what it needs"
  local packages
  .venv/bin/python -m venv --without-pip --clear build/lerobot
  packages=$(echo build/lerobot/lib/python3.*/site-packages)
  echo "$PWD/.venv/${packages#build/lerobot/}" > "$packages/zz_o80.pth" # behind its own packages
  pip --python build/lerobot/bin/python install --no-deps -r tools/lerobot.txt
  mkdir "$packages/torchvision"
  cp tools/torchvision.py "$packages/torchvision/__init__.py"
  say "installed LeRobot"
}

# rclpy of two versions of ROS 2, the judges of the gateway, each in an environment of its own
install_ros() {
  local name
  for name in jazzy kilted; do
    say "installing rclpy of ROS 2 $name"
    "$python" -m venv --clear "build/ros/$name"
    "build/ros/$name/bin/python" -m pip -qq --disable-pip-version-check install \
      -r <(.venv/bin/python tools/build_requirements.py run "$name" | grep '^ros-')
  done
}

# install_package NAME FOLDER [DEFINITION...]: one of the packages, whose requirements are there
install_package() {
  local name=$1 folder=$2
  shift 2
  say "building $name"
  pip install --no-build-isolation --no-deps "-Cbuild-dir=$PWD/build/pip/$name" \
    "${@/#/-Ccmake.define.}" "$folder"
  say "installed $name"
}

install_core() {
  once o80 "$(state_of pyproject.toml CMakeLists.txt README.md LICENSE cmake include src python \
    robots/two_joints)" install_package o80 .
}

# they are compiled against the headers of the checkout, and wait for nothing; those with bindings come
# last: ccache then has those of the core
install_others() {
  local headers checkout=o80_DIR=$PWD/cmake/checkout
  headers=$(state_of include cmake/o80_add_robot.cmake cmake/checkout)
  once table_tennis "$(package_state apps/table_tennis)" \
    install_package o80-table-tennis ./apps/table_tennis
  once pam "$headers $(package_state robots/pam)" install_package o80-pam ./robots/pam "$checkout"
  once mujoco "$headers $(package_state simulators/mujoco)" \
    install_package o80-mujoco ./simulators/mujoco "$checkout"
  case $purpose in
    demo | learn) ;;
    *)
      once devices "$(package_state devices)" install_package o80-devices ./devices
      once ros2 "$(package_state gateways/ros2)" install_package o80-ros2 ./gateways/ros2
      once arms "$headers $(package_state robots/arms)" \
        install_package o80-arms ./robots/arms "$checkout"
      once lerobot_robot "$(package_state gateways/lerobot)" \
        install_package lerobot_robot_o80 ./gateways/lerobot
      ;;
  esac
}

# says from time to time how far the compilers are
watch_compilers() {
  local all made never
  exec {never}<> <(:) # nothing is ever read from it: a way to sleep without a process
  while ! read -rt 15 -u "$never"; do
    all=$(cat build/pip/*/build.ninja 2> /dev/null | grep -c '^build [^ ]*\.o:') || continue
    made=$(find build/pip -path '*.dir/*.o' ! -path '*LTOTest*' -newer build/setup.lock | wc -l)
    [ "$made" -eq 0 ] || say "compiled $made of $all files"
  done
}

# all at the same time: each of them leaves a processor idle for a while
install_everything() {
  touch build/setup.lock
  watch_compilers &
  local watch=$! job jobs=() failed=0
  for job in install_core install_others install_rest install_programs; do
    $job &
    jobs+=($!)
  done
  for job in "${jobs[@]}"; do
    wait "$job" || failed=1
  done
  kill "$watch"
  return $failed
}

# pictures without a screen, where EGL cannot make them; refused, only the film is missing
has_renderer() { ldconfig -p | grep -q libEGL_mesa || is_installed libosmesa6; }
need_renderer() { has_renderer || need_packages libosmesa6 || say "continuing without pictures"; }

# before anything else, so that a user knows at once what is missing
case $purpose in
  demo | learn | wheels | site) need_packages ;;
  setup | environment | tools | test | check)
    packages=(g++ ccache libgtest-dev libgmock-dev libaravis-0.8-0 aravis-tools)
    [ "$purpose" != setup ] || has_renderer || packages+=(libosmesa6)
    need_packages "${packages[@]}"
    ;;
  bench) need_packages g++ rt-tests ;;
  systemd) need_packages systemd ;; # beside what `check` brings
  debian13) need_packages debootstrap ;;
  *) say "unknown purpose '$purpose'"; exit 2 ;;
esac
case $purpose in setup | systemd | debian13) exit ;; esac

mkdir -p build
exec 9> build/setup.lock
flock 9

install_programs() {
  case $purpose in
    demo) need_renderer ;;
    check) # compilers of the sanitizers and of another machine, model checkers, emulators, browser
      need_packages googletest clang-19 libclang-rt-19-dev llvm-19 g++-aarch64-linux-gnu \
        qemu-user-static relacy-dev spin strace rt-tests qemu-system-x86 busybox-static \
        cpio chromium
      need_renderer
      [ -e build/lerobot ] || rm -f .venv/stamps/lerobot # after make clean
      once lerobot "$(state_of tools/lerobot.txt tools/torchvision.py)" install_lerobot
      [ -e build/ros ] || rm -f .venv/stamps/ros
      # there are wheels for this processor only
      [ "$(uname -m)" != x86_64 ] || once ros "$(state_of gateways/ros2/pyproject.toml)" install_ros
      ;;
  esac
}

has_environment || make_environment
[ "$purpose" = environment ] && exit
case $purpose in
  tools | test) group=test ;;
  check | wheels | site) group=$purpose ;;
  bench) group=peers ;;
  *) group= ;;
esac
# extras for the purposes that use or test them
case $purpose in
  demo) extras=rendering ;;
  wheels | site) extras= ;;
  bench) extras="rendering zeromq cameras" ;;
  test | tools) extras="zeromq motioncapture" ;;
  check) extras="rendering learn zeromq cameras motioncapture" ;;
  *) extras="rendering learn" ;;
esac
requirements=$(state_of pyproject.toml ./*/pyproject.toml ./*/*/pyproject.toml)
# reuse objects that were compiled before or for another package
if command -v ccache > /dev/null; then
  export CMAKE_CXX_COMPILER_LAUNCHER=ccache
  export CCACHE_DIR=${CCACHE_DIR:-$PWD/build/ccache}
  export CCACHE_NOHASHDIR=${CCACHE_NOHASHDIR:-1} CCACHE_BASEDIR=${CCACHE_BASEDIR:-$PWD}
fi
install_rest() { once "tools-${group:-build$extras}" "$requirements" install_tools "$group"; }
once build-tools "$requirements" install_build_tools
if [ "$purpose" = tools ]; then install_rest; else install_everything; fi
