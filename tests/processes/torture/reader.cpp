#include <optional>

#include "torture/verify.hpp"

namespace torture {

namespace {

using o80::Iteration;

class Reader {
 public:
  explicit Reader(Actor& actor) : actor_(actor) {}

  void run() {
    while (actor_.acting()) {
      std::optional<o80::UntypedFrontend> frontend = attach();
      if (!frontend) continue;
      Generation& life = actor_.life_of(*frontend);
      Verifier verifier(actor_, *frontend);
      latest_ = -1;
      position_ = -1;
      try {
        while (actor_.acting()) read(*frontend, life, verifier);
      } catch (const o80::BackendGone& error) {
        actor_.judge_gone(life, error, call_began_);
        read_to_the_end(*frontend, verifier);
      }
    }
  }

 private:
  std::optional<o80::UntypedFrontend> attach() {
    const bool only_reads = actor_.chance.percent(30);
    return actor_.attach(actor_.slot.segment,
                         only_reads ? o80::Access::read_only : o80::Access::read_write);
  }

  void read(const o80::UntypedFrontend& frontend, Generation& life, Verifier& verifier) {
    call_began_ = o80::monotonic_now();
    const std::int64_t stopped = actor_.stopped();
    try {
      switch (actor_.chance.below(4)) {
        case 0:
          return latest(frontend, verifier);
        case 1:
          return wait_for(frontend, verifier);
        case 2:
          return stream(frontend, verifier);
        default:
          return history(frontend, verifier);
      }
    } catch (const o80::TimeoutError&) {
      actor_.judge_timeout(life, call_began_, stopped);
    } catch (const o80::RowOverwritten&) {
      // the backend was faster
    }
  }

  void latest(const o80::UntypedFrontend& frontend, Verifier& verifier) {
    for (int i = 0; i < 20; ++i) {
      const o80::UntypedObservation row = frontend.latest();
      verifier.verify(row);
      if (row.iteration() < latest_)
        actor_.fail(Fault::wrong_row, "the latest row was %ld, then %ld",
                    static_cast<long>(latest_), static_cast<long>(row.iteration()));
      latest_ = row.iteration();
    }
  }

  void wait_for(const o80::UntypedFrontend& frontend, Verifier& verifier) {
    const Iteration k =
        std::max<Iteration>(0, frontend.published() + actor_.chance.between(-20, 20));
    const auto timeout = actor_.some_timeout();
    const o80::UntypedObservation row =
        actor_.timed("wait_for", timeout, [&] { return frontend.wait_for(k, timeout); });
    verifier.verify(row, k);
  }

  void stream(const o80::UntypedFrontend& frontend, Verifier& verifier) {
    o80::UntypedObservation row(frontend.description());
    std::optional<Sensors> before;
    if (position_ < 0 || actor_.chance.percent(20)) position_ = frontend.published();
    for (int i = 0; i < 30 && actor_.acting(); ++i) {
      const Iteration wanted = position_;
      const auto timeout = actor_.some_timeout();
      const std::int64_t missed = actor_.timed("wait_for_next", timeout, [&] {
        return frontend.wait_for_next(position_, row.bytes(), timeout);
      });
      const Sensors sensors = verifier.verify(row, wanted + missed);
      if (position_ != wanted + missed + 1)
        actor_.fail(Fault::wrong_row, "a stream went from %ld to %ld and missed %ld",
                    static_cast<long>(wanted), static_cast<long>(position_),
                    static_cast<long>(missed));
      if (before && missed == 0 && sensors.chain != before->digest)
        actor_.fail(Fault::wrong_row, "row %ld does not follow row %ld", static_cast<long>(wanted),
                    static_cast<long>(wanted - 1));
      before = sensors;
    }
  }

  void history(const o80::UntypedFrontend& frontend, Verifier& verifier) {
    verify_all(frontend.history(static_cast<std::size_t>(actor_.chance.between(1, 200))), verifier);
  }

  void verify_all(const o80::Rows& rows, Verifier& verifier) {
    std::uint64_t before = 0;
    for (std::size_t i = 0; i < rows.count; ++i) {
      const Sensors sensors =
          verifier.verify(rows.row(i).data(), rows.first + static_cast<Iteration>(i));
      if (i > 0 && sensors.chain != before)
        actor_.fail(Fault::wrong_row, "row %ld of a history does not follow the one before",
                    static_cast<long>(rows.first + static_cast<Iteration>(i)));
      before = sensors.digest;
    }
  }

  /// What a dead backend left can be read to its last row.
  void read_to_the_end(const o80::UntypedFrontend& frontend, Verifier& verifier) {
    const Iteration last = frontend.published();
    const o80::Rows rows = frontend.history(100);
    verify_all(rows, verifier);
    if (last >= 0 &&
        (rows.count == 0 || rows.first + static_cast<Iteration>(rows.count) != last + 1))
      actor_.fail(Fault::wrong_row, "the history of a dead backend ends before its last row %ld",
                  static_cast<long>(last));
    try {
      frontend.wait_for(last + 1, std::chrono::milliseconds(10));
      actor_.fail(Fault::wrong_row, "a dead backend went on to row %ld",
                  static_cast<long>(last + 1));
    } catch (const o80::BackendGone&) {
      // as it must be
    }
  }

  Actor& actor_;
  Iteration latest_ = -1;
  Iteration position_ = -1;
  std::int64_t call_began_ = 0;
};

}  // namespace

void be_a_reader(Actor& actor) { Reader(actor).run(); }

}  // namespace torture
