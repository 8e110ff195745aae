#pragma once

#include <cstdint>

/// Counters for tests that check the work of an iteration: visited blocks of the pool, and the
/// operations of Work.
///
/// Compiles to nothing unless O80_COUNT_BLOCKS is defined. With it, the test defines the functions.
#ifdef O80_COUNT_BLOCKS
namespace o80 {
enum class Work : std::uint8_t {
  batch_taken,
  status_told,
  queue_dropped,  // the queue of one actuator
  speed_change,   // a VelocityChange was planned
  trapezoid,      // one that it tried
  smooth_motion   // a SmoothMotion was planned
};
void visit_block(std::uint32_t block) noexcept;
void count(Work work) noexcept;
}  // namespace o80
#define O80_VISIT_BLOCK(block) ::o80::visit_block(block)
#define O80_COUNT(work) ::o80::count(::o80::Work::work)
#else
#define O80_VISIT_BLOCK(block) static_cast<void>(0)
#define O80_COUNT(work) static_cast<void>(0)
#endif
