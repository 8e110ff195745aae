#pragma once

#include <cstdint>
#include <vector>

#include "balls/balls.hpp"
#include "o80/robot.hpp"

namespace o80::mujoco {

/// Places of the balls in a row: each is an actuator, and has an element of the sensor `contacts`
/// with a field for each surface, named after the geom.
class BallRows {
 public:
  void add_actuators(Schema& schema, const Balls& balls);
  void add_sensors(Schema& schema, const Balls& balls);
  /// Names the positions of the balls for viewers.
  void show(ShownModel& shown, const Balls& balls) const;

  template <class Driver>
  void write(const Desired<Driver>& desired, Balls& balls) const {
    for (std::size_t i = 0; i < balls.size(); ++i) {
      balls.targets()[i] = {desired.at(states_[i]), desired.active(first_actuator_ + i)};
    }
  }

  template <class Driver>
  void read(const Balls& balls, Reading<Driver>& reading) const {
    for (std::size_t i = 0; i < balls.size(); ++i) {
      reading.observe(states_[i], balls.ball(i));
      read_contacts(balls, i, reading);
      if (balls.released(i) && !reading.fresh()) reading.interrupt(first_actuator_ + i);
    }
  }

  /// Writes the targets of a restored simulation into the desired states of a row.
  void go_on_from_targets(const Balls& balls, std::byte* desired) const;

 private:
  template <class Driver>
  void read_contacts(const Balls& balls, std::size_t i, Reading<Driver>& reading) const {
    const auto ball = static_cast<std::uint32_t>(i) * contacts_size_;
    const auto watched = balls.watched_contacts(i);
    for (std::size_t k = 0; k < watched.size(); ++k) {
      reading.extend(Place<WatchedContacts>{watched_[k] + ball}, watched[k]);
    }
    const auto others = balls.other_contacts(i);
    for (std::size_t k = 0; k < others.size(); ++k) {
      reading.extend(Place<SurfaceContacts>{others_[k] + ball}, others[k]);
    }
  }

  std::uint32_t first_actuator_ = 0;
  std::vector<Place<BallState>> states_;
  // of the first ball
  std::vector<std::uint32_t> watched_;
  std::vector<std::uint32_t> others_;
  std::uint32_t contacts_size_ = 0;  // of each ball [bytes]
};

}  // namespace o80::mujoco
