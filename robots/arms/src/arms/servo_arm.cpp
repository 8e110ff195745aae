#include "arms/servo_arm.hpp"

#include <algorithm>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>

#include "arms/servo_arm_numbers.hpp"

namespace o80::arms {
namespace {

constexpr double kReach = 0.15;                 // of a gripper's goal beyond its position [1]
constexpr int kMissesToHalt = 3;                // transfers
constexpr int kAlarmsToHalt = 2;                // answers: one may be damaged and pass its checksum
constexpr int kJumpsToHalt = 3;                 // readings
constexpr double kGentleSpeed = 300.0;          // [steps/s]
constexpr double kFullSpeed = 2500.0;           // half more than kMostSpeed [steps/s]
constexpr double kGentleAcceleration = 2000.0;  // [steps/s^2]
constexpr double kFullAcceleration = 25'400.0;
constexpr double kRestSpeed = 0.5;                 // [rad/s]
constexpr double kSettleTime = 0.5;                // [s]
constexpr std::int64_t kSecond = 1'000'000'000;    // [ns]
constexpr std::int64_t kLongestGap = 100'000'000;  // in which a servo is believed to move [ns]

}  // namespace

double ServoArm::strength_of(std::size_t servo, double share) const noexcept {
  return share * (servo == kGripper ? config_.gripper_strength : config_.strength);
}

void ServoArm::set_motion(Mask servos, double speed, double acceleration,
                          double strength) noexcept {
  OfServos<double> strengths{};
  for (std::size_t i = 0; i < kServos; ++i) strengths[i] = strength_of(i, strength);
  chain_->queue_motion(servos, speed, acceleration, strengths);
}

/// Whether a servo's torque is on, without alarms.
bool ServoArm::holds(std::size_t servo) const noexcept {
  return (*chain_)[servo].torque && (*chain_)[servo].status == 0;
}

/// Sets goals to the present positions, and gentle registers for servos that do not hold yet.
void ServoArm::approach(Mask servos) noexcept {
  chain_->watch(false);  // servos stopped by the watchdog accept neither goal nor strength
  Mask gentle = servos;
  for (std::size_t i = 0; i < kServos; ++i) {
    if (holds(i)) gentle &= ~bit(i);
  }
  set_motion(gentle, kGentleSpeed, kGentleAcceleration, kGentleStrength);
  for (std::size_t i = 0; i < kServos; ++i) {
    const Calibration& range = calibration_[i];
    held_places_[i] = std::clamp(servos_[i].position, range.smallest, range.largest);
  }
  goals_ = held_places_;
  chain_->queue_goals(servos, goals_);
  settling_ = static_cast<int>(kSettleTime * 1e9 / static_cast<double>(period_));
}

/// Switches the torque on at the present positions, with the next request.
void ServoArm::hold(Mask servos) noexcept {
  if (servos == 0) return;
  chain_->queue_recovery(servos & failing());
  approach(servos);
  chain_->queue_torque(servos, true);
  chain_->watch(true);
  held_ |= servos;
  relaxed_ = false;
  for (std::size_t i = 0; i < kServos; ++i) {
    if (has(servos, i)) servos_[i].without_torque = false;
  }
}

/// Sets full strength after half a second at rest.
void ServoArm::settle() noexcept {
  if (settling_ == 0 || !link_.fresh) return;
  for (std::size_t i = 0; i < kServos; ++i) {
    const bool stands = std::abs(servos_[i].position - held_places_[i]) <= kBacklash;
    if (!stands && has(held_, i) && goals_[i] == held_places_[i]) {
      because(
          "%s moved when its torque was switched on, and is held with little strength: check "
          "that nothing pulls it",
          kJointNames[i]);
    }
  }
  if (why_[0] == 0 && --settling_ == 0) set_motion(held_, kFullSpeed, kFullAcceleration, 1.0);
}

int ServoArm::goal_of(std::size_t servo, const ArmState& desired) const noexcept {
  const Calibration& range = calibration_[servo];
  double steps = 0.0;
  if (servo == kGripper) {
    // limits the force on an object by a goal near the position
    const double stands = range.share(servos_[servo].position);
    steps = range.steps_of_share(std::clamp(desired.gripper, stands - kReach, stands + kReach));
  } else {
    steps = range.steps(desired.joints[servo]);
  }
  return std::clamp(static_cast<int>(std::lround(steps)), range.smallest, range.largest);
}

void ServoArm::send(const ArmState& desired) noexcept {
  wrote_ = true;
  if (!chain_->has_port()) return reopen();
  settle();
  for (std::size_t i = 0; i < kServos; ++i) {
    if (has(held_, i)) goals_[i] = goal_of(i, desired);
  }
  chain_->request(held_, goals_);
}

/// Tries every half second to reopen the adapter.
void ServoArm::reopen() noexcept {
  if (++closed_ * period_ < kSecond / 2) return;
  closed_ = 0;
  static_cast<void>(chain_->port().reopen(lasting_name_.c_str()));
}

std::int64_t ServoArm::deadline() const noexcept {
  const std::int64_t asked = chain_->is_asking() ? chain_->asked_at() : now();
  if (config_.answer_timeout > 0.0) {
    return asked + static_cast<std::int64_t>(config_.answer_timeout * 1e9);
  }
  return asked + (failed_before_ ? period_ : period_ * 5 / 4);
}

void ServoArm::receive(ArmState& observed, ArmSensors& sensors, std::int64_t time) noexcept {
  // row 0 and fresh starts have separate readings
  if (!wrote_) chain_->request(0, {});
  wrote_ = false;
  const ServoChain::Transfer transfer = chain_->collect(deadline());
  take(transfer);
  if (transfer.asked) look_for_trouble(transfer);
  if (!chain_->has_port()) {
    because("the adapter %s is unplugged", lasting_name_.c_str());
    held_ = 0;  // old goals would move the arm when the adapter returns
  }

  for (std::size_t i = 0; i < kServos; ++i) {
    const ServoState& state = (*chain_)[i];
    const double place = servos_[i].position;
    if (i == kGripper) {
      observed.gripper = calibration_[i].share(place);
    } else {
      observed.joints[i] = calibration_[i].angle(place);
    }
    Measured& measured = sensors.measured;
    measured.velocity[i] = state.speed * Calibration::kStep;
    measured.effort[i] = state.effort;
    measured.temperature[i] = state.temperature;
    measured.voltage[i] = state.voltage;
    sensors.health[i] = health_of(i);
  }
  link_.age = now() - complete_at_;
  link_.capture_time = time - link_.age;
  sensors.link = link_;
}

/// Updates the state of each servo from the answers.
void ServoArm::take(const ServoChain::Transfer& transfer) noexcept {
  link_.late += transfer.late;
  link_.damaged += transfer.damaged;
  link_.fresh = transfer.asked && transfer.answered == chain_->all();
  failed_before_ = transfer.answered != chain_->all();
  for (std::size_t i = 0; transfer.asked && i < kServos; ++i) {
    Servo& servo = servos_[i];
    if (!has(transfer.answered, i)) {
      ++servo.missed;
      ++link_.lost;
      continue;
    }
    servo.missed = 0;
    if (!is_plausible(i)) {
      ++servo.jumped;
      ++link_.damaged;
      link_.fresh = false;
      continue;
    }
    servo.jumped = 0;
    servo.position = (*chain_)[i].position;
    servo.seen_at = chain_->asked_at();
    if (has(transfer.torque_known, i)) servo.without_torque = !(*chain_)[i].torque;
    servo.alarmed = (*chain_)[i].status != 0 ? servo.alarmed + 1 : 0;
  }
  if (link_.fresh) complete_at_ = chain_->asked_at();
}

/// Whether the servo can have moved there: a damaged answer may pass its checksum.
bool ServoArm::is_plausible(std::size_t servo) const noexcept {
  const std::int64_t unseen = chain_->asked_at() - servos_[servo].seen_at;
  const std::int64_t since = std::clamp(unseen, period_, std::max(period_, kLongestGap));
  // a hand moves it faster
  const double speed = (relaxed_ ? 8.0 : 2.0) * kMostSpeed / Calibration::kStep;
  const double most = speed * static_cast<double>(since) * 1e-9 + kBacklash;
  return std::abs((*chain_)[servo].position - servos_[servo].position) <= most;
}

void ServoArm::look_for_trouble(const ServoChain::Transfer& transfer) noexcept {
  const auto lost = [](const Servo& servo) { return servo.missed >= kMissesToHalt; };
  const auto first = std::ranges::find_if(servos_, lost);
  if (std::ranges::all_of(servos_, lost)) {
    because("no servo answers: is the power supply on?");
  } else if (first != servos_.end()) {
    const auto i = static_cast<std::size_t>(first - servos_.begin());
    because("%s (servo %zu) does not answer: check its plug and the plug before it", kJointNames[i],
            i + 1);
  }
  for (std::size_t i = 0; i < kServos; ++i) {
    Servo& servo = servos_[i];
    // a returning servo may be elsewhere, and has lost its goal
    if (lost(servo)) held_ &= ~bit(i);
    if (servo.jumped >= kJumpsToHalt) {
      // the goal is from before the jump, and would move the servo
      goals_[i] = (*chain_)[i].position;
      chain_->queue_goals(bit(i) & held_, goals_);
      held_ &= ~bit(i);
      because("%s is read at an impossible position: has its encoder lost a turn?", kJointNames[i]);
    }
    if (servo.alarmed >= kAlarmsToHalt) name_alarm(i);
    if (has(held_, i) && servo.without_torque && (*chain_)[i].status == 0) {
      held_ &= ~bit(i);
      because("somebody switched the torque of servo %zu (%s) off", i + 1, kJointNames[i]);
    }
  }
  damaged_in_window_ += transfer.damaged > 0 ? 1 : 0;
  const std::int64_t window = std::max<std::int64_t>(kSecond / period_, 20);
  if (damaged_in_window_ * 20 > window) {
    because("more than 5 %% of the answers of a second are damaged: check the cables");
  }
  if (++window_ >= window) window_ = damaged_in_window_ = 0;
}

/// Returns the halt for a servo's status byte, if any.
void ServoArm::name_alarm(std::size_t servo) noexcept {
  const ServoState& state = (*chain_)[servo];
  const char* const name = kJointNames[servo];
  const int weak = chain_->strength_of_overloaded(servo);
  if ((state.status & overload_alarm) != 0 && weak == 0) {
    because("%s is overloaded and has switched itself off: free it", name);
  } else if ((state.status & overload_alarm) != 0) {
    because("%s is overloaded and has only %d %% of its strength: free it", name, weak);
  } else if ((state.status & heat_alarm) != 0) {
    servos_[servo].was_hot = true;
    because("%s is too hot (%d C): it has switched itself off", name, state.temperature);
  } else if ((state.status & voltage_alarm) != 0) {
    because("%.1f V at %s, at least %.1f V and at most %.1f V needed: wrong or weak supply",
            state.voltage, name, state.least_voltage, state.most_voltage);
  } else if ((state.status & current_alarm) != 0) {
    because("%s draws too much current: free it", name);
  } else if ((state.status & encoder_alarm) != 0) {
    because("the encoder of %s reports a failure: switch the servo off and on", name);
  }
}

Health ServoArm::health_of(std::size_t servo) const noexcept {
  const ServoState& state = (*chain_)[servo];
  const auto alarmed = [&](Alarm alarm) { return (state.status & alarm) != 0; };
  if (servos_[servo].missed >= kMissesToHalt) return Health::silent;
  if (servos_[servo].without_torque && !relaxed_ && state.status == 0) return Health::torque_off;
  if (alarmed(overload_alarm)) return Health::overload;
  if (alarmed(current_alarm)) return Health::current;
  if (alarmed(heat_alarm) || state.temperature + 5 >= state.hottest) {
    return Health::heat;
  }
  if (alarmed(encoder_alarm)) return Health::encoder;
  return alarmed(voltage_alarm) ? Health::voltage : Health::ok;
}

/// Lists servos that report a failure.
ServoArm::Mask ServoArm::failing() const noexcept {
  Mask found = 0;
  for (std::size_t i = 0; i < kServos; ++i) found |= (*chain_)[i].status != 0 ? bit(i) : 0;
  return found;
}

/// Lists servos that should hold but do not, or have less strength.
ServoArm::Mask ServoArm::troubled() const noexcept {
  Mask found = failing() | (relaxed_ ? 0 : chain_->all() & ~held_);
  for (std::size_t i = 0; i < kServos; ++i) found |= servos_[i].without_torque ? bit(i) : 0;
  return found;
}

/// Reason why the arm cannot hold now; null if it can.
const char* ServoArm::why_not_ready() noexcept {
  const auto say = [&](const char* format, auto... values) {
    std::snprintf(not_ready_.data(), not_ready_.size(), format, values...);
    return not_ready_.data();
  };
  if (!chain_->has_port()) return say("the adapter %s is unplugged", lasting_name_.c_str());
  for (std::size_t i = 0; i < kServos; ++i) {
    const char* const name = kJointNames[i];
    const int status = (*chain_)[i].status;
    Servo& servo = servos_[i];
    if (servo.missed > 0) return say("%s (servo %zu) does not answer", name, i + 1);
    if (status != 0 && chain_->recovery_restarts()) {
      return say("%s (servo %zu) reports a failure: `recover` restarts it, and it sinks", name,
                 i + 1);
    }
    if ((status & voltage_alarm) != 0) {
      return say("%.1f V at %s: wrong or weak supply", (*chain_)[i].voltage, name);
    }
    servo.was_hot = servo.was_hot && (*chain_)[i].temperature > (*chain_)[i].hottest - 10;
    if (servo.was_hot) return say("%s is still too hot: wait", name);
    const int position = (*chain_)[i].position;
    const bool inside =
        position >= calibration_[i].smallest - kEdge && position <= calibration_[i].largest + kEdge;
    if (!inside && !config_.leader) {
      return say("%s stands outside its range: move it inside by hand", name);
    }
  }
  return nullptr;
}

Served ServoArm::resume() noexcept {
  if (const char* const why = why_not_ready()) return Served::rejected(why);
  begin_anew();
  if (!config_.leader) {
    chain_->watch(true);
    hold(relaxed_ ? chain_->all() : troubled());
  }
  return Served::done();
}

/// Clears the halt. From now on implausible readings are accepted, because o80 checks them.
void ServoArm::begin_anew() noexcept {
  why_[0] = 0;
  halted_ = false;
  window_ = damaged_in_window_ = 0;
  for (std::size_t i = 0; i < kServos; ++i) {
    servos_[i].position = (*chain_)[i].position;
    servos_[i].alarmed = servos_[i].jumped = 0;
  }
}

Served ServoArm::on(const Hold& /*request*/) noexcept {
  if (config_.leader) return Served::rejected("a leader is moved by hand: it gets no torque");
  if (const char* const why = why_not_ready()) return Served::rejected(why);
  hold(relaxed_ ? chain_->all() : troubled());
  return Served::start_afresh();
}

Served ServoArm::on(const Relax& /*request*/) noexcept {
  chain_->queue_torque(chain_->all(), false);
  held_ = 0;
  settling_ = 0;
  relaxed_ = true;
  return Served::start_afresh();
}

Served ServoArm::on(const Strength& request) noexcept {
  if (!(request.share > 0.0 && request.share <= 1.0)) {
    return Served::rejected("the share must be above 0 and at most 1");
  }
  config_.strength = request.share;
  if (settling_ == 0) set_motion(held_, kFullSpeed, kFullAcceleration, 1.0);
  return Served::done();
}

Served ServoArm::on(const Recover& /*request*/) noexcept {
  if (failing() != 0 && chain_->recovery_restarts()) {
    chain_->queue_recovery(failing());
    held_ &= ~failing();
    return Served::done();
  }
  if (const char* const why = why_not_ready()) return Served::rejected(why);
  if (!relaxed_) hold(troubled());
  return Served::start_afresh();  // old desired states would move a sunken arm
}

/// Moves the joints slowly to their positions at the start; false after a fault.
bool ServoArm::goes_to_rest() noexcept {
  if (halted_ || relaxed_ || held_ != chain_->all()) return false;
  const OfServos<int> from = goals_;
  double most = 0.0;  // [rad]
  for (std::size_t i = 0; i < kGripper; ++i) {
    most = std::max(most, std::abs(start_places_[i] - from[i]) * Calibration::kStep);
  }
  const double seconds = std::max(1.0, most * std::numbers::pi / 2.0 / kRestSpeed);
  const int steps = static_cast<int>(seconds * 1e9 / static_cast<double>(period_));
  for (int step = 1; step <= steps && why_[0] == 0; ++step) {
    const double share = 0.5 - 0.5 * std::cos(std::numbers::pi * step / steps);
    for (std::size_t i = 0; i < kGripper; ++i) {
      goals_[i] = from[i] + static_cast<int>(std::lround(share * (start_places_[i] - from[i])));
    }
    chain_->request(held_, goals_);
    const ServoChain::Transfer transfer = chain_->collect(deadline());
    take(transfer);
    if (!chain_->has_port()) return false;
    if (transfer.asked) look_for_trouble(transfer);
    sleep_until(chain_->asked_at() + period_);
  }
  return why_[0] == 0;
}

void ServoArm::stop() noexcept {
  if (!started_) return;
  const bool asks_to_relax =
      config_.at_stop == AtStop::relax || (config_.at_stop == AtStop::rest && goes_to_rest());
  const bool is_there = chain_->has_port();
  if (asks_to_relax && is_there) {
    for (int i = 0; i < 3; ++i) {  // nobody answers to it
      chain_->watch(false);
      chain_->queue_torque(chain_->all(), false);
      chain_->send_queued();
    }
  } else if (!relaxed_) {
    chain_->watch(false);
    // a gripper that presses on would overheat with nobody to see it
    goals_[kGripper] = servos_[kGripper].position;
    chain_->queue_goals(bit(kGripper) & held_, goals_);
    chain_->send_queued();
    const auto holding = std::ranges::count_if(
        servos_, [](const Servo& servo) { return servo.missed == 0 && !servo.without_torque; });
    std::fprintf(stderr,
                 "%s%d servos keep their torque, and no process watches their temperature: "
                 "`o80 arms relax` switches the torque off\n",
                 is_there ? "" : "the adapter is unplugged; ",
                 is_there ? static_cast<int>(holding) : static_cast<int>(kServos));
  }
  chain_->port().close();
}

/// The first reason stays until somebody resumes: another text would be another halt.
void ServoArm::because(const char* format, ...) noexcept {
  if (why_[0] != 0) return;
  std::va_list values;
  va_start(values, format);
  std::vsnprintf(why_.data(), why_.size(), format, values);
  va_end(values);
}

}  // namespace o80::arms
