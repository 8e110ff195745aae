#include "o80/runtime/typed_backend.hpp"

#include <cmath>

#include "o80/runtime/typed_frontend.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class TypedBackendTest : public ManualBackendTest {};

TEST_F(TypedBackendTest, PublishesRowZeroFirstAndThenStepsAndPublishes) {
  Backend<Pair> backend({.segment = "pair"});
  backend.publish({1, 2}, {.total = 3});
  Frontend<Pair> frontend("pair");
  EXPECT_EQ(frontend.latest().observed()[1], 2);
  EXPECT_EQ(frontend.latest().extended().total, 3);
  frontend.add_command(0, 5.0);
  frontend.pulse();
  const auto desired = backend.step();
  ASSERT_TRUE(desired);
  EXPECT_EQ((*desired)[0], 5);
  EXPECT_EQ((*desired)[1], 2) << "held";
}

TEST_F(TypedBackendTest, StepsNoFurtherWhenAskedToStop) {
  Backend<Pair> backend({.segment = "pair", .bursting = true});
  backend.publish({});
  backend.untyped().ask_to_stop();
  EXPECT_FALSE(backend.step());
}

TEST_F(TypedBackendTest, WaitsForAGrantWhenItBursts) {
  Backend<Pair> backend({.segment = "pair", .bursting = true});
  backend.publish({});
  std::thread loop([&] {
    while (const auto desired = backend.step()) backend.publish(*desired);
  });
  Frontend<Pair> frontend("pair");
  frontend.add_command("actuator_1", 4.0);
  EXPECT_EQ(frontend.burst(3, kPatience).observed()[1], 4.0);
  backend.untyped().ask_to_stop();
  loop.join();
  EXPECT_EQ(frontend.published(), 3);
}

TEST_F(TypedBackendTest, ServesRequestsAndReadsAfresh) {
  Backend<Pair> backend({.segment = "pair"});
  backend.on<Reset>([](const Reset&) { return Served::start_afresh(); });
  backend.on<Refuse>([](const Refuse&) -> Served { return Served::rejected("no"); });
  backend.on_fresh_start([](Pair::Actuators& observed, Pair::Effort& effort) {
    observed = {7, 8};
    effort.total = 9;
  });
  backend.publish({});
  Frontend<Pair> frontend("pair");
  frontend.add_request(Reset{});
  frontend.add_request(Refuse{});
  frontend.add_request(Break{});
  const Batch batch = frontend.pulse();
  ASSERT_TRUE(backend.step());
  const Observation<Pair> fresh = frontend.wait_for(1, kAtOnce);
  EXPECT_EQ(fresh.observed()[0], 7);
  EXPECT_EQ(fresh.desired()[1], 8);
  EXPECT_EQ(fresh.extended().total, 9);
  EXPECT_EQ(batch.handle(1).text, "no");
  EXPECT_THAT(batch.handle(2).text, HasSubstr("this request has no handler"));
}

TEST_F(TypedBackendTest, ARequestThatThrowsEndsItAsFailed) {
  auto backend = std::make_unique<Backend<Pair>>(BackendOptions{.segment = "pair"});
  backend->on<Break>([](const Break&) -> Served { throw std::runtime_error("sparks"); });
  backend->publish({});
  Frontend<Pair> frontend("pair");
  frontend.add_request(Break{});
  frontend.pulse();
  EXPECT_FALSE(backend->step());
  backend.reset();
  EXPECT_THAT(message_of<BackendFailed>([&] { frontend.wait_for(1, kPatience); }),
              HasSubstr("sparks"));
}

TEST_F(TypedBackendTest, RefusesAFirstReadingThatIsNoNumber) {
  Backend<Pair> backend({.segment = "pair"});
  EXPECT_THAT(message_of<InvalidArgument>([&] { backend.publish({1, std::nan("")}); }),
              AllOf(HasSubstr("actuator 'actuator_1'"), HasSubstr("first reading")));
  EXPECT_THROW(Frontend<Pair>("pair", {.timeout = kAtOnce}), TimeoutError) << "it has not begun";
  backend.publish({1, 2});
  EXPECT_EQ(Frontend<Pair>("pair").latest().desired()[1], 2) << "the next one may be";
  EXPECT_TRUE(backend.step());
}

TEST_F(TypedBackendTest, AFreshReadingThatIsNoNumberEndsItAsFailed) {
  Backend<Pair> backend({.segment = "pair"});
  backend.on<Reset>([](const Reset&) { return Served::start_afresh(); });
  backend.on_fresh_start(
      [](Pair::Actuators& observed, Pair::Effort&) { observed = {-INFINITY, 0}; });
  backend.publish({});
  Frontend<Pair> frontend("pair");
  frontend.add_request(Reset{});
  const Batch batch = frontend.pulse();
  EXPECT_FALSE(backend.step());
  EXPECT_EQ(batch.handle(0).status, Status::rejected);
  EXPECT_THAT(batch.handle(0).text, HasSubstr("actuator 'actuator_0'"));
  EXPECT_THAT(std::string(backend.untyped().failure()),
              AllOf(HasSubstr("actuator 'actuator_0'"), HasSubstr("fresh start")));
  EXPECT_EQ(frontend.latest().iteration(), 0) << "no row begins with it";
}

TEST_F(TypedBackendTest, IsNotResumedWhileItsReadingIsNoNumber) {
  Backend<Pair> backend({.segment = "pair"});
  backend.publish({});
  Frontend<Pair> frontend("pair");
  const auto resume = [&] {
    const Batch batch = send_resume(frontend, 1);
    EXPECT_TRUE(backend.step());
    return batch.handle(0);
  };
  backend.halt("the belt slipped");
  ASSERT_TRUE(backend.step());
  backend.publish({std::nan(""), 0});
  const Handle refused = resume();
  EXPECT_EQ(refused.status, Status::rejected);
  EXPECT_THAT(refused.text, HasSubstr("actuator 'actuator_0'"));
  EXPECT_TRUE(frontend.halted());
  backend.publish({1.5, 0});
  EXPECT_EQ(resume().status, Status::completed);
  EXPECT_EQ(frontend.latest().desired()[0], 1.5);
}

}  // namespace
}  // namespace o80::test
