#!/usr/bin/env bash
# Sets up what a make target needs: tools/setup.sh demo|learn|tools|test|check|wheels|bench|systemd
# `tools` is `test` without the packages of this repository: C++ tests do not use them installed.
# Nothing is done twice; stamps of what was done lie in .venv/stamps.
set -euo pipefail
cd "$(dirname "$0")/.."
PATH=$PATH:/usr/sbin:/sbin # ldconfig, for users whose path lacks them
purpose=${1:?demo, learn, tools, test, check, wheels, bench or systemd}

mkdir -p build
exec 9> build/setup.lock
flock 9

say() { printf '== %s\n' "$*" >&2; }

# Debian packages that are missing: asked for as root, named otherwise
need_packages() {
  local missing=()
  for package in "$@"; do
    [ "$(dpkg-query -W -f '${Status}' "$package" 2> /dev/null)" = "install ok installed" ] ||
      missing+=("$package")
  done
  [ ${#missing[@]} -eq 0 ] && return
  if ! command -v apt-get > /dev/null || [ "$(id -u)" -ne 0 ]; then
    say "missing, please install: apt-get install ${missing[*]}"
    return 1
  fi
  say "installing ${missing[*]}"
  export DEBIAN_FRONTEND=noninteractive
  # another process may be installing: wait for it
  local apt=(apt-get -qq -o DPkg::Lock::Timeout=600) words=(-y --no-install-recommends)
  "${apt[@]}" install "${words[@]}" "${missing[@]}" > build/apt.log 2>&1 ||
    { "${apt[@]}" update && "${apt[@]}" install "${words[@]}" "${missing[@]}"; } \
      > build/apt.log 2>&1 || { tail -n 20 build/apt.log >&2; return 1; }
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
  local python
  for python in python3 python3.11 python3.12 python3.13; do
    "$python" -c 'import sys; sys.exit(sys.version_info < (3, 11))' 2> /dev/null && break
    python=
  done
  [ -n "$python" ] || { say "Python 3.11 or later is needed"; return 1; }
  "$python" -c 'import ensurepip' 2> /dev/null || need_packages python3-venv python3-dev
  say "making .venv"
  "$python" -m venv --clear .venv
}

install_tools() {
  say "installing what building, running ${1:+and testing }needs"
  pip install 'pip>=25.1'
  .venv/bin/python tools/build_requirements.py build > build/requirements.txt
  .venv/bin/python tools/build_requirements.py run rendering record $extras >> build/requirements.txt
  pip install -r build/requirements.txt --group build ${1:+--group "$1"}
}

# install_package NAME FOLDER: one of the five packages, whose requirements are there
install_package() {
  say "building and installing $1"
  pip install --no-build-isolation --no-deps "-Cbuild-dir=$PWD/build/pip/$1" "$2"
}

install_packages() {
  once o80 "$(state_of pyproject.toml CMakeLists.txt README.md LICENSE cmake include src python \
    robots/two_joints)" install_package o80 .
  # what the others are compiled against
  local headers
  headers=$(state_of include cmake/o80_add_robot.cmake cmake/o80Config.cmake.in)
  once pam "$headers $(package_state robots/pam)" install_package o80-pam ./robots/pam
  once mujoco "$headers $(package_state simulators/mujoco)" install_package o80-mujoco ./simulators/mujoco
  once devices "$(package_state devices)" install_package o80-devices ./devices
  once table_tennis "$(package_state apps/table_tennis)" \
    install_package o80-table-tennis ./apps/table_tennis
}

case $purpose in
  demo | learn) ;;
  tools | test) need_packages g++ ccache libgtest-dev libgmock-dev libaravis-0.8-0 aravis-tools ;;
  check) # compilers of the sanitizers and of another machine, model checkers, emulators, stress, browser
    need_packages g++ ccache libgtest-dev libgmock-dev libaravis-0.8-0 aravis-tools googletest \
      clang-19 libclang-rt-19-dev \
      llvm-19 g++-aarch64-linux-gnu qemu-user-static relacy-dev spin strace stress-ng rt-tests \
      qemu-system-x86 busybox-static cpio chromium
    ;;
  wheels) need_packages g++ ;;
  bench) need_packages g++ rt-tests stress-ng libaravis-0.8-0 aravis-tools ;;
  systemd) # what `make systemd` needs beside what `check` brings
    need_packages systemd
    exit
    ;;
  *) say "unknown purpose '$purpose'"; exit 2 ;;
esac
# pictures without a screen, where EGL cannot make them; refused, only the film is missing
case $purpose in
  demo | check) ldconfig -p | grep -q libEGL_mesa || need_packages libosmesa6 || true ;;
esac

.venv/bin/python -c '' 2> /dev/null || make_environment
case $purpose in
  tools | test) group=test ;;
  check | wheels) group=$purpose ;;
  *) group= ;;
esac
# torch and the rest that learning needs, clients of devices: for those that use or test them
case $purpose in
  demo) extras= ;;
  bench) extras="zeromq cameras" ;;
  test | tools | check) extras="learn zeromq cameras motioncapture" ;;
  *) extras=learn ;;
esac
once "tools-${group:-build$extras}" "$(state_of pyproject.toml ./*/pyproject.toml ./*/*/pyproject.toml)" install_tools "$group"
[ "$purpose" = tools ] || install_packages
