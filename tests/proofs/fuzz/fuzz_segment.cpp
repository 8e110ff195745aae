// Damaged files: a good segment with bytes of any part of both its files changed, cut or
// stretched. Whoever attaches to it works or is told what is wrong, and goes on.

#include <fcntl.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <vector>

#include "fuzz/bytes.hpp"
#include "fuzz/robot.hpp"
#include "memory/file_bytes.hpp"
#include "memory/private_directory.hpp"
#include "memory/segment/owned_segment.hpp"
#include "memory/segment/segment_file.hpp"
#include "memory/segment/segment_name.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/segment_list.hpp"
#include "o80/runtime/backend.hpp"
#include "o80/runtime/frontend.hpp"
#include "o80/runtime/journal.hpp"
#include "o80/runtime/typed_frontend.hpp"
#include "runtime/frontend/link.hpp"

namespace o80::fuzz {
namespace {

constexpr std::size_t kMaxBytes = 1U << 20;  // of a file

/// The segment file and the commanders' file.
using Files = std::array<std::vector<char>, 2>;

/// A part of one of them.
struct Part {
  std::size_t file, begin, end;
};

/// A good segment of a few rows, as its backend left it when it was killed.
class Original {
 public:
  Original() {
    UntypedBackend backend(schema_of_robot(),
                           {.segment = "robot", .history = 4, .lanes = 2, .lane_blocks = 16});
    backend.publish();
    UntypedFrontend frontend("robot");
    offsets_ = frontend.link()->segment.view().offsets;
    paths_ = {segment_path("robot"), commands_path("robot", frontend.epoch())};
    const double target = 0.5;
    for (int i = 0; i < 6; ++i) {
      frontend.add_command(0, std::as_bytes(std::span(&target, 1)));
      frontend.pulse();
      if (backend.try_step() == Step::run) backend.publish();
    }
    for (std::size_t i = 0; i < files_.size(); ++i) {
      files_[i] = o80::read_all(paths_[i]);
    }
  }

  const std::string& path(std::size_t file) const { return paths_[file]; }
  const Files& files() const { return files_; }
  Part part(std::uint32_t which) const {
    const SegmentOffsets& at = offsets_;
    const Part parts[] = {{0, 0, at.schema},
                          {0, at.schema, at.provenance},
                          {0, at.counters, at.history},
                          {0, at.history, at.journal},
                          {1, 0, at.wakes},
                          {1, at.wakes, at.bell},
                          {1, at.bell, at.lanes},
                          {1, at.lanes, at.feedback},
                          {1, at.feedback, at.feedback + at.statuses},
                          {1, at.feedback + at.statuses, at.commands_bytes},
                          {0, at.journal, at.file_bytes},
                          {0, at.provenance, at.counters}};
    return parts[which % std::size(parts)];
  }

 private:
  PrivateDirectory directory_;
  SegmentOffsets offsets_{};
  std::array<std::string, 2> paths_;
  Files files_;
};

/// The original as the fuzzer wants it.
Files lie(const Original& original, Bytes& bytes) {
  Files files = original.files();
  while (!bytes.empty()) {
    const auto what = bytes.number<std::uint8_t>();
    const auto [which, begin, end] = original.part(what >> 4);
    std::vector<char>& file = files[which];
    switch (what & 7) {
      case 0:
        file.resize(std::min<std::size_t>(bytes.number<std::uint32_t>(), kMaxBytes));
        break;
      case 1:
        file.resize(begin + bytes.below(16));
        break;
      case 2:
      case 3: {  // bytes of its own
        const std::size_t at = begin + bytes.below(static_cast<std::uint32_t>(end - begin));
        const auto with = bytes.take(bytes.number<std::uint8_t>());
        if (at + with.size() <= file.size() && !with.empty())
          std::memcpy(file.data() + at, with.data(), with.size());
        break;
      }
      default: {  // a word that means something, most often near the beginning of its part
        const std::uint32_t within = static_cast<std::uint32_t>(end - begin) / 8;
        const std::size_t at = begin + 8 * bytes.below((what & 7) < 7 ? 32 : within);
        const std::uint64_t word = bytes.word();
        if (at + 8 <= file.size()) std::memcpy(file.data() + at, &word, 8);
      }
    }
  }
  return files;
}

constexpr Timeout kAtOnce = std::chrono::nanoseconds(0);

template <class Call>
void may_refuse(Call&& call) {
  try {
    call();
  } catch (const Error&) {
    return;
  }
}

void read_all(UntypedFrontend& frontend) {
  may_refuse([&] { frontend.provenance(); });
  may_refuse([&] { frontend.latest(); });
  may_refuse([&] { frontend.history(3); });
  may_refuse([&] { frontend.history(0, 1'000'000); });
  may_refuse([&] { frontend.wait_for(2, kAtOnce); });
  may_refuse([&] { frontend.wait_for(frontend.published(), kAtOnce); });
  std::vector<std::byte> row(frontend.layout().size);
  Iteration position = 0;
  for (int i = 0; i < 8; ++i)
    may_refuse([&] { frontend.wait_for_next(position, row.data(), kAtOnce); });
  may_refuse([&] {
    Journal journal(frontend);
    JournalEntry entry;
    // no entry is shorter than the status that it gives
    const std::uint64_t most = frontend.link()->segment.view().shape.journal_bytes / 16;
    for (std::uint64_t i = 0; journal.next(entry); ++i) {
      if (i > most) std::abort();
    }
  });
}

void command(UntypedFrontend& frontend) {
  may_refuse([&] {
    const double target = 0.25;
    frontend.add_command(0, std::as_bytes(std::span(&target, 1)), {.pace = iterations(3)});
    const Batch batch = frontend.pulse();
    batch.handles();
    batch.ended();
    batch.first_iteration();
    batch.rejection();
    batch.wait(kAtOnce);
  });
  may_refuse([&] { frontend.burst(2, kAtOnce); });
  may_refuse([&] {
    frontend.add_purge();
    frontend.pulse_and_wait(kAtOnce);
  });
}

void attach(const FrontendOptions& options) {
  may_refuse([&] {
    UntypedFrontend frontend("robot", options);
    read_all(frontend);
    if (options.access == Access::read_write) command(frontend);
    frontend.life();
  });
  may_refuse([&] { Frontend<Robot>("robot", options).latest(); });
}

}  // namespace

void run(Bytes bytes) {
  static const Original original;
  const bool alive = bytes.number<std::uint8_t>() % 2 == 0;
  const Files files = lie(original, bytes);
  for (std::size_t i = 0; i < files.size(); ++i) {
    write_all(original.path(i), files[i]);
  }
  list_segments();
  if (alive) {
    // somebody holds both bytes 0: it looks like the segment of a living backend
    LockFile segment = LockFile::open(original.path(0), O_RDWR);
    LockFile commands = LockFile::open(original.path(1), O_RDWR);
    if (!segment.try_lock(kBackendByte) || !commands.try_lock(kBackendByte)) std::abort();
    attach({.timeout = kAtOnce});
    attach({.timeout = kAtOnce, .access = Access::read_only});
  }
  attach({.timeout = kAtOnce, .access = Access::read_only, .dead = true});
  attach({.timeout = kAtOnce, .dead = true});
  // and a new backend comes whatever it finds
  OwnedSegment::create(
      {.name = "robot", .schema = {}, .row_bytes = 64, .rows = 1, .lanes = 1, .lane_blocks = 1});
  if (std::filesystem::exists(original.path(0))) std::abort();
  clean_dead();
  if (std::filesystem::exists(original.path(1))) std::abort();
}

}  // namespace o80::fuzz
