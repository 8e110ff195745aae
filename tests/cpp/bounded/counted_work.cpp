#include "bounded/counted_work.hpp"

#include <utility>
#include <vector>

namespace {

std::vector<std::uint32_t> visited_in(1U << 18);  // the period in which a block was last seen
std::uint32_t period = 1;
o80::test::CountedWork work;

}  // namespace

namespace o80 {

void visit_block(std::uint32_t block) noexcept {
  ++work.visits;
  if (std::exchange(visited_in[block], period) != period) ++work.blocks;
}

void count(Work what) noexcept { ++work.counts.at(static_cast<std::size_t>(what)); }

test::CountedWork test::work_since_last_asked() noexcept {
  ++period;
  return std::exchange(work, {});
}

}  // namespace o80
