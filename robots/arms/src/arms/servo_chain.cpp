#include "arms/servo_chain.hpp"

#include <algorithm>
#include <bit>
#include <stdexcept>
#include <utility>

namespace o80::arms {

ServoChain::ServoChain(std::size_t count, Requests& requests, Answers& answers, Register torque,
                       Register goal)
    : count_(count), requests_(requests), answers_(answers), torque_(torque), goal_(goal) {
  for (std::size_t i = 0; i < count; ++i) ids_[i] = static_cast<std::uint8_t>(i + 1);
}

void ServoChain::open(SerialPort port, double patience) {
  port_ = std::move(port);
  set_up_wait_ = std::max(kSetUpWait, static_cast<std::int64_t>(patience * 1e9));
}

std::optional<Answer> ServoChain::answer_to(std::size_t servo, std::size_t size) {
  port_.discard_input();
  answers_.clear();
  const bool sent = send_queued();
  const std::int64_t deadline = now() + set_up_wait_;
  while (sent && port_.wait_readable(deadline)) {
    receive();
    while (const std::optional<Answer> answer = answers_.next()) {
      if (answer->id == ids_[servo] && answer->data.size() == size) return answer;
    }
  }
  return std::nullopt;
}

std::optional<int> ServoChain::read(std::size_t servo, Register where) {
  for (int i = 0; i < kTries; ++i) {
    // a number of bytes of its own for each question: an answer to another one is known by it
    variant_ = static_cast<std::uint8_t>((variant_ + 1) % kVariants);
    const auto size = static_cast<std::uint8_t>(where.size + variant_);
    requests_.read(ids_[servo], where.address, size);
    const std::optional<Answer> answer = answer_to(servo, size);
    if (answer) return number_of(where, answer->data);
  }
  return std::nullopt;
}

int ServoChain::needed(std::size_t servo, Register where) {
  const std::optional<int> value = read(servo, where);
  if (value) return *value;
  throw std::runtime_error("does not answer: check its plug and the plug before it");
}

bool ServoChain::find(std::size_t servo) {
  const std::optional<int> torque = read(servo, torque_);
  states_[servo].torque = torque.value_or(0) != 0;
  return torque.has_value();
}

bool ServoChain::send_queued() noexcept {
  const bool sent = port_.write(requests_.bytes());
  requests_.clear();
  return sent;
}

void ServoChain::queue(Register where, Mask servos, std::span<const int> values) noexcept {
  std::array<Value, kMost> each{};
  std::size_t size = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    if ((servos >> i & 1) != 0) each[size++] = {ids_[i], values[i]};
  }
  requests_.sync_write(where, std::span(each).first(size));
}

void ServoChain::queue(Register where, Mask servos, int value) noexcept {
  std::array<int, kMost> values{};
  values.fill(value);
  queue(where, servos, values);
}

void ServoChain::queue_goals(Mask servos, std::span<const int> goals) noexcept {
  std::array<int, kMost> values{};
  for (std::size_t i = 0; i < goals.size(); ++i) values[i] = goal(i, goals[i]).value;
  queue(goal_, servos, values);
}

void ServoChain::queue_motion(Mask servos, double speed, double acceleration,
                              std::span<const double> strengths) noexcept {
  // servos of one register => one packet
  const auto queue_each = [&](auto&& setting) {
    for (Mask left = servos; left != 0;) {
      const Register where = setting(static_cast<std::size_t>(std::countr_zero(left))).where;
      std::array<int, kMost> values{};
      Mask together = 0;
      for (std::size_t i = 0; i < count_; ++i) {
        const Setting each = setting(i);
        values[i] = each.value;
        if (each.where.address == where.address) together |= left & Mask{1} << i;
      }
      queue(where, together, values);
      left &= ~together;
    }
  };
  queue_each([&](std::size_t) { return this->acceleration(acceleration); });
  queue_each([&](std::size_t i) { return this->speed(i, speed); });
  queue_each([&](std::size_t i) { return strength(i, strengths[i]); });
}

void ServoChain::request(Mask servos, std::span<const int> goals) noexcept {
  asking_ = false;
  const bool was_silent = !port_.discard_input();
  answers_.clear();
  if (failed_ && !was_silent) heard_at_ = now();
  if (!port_.is_open()) return requests_.clear();
  if (failed_ && now() - heard_at_ < kQuiet) return;
  if (unanswered_ >= kMissing && now() - asked_at_ < kRarely) return;

  // queued, goals, question => one system call
  if (watched_ && now() - asked_at_ > kPause) queue_watchdog(true);
  queue_goals(servos, goals);
  ask(variant_);
  asked_at_ = now();
  asking_ = send_queued();
}

void ServoChain::receive() noexcept {
  const std::size_t count = port_.read(answers_.room());
  answers_.arrived(count);
  if (count > 0) heard_at_ = now();
}

int ServoChain::number(std::size_t servo, const Answer& answer, Register where) const noexcept {
  return number_of(where, answer.data.subspan(where.address - asked_[servo].first));
}

/// Takes an answer; false if it is none to this question.
bool ServoChain::counts(const Answer& answer, Transfer& transfer) noexcept {
  const auto* const place = std::find(ids_.begin(), ids_.begin() + count_, answer.id);
  const auto i = static_cast<std::size_t>(place - ids_.begin());
  const Mask bit = Mask{1} << i;
  if (i == count_ || answer.data.size() != asked_[i].size || (transfer.answered & bit) != 0) {
    return false;
  }
  if (asked_[i].first <= torque_.address) {
    states_[i].torque = number(i, answer, torque_) != 0;
    transfer.torque_known |= bit;
  }
  take(i, answer);
  transfer.answered |= bit;
  return true;
}

ServoChain::Transfer ServoChain::collect(std::int64_t deadline) noexcept {
  Transfer transfer{.asked = asking_};
  if (!asking_) {
    // until something may be sent again
    while (failed_ && port_.wait_readable(std::min(deadline, heard_at_ + kQuiet))) {
      if (port_.discard_input()) heard_at_ = now();
    }
    return transfer;
  }
  const std::uint32_t damaged = answers_.damaged();
  do {
    receive();
    while (const std::optional<Answer> answer = answers_.next()) {
      if (!counts(*answer, transfer)) ++transfer.late;
    }
  } while (transfer.answered != all() && port_.wait_readable(deadline));
  transfer.damaged = answers_.damaged() - damaged;
  asking_ = false;
  failed_ = transfer.answered != all();
  unanswered_ = transfer.answered == 0 ? unanswered_ + 1 : 0;
  if (failed_) variant_ = static_cast<std::uint8_t>((variant_ + 1) % kVariants);
  return transfer;
}

}  // namespace o80::arms
