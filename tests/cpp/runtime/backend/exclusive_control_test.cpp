// Who has control, from when until when, and who has a say in it.

#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::HasSubstr;
using ExclusiveControl = StationTest;

// rule B5
TEST_F(ExclusiveControl, WhoHasControlHasItAlone) {
  StartedStation station;
  UntypedFrontend holder("pair");
  UntypedFrontend other("pair");
  const Batch before = send(other, 1, 5.0, {.pace = iterations(5)});
  station.run(1);
  holder.add_take_control();
  const Batch taken = holder.pulse();
  station.run(1);
  EXPECT_EQ(taken.handle(0).status, Status::completed);

  const Batch commands = send(other, 0, 1.0);
  other.add_purge();
  const Batch purge = other.pulse();
  add_request(other, Reset{});
  const Batch request = other.pulse();
  other.add_take_control();
  const Batch control = other.pulse();
  station.run(1);
  for (const Batch& batch : {commands, purge, request, control}) {
    EXPECT_EQ(batch.handle(0).status, Status::rejected);
    EXPECT_EQ(batch.handle(0).reason, Reason::exclusive);
    EXPECT_THAT(batch.rejection(), HasSubstr("pid " + std::to_string(getpid())));
    EXPECT_THAT(batch.rejection(), HasSubstr("has exclusive control"));
  }
  EXPECT_EQ(before.handle(0).status, Status::active) << "what was taken before goes on";
  other.add_mark("a note needs no control");
  const Batch mark = other.pulse();
  other.add_mark("a note beside a command");
  const Batch mixed = send(other, 0, 1.0);
  station.run(1);
  EXPECT_EQ(mark.handle(0).status, Status::completed);
  EXPECT_EQ(mixed.handle(0).reason, Reason::exclusive);

  holder.add_release_control();
  holder.pulse();
  const Batch after = send(other, 0, 1.0);
  station.run(1);
  EXPECT_EQ(after.handle(0).status, Status::completed);
}

TEST_F(ExclusiveControl, ControlFallsWhenItsHolderCloses) {
  StartedStation station;
  UntypedFrontend holder("pair");
  UntypedFrontend other("pair");
  holder.add_take_control();
  const Batch kept = holder.pulse();
  send(other, 1, 1.0);
  station.run(1);
  holder.close();
  const Batch after = send(other, 0, 1.0);
  station.run(1);
  EXPECT_EQ(after.handle(0).status, Status::completed) << "though a batch of the holder is kept";
  EXPECT_EQ(kept.handle(0).status, Status::completed) << "and still answers";
}

TEST_F(ExclusiveControl, ControlDoesNotPassToWhoGetsTheLaneNext) {
  StartedStation station({.segment = "pair", .lanes = 2});
  auto holder = std::make_unique<UntypedFrontend>("pair");
  UntypedFrontend other("pair");
  holder->add_take_control();
  holder->pulse();
  send(other, 1, 1.0);
  station.run(1);
  holder.reset();
  UntypedFrontend successor("pair");
  const Batch of_successor = send(successor, 0, 1.0);
  const Batch of_other = send(other, 0, 2.0);
  station.run(2);
  EXPECT_EQ(of_successor.handle(0).status, Status::completed);
  EXPECT_EQ(of_other.handle(0).status, Status::completed);
}

/// Two lanes: one that changes hands with a batch of its former owner put off to iteration 5, and
/// another's.
class InheritedControl : public StationTest {
 protected:
  InheritedControl() {
    station_.start();
    former_.emplace("pair");
    other_.emplace("pair");
  }
  /// Sends what was added and leaves the lane to a successor before that is taken.
  Batch leave_for_later() {
    const Batch late = former_->pulse({.at = 5});
    send(*other_, 1, 0.5);
    station_.run(1);
    former_.reset();
    successor_.emplace("pair");
    send(*successor_, 1, 0.25);
    station_.run(1);
    return late;
  }
  Batch take_control_at_once() {
    successor_->add_take_control();
    const Batch taken = successor_->pulse();
    station_.run(1);
    EXPECT_EQ(taken.handle(0).status, Status::completed);
    return taken;
  }
  Status of_another_after(int iterations) {
    station_.run(iterations);
    const Batch batch = send(*other_, 0, 2.0);
    station_.run(1);
    return batch.handle(0).status;
  }

  Station station_{{.segment = "pair", .lanes = 2}};
  std::optional<UntypedFrontend> former_;
  std::optional<UntypedFrontend> other_;
  std::optional<UntypedFrontend> successor_;
};

TEST_F(InheritedControl, IsNotLostByARequestOfTheFormerOwnerToLetGo) {
  former_->add_release_control();
  leave_for_later();
  take_control_at_once();
  EXPECT_EQ(of_another_after(8), Status::rejected);
}

TEST_F(InheritedControl, IsNotTakenForTheSuccessorByTheFormerOwner) {
  former_->add_take_control();
  leave_for_later();
  EXPECT_EQ(of_another_after(8), Status::completed);
}

TEST_F(InheritedControl, HoldsAgainstWhatTheFormerOwnerSent) {
  const std::array<double, 1> target{3.0};
  former_->add_command(0, std::as_bytes(std::span(target)));
  const Batch late = leave_for_later();
  take_control_at_once();
  station_.run(8);
  EXPECT_EQ(late.handle(0).status, Status::rejected);
  EXPECT_EQ(late.handle(0).reason, Reason::exclusive);
}

}  // namespace
}  // namespace o80::test
