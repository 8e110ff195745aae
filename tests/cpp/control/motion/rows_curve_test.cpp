// The curve `smooth` through rows (docs/chunks.md), of one number.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>
#include <vector>

#include "control/motion/number_plan.hpp"
#include "dice.hpp"

namespace o80::test {
namespace {

constexpr double kHuge = std::numeric_limits<double>::max();
constexpr Span kUnbounded{-kHuge, kHuge};

struct Row {
  double place;
  std::int64_t iterations;  // from the row before
};

/// Plays rows from a moment; keeps each place, and how far each way leaves its two rows.
class Played {
 public:
  Played(const Moment& start, const std::vector<Row>& rows, const Span& bounds = kUnbounded) {
    plan.start_from(start);
    double before = start.position;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      RowsAhead ahead;
      if (i + 1 < rows.size())
        ahead = {rows[i + 1].place, rows[i + 1].iterations, i == 0, rows[i + 1].place};
      if (i + 2 < rows.size()) ahead.after = rows[i + 2].place;
      plan.curve_on(Profile::smooth, rows[i].place, rows[i].iterations, ahead, bounds);
      double outside = 0.0;
      for (std::int64_t k = 0; k < rows[i].iterations; ++k) {
        const double place = plan.next();
        places.push_back(place);
        held += plan.is_held() ? 1 : 0;
        const auto [low, high] = std::minmax(before, rows[i].place);
        outside = std::max({outside, place - high, low - place});
      }
      excess.push_back(outside);
      at_rows.push_back(plan.moment());
      before = places.back();
    }
  }
  double acceleration(std::size_t i) const {
    return places[i] - 2.0 * places[i - 1] + places[i - 2];
  }

