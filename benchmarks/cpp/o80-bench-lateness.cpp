// Lateness of the last rows of a running backend, a line each, as cyclictest prints its own.
// Arguments: segment, number of rows.

#include <cstdio>
#include <cstdlib>

#include "o80/o80.hpp"

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const o80::UntypedFrontend frontend(argv[1], {.access = o80::Access::read_only});
  const o80::Rows rows = frontend.history(static_cast<std::size_t>(std::atol(argv[2])));
  for (std::size_t i = 0; i < rows.count; ++i) {
    std::printf("%lld\n",
                static_cast<long long>(o80::unpack<o80::RowHead>(rows.row(i).data()).lateness));
  }
}
