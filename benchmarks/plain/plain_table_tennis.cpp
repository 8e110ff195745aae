// The table-tennis experiment in one process and without o80: the same plant, the same MuJoCo model
// and the same balls, stepped by plain calls. The environment is measured against it.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <memory>
#include <span>

#include "driver/simulation.hpp"
#include "o80/describe/options.hpp"
#include "pam/driver.hpp"
#include "pam/presets.hpp"

namespace {

constexpr int kIterations = 5;  // of arm and twin in a step

/// The result of a step; Python knows the same layout.
struct Seen {
  double q[4];
  double dq[4];
  double pressures[8];
  double ball[6];
  // as in a row of the simulation
  o80::mujoco::WatchedContacts racket;
  std::array<o80::mujoco::SurfaceContacts, 3> others;
};

class Plain {
 public:
  Plain(const o80::pam::Plant::Config& arm, const o80::mujoco::Config& twin)
      : arm_(arm), twin_(twin) {}

  void reset(std::uint64_t seed, std::span<const o80::mujoco::BallState> flight, Seen& seen) {
    arm_.reset(seed);
    twin_.reset();
    asked_ = arm_.state().commanded;
    flight_ = flight;
    played_ = 0;
    mirror();
    look(seen);
    for (std::size_t m = 0; m < 8; ++m) seen.pressures[m] = asked_[m];
  }

  void step(const double* pressures, int delay, Seen& seen) {
    for (int i = 0; i < kIterations; ++i) {
      if (i == delay) {
        for (std::size_t m = 0; m < 8; ++m) {
          asked_[m] = static_cast<std::int32_t>(std::lround(pressures[m]));
        }
      }
      arm_.advance(asked_);
      mirror();
    }
    look(seen);
  }

 private:
  void mirror() {
    o80::mujoco::Targets& targets = twin_.targets();
    for (std::size_t i = 0; i < 4; ++i) targets.joints[i] = {arm_.q()[i], arm_.dq()[i]};
    o80::mujoco::BallTarget& ball = twin_.balls()->targets()[0];
    ball.imposed = played_ < flight_.size();
    if (ball.imposed) ball.state = flight_[played_++];
    twin_.advance();
    if (twin_.balls()->released(0)) played_ = flight_.size();
  }

  void look(Seen& seen) const {
    for (std::size_t i = 0; i < 4; ++i) {
      seen.q[i] = arm_.q()[i];
      seen.dq[i] = arm_.dq()[i];
    }
    for (std::size_t m = 0; m < 8; ++m) {
      seen.pressures[m] = arm_.config().ranges[m].pressure(arm_.state().activation[m]);
    }
    const o80::mujoco::BallState ball = twin_.balls()->ball(0);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      seen.ball[axis] = ball.position[axis];
      seen.ball[3 + axis] = ball.velocity[axis];
    }
    seen.racket = twin_.balls()->watched_contacts(0)[0];
    std::ranges::copy(twin_.balls()->other_contacts(0), seen.others.begin());
  }

  o80::pam::Plant arm_;
  o80::mujoco::Simulation twin_;
  o80::pam::Pressures asked_{};
  std::span<const o80::mujoco::BallState> flight_;  // the caller's memory
  std::size_t played_ = 0;
};

}  // namespace

extern "C" {

/// `preset` is that of the arm, `names` and `texts` are the options of the simulation.
__attribute__((visibility("default"))) Plain* plain_create(const char* preset,
                                                           const char* const* names,
                                                           const char* const* texts,
                                                           std::size_t options) {
  try {
    o80::pam::PamDriver::Config arm;
    o80::set_option(arm, "preset", preset);
    o80::mujoco::Config config;
    for (std::size_t i = 0; i < options; ++i) o80::set_option(config, names[i], texts[i]);
    return new Plain(o80::pam::preset(arm.preset), config);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return nullptr;
  }
}

__attribute__((visibility("default"))) void plain_reset(Plain* plain, std::uint64_t seed,
                                                        const o80::mujoco::BallState* flight,
                                                        std::size_t rows, Seen* seen) {
  plain->reset(seed, {flight, rows}, *seen);
}

__attribute__((visibility("default"))) void plain_step(Plain* plain, const double* pressures,
                                                       int delay, Seen* seen) {
  plain->step(pressures, delay, *seen);
}

/// Makes the steps from `first` to `last` of `count` of them, one after the other in each step.
/// Each is reset every `episode` steps, not all in the same step. `pressures` are those of the
/// steps of an episode, `flights` has a row for each copy.
__attribute__((visibility("default"))) void plain_play(Plain* const* all, std::size_t count,
                                                       std::size_t first, std::size_t last,
                                                       std::size_t episode, const double* pressures,
                                                       const o80::mujoco::BallState* flights) {
  Seen seen;
  for (std::size_t step = first; step < last; ++step) {
    for (std::size_t i = 0; i < count; ++i) {
      const std::size_t own = (step + i * episode / count) % episode;
      if (own == 0) all[i]->reset(step, {flights + i, 1}, seen);
      all[i]->step(pressures + 8 * own, 1, seen);
    }
  }
}

__attribute__((visibility("default"))) void plain_destroy(Plain* plain) { delete plain; }

}  // extern "C"
