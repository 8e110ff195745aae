#include "robot/group/row_gather.hpp"

#include <algorithm>
#include <cstring>

#include "describe/visit_number.hpp"

namespace o80 {

namespace {

double number_at(const std::byte* row, const RowNumber& from) noexcept {
  return visit_number(from.kind, [&](auto number) {
    std::memcpy(&number, row + from.at, sizeof number);
    return static_cast<double>(number);
  });
}

bool compares(double number, EventFlag::Compare how, double value) noexcept {
  switch (how) {
    case EventFlag::Compare::equal:
      return number == value;
    case EventFlag::Compare::unequal:
      return number != value;
    case EventFlag::Compare::less:
      return number < value;
    case EventFlag::Compare::less_equal:
      return number <= value;
    case EventFlag::Compare::greater:
      return number > value;
    case EventFlag::Compare::greater_equal:
      return number >= value;
  }
  return false;
}

}  // namespace

void RowGather::read(const std::byte* row, std::span<float> observation,
                     std::span<std::uint8_t> raised) const noexcept {
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const GatheredNumber& wanted = numbers[i];
    double number = (number_at(row, wanted.from) - wanted.offset) * wanted.scale;
    if (wanted.low < wanted.high) number = std::clamp(number, wanted.low, wanted.high);
    observation[i] = static_cast<float>(number);
  }
  for (std::size_t i = 0; i < flags.size(); ++i) {
    const EventFlag& flag = flags[i];
    raised[i] = compares(number_at(row, flag.from), flag.compare, flag.value) ? 1 : 0;
  }
}

}  // namespace o80
