#!/bin/sh
# First process of the machine. Lines that begin with "rt:" are read by tools/rt.py; options come
# as words of the kernel's command line: o80.frequency=, o80.iterations=, o80.left_out=
/bin/busybox --install -s /bin
mount -t devtmpfs none /dev
mkdir -p /dev/shm
mount -t tmpfs none /dev/shm
mount -t tmpfs none /tmp
mount -t proc none /proc
mount -t sysfs none /sys
exec > /dev/ttyS0 2>&1 < /dev/null
export HOME=/ PATH=/bin TERM=dumb
for word in $(cat /proc/cmdline); do
  case $word in
    o80.*) export "${word#o80.}" ;;
  esac
done

echo # behind what the firmware left on the line
echo "rt: kernel $(uname -r) $(uname -v)"
echo "rt: realtime $(cat /sys/kernel/realtime 2> /dev/null)"

# the kernel's first random numbers come of timers that no real-time thread may wait for: it spins
# for them, and their softirq, an ordinary thread on this kernel, never runs
head -c 1 /dev/random > /dev/null

# at SCHED_FIFO; those in turns (SCHED_RR) of which some spin with more threads than there are
# processors: at SCHED_FIFO the thread they wait for would never run
echo 4 > /proc/sys/kernel/sched_rr_timeslice_ms
cd /o80 || exit 1
for test in o80_test_*; do
  case $test in
    *_memory | *_runtime | *_robot) class=-r ;;
    *) class=-f ;;
  esac
  { chrt $class 10 ./"$test" "--gtest_filter=-$left_out" 2>&1; echo $? > /tmp/code; } | tee /tmp/test
  echo "rt: test $test $(cat /tmp/code) $(grep -e '  PASSED  ' /tmp/test)"
done

# the loop, a frontend that commands it, and cyclictest at the same priority on its processor
./o80-rt-loop --iterations "$iterations" --frequency "$frequency" --policy fifo --priority 80 \
  --cpus 1 --lock-memory > /tmp/loop 2> /tmp/complaints &
loop=$!
./o80-rt-frontend > /tmp/frontend 2>&1 &
frontend=$!
until grep -q 'runs on segment' /tmp/loop || ! kill -0 $loop; do sleep 0.05; done
echo "rt: policy $(awk '$1 == "policy" { print $3 }' /proc/$loop/sched)"
echo "rt: prio $(awk '$1 == "prio" { print $3 }' /proc/$loop/sched)"
echo "rt: locked $(awk '$1 == "VmLck:" { print $2 }' /proc/$loop/status)"
echo "rt: processors $(awk '$1 == "Cpus_allowed_list:" { print $2 }' /proc/$loop/status)"
cyclictest -m -q -t 1 -a 1 -p 80 -i $((1000000 / frequency)) -d 0 -l $((iterations * 8 / 10)) \
  -h 20000 --json=/tmp/cyclictest > /tmp/said 2>&1 || cat /tmp/said
wait $loop
echo "rt: ended loop $?"
wait $frontend
echo "rt: ended frontend $?"
sed 's/^/rt: /' /tmp/loop /tmp/frontend
sed 's/^/rt: refused /' /tmp/complaints
echo "rt: cyclictest $(tr -d '\n' < /tmp/cyclictest)"
echo "rt: over"
poweroff -f
