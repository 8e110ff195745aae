#!/bin/sh
# Runs in the machine, as a service. Lines that begin with "service:" are read by run.py beside this file.
/bin/busybox --install -s /bin 2> /dev/null
export PATH=/bin:/opt/o80/bin LD_LIBRARY_PATH=/opt/o80/lib HOME=/ TERM=dumb SYSTEMD_COLORS=0
robot=o80@udp_arm.service
say() { echo "service: $*"; }
of() { systemctl show -P "$1" "${2:-$robot}"; }
operator() { su ada -c "o80_operator udp_arm $*" 2>&1; } # of group robot

# waits until a property of the robot's service has a value
until_is() {
  for _ in $(seq 300); do
    [ "$(of "$1")" = "$2" ] && return
    sleep 0.2
  done
  say "wrong $1 is $(of "$1"), expected $2"
}

# again until the arm answers in time: this machine is slow
resume() {
  for _ in $(seq 100); do
    operator resume 1 > /tmp/resumed && return
    sleep 0.2
  done
  say "wrong $(cat /tmp/resumed)"
}

# waits for the next process of the service, which runs
until_restarted() {
  until_is NRestarts "$1"
  until_is ActiveState active
}

say "kernel $(uname -r)"
say "systemd $(systemctl --version | head -n 1)"
say "verify $(systemd-analyze verify --man=no /etc/systemd/system/o80@udp_arm.service 2>&1 | tr '\n' ' ')"
mkdir -p /var/crash
chmod 1777 /var/crash
echo '/var/crash/core.%e' > /proc/sys/kernel/core_pattern

# start: returns when the robot is ready
systemctl start fake-arm.service
echo 'OPTIONS=--frequency 100 --tolerated 1000000 --give-up 3' > /etc/o80/udp_arm.conf
systemctl start $robot && say "started $(of ActiveState): $(of StatusText)"
pid=$(of MainPID)
say "user $(stat -c %U /proc/$pid)"
say "policy $(chrt -p $pid | tr '\n' ' ')"
say "locked $(awk '$1 == "VmLck:" { print $2 }' /proc/$pid/status)"
say "state $(operator state)"

# killed while it moves: restarted, halted, moves after a resume only
say "moves $(operator move 50)"
kill -9 "$pid"
until_restarted 1
say "after-kill $(operator state)"
say "after-kill-moves $(operator move 50)"
resume
say "after-resume $(operator state)"
say "after-resume-moves $(operator move 50)"

# crashed while it moves: the same, and a dump
kill -SEGV "$(of MainPID)"
until_restarted 2
say "after-crash $(operator state)"
say "dump $(ls -s /var/crash | grep core)"
resume

# halted by an operator, then killed
operator halt
for _ in $(seq 100); do
  case $(of StatusText) in halted*) break ;; *) sleep 0.2 ;; esac
done
say "status-of-halt $(of StatusText)"
kill -9 "$(of MainPID)"
until_restarted 3
say "after-kill-halted $(operator state)"
resume

# stopped while it moves: brakes, then ends
# six of its twenty seconds: fast enough that braking takes several rows
say "before-stop $(operator move 600)"
operator watch > /tmp/watched &
watcher=$!
systemctl stop $robot
wait $watcher
say "watched $(cat /tmp/watched)"
say "stopped $(of ActiveState) $(of Result) $(of ExecMainStatus)"

# started by hand after a stop in order: no halt
systemctl reset-failed $robot 2> /dev/null
systemctl start $robot
say "after-stop $(operator state)"

# the arm is gone for a while: a fault, and a successor without a halt
say "before-fault $(operator move 50)"
systemctl stop fake-arm.service
until_is NRestarts 1
systemctl start fake-arm.service
until_is ActiveState active
say "after-fault $(operator state)"
systemctl reset-failed $robot 2> /dev/null

# the arm is gone for good: a fault, and in the end a service that has failed
systemctl stop fake-arm.service
until_is ActiveState failed
say "gone $(of ActiveState) $(of Result) after $(of NRestarts) restarts"
journalctl -u $robot -o cat --no-pager > /tmp/journal
sed 's/^/journal: /' /tmp/journal
say "journal-fault $(grep -c 'o80: .*--give-up' /tmp/journal)"
say "journal-halt $(grep -c 'o80: halted in iteration' /tmp/journal)"
say "journal-start $(grep -c 'is the arm switched on' /tmp/journal)"

# wrong flags are not tried again
systemctl reset-failed $robot 2> /dev/null
echo 'OPTIONS=--frequency -3' > /etc/o80/udp_arm.conf
systemctl start $robot 2> /dev/null
sleep 3
say "wrong-flags $(of ActiveState) $(of ExecMainStatus) restarts $(of NRestarts)"
say over
poweroff -f
