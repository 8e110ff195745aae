#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <random>
#include <string>

#include "link_faults.hpp"
#include "protocol.hpp"
#include "udp_socket.hpp"

namespace udp_arm {

/// The arm's side of the protocol, with simulated joints and a link that fails by a script. It
/// knows no clock: who owns it calls `tick` once a period.
class FakeArm {
 public:
  struct Options {
    int port = 0;                        // 0: any that is free
    std::int64_t period = 10'000'000;    // [ns]
    std::uint64_t command_timeout = 20;  // ticks without a command, after which it stops by itself
    LinkFaults faults{};
  };

  explicit FakeArm(const Options& options) : options_(options) {
    socket_.bind("127.0.0.1", options.port);
    switch_on();
  }

  int port() const { return socket_.port(); }
  Mode mode() const { return state_.mode; }
  const State& state() const { return state_; }

  /// Another script, by ticks from now on.
  void play(const LinkFaults& faults) {
    options_.faults = faults;
    ticks_ = 0;
  }

  // commands => joints => state
  void tick() {
    if (driver_) ++ticks_;
    const bool off = happens(What::restart);
    if (was_off_ && !off) switch_on();
    was_off_ = off;
    take_commands(off || happens(What::deaf));
    if (off) return;
    watch_commands();
    if (happens(What::fail)) state_.mode = Mode::failed;
    move();
    ++state_.tick;
    if (driver_) send_state();
  }

 private:
  using What = LinkFaults::What;

  bool happens(What what) const { return driver_ && options_.faults.has(what, ticks_); }

  void switch_on() {
    State fresh;
    fresh.session = std::random_device()() | std::uint64_t{1} << 32;
    fresh.period = options_.period;
    fresh.position = state_.position;  // where it stood
    state_ = fresh;
    sequence_ = 0;
    before_.reset();
    after_.reset();
  }

  void take_commands(bool lost) {
    Command command;
    sockaddr_in sender{};
    bool obeyed = false;
    for (UdpSocket::Received received = UdpSocket::Received::garbage;
         received != UdpSocket::Received::nothing;) {
      received = socket_.receive(command, &sender);
      if (received != UdpSocket::Received::packet || lost) continue;
      obeyed = obey(command, sender) || obeyed;
    }
    silent_ = obeyed ? 0 : silent_ + 1;
  }

  void watch_commands() {
    if (state_.mode == Mode::moving && silent_ > options_.command_timeout) {
      state_.mode = Mode::timed_out;
    }
  }

  bool obey(const Command& command, const sockaddr_in& sender) {
    if (state_.mode == Mode::failed) return false;
    if (command.kind == Kind::connect) {
      driver_ = sender;
      sequence_ = command.sequence;
      state_.mode = Mode::ready;
      return true;
    }
    const bool is_new = command.session == state_.session && command.sequence > sequence_;
    if (!is_new || state_.mode == Mode::timed_out) return false;
    sequence_ = command.sequence;
    state_.mode = command.kind == Kind::move ? Mode::moving : Mode::ready;
    setpoint_ = command.position;
    return true;
  }

  /// Each joint closes a part of its distance to the setpoint, or stands.
  void move() {
    const double period = static_cast<double>(options_.period) * 1e-9;
    for (std::size_t i = 0; i < kJoints; ++i) {
      const double way = state_.mode == Mode::moving ? setpoint_[i] - state_.position[i] : 0.0;
      state_.position[i] += 0.5 * way;
      state_.velocity[i] = 0.5 * way / period;
    }
  }

  void send_state() {
    if (before_) deliver(*before_);
    before_.reset();
    if (happens(What::late)) {
      before_ = state_;
    } else if (happens(What::swap)) {
      after_ = state_;
      return;
    } else if (!happens(What::drop)) {
      deliver(state_);
      if (happens(What::twice)) deliver(state_);
    }
    if (after_) deliver(*after_);
    after_.reset();
  }

  void deliver(const State& state) { static_cast<void>(socket_.send_to(state, *driver_)); }

  Options options_;
  UdpSocket socket_;
  State state_;
  std::array<double, kJoints> setpoint_{};
  std::optional<sockaddr_in> driver_;  // who connected last
  std::uint64_t sequence_ = 0;         // of the last command taken
  std::uint64_t silent_ = 0;           // ticks
  std::uint64_t ticks_ = 0;            // since the first connect
  bool was_off_ = false;
  std::optional<State> before_, after_;  // held back until the next tick's state
};

}  // namespace udp_arm
