#!/usr/bin/env bash
# `make demo` and `make test` on a bare Debian 13, in a chroot that stays in build/debian13:
#   tools/debian13.sh                   as an ordinary user, who is first told what is missing
#   tools/debian13.sh root              as root, for whom it is installed
#   tools/debian13.sh USER COMMAND...   another command, in the copy of the checkout of `o80` or `root`
#   tools/debian13.sh wheels [SUITE]    installs build/wheels in another chroot (build/wheels_SUITE, by default
#                                       of trixie; bookworm is Debian 12), which has no compiler, and runs demos
set -euo pipefail
cd "$(dirname "$0")/.."
user=${1:-o80} suite=trixie root=$PWD/build/debian13 packages=ca-certificates,make,sudo
command=(bash -ec 'make demo; make test')
[ $# -le 1 ] || command=("${@:2}")
if [ "$user" = wheels ]; then
  user=o80 suite=${2:-trixie} packages=ca-certificates,python3-venv
  root=$PWD/build/wheels_$suite
  ls build/wheels/*.whl > /dev/null || { echo "run \`make wheel\` first" >&2; exit 1; }
  command=(bash -e try_wheels.sh)
fi
[ "$(id -u)" -eq 0 ] || { echo "a chroot needs root: run \`make debian13\` as root" >&2; exit 1; }

# in namespaces of its own: the kernel unmounts all and ends all processes, however this one ends
if [ -z "${O80_INSIDE-}" ]; then
  tools/setup.sh debian13
  O80_INSIDE=yes exec unshare --mount --pid --fork --kill-child "$0" "$@"
fi

say() { echo "== debian13: $*" >&2; }

home_of() { if [ "$1" = root ]; then echo /root; else echo "/home/$1"; fi; }

# in the copy of the checkout; nothing of this environment but what leads to the package registries
as_user() {
  local reach home
  home=$(home_of "$user")
  mapfile -t reach < <(env | grep -iE '^(pip_|(https?|no)_proxy=)')
  chroot --userspec="$user:$user" "$root" env -i HOME="$home" USER="$user" LANG=C.UTF-8 \
    PATH=/usr/local/sbin:/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin "${reach[@]}" \
    bash -c 'cd ~/o80 && exec "$@"' bash "$@"
}

if [ ! -e "$root/made" ]; then
  # the mirror from which this machine has its own packages
  mirror=$(apt-get indextargets --format '$(REPO_URI)' 'Created-By: Packages' 'Label: Debian' | head -n 1)
  say "making ${root#"$PWD"/}"
  rm -rf "$root"
  debootstrap --variant=minbase --include=$packages $suite "$root" \
    ${mirror:+"$mirror"} > build/debian13.log || { tail -n 20 build/debian13.log >&2; exit 1; }
  chroot "$root" useradd -m -s /bin/bash o80
  mkdir -p "$root/etc/sudoers.d"
  echo 'o80 ALL=(ALL) NOPASSWD: ALL' > "$root/etc/sudoers.d/o80"
  touch "$root/made"
fi

mount --rbind /dev "$root/dev"
mount --rbind /sys "$root/sys"
mount -t proc proc "$root/proc"
mount -t tmpfs -o size=4g,mode=1777 tmpfs "$root/dev/shm"
# the network and pip as on this machine
cp -L /etc/resolv.conf /etc/hosts "$root/etc"
cp -rL /usr/local/share/ca-certificates "$root/usr/local/share"
chroot "$root" update-ca-certificates > /dev/null 2>&1
for file in /etc/pip.conf /etc/xdg/pip/*; do
  [ ! -e "$file" ] || install -D -m 644 "$file" "$root$file"
done
home=$root$(home_of "$user")
owner=$(chroot "$root" id -u "$user")
for file in .pip/pip.conf .config/pip/pip.conf; do
  [ ! -e ~/"$file" ] || install -D -m 644 ~/"$file" "$home/$file"
done
chown -R "$owner:$owner" "$home"/.[!.]* # programs write their settings there, too

# the checkout, with what was built from it before
copy=$home/o80
mkdir -p "$copy"
find "$copy" -mindepth 1 -maxdepth 1 ! -name .venv ! -name build -exec rm -rf {} +
if [ "${1-}" = wheels ]; then
  cp -r build/wheels tools/try_wheels.sh "$copy"
  chown -R "$owner:$owner" "$copy"
  as_user "${command[@]}"
  exit
fi
tar -c --exclude=./.git --exclude=./.venv --exclude=./build --owner="+$owner" --group="+$owner" . |
  tar -x -C "$copy"
chown "$owner:$owner" "$copy"

if [ "$user" != root ] && [ ! -e "$root/usr/bin/g++" ]; then
  for target in demo test; do
    said=$(as_user make "$target" 2>&1) && failed=no || failed=yes
    say "make $target, before anything is installed: $said"
    [[ $failed = yes && $said = *"apt-get install"* ]] || { say "it does not name what is missing"; exit 1; }
  done
  as_user make setup
fi
as_user "${command[@]}"
