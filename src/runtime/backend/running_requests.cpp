#include "runtime/backend/running_requests.hpp"

#include <algorithm>
#include <iterator>

#include "memory/os/atomic_words.hpp"

namespace o80 {

bool RunningRequests::may_begin(std::uint32_t request, ShortText<248>& why) const noexcept {
  if (const Entry* other = find(request)) {
    why.add("'")
        .add(schema_.requests[request].name.view())
        .add("' has been running since iteration ");
    why.add(other->shown.since).add(": wait for its end");
    return false;
  }
  if (std::ranges::all_of(entries_, &Entry::runs)) {
    why.add(kMaxRunning).add(" requests are running, the maximum: wait for the end of one");
    return false;
  }
  return true;
}

void RunningRequests::begin(std::uint32_t request, std::uint32_t lane, std::uint64_t id,
                            BlockIndex record, Iteration now, std::string_view progress) noexcept {
  const auto free = std::ranges::find(entries_, false, &Entry::runs);
  if (free == entries_.end()) return;  // see may_begin
  *free = {};
  free->runs = true;
  ++count_;
  free->record = record;
  free->shown.request = request;
  free->shown.lane = lane;
  free->shown.id = id;
  free->shown.since = now;
  const auto& owner = view_.lane(lane).owner;
  load_text(owner, std::size(owner), free->shown.who.data());
  show(*free, progress);
}

void RunningRequests::show(Entry& entry, std::string_view progress) noexcept {
  auto& text = entry.shown.progress;
  text.fill(0);
  std::ranges::copy(progress.substr(0, text.size() - 1), text.begin());
  const auto place = static_cast<std::size_t>(&entry - entries_.data());
  show_running(view_.counters().running[place], ++writes_, entry.shown);
}

void RunningRequests::show_progress(std::uint32_t request, std::string_view progress) noexcept {
  Entry* entry = find(request);
  if (entry == nullptr) return;
  // a driver may repeat the same text with each reading
  if (entry->shown.progress_text() == progress.substr(0, entry->shown.progress.size() - 1)) return;
  show(*entry, progress);
}

void RunningRequests::note_end(std::uint32_t request, const Served& how) noexcept {
  Entry* entry = find(request);
  if (entry != nullptr && !entry->end) entry->end = how;
}

void RunningRequests::forget(Entry& entry) noexcept {
  hide_running(view_.counters().running[static_cast<std::size_t>(&entry - entries_.data())]);
  if (entry.runs) --count_;
  entry = {};
}

const RunningRequests::Entry* RunningRequests::find(std::uint32_t request) const noexcept {
  const auto found = std::ranges::find_if(
      entries_, [&](const Entry& entry) { return entry.runs && entry.shown.request == request; });
  return found == entries_.end() ? nullptr : &*found;
}

const RunningRequests::Entry* RunningRequests::find_wanting_fresh_start() const noexcept {
  const auto found = std::ranges::find_if(entries_, [](const Entry& entry) {
    return entry.runs && entry.end && entry.end->kind == Served::Kind::start_afresh;
  });
  return found == entries_.end() ? nullptr : &*found;
}

bool RunningRequests::moves() const noexcept {
  return std::ranges::any_of(
      entries_, [&](const Entry& entry) { return entry.runs && !is_while_halted(entry); });
}

bool RunningRequests::moves(std::uint32_t lane) const noexcept {
  return std::ranges::any_of(entries_, [&](const Entry& entry) {
    return entry.runs && entry.shown.lane == lane && !is_while_halted(entry);
  });
}

}  // namespace o80
