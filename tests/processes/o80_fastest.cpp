// Motions of pace `fastest` for tests/processes/test_fastest.py, played by the controller itself.
//
// Reads cases from the standard input, as doubles: limits of speed, acceleration and jerk (in
// iterations), a first target, the iteration at which the motion to it is cut, and a second target.
// Writes for each, as doubles: how many positions follow; the three at and before the cut, then
// those of the motion to the second target.

#include <cstdio>
#include <vector>

#include "tests/cpp/control/rig.hpp"

namespace {

struct Case {
  double speed;
  double acceleration;
  double jerk;
  double first;
  double cut;
  double second;
};

constexpr int kLongest = 1'000'000;

void fastest_to(o80::test::Rig& rig, double target) {
  o80::RecordHead head = o80::test::paced(o80::Pace::fastest, 0);
  head.mode = o80::Mode::overwrite;
  rig.add(0, head, {target});
  rig.pulse();
}

std::vector<double> positions_of(const Case& one) {
  o80::Schema robot = o80::test::plain_robot(1);
  robot.actuator(0).limits(
      {.speed = one.speed * 1e3, .acceleration = one.acceleration * 1e6, .jerk = one.jerk * 1e9});
  o80::test::Rig rig(robot, 16);
  rig.witness.keep = false;
  std::vector<double> positions(3, 0.0);
  fastest_to(rig, one.first);
  for (int i = 0; i < static_cast<int>(one.cut); ++i) {
    rig.step();
    positions.push_back(rig.desired());
  }
  positions.erase(positions.begin(), positions.end() - 3);
  fastest_to(rig, one.second);
  for (int i = 0; i < kLongest && rig.controller.active(); ++i) {
    rig.step();
    positions.push_back(rig.desired());
  }
  return positions;
}

}  // namespace

int main() {
  Case one{};
  while (std::fread(&one, sizeof one, 1, stdin) == 1) {
    const std::vector<double> positions = positions_of(one);
    const auto count = static_cast<double>(positions.size());
    std::fwrite(&count, sizeof count, 1, stdout);
    std::fwrite(positions.data(), sizeof(double), positions.size(), stdout);
  }
  return std::ferror(stdin) == 0 && std::fflush(stdout) == 0 ? 0 : 1;
}
