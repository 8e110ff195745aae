#include "bounded/counted_work.hpp"

#include <utility>
#include <vector>

#include "control/motion/visit_block.hpp"

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

void count(Work what) noexcept {
  switch (what) {
    case Work::batch_taken:
      ++work.batches;
      break;
    case Work::status_told:
      ++work.statuses;
      break;
    case Work::queue_dropped:
      ++work.drops;
      break;
    case Work::speed_change:
      ++work.speed_changes;
      break;
    case Work::trapezoid:
      ++work.trapezoids;
      break;
    case Work::smooth_motion:
      ++work.smooth_motions;
  }
}

test::CountedWork test::work_since_last_asked() noexcept {
  ++period;
  return std::exchange(work, {});
}

}  // namespace o80
