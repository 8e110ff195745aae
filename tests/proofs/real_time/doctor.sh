#!/bin/sh
# First process of the machine of doctor.py: injects faults one at a time, and prints for each what
# the doctor reads, now and after two seconds: lines "path:line". With the word o80.isolated=no the
# machine was booted without an isolated processor.
if [ "$1" = record ]; then
  cpu=/sys/devices/system/cpu
  counters="/proc/uptime /proc/stat /proc/interrupts /proc/[0-9]*/task/[0-9]*/stat"
  # one process for all: each takes long where the processor is emulated
  grep -sH "" /proc/version /proc/cmdline /proc/cpuinfo /proc/swaps /proc/irq/*/smp_affinity_list \
    /proc/sys/kernel/osrelease /proc/sys/kernel/sched_* /proc/self/limits /proc/self/status \
    /proc/self/uid_map /proc/self/cgroup /proc/self/mountinfo $cpu/online $cpu/isolated \
    $cpu/smt/active $cpu/cpu*/topology/thread_siblings_list \
    $cpu/cpu*/cpufreq/scaling_governor $cpu/cpu*/cpuidle/state*/name \
    $cpu/cpu*/cpuidle/state*/latency $cpu/cpu*/cpuidle/state*/disable \
    /sys/devices/system/clocksource/clocksource0/*_clocksource /sys/kernel/realtime \
    /sys/kernel/mm/transparent_hugepage/enabled /sys/class/dmi/id/sys_vendor \
    /sys/class/dmi/id/product_name /sys/hypervisor/type $counters
  sleep 2
  echo later
  grep -sH "" $counters
  exit
fi

/bin/busybox --install -s /bin
mount -t devtmpfs none /dev
mkdir -p /dev/shm
mount -t tmpfs none /dev/shm
mount -t tmpfs -o mode=1777 none /tmp
mount -t proc none /proc
mount -t sysfs none /sys
exec > /dev/ttyS0 2>&1 < /dev/null
export HOME=/ PATH=/bin TERM=dumb
kernel=/proc/sys/kernel
clock=/sys/devices/system/clocksource/clocksource0

record() { # name of what was done, as a user without rights and with the limits of this shell
  rm -f /tmp/recorded
  su nobody -c '/bin/sh /init record' > /tmp/recorded
  echo
  echo "rt: begin $1"
  cat /tmp/recorded
  echo "rt: end $1"
}
with_limits() { # of priorities, of locked memory [KiB], name
  (ulimit -r "$1" && ulimit -l "$2" && record "$3")
}
busy() { # on a processor
  taskset "$1" sh -c 'while :; do :; done' &
}

# the machine made ready; its processor 1 is isolated, and this shell on processor 0
echo -1 > $kernel/sched_rt_runtime_us
echo 0 > $kernel/sched_autogroup_enabled
ulimit -r 99
ulimit -l unlimited
echo "rt: clock $(cat $clock/current_clocksource) of $(cat $clock/available_clocksource)"

if grep -q o80.isolated=no /proc/cmdline; then
  record "not isolated"
  busy 1
  record "not isolated, a busy neighbour"
  kill $!
  poweroff -f
fi

for turn in 1 2 3 4 5 6 7 8 9 10; do
  record "clean $turn"
done

echo 950000 > $kernel/sched_rt_runtime_us
record throttling
echo -1 > $kernel/sched_rt_runtime_us

with_limits 0 unlimited "priority limit 0"
with_limits 99 64 "locked memory 64 kB"

# the cure that `o80 run` and the doctor name for both, typed for a shell of that user
rm -f /tmp/recorded
(ulimit -r 0 && ulimit -l 64 && exec su nobody -c 'echo $$ > /tmp/shell; until [ -e /tmp/cured ]; do sleep 0.1; done
  chrt -f 81 true && sh /init record > /tmp/recorded') &
until [ -s /tmp/shell ]; do sleep 0.1; done
prlimit --pid "$(cat /tmp/shell)" --rtprio=99
prlimit --pid "$(cat /tmp/shell)" --memlock=unlimited
touch /tmp/cured
wait $!
echo
echo "rt: begin limits cured"
cat /tmp/recorded
echo "rt: end limits cured"

busy 2
record "busy on the isolated processor"
kill $!

# no disk and no module here: a file in the place of the kernel's
printf 'Filename Type Size Used Priority\n/dev/sda2 partition 1048572 0 -2\n' > /tmp/swaps
mount --bind /tmp/swaps /proc/swaps
record swap
umount /proc/swaps

mount -o remount,size=64M /dev/shm
record "small shared memory"
mount -o remount,size=4M /dev/shm
record "tiny shared memory"
mount -o remount,size=50% /dev/shm

echo 1 > $kernel/sched_autogroup_enabled
record autogroup
echo 0 > $kernel/sched_autogroup_enabled

before=$(cat $clock/current_clocksource)
echo acpi_pm > $clock/current_clocksource
record "wrong clock source"
echo "$before" > $clock/current_clocksource

# the serial port interrupts the isolated processor, 300 times a second: more, and the kernel gives up
# the emulated port
number=$(awk '/ttyS0/ { sub(":", "", $1); print $1 }' /proc/interrupts)
echo 1 > "/proc/irq/$number/smp_affinity_list"
while usleep 3000; do echo 0123456789abcde; done > /dev/ttyS0 &
record "interrupt storm"
kill $!
echo 0 > "/proc/irq/$number/smp_affinity_list"

record "clean again"
echo "rt: over"
poweroff -f
