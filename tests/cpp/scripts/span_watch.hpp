#pragma once

#include <optional>
#include <vector>

#include "scripts/script_world.hpp"

namespace o80::test {

/// Where a motion may be, how fast a speed pace may go, and how long a planned motion may take
/// (docs/commands.md#one-command).
///
/// The span of a motion is that of its present place, its targets, and, if it overwrote another
/// motion, of the former target and of every place where the former motion could have come to
/// stop: those that a braking velocity can reach from the present place without leaving the former
/// span. Curves that leave it (`smooth`, and `monotone` from another motion) are not judged here,
/// but by tests/cpp/control/motion/rows_curve_test.cpp. That of a planned motion within limits is
/// exact: the present place, its target, and where the fastest stop from here ends and turns.
class SpanWatch {
 public:
  explicit SpanWatch(const ScriptWorld& world);

  void restart(const ScriptWorld& world);
  std::optional<Failure> step(const ScriptWorld& world);

 private:
  struct Span {
    long double low = 0.0L;
    long double high = 0.0L;

    void include(long double place);
    void include(const Span& other);
  };
  struct Number {
    Span span;                  // of the motion under way
    Span targets;               // of its command
    Span planned;               // instead of `span`, of a planned motion within limits
    long double from = 0.0L;    // where it began
    long double first = 0.0L;   // difference of the last two positions
    long double second = 0.0L;  // of the last two differences
    long double third = 0.0L;
    long double fastest = 0.0L;  // step allowed by a speed pace; 0: any
  };

  /// Of an actuator whose motion is planned within limits of acceleration.
  struct Plan {
    const SentCommand* command = nullptr;  // in force
    bool is_known = false;
    Iteration fewest = 1;  // iterations of the fastest motion to its target
    Iteration requested = 0;
  };

  static bool is_planned(const ScriptWorld& world, const SentCommand& command);
  void plan(const ScriptWorld& world, std::size_t actuator);
  std::optional<Failure> takes_its_time(const ScriptWorld& world, std::size_t actuator) const;
  static long double seam_speed(const ScriptWorld& world, std::size_t actuator,
                                const Number& number, const NumberSpec& spec);
  void begin(const ScriptWorld& world, std::size_t actuator, bool taken_over);
  static Span stops(const Number& number, long double place, long double rounding);
  std::optional<Failure> check(const ScriptWorld& world, std::size_t actuator,
                               std::size_t number) const;

  std::vector<std::vector<Number>> numbers_;
  std::vector<Plan> plans_;
};

}  // namespace o80::test
