// Who has control, from when until when, and who has a say in it.

#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using ExclusiveControl = ManualBackendTest;

// rule B5
TEST_F(ExclusiveControl, WhoHasControlHasItAlone) {
  play(R"(B: before = 1 to 5 over 5; run 1; take; a = pulse; run 1; a completed
    B: b = 0 to 1; B: c = purge; B: d = reset 0; B: e = take; run 1
    b rejected exclusive; b says has exclusive control; c rejected exclusive
    d rejected exclusive; e rejected exclusive; e says pid
    before active  # what was taken before goes on
    B: alone = note; B: note; B: mixed = 0 to 1; run 1
    alone completed; mixed.1 rejected exclusive  # a note needs no control
    release; f = pulse; B: g = 0 to 1; run 1; g completed)");
}

TEST_F(ExclusiveControl, ControlFallsWhenItsHolderCloses) {
  play(R"(a = take; B: b = 1 to 1; run 1; close; B: c = 0 to 1; run 1
    c completed; a completed  # though a batch of the holder is kept, which still answers)");
}

TEST_F(ExclusiveControl, ControlDoesNotPassToWhoGetsTheLaneNext) {
  play({.segment = "pair", .lanes = 2}, R"(a = take; B: b = 1 to 1; run 1; close
    C: c = 0 to 1; B: d = 0 to 2; run 2; c completed; d completed)");
}

/// Two lanes: that of A changes hands, to C, with a batch put off to iteration 5.
BackendOptions two_lanes() { return {.segment = "pair", .lanes = 2}; }

TEST_F(ExclusiveControl, IsNotLostByARequestOfTheFormerOwnerToLetGo) {
  play(two_lanes(), R"(a = release at 5; B: b = 1 to 0.5; run 1; close; C: c = 1 to 0.25; run 1
    C: d = take; run 1; d completed; run 8; B: e = 0 to 2; run 1; e rejected)");
}

TEST_F(ExclusiveControl, IsNotTakenForTheSuccessorByTheFormerOwner) {
  play(two_lanes(), R"(a = take at 5; B: b = 1 to 0.5; run 1; close; C: c = 1 to 0.25; run 1
    run 8; B: e = 0 to 2; run 1; e completed)");
}

TEST_F(ExclusiveControl, HoldsAgainstWhatTheFormerOwnerSent) {
  play(two_lanes(), R"(a = 0 to 3 at 5; B: b = 1 to 0.5; run 1; close; C: c = 1 to 0.25; run 1
    C: d = take; run 1; d completed; run 8; a rejected exclusive)");
}

}  // namespace
}  // namespace o80::test
