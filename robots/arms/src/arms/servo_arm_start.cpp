// How the driver begins: what it is made of, who the servos are, and the first torque.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <stdexcept>

#include "arms/servo_arm.hpp"
#include "arms/servo_arm_numbers.hpp"

namespace o80::arms {
namespace {

constexpr std::int64_t kDefaultPeriod = 6'666'667;  // 150 Hz [ns]
constexpr int kAgreement = 10;                      // of two readings of an arm that stands [steps]
constexpr std::int64_t kStartWait = 100'000'000;    // for a transfer [ns]

std::string range_of(const Calibration& calibration) {
  return "offset " + std::to_string(calibration.offset) + ", range " +
         std::to_string(calibration.smallest) + ".." + std::to_string(calibration.largest);
}

}  // namespace

ServoArm::ServoArm(const Config& config, const ArmKind& kind)
    : config_(config), kind_(kind), chain_(kind.chain(config.leader)), period_(kDefaultPeriod) {
  for (const double share : {config.strength, config.gripper_strength, config.speed_share}) {
    if (!(share > 0.0 && share <= 1.0)) {
      throw InvalidArgument(
          "a strength and the share of speed must be above 0 and at most 1, got " +
          std::to_string(share));
    }
  }
  if (!(config.answer_timeout >= 0.0 && config.answer_timeout < 10.0)) {
    throw InvalidArgument("answer_timeout must be at least 0 and below 10 s, got " +
                          std::to_string(config.answer_timeout));
  }
  std::vector<std::string> folders;
  for (const char* const name : kind.names) {
    if (name == nullptr) continue;
    folders.push_back(config.leader ? "teleoperators/" + std::string(name) + "_leader"
                                    : "robots/" + std::string(name) + "_follower");
  }
  const std::string path = find_calibration(config.calibration, folders);
  if (!path.empty()) {
    calibration_ = read_calibration(path, {kJointNames.begin(), kJointNames.end()});
    config_.calibration = path;
  }
}

void ServoArm::describe(Schema& schema) const {
  if (schema.asked_period() != 0) period_ = schema.asked_period();
  schema.period(period_);
  for (std::uint32_t i = 0; i < kServos; ++i) {
    schema.actuator(i).name(kJointNames[i]);
    if (config_.leader) schema.actuator(i).when_idle(WhenIdle::follow);
  }
  for (std::uint32_t i = 0; i < kGripper; ++i) {
    const double half =
        calibration_.empty() ? kind_.farthest[i] : calibration_[i].width() / 2 * Calibration::kStep;
    const double bound = std::min(half, kind_.farthest[i]);
    schema.actuator(i).unit("rad").limits({.minimum = -bound,
                                           .maximum = bound,
                                           .speed = kMostSpeed * config_.speed_share,
                                           .acceleration = 20.0,
                                           .jerk = 1000.0,
                                           .error = 0.35});
  }
  // it may close on something, so it has no limit of error
  schema.actuator(kGripper).unit("1").limits({.minimum = 0.0,
                                              .maximum = 1.0,
                                              .speed = 2.0 * config_.speed_share,
                                              .acceleration = 20.0,
                                              .jerk = 1000.0,
                                              .noise = 0.05});
  tell_ranges(schema);
}

/// The calibrated ranges as help of the joints, which recordings keep. LeRobot's normalised units
/// are shares of them; the limits may be narrower.
void ServoArm::tell_ranges(Schema& schema) const {
  if (calibration_.empty()) return;
  std::string text = "0: the middle of calibrated ranges";
  for (std::size_t i = 0; i < kGripper; ++i) {
    std::array<char, 16> width{};
    std::snprintf(width.data(), width.size(), " %.6f",
                  calibration_[i].width() * Calibration::kStep);
    text += width.data();
  }
  const TypeRow& joints = schema.types.at(schema.groups.at(0).type);
  schema.fields.at(joints.first_field).help = FieldHelpText(text + " rad");
}

// start() may wait, and throws

void ServoArm::refuse(std::size_t servo, const std::string& why) const {
  throw std::runtime_error(std::string(kJointNames[servo]) + " (servo " +
                           std::to_string(servo + 1) + ") " + why);
}

void ServoArm::start() {
  if (calibration_.empty()) {
    throw std::runtime_error(
        "no calibration was given, and there is none or more than one: choose one with "
        "--calibration NAME, or make one from the values in the servos with `o80 arms calibrate "
        "--take NAME` (for a leader add --leader)");
  }
  const std::string port = config_.port.empty() ? only_port() : config_.port;
  lasting_name_ = lasting_name(port);
  chain_->open(SerialPort::open(port), config_.answer_timeout);
  check_servos();
  check_calibration();
  check_rate();
  find_place();
  if (config_.leader) return let_go();
  begin_to_hold();
}

/// A leader has no torque, and is followed.
void ServoArm::let_go() {
  chain_->queue_torque(chain_->all(), false);
  chain_->send_queued();
  relaxed_ = started_ = true;
}

/// Who they are, and how they are.
void ServoArm::check_servos() {
  Mask silent = 0;
  for (std::size_t i = 0; i < kServos; ++i) {
    if (!chain_->find(i)) silent |= bit(i);
  }
  if (silent == chain_->all()) {
    throw std::runtime_error(
        "no servo answers: is the power supply on? `o80 arms` lists the servos of each port");
  }
  for (std::size_t i = 0; i < kServos; ++i) {
    try {
      chain_->set_up(i);
    } catch (const std::runtime_error& error) {
      refuse(i, error.what());
    }
  }
}

void ServoArm::check_calibration() {
  for (std::size_t i = 0; i < kServos; ++i) {
    const Calibration own = chain_->calibration_of(i);
    if (own == calibration_[i]) continue;
    throw std::runtime_error(
        std::string(kJointNames[i]) + ": the calibration '" + config_.calibration + "' has " +
        range_of(calibration_[i]) + ", but the servo has " + range_of(own) +
        ". Write the file to the servos with `o80 arms calibrate --write NAME`, or make a new file "
        "from their values with `--take NAME` (for a leader add --leader)");
  }
  tell_doubts();
}

/// The zero of a joint is the middle of what a person moved. `o80 arms` says the same.
void ServoArm::tell_doubts() const {
  constexpr double kWholeTurn = 3.1;  // [rad]: what a joint can do is not known
  constexpr double kEnough = 0.85;
  constexpr double kDegrees = 180.0 / std::numbers::pi;
  for (std::size_t i = 0; i < kRoll; ++i) {
    const double all = 2 * kind_.farthest[i];
    const double moved = calibration_[i].width() * Calibration::kStep;
    if (kind_.farthest[i] > kWholeTurn || moved >= kEnough * all) continue;
    std::fprintf(stderr,
                 "%s was moved through only %.0f of %.0f deg during its calibration: its zero may "
                 "be wrong by up to %.0f deg. Calibrate it again\n",
                 kJointNames[i], moved * kDegrees, all * kDegrees, (all - moved) / 2 * kDegrees);
  }
}

/// A rate that the bus does not reach would be a row of missed readings.
void ServoArm::check_rate() {
  constexpr int kTransfers = 20;
  std::array<std::int64_t, kTransfers> times{};
  for (std::int64_t& each : times) {
    chain_->request(0, {});
    chain_->collect(now() + kStartWait);
    each = now() - chain_->asked_at();
  }
  std::ranges::sort(times);
  const std::int64_t most = times[kTransfers - 1 - kTransfers / 20];
  if (config_.answer_timeout > 0.0 || most <= period_) return;
  std::array<char, 200> text{};
  std::snprintf(text.data(), text.size(),
                "the bus answers within %.1f ms (95 %%): %.0f Hz are possible, not %.0f Hz. "
                "Is this an ESP32 board, or an FTDI adapter with a latency of 16 ms?",
                static_cast<double>(most) * 1e-6, std::floor(0.9e9 / static_cast<double>(most)),
                1e9 / static_cast<double>(period_));
  throw std::runtime_error(text.data());
}

void ServoArm::refuse_if_gone() const {
  if (chain_->has_port()) return;
  throw std::runtime_error("the adapter " + lasting_name_ + " is unplugged");
}

/// Two complete readings that agree, inside what the servos do not clamp.
void ServoArm::find_place() {
  constexpr int kTries = 10;
  bool known = false;
  bool agree = false;
  std::size_t differs = 0;
  for (int i = 0; i < kTries && !agree; ++i) {
    chain_->request(0, {});
    const ServoChain::Transfer transfer = chain_->collect(now() + kStartWait);
    if (transfer.answered != chain_->all()) continue;
    agree = known;
    for (std::size_t k = 0; k < kServos; ++k) {
      if (std::abs((*chain_)[k].position - servos_[k].position) > kAgreement)
        agree = false, differs = k;
      servos_[k].position = (*chain_)[k].position;
      servos_[k].seen_at = complete_at_ = chain_->asked_at();
    }
    known = true;
  }
  refuse_if_gone();
  if (!agree) refuse(differs, "moved between its readings: the arm must be still while it starts");
  for (std::size_t i = 0; i < kServos; ++i) {
    const Calibration& range = calibration_[i];
    const int position = servos_[i].position;
    const bool inside = position >= range.smallest - kEdge && position <= range.largest + kEdge;
    if (!inside && !config_.leader) {
      refuse(i, "stands at step " + std::to_string(position) + ", outside its range " +
                    std::to_string(range.smallest) + ".." + std::to_string(range.largest) +
                    ": move it inside by hand, or calibrate it again");
    }
    name_alarm(i);
    if (why_[0] != 0) throw std::runtime_error(why_.data());
  }
}

/// Goals and gentle registers, read back, before torque. Torque that is found on stays as it is:
/// with less strength the arm would sink.
void ServoArm::begin_to_hold() {
  const auto check = [&](std::size_t servo, const Setting& wanted) {
    const std::optional<int> found = chain_->read(servo, wanted.where);
    if (found == wanted.value) return;
    refuse_if_gone();
    if (!found) refuse(servo, "does not answer: check its plug and the plug before it");
    refuse(servo, "does not keep the value written to its register " +
                      std::to_string(static_cast<int>(wanted.where.address)));
  };
  approach(chain_->all());
  start_places_ = held_places_;
  chain_->send_queued();
  for (std::size_t i = 0; i < kServos; ++i) {
    if (!holds(i)) check(i, chain_->strength(i, strength_of(i, kGentleStrength)));
    check(i, chain_->goal(i, held_places_[i]));
  }
  chain_->queue_torque(chain_->all(), true);
  chain_->send_queued();
  for (std::size_t i = 0; i < kServos; ++i) check(i, chain_->torque(true));
  chain_->watch(true);
  held_ = chain_->all();
  started_ = true;
  while (settling_ > 0 && why_[0] == 0) {
    chain_->request(0, {});
    const ServoChain::Transfer transfer = chain_->collect(deadline());
    take(transfer);
    refuse_if_gone();
    if (transfer.asked) look_for_trouble(transfer);
    settle();
    sleep_until(chain_->asked_at() + period_);
  }
}

}  // namespace o80::arms
