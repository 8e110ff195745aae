// Table tennis in many copies without o80: the same plant, MuJoCo model and balls, stepped by plain
// calls. The vector environment is measured against them.

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <memory>

#include "driver/simulation.hpp"
#include "o80/describe/options.hpp"
#include "pam/driver.hpp"
#include "pam/presets.hpp"

namespace {

constexpr int kIterations = 5;  // of arm and twin in a step

class Plain {
 public:
  Plain(const o80::pam::Plant::Config& arm, const o80::mujoco::Config& twin)
      : arm_(arm), twin_(twin) {}

  /// The ball flies on from `start`.
  void reset(std::uint64_t seed, const o80::mujoco::BallState& start) {
    arm_.reset(seed);
    twin_.reset();
    requested_ = arm_.state().commanded;
    o80::mujoco::BallTarget& ball = twin_.balls()->targets()[0];
    ball.imposed = true;
    ball.state = start;
    mirror();
    ball.imposed = false;
  }

  void step(const double* pressures, int delay) {
    for (int i = 0; i < kIterations; ++i) {
      if (i == delay) {
        for (std::size_t m = 0; m < 8; ++m) {
          requested_[m] = static_cast<std::int32_t>(std::lround(pressures[m]));
        }
      }
      arm_.advance(requested_);
      mirror();
    }
  }

 private:
  void mirror() {
    o80::mujoco::Targets& targets = twin_.targets();
    for (std::size_t i = 0; i < 4; ++i) targets.joints[i] = {arm_.q()[i], arm_.dq()[i]};
    twin_.advance();
  }

  o80::pam::Plant arm_;
  o80::mujoco::Simulation twin_;
  o80::pam::Pressures requested_{};
};

}  // namespace

extern "C" {

/// `preset` is that of the arm, `names` and `texts` are the options of the simulation.
__attribute__((visibility("default"))) Plain* plain_create(const char* preset,
                                                           const char* const* names,
                                                           const char* const* texts,
                                                           std::size_t options,
                                                           const o80::mujoco::BallState* start) {
  try {
    o80::pam::PamDriver::Config arm;
    o80::set_option(arm, "preset", preset);
    o80::mujoco::Config config;
    for (std::size_t i = 0; i < options; ++i) o80::set_option(config, names[i], texts[i]);
    auto plain = std::make_unique<Plain>(o80::pam::preset(arm.preset), config);
    plain->reset(1, *start);
    return plain.release();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return nullptr;
  }
}

/// Makes the steps from `first` to `last` of `count` of them, one after the other in each step.
/// Each is reset every `episode` steps, not all in the same step. `pressures` are those of the
/// steps of an episode, `starts` has the ball of each copy.
__attribute__((visibility("default"))) void plain_play(Plain* const* all, std::size_t count,
                                                       std::size_t first, std::size_t last,
                                                       std::size_t episode, const double* pressures,
                                                       const o80::mujoco::BallState* starts) {
  for (std::size_t step = first; step < last; ++step) {
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t own = (step + i * episode / count) % episode;
      if (own == 0) all[i]->reset(step, starts[i]);
      all[i]->step(pressures + 8 * own, 1);
    }
  }
}

__attribute__((visibility("default"))) void plain_destroy(Plain* plain) { delete plain; }

}  // extern "C"
