#include "o80/runtime/typed_backend.hpp"

#include <cmath>

#include "o80/runtime/typed_frontend.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

class TypedBackendTest : public ManualBackendTest {};

TEST_F(TypedBackendTest, ServesRequestsAndReadsAfresh) {
  Backend<Pair> backend({.segment = "pair"});
  backend.on<Reset>([](const Reset& reset) {
    EXPECT_EQ(reset.seed, 7U);
    return Served::start_afresh();
  });
  backend.on<Refuse>([](const Refuse&) -> Served { return Served::rejected("no"); });
  backend.on_fresh_start([](Pair::Actuators& observed, Pair::Effort& effort) {
    observed = {7, 8};
    effort.total = 9;
  });
  backend.publish({});
  Frontend<Pair> frontend("pair");
  frontend.add_request(Reset{.seed = 7});
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
  EXPECT_EQ(frontend.schema().requests[0].help.view(), Reset::kHelp);
  EXPECT_EQ(frontend.schema().requests[3].help.view(), "") << "a struct without kHelp";
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
