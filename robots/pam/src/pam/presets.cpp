#include "pam/presets.hpp"

namespace o80::pam {
namespace {

/// Step responses of the real arm, published for December 2023: gain 0.25, 0.17, 0.30,
/// 0.30 rad per 1000 raw units; 63 % after 190, 270, 160, 110 ms; overshoot 47, 31, 4, 1 %; dead
/// time 40, 40, 20, 10 ms; agonists of joints 1 and 3 that decrease the angle. Force, stroke and
/// damping were fitted to the first three (a step of 500 units up in one muscle and down in the
/// other, in the playing posture). Assumed, because not published: the friction, and equal lengths
/// of antagonists in the playing posture.
Plant::Config identified() noexcept {
  Plant::Config config;
  config.ranges = in_bar(kRealRanges, kFullBar);
  config.maximum_force = {2340.0, 960.0, 2170.0, 2000.0};
  config.stroke = {0.104, 0.0756, 0.126, 0.121};
  config.dead_time = {0.040, 0.040, 0.020, 0.010};
  config.directions = {-1.0, 1.0, -1.0, 1.0};
  config.neutral = kPlayingPosture;
  config.arm.damping = {1.42, 1.27, 1.85, 1.13};
  config.arm.friction = {0.05, 0.03, 0.03, 0.03};
  return config;
}

}  // namespace

PressureRanges in_bar(PressureRanges ranges, double full) noexcept {
  for (PressureRange& range : ranges) {
    range.idle = from_bar(0.0);
    range.full = from_bar(full);
  }
  return ranges;
}

Plant::Config preset(Preset preset) noexcept {
  switch (preset) {
    case Preset::identified:
      return identified();
    case Preset::published_simulation:
      return {.muscle = MuscleModel::hill};
    case Preset::standard:
      break;
  }
  return {};
}

}  // namespace o80::pam
