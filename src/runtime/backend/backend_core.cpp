#include "runtime/backend/backend_core.hpp"

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <utility>

#include "runtime/backend/backend_options.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

BackendCore::BackendCore(Schema&& given, const BackendOptions& options,
                         RequestServer* server_or_null, RecordedDecisions* recorded_or_null,
                         StatusSink& statuses)
    : schema(prepared(std::move(given), options)),
      layout(row_layout(schema)),
      provenance(provenance_of(schema, options)),
      segment(segment_of(schema, provenance, options)),
      history(segment.view()),
      journal(segment.view()),
      row_signal(segment.view()),
      bell(segment.view()),
      lanes(segment.view(), offsetof(BatchRecord, ticket)),
      liveness(segment),
      pool(lanes.size() * segment.view().shape.lane_blocks),
      controller(schema, pool, statuses, lanes.size()),
      schedule(lanes.size()),
      running(schema, segment.view()),
      server(server_or_null),
      recorded(recorded_or_null),
      row_(layout.size / 8) {}

std::int64_t BackendCore::real_time() const noexcept {
  return recorded == nullptr ? monotonic_now() : recorded->time(current);
}

void BackendCore::note_failure(std::string_view text) noexcept {
  const std::size_t size = std::min(text.size(), failure.size() - 1);
  std::memcpy(failure.data(), text.data(), size);
  failure[size] = 0;
}

void BackendCore::end_running(RunningRequests::Entry& entry, const Outcome& outcome) noexcept {
  const BlockIndex record = entry.record;
  running.forget(entry);
  controller.end(record, outcome, current);
}

void BackendCore::drop_running(const Outcome& outcome) noexcept {
  const bool is_halt = outcome.status == Status::halted;
  running.each([&](RunningRequests::Entry& entry) {
    if (!is_halt || !running.is_while_halted(entry)) end_running(entry, outcome);
  });
}

}  // namespace o80
