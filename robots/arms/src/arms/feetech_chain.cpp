#include "arms/feetech_chain.hpp"

#include <algorithm>

namespace o80::arms {

using feetech::Answer;
using feetech::Register;
using feetech::Value;

void FeetechChain::open(SerialPort port, double patience) {
  port_ = std::move(port);
  set_up_wait_ = std::max(kSetUpWait, static_cast<std::int64_t>(patience * 1e9));
}

std::optional<Answer> FeetechChain::answer_to(std::size_t servo, std::size_t size) {
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

bool FeetechChain::ping(std::size_t servo) {
  for (int i = 0; i < kTries; ++i) {
    requests_.ping(ids_[servo]);
    if (answer_to(servo, 0)) return true;
  }
  return false;
}

std::optional<int> FeetechChain::read(std::size_t servo, Register where) {
  for (int i = 0; i < kTries; ++i) {
    // a number of bytes of its own for each question: an answer to another one is known by it
    question_ = static_cast<std::uint8_t>((question_ + 1) % kLengths);
    const auto size = static_cast<std::uint8_t>(2 + question_);
    requests_.read(ids_[servo], where.address, size);
    const std::optional<Answer> answer = answer_to(servo, size);
    if (!answer) continue;
    states_[servo].status = answer->status;
    return where.size == 1 ? answer->data[0] : feetech::number_at(answer->data, 0);
  }
  return std::nullopt;
}

bool FeetechChain::send_queued() noexcept {
  const bool sent = port_.write(requests_.bytes());
  requests_.clear();
  return sent;
}

void FeetechChain::queue(Register where, Mask servos,
                         std::span<const std::uint16_t> values) noexcept {
  std::array<Value, kMost> each{};
  std::size_t size = 0;
  for (std::size_t i = 0; i < count_; ++i) {
    if ((servos >> i & 1) != 0) each[size++] = {ids_[i], values[i]};
  }
  requests_.sync_write(where, std::span(each).first(size));
}

void FeetechChain::queue(Register where, Mask servos, std::uint16_t value) noexcept {
  std::array<std::uint16_t, kMost> values{};
  values.fill(value);
  queue(where, servos, values);
}

void FeetechChain::request(Mask servos, std::span<const int> goals) noexcept {
  asking_ = false;
  const bool was_silent = !port_.discard_input();
  answers_.clear();
  if (failed_ && !was_silent) heard_at_ = now();
  if (!port_.is_open()) return requests_.clear();
  if (failed_ && now() - heard_at_ < kQuiet) return;
  if (unanswered_ >= kMissing && now() - asked_at_ < kRarely) return;

  // queued, goals, question => one system call
  std::array<std::uint16_t, kMost> steps{};
  for (std::size_t i = 0; i < goals.size(); ++i) steps[i] = feetech::with_sign_bit(goals[i], 15);
  queue(feetech::kGoal, servos, steps);
  asked_torque_ = ++transfers_ >= kTorqueEvery;
  const Register first = asked_torque_ ? feetech::kTorque : feetech::kPosition;
  const int extra = feetech::kPosition.address - first.address + kShortest + question_;
  asked_size_ = static_cast<std::uint8_t>(extra);
  requests_.sync_read(first.address, asked_size_, std::span(ids_).first(count_));
  asked_at_ = now();
  asking_ = port_.write(requests_.bytes());
  requests_.clear();
}

void FeetechChain::receive() noexcept {
  const std::size_t count = port_.read(answers_.room());
  answers_.arrived(count);
  if (count > 0) heard_at_ = now();
}

bool FeetechChain::take(const Answer& answer, Transfer& transfer) noexcept {
  const auto* const place = std::find(ids_.begin(), ids_.begin() + count_, answer.id);
  const auto i = static_cast<std::size_t>(place - ids_.begin());
  const Mask bit = Mask{1} << i;
  if (i == count_ || answer.data.size() != asked_size_ || (transfer.answered & bit) != 0) {
    return false;
  }
  std::span<const std::uint8_t> data = answer.data;
  ServoState& state = states_[i];
  if (asked_torque_) {
    state.torque = data[0] != 0;
    transfer.torque_known |= bit;
    data = data.subspan(feetech::kPosition.address - feetech::kTorque.address);
  }
  state.position = feetech::signed_by_bit(feetech::number_at(data, 0), 15);
  state.speed = feetech::signed_by_bit(feetech::number_at(data, 2), 15);
  state.load = feetech::signed_by_bit(feetech::number_at(data, 4), 10);
  state.voltage = data[6];
  state.temperature = data[7];
  state.status = answer.status;
  transfer.answered |= bit;
  return true;
}

FeetechChain::Transfer FeetechChain::collect(std::int64_t deadline) noexcept {
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
      if (!take(*answer, transfer)) ++transfer.late;
    }
  } while (transfer.answered != all() && port_.wait_readable(deadline));
  transfer.damaged = answers_.damaged() - damaged;
  asking_ = false;
  failed_ = transfer.answered != all();
  unanswered_ = transfer.answered == 0 ? unanswered_ + 1 : 0;
  if (failed_) question_ = static_cast<std::uint8_t>((question_ + 1) % kLengths);
  if (asked_torque_ && !failed_) transfers_ = 0;
  return transfer;
}

}  // namespace o80::arms
