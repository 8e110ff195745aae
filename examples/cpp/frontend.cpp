// Commands a robot that runs: queue and overwrite, blocking or not, every pace, the history.
// Start `o80 run two_joints` in another terminal first.

#include <cstdio>

#include "o80/o80.hpp"

using namespace std::chrono_literals;

namespace {

// the types of the robot; its driver is not needed here
struct Sensors {
  bool homing;
  std::array<double, 2> effort;
};
O80_DESCRIBE(Sensors, (homing, "it moves to 0 by itself"),
             (effort, "what is asked less what is there [rad]"));

struct TwoJoints {
  using Actuators = std::array<double, 2>;  // [rad]
  using Extended = Sensors;
  using Requests = o80::Requests<o80::Reset, o80::Snapshot, o80::Restore>;
};

const char* words(o80::Status status) { return to_text(status).data(); }

}  // namespace

int main() try {
  o80::Frontend<TwoJoints> arm("two_joints");

  // queued: one after the other, without an idle iteration between
  arm.add_command("elbow", 0.2, {.pace = o80::duration(100ms)});
  arm.add_command("elbow", 0.4, {.pace = o80::speed(2.0)});
  arm.add_command("elbow", 0.5,
                  {.pace = o80::iterations(50), .profile = o80::Profile::minimum_jerk});
  const auto there = arm.pulse_and_wait(5s);
  std::printf("blocking: asked for %.3f rad at iteration %ld, at %.3f rad\n", there.desired()[1],
              there.iteration(), there.observed()[1]);

  // not blocking; overwriting drops what runs
  arm.add_command("elbow", 1.0, {.pace = o80::duration(10s)});
  const o80::Batch slow = arm.pulse();
  arm.add_command("elbow", 0.0,
                  {.pace = o80::until(arm.published() + 200), .mode = o80::Mode::overwrite});
  const o80::Batch quick = arm.pulse();
  quick.wait(5s);
  std::printf("the slow command was %s, the quick one %s at iteration %ld\n",
              words(slow.handle(0).status), words(quick.handle(0).status), quick.last_iteration());

  // the history: every iteration that is still kept
  const o80::Rows rows = arm.history(100);
  std::printf("read %zu rows from iteration %ld on\n", rows.count, rows.first);
  return 0;
} catch (const o80::Error& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