  NumberPlan plan;
  std::vector<double> places;
  std::vector<double> excess;
  std::vector<Moment> at_rows;
  int held = 0;
};

/// Rows that jump, that drift, and that stay; due evenly, within a factor of two, or anyhow.
std::vector<Row> random_rows(Dice& dice, int unevenness) {
  const std::int64_t step = dice.whole(2, 25);
  const std::int64_t style = dice.whole(0, 2);
  std::vector<Row> rows;
  for (std::int64_t i = dice.whole(1, 12); i > 0; --i) {
    const double last = rows.empty() ? 0.0 : rows.back().place;
    double place = dice.real(-1, 1);
    if (style == 1) place = last + 0.1 * place;
    if (style == 2 && dice.whole(0, 1) == 0) place = last;
    const std::array ways{step, dice.whole(step, 2 * step), dice.whole(1, 50)};
    rows.push_back({place, ways[static_cast<std::size_t>(unevenness)]});
  }
  return rows;
}

double step_of(const std::vector<Row>& rows, std::size_t i) {
  return std::abs(rows[i].place - rows[i - 1].place);
}

// rule K9
TEST(RowsCurve, LeavesItsRowsByAPartOfTheStepsAroundThem) {
  constexpr std::array kMost{1.0 / 8.0, 1.0 / 3.0, 1.0 / 2.0};
  for (unsigned seed = 0; seed < 3000; ++seed) {
    Dice dice(seed);
    const int unevenness = static_cast<int>(seed % 3);
    const std::vector<Row> rows = random_rows(dice, unevenness);
    const Moment start{dice.real(-1, 1), 0.1 * dice.real(-1, 1), 0.02 * dice.real(-1, 1)};
    const Played played(start, rows);
    for (std::size_t i = 0; i < rows.size(); ++i) {
      ASSERT_EQ(played.at_rows[i].position, rows[i].place) << seed;
      const double next = i + 1 < rows.size() ? step_of(rows, i + 1) : 0.0;
      if (i == 0) {
        // the take-over
        const double after = i + 2 < rows.size() ? step_of(rows, i + 2) : 0.0;
        const double speed = std::abs(start.speed) + std::abs(played.at_rows[0].speed);
        const double room = std::max({std::abs(rows[0].place - start.position), next, after}) +
                            speed * static_cast<double>(rows[0].iterations);
        ASSERT_LE(played.excess[0], 0.3 * room + 1e-12) << seed;
      } else if (i > 1) {
        const double steps = std::max({step_of(rows, i - 1), step_of(rows, i), next});
        ASSERT_LE(played.excess[i], kMost[static_cast<std::size_t>(unevenness)] * steps + 1e-12)
            << seed << " row " << i;
      }
    }
    EXPECT_EQ(played.at_rows.back().speed, 0.0);
    EXPECT_EQ(played.at_rows.back().acceleration, 0.0);
  }
}

double sine(double t) { return 0.4 * std::sin(std::numbers::pi * 1e-3 * t); }
constexpr double kPeak = 3.9478e-6;  // its acceleration

/// From time `t` on, each `step` iterations a row; `first` iterations to the first one.
std::vector<Row> rows_of_sine(std::int64_t t, std::int64_t first, std::int64_t step, int count) {
  std::vector<Row> rows;
  for (int i = 0; i < count; ++i) {
    t += i == 0 ? first : step;
    rows.push_back({sine(static_cast<double>(t)), i == 0 ? first : step});
  }
  return rows;
}

TEST(RowsCurve, ASampledSineComesBack) {
  for (const std::int64_t step : {25, 20, 10}) {
    const auto phase = step / 2;
    const auto t0 = static_cast<double>(phase);
    const Moment start{sine(t0), sine(t0) - sine(t0 - 1.0)};
    const Played played(start, rows_of_sine(phase, step, step, 200));
    for (std::size_t i = 50; i + 50 < played.places.size(); ++i) {
      ASSERT_NEAR(played.places[i], sine(t0 + 1.0 + static_cast<double>(i)), 0.01e-3);
      ASSERT_LE(std::abs(played.acceleration(i)), 1.005 * kPeak);
    }
  }
}

TEST(RowsCurve, ATakeOverAtAnyMomentOfASineKeepsItsAcceleration) {
  constexpr std::int64_t kStep = 25;
  for (std::int64_t at = 100; at < 1100; ++at) {
    const Played before({sine(0.0), sine(0.0) - sine(-1.0)},
                        rows_of_sine(0, kStep, kStep, static_cast<int>(at / kStep) + 3));
    // the plan as it is then
    NumberPlan plan;
    plan.start_from({sine(0.0), sine(0.0) - sine(-1.0)});
    const std::vector<Row> rows = rows_of_sine(0, kStep, kStep, static_cast<int>(at / kStep) + 3);
    for (std::size_t i = 0; i <= static_cast<std::size_t>(at / kStep); ++i) {
      plan.curve_on(Profile::smooth, rows[i].place, kStep,
                    {rows[i + 1].place, kStep, i == 0, rows[i + 2].place}, kUnbounded);
      const auto first = static_cast<std::int64_t>(i) * kStep;
      for (std::int64_t k = first; k < std::min(at, first + kStep); ++k) plan.next();
    }
    const Moment there = plan.moment();
    ASSERT_NEAR(there.position, sine(static_cast<double>(at)), 1e-5);
    // the first row that is due a step later, or after that
    const std::int64_t first = (at + 2 * kStep - 1) / kStep * kStep - at;
    const Played after(there, rows_of_sine(at, first, kStep, 8));
    std::vector<double> all(before.places.begin(), before.places.begin() + at);
    all.insert(all.end(), after.places.begin(), after.places.begin() + 4 * kStep);
    for (auto i = static_cast<std::size_t>(at) - 3; i < all.size(); ++i) {
      ASSERT_LE(std::abs(all[i] - 2.0 * all[i - 1] + all[i - 2]), 1.01 * kPeak) << at;
    }
  }
}

TEST(RowsCurve, RowsThatAreSentAgainGiveTheOldMotion) {
  for (unsigned seed = 0; seed < 300; ++seed) {
    Dice dice(seed);
    std::vector<Row> rows = random_rows(dice, 0);
    const Played once({}, rows);
    for (std::size_t i = 0; i + 1 < rows.size(); ++i) {
      // bounds at the first row may act where the step before it is the larger one
      const double next = i + 2 < rows.size() ? step_of(rows, i + 2) : kHuge;
      const double after = i + 3 < rows.size() ? step_of(rows, i + 3) : 0.0;
      if (step_of(rows, i + 1) > 3.0 * std::max(next, after)) continue;
      const Played again(once.at_rows[i],
                         {rows.begin() + static_cast<std::ptrdiff_t>(i) + 1, rows.end()});
      const auto from = (i + 1) * static_cast<std::size_t>(rows[0].iterations);
      for (std::size_t k = 0; k < again.places.size(); ++k)
        ASSERT_NEAR(again.places[k], once.places[from + k], 1e-14) << seed;
    }
  }
}

/// A policy that is at its limits: the curve would leave them at each turn.
TEST(RowsCurve, OfSaturatedRowsIsHeldAtTheBounds) {
  int held = 0;
  for (unsigned seed = 0; seed < 1000; ++seed) {
    Dice dice(seed);
    std::vector<Row> rows = random_rows(dice, static_cast<int>(seed % 3));
    for (Row& row : rows) row.place = row.place < 0.0 ? -1.0 : 1.0;
    const Played played({dice.real(-1, 1), 0.1 * dice.real(-1, 1)}, rows, {-1.0, 1.0});
    for (const double place : played.places) ASSERT_LE(std::abs(place), 1.0) << seed;
    held += played.held;
  }
  EXPECT_GT(held, 1000);
  // rows at a bound that stay there are not held
  EXPECT_EQ(Played({1.0}, {{1.0, 10}, {1.0, 10}, {1.0, 30}}, {-1.0, 1.0}).held, 0);
}

}  // namespace
}  // namespace o80::test
