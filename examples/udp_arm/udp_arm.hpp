#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <string>

#include "o80/robot.hpp"
#include "protocol.hpp"
#include "udp_socket.hpp"

namespace udp_arm {

/// The driver of an arm that is served over UDP and ticks by its own clock: it paces the loop.
///
/// Each iteration belongs to one tick of the arm. A tick whose packet is lost or late is a missed
/// tick: the reading before it stays. More of them in a row than `tolerated`, a restart of the arm
/// and a stop by the arm itself halt the robot; `o80 resume` goes on where the arm is then. Silence
/// for longer than `give_up` is a fault.
class UdpArm {
 public:
  struct Config {
    std::string address = "127.0.0.1";
    int port = 5700;
    int tolerated = 4;
    double give_up = 60.0;
  };
  struct Link {
    std::array<double, kJoints> velocity{};
    std::uint64_t tick = 0;
    std::uint32_t missed = 0;
    std::uint32_t late = 0;
    std::uint32_t repeated = 0;
    std::uint32_t restarts = 0;
  };
  using Actuators = std::array<double, kJoints>;  // positions [rad]
  using Extended = Link;

  explicit UdpArm(const Config& config) : config_(config) {}

  void describe(o80::Schema& schema) const {
    for (std::size_t i = 0; i < kJoints; ++i) {
      schema.actuator(i)
          .name("joint" + std::to_string(i + 1))
          .limits({.minimum = -2.8, .maximum = 2.8, .speed = 2.0, .acceleration = 10.0});
    }
  }

  /// Connects; the loop does not run yet, so this may take its time.
  void start() {
    socket_.connect(config_.address, config_.port);
    const std::int64_t end = now() + kStartTimeout;
    while (now() < end) {
      send(Kind::connect, {});
      if (!socket_.wait_until(now() + kConnectAgain)) continue;
      if (socket_.receive(state_) != UdpSocket::Received::packet) continue;
      if (state_.mode == Mode::timed_out) continue;  // until the connect has reached it
      next_ = state_.tick + 1;
      return;
    }
    throw std::runtime_error("no answer from " + place() + " within 2 s: is the arm switched on, " +
                             "and are --address and --port those of the arm?");
  }

  void write(const o80::Desired<UdpArm>& desired) noexcept {
    period_ = std::llround(desired.period() * 1e9);
    // a setpoint from before an interruption may be far from where the arm is now
    send(why_halted_ == nullptr ? Kind::move : Kind::connect, desired.states);
  }

  /// Until the packet of the next tick is there, or its deadline has passed.
  void wait(std::int64_t due) noexcept {
    // due is a period after the last return, which was a quarter late if it was a timeout
    const std::int64_t deadline = missed_in_a_row_ == 0 ? due + period_ / 4 : due;
    in_time_ = take_arrived(due);
    while (!in_time_ && socket_.wait_until(deadline)) in_time_ = take_arrived(due);
    next_ = in_time_ ? state_.tick + 1 : next_ + 1;
    missed_in_a_row_ = in_time_ ? 0 : missed_in_a_row_ + 1;
    link_.missed += in_time_ ? 0 : 1;
    if (missed_in_a_row_ > config_.tolerated) interrupted("the arm sends nothing in time");
    if (state_.mode == Mode::timed_out) interrupted("the arm stopped: no command reached it");
  }

  void read(o80::Reading<UdpArm>& reading) {
    reading.observed = state_.position;
    link_.velocity = state_.velocity;
    link_.tick = state_.tick;
    reading.extended = link_;
    if (!in_time_) reading.missed();
    if (why_halted_ != nullptr) reading.halt(why_halted_);
    check(reading);
  }

  o80::Served resume() {
    if (missed_in_a_row_ > config_.tolerated) {
      return o80::Served::rejected("the arm sends nothing in time: resume when it does");
    }
    if (state_.mode == Mode::timed_out) {
      return o80::Served::rejected("the arm is still in its own stop: try again");
    }
    why_halted_ = nullptr;
    return o80::Served::done();
  }

