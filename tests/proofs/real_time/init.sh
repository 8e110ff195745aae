#!/bin/sh
# First process of the machine. Lines that begin with "rt:" are read by run.py beside this file; options come
# as words of the kernel's command line: o80.frequency=, o80.iterations=, o80.tests= (a filter of
# GoogleTest), o80.limit= (of one suite [s])
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

# those of the list that belong to a suite, as a filter
tests_of() {
  awk -v suite="$1" '
    /^[^ ]/ { here = $1 == suite }
    here && /^  / { printf ":%s%s", suite, $1 }' /tmp/tests
}

# how many tests of the last run ended so
count() {
  sed -n "s/^\[  $1 *\] \([0-9]*\) tests\{0,1\}[.,].*/\1/p" /tmp/said | grep . || echo 0
}

uptime_s() { read -r up _ < /proc/uptime && echo "$up"; }

# Each suite is a process of its own at SCHED_FIFO, or in turns (SCHED_RR) in those programs of which
# some spin with more threads than there are processors: at SCHED_FIFO the thread they wait for
# would never run. This script goes before them, and ends one that hangs. Ordinary threads get no
# share of a second of their own: what may not wait must not be one.
chrt -f -p 95 $$
echo -1 > /proc/sys/kernel/sched_rt_runtime_us
echo 4 > /proc/sys/kernel/sched_rr_timeslice_ms
cd /o80 || exit 1
for program in o80_test_*; do
  case $program in
    *_memory | *_runtime | *_robot) class=-r ;;
    *) class=-f ;;
  esac
  passed=0
  skipped=0
  ./"$program" --gtest_list_tests "--gtest_filter=$tests" > /tmp/tests
  awk '/^[^ ]+\./ { print $1 }' /tmp/tests > /tmp/suites
  while read -r suite; do
    begin=$(uptime_s)
    timeout -s KILL "$limit" chrt $class 10 ./"$program" "--gtest_filter=$(tests_of "$suite")" \
      > /tmp/said 2>&1
    code=$?
    sed -n "s/^\[ *OK \] \([^ ]*\) .*/rt: ok ${program#o80_test_}.\1/p" /tmp/said
    echo "rt: took $begin $(uptime_s) $suite"
    passed=$((passed + $(count PASSED)))
    skipped=$((skipped + $(count SKIPPED)))
    [ $code -eq 0 ] && continue
    killall -q -9 "$program"
    if [ $code -eq 137 ]; then
      echo "rt: wrong $(sed -n 's/^\[ RUN  *\] //p' /tmp/said | tail -n 1) did not end in $limit s"
    else
      sed -n 's/^\[  FAILED  \] \([^ ]*\) (.*/rt: wrong \1 failed/p' /tmp/said
      echo "rt: wrong $suite ended with $code"
    fi
    cat /tmp/said
  done < /tmp/suites
  echo "rt: test $program $passed $skipped $(grep -c '^  ' /tmp/tests)"
done
echo 950000 > /proc/sys/kernel/sched_rt_runtime_us
chrt -o -p 0 $$

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
sed 's/^/rt: said /' /tmp/complaints
echo "rt: cyclictest $(tr -d '\n' < /tmp/cyclictest)"
echo "rt: over"
poweroff -f
