#include "torture/labels.hpp"

namespace torture {

namespace {

constexpr Label kBackend[] = {{"create.before_lock", 1},
                              {"create.after_lock", 1},
                              {"create.after_draft", 1},
                              {"create.before_link", 1},
                              {"create.after_link", 1},
                              {"create.before_rename", 1},
                              {"create.after_rename", 1},
                              {"create.after_former", 1},
                              {"sweep.before_draft", 1},
                              {"sweep.after_draft", 1},
                              {"sweep.after_commands", 1},
                              {"segment.before_state", 1},
                              {"segment.after_state", 1},
                              {"segment.before_end", 1},
                              {"segment.after_end", 1},
                              {"segment.before_unlink", 1},
                              {"segment.between_unlinks", 1},
                              {"segment.after_unlink", 1},
                              {"history.before_begun", 200},
                              {"history.before_row", 200},
                              {"history.before_published", 200},
                              {"history.after_published", 200},
                              {"journal.before_begun", 200},
                              {"journal.before_entry", 200},
                              {"journal.before_published", 200},
                              {"journal.after_published", 200},
                              {"rows.before_reset", 40},
                              {"rows.before_wake", 40},
                              {"rows.after_wake", 40},
                              {"status.before_id", 80},
                              {"status.before_word", 80},
                              {"status.after_word", 80},
                              {"message.before_text", 4},
                              {"message.before_id", 4},
                              {"events.before", 30},
                              {"events.after", 30},
                              {"lane.before_freed", 30},
                              {"lane.after_freed", 30},
                              {"backend.after_take", 30},
                              {"backend.after_step", 100},
                              {"staged.before", 20},
                              {"staged.after", 20},
                              {"halt.before_count", 2},
                              {"halt.after_count", 2},
                              {"halt.before_reason", 4},
                              {"halt.before_number", 4}};

/// Beside those of every backend.
constexpr Label kBursting[] = {{"burst.before", 30},    {"burst.before_row", 30},
                               {"burst.before_id", 30}, {"burst.before_newest", 30},
                               {"burst.after", 30},     {"bell.before_sleep", 20},
                               {"bell.after_sleep", 20}};

constexpr Label kSender[] = {
    {"lane.after_lock", 1},        {"lane.before_dead", 1},   {"lane.before_incarnation", 1},
    {"lane.after_incarnation", 1}, {"lane.before_copy", 20},  {"lane.before_ticket", 20},
    {"lane.before_commit", 20},    {"lane.after_commit", 20}, {"bell.before_ring", 20},
    {"bell.after_ring", 20},       {"lane.before_close", 1},  {"lane.after_close", 1},
    {"lane.before_ids", 20},       {"lane.before_sleep", 10}, {"lane.after_sleep", 10},
    {"halt.after_count", 3},       {"halt.before_number", 3}};

constexpr Label kHalter[] = {{"halt.before_count", 10},     {"halt.after_count", 10},
                             {"halt.before_reason", 10},    {"halt.before_number", 10},
                             {"bell.before_ring", 10},      {"bell.after_ring", 10},
                             {"lane.after_incarnation", 1}, {"lane.before_commit", 10},
                             {"lane.after_commit", 10},     {"lane.after_sleep", 10}};

constexpr Label kReader[] = {
    {"rows.before_register", 10}, {"rows.before_sleep", 10}, {"rows.before_pass_on", 5}};

}  // namespace

std::span<const Label> labels_of(Role role) {
  switch (role) {
    case Role::backend:
      return kBackend;
    case Role::bursting_backend:
      return kBursting;
    case Role::commander:
    case Role::burster:
    case Role::group_burster:
      return kSender;
    case Role::halter:
      return kHalter;
    case Role::reader:
      return kReader;
    default:
      return {};
  }
}

}  // namespace torture
