// A plain loop without o80, by which absolute budgets are scaled: copies of 1 kB.

#include <array>
#include <cstddef>
#include <cstring>

#include "sample.hpp"

namespace o80::bench {
namespace {

constexpr int kCopies = 20'000;
constexpr std::size_t kBytes = 1024;

double copying() {
  static std::array<std::array<std::byte, kBytes>, 16> buffers{};
  return nanoseconds([] {
           for (int i = 0; i < kCopies; ++i) {
             std::byte* to = buffers[(i + 1) % 16].data();
             std::memcpy(to, buffers[i % 16].data(), kBytes);
             asm volatile("" : : "r"(to) : "memory");  // it is used
           }
         }) /
         kCopies;
}

}  // namespace
}  // namespace o80::bench

int main(int argc, char** argv) {
  o80::bench::take_priority();
  o80::bench::copying();
  for (int round = 0; round < o80::bench::rounds_of(argc, argv); ++round) {
    o80::bench::sample("plain_cpp", "ns", o80::bench::copying());
  }
}