  void stop() noexcept {
    send(Kind::stop, {});
    socket_.close();
  }

 private:
  static constexpr std::int64_t kStartTimeout = 2'000'000'000;  // [ns]
  static constexpr std::int64_t kConnectAgain = 50'000'000;     // [ns]
  static constexpr int kMaxAtOnce = 1000;                       // packets

  std::string place() const { return config_.address + ":" + std::to_string(config_.port); }

  /// A datagram that does not leave is lost like any other: the arm has a timeout of its own.
  void send(Kind kind, const std::array<double, kJoints>& position) noexcept {
    static_cast<void>(socket_.send(Command{
        .kind = kind, .session = state_.session, .sequence = ++sequence_, .position = position}));
  }

  /// All packets that have arrived => the newest state; true if it belongs to this iteration.
  /// After a delay of this process only the newest counts: ticks are skipped, not made up for.
  bool take_arrived(std::int64_t due) noexcept {
    bool in_time = false;
    State packet;
    for (int i = 0; i < kMaxAtOnce; ++i) {
      const UdpSocket::Received received = socket_.receive(packet);
      if (received == UdpSocket::Received::nothing) break;
      if (received == UdpSocket::Received::garbage || packet.session == former_session_) continue;
      if (packet.session != state_.session) {
        former_session_ = state_.session;
        ++link_.restarts;
        interrupted("the arm was restarted");
        in_time = true;
      } else if (packet.tick <= state_.tick) {
        ++link_.repeated;  // or reordered
        continue;
      } else if (packet.tick < next_ && now() < due - period_ / 3) {
        ++link_.late;  // newer than the reading, but its iteration is over
      } else {         // of the next tick; or the arm has left out a tick
        in_time = true;
      }
      state_ = packet;
    }
    return in_time;
  }

  /// The first reason stays until somebody resumes: another text would be another halt.
  void interrupted(const char* why) noexcept {
    if (why_halted_ == nullptr) why_halted_ = why;
  }

  /// What cannot be resumed from.
  void check(o80::Reading<UdpArm>& reading) const {
    if (state_.mode == Mode::failed) reading.fault("the arm reports a failure of its hardware");
    if (static_cast<double>(missed_in_a_row_ * period_) * 1e-9 > config_.give_up) {
      reading.fault("nothing from " + place() + " for longer than --give-up");
    }
    if (period_ != 0 && std::abs(state_.period - period_) > period_ / 50) {
      reading.fault("the arm ticks at another rate: start with --frequency " +
                    std::to_string(std::llround(1e9 / static_cast<double>(state_.period))));
    }
  }

  Config config_;
  UdpSocket socket_;
  State state_;                       // the newest
  Link link_;                         // so far
  std::uint64_t next_ = 0;            // tick of the next iteration
  std::uint64_t sequence_ = 0;        // of the last command
  std::uint64_t former_session_ = 0;  // its late packets are ignored
  std::int64_t period_ = 0;           // [ns], 0: no iteration yet
  std::int64_t missed_in_a_row_ = 0;  // ticks
  bool in_time_ = true;               // the reading is of this iteration's tick
  const char* why_halted_ = nullptr;  // until resumed: the arm is told to hold its position
};

O80_DESCRIBE(UdpArm::Config, (address, "of the arm: four numbers"), port,
             (tolerated, "ticks in a row without a reading; one more halts"),
             (give_up, "silence after which the robot ends with a fault [s]"));
O80_DESCRIBE(UdpArm::Link, (velocity, "[rad/s]"), (tick, "of the arm, newest received"),
             (missed, "ticks without a packet in time"), (late, "packets after their tick"),
             (repeated, "packets older than one before, or sent twice"), (restarts, "of the arm"));

}  // namespace udp_arm
