// o80_mujoco._balls: the laws of flight and bounce of simulated balls, for Python.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "estimates/ball_filter.hpp"
#include "estimates/platform.hpp"
#include "estimates/predicted_flight.hpp"

namespace nb = nanobind;
using namespace nb::literals;  // NOLINT(google-build-using-namespace)

namespace o80::mujoco {

namespace {

constexpr std::size_t kNumbers = 9;       // of a ball: position, velocity, spin
constexpr std::size_t kNodeNumbers = 11;  // time, ball, bounced
constexpr double kMaxSteps = 1e6;         // of one call

using Doubles = nb::ndarray<nb::numpy, double>;
template <int Columns>
using Rows = nb::ndarray<const double, nb::shape<-1, Columns>, nb::c_contig, nb::device::cpu>;
using Numbers = nb::ndarray<const double, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Flags = nb::ndarray<const bool, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Which = nb::ndarray<const std::int64_t, nb::shape<-1>, nb::c_contig, nb::device::cpu>;
using Three = std::array<double, 3>;

/// Makes a new array for the caller to fill.
Doubles array(std::initializer_list<std::size_t> shape, double*& values) {
  std::size_t count = 1;
  for (const std::size_t each : shape) count *= each;
  values = new double[std::max<std::size_t>(count, 1)];
  const nb::capsule owner(values, [](void* made) noexcept { delete[] static_cast<double*>(made); });
  return Doubles(values, shape.size(), shape.begin(), owner);
}

Vector vector(const double* n) { return {n[0], n[1], n[2]}; }
Vector vector(const Three& n) { return {n[0], n[1], n[2]}; }
Ball ball_at(const double* n) { return {vector(n), vector(n + 3), vector(n + 6)}; }

double* put(double* to, const Vector& from) {
  *to++ = from.x;
  *to++ = from.y;
  *to++ = from.z;
  return to;
}
double* put(double* to, const Ball& from) {
  return put(put(put(to, from.position), from.velocity), from.spin);
}

/// Raises ValueError with the name of a wrong number.
double finite(double x, const std::string& name) {
  if (std::isfinite(x)) return x;
  throw nb::value_error((name + " must be a finite number, got " + std::to_string(x)).c_str());
}
double positive(double x, const std::string& name) {
  if (finite(x, name) > 0) return x;
  throw nb::value_error((name + " must be positive, got " + std::to_string(x)).c_str());
}
template <std::size_t N>
const std::array<double, N>& finite(const std::array<double, N>& numbers, const char* name) {
  for (const double each : numbers) finite(each, name);
  return numbers;
}
double checked_friction(double friction) {
  if (friction >= 0) return friction;
  throw nb::value_error("friction must be 0 or more; inf: the ball never slides");
}
Sphere sphere(double radius, double inertia) {
  return {positive(radius, "radius"), positive(inertia, "inertia")};
}

Air air(double drag, double magnus, double spin_decay, double gravity, double saturation) {
  return {finite(drag, "drag"),
          finite(magnus, "magnus"),
          finite(spin_decay, "spin_decay"),
          {0, 0, -finite(gravity, "gravity")},
          finite(saturation, "saturation")};
}

Platform platform(double height, const std::array<double, 2>& low,
                  const std::array<double, 2>& high, const Three& restitution, double friction,
                  double radius, double inertia) {
  if (!(low[0] < high[0]) || !(low[1] < high[1])) {
    throw nb::value_error("low must be less than high, in x and in y");
  }
  return {finite(height, "height"),           finite(low, "low"),         finite(high, "high"),
          finite(restitution, "restitution"), checked_friction(friction), sphere(radius, inertia)};
}

Doubles accelerations(const Rows<kNumbers>& balls, const Air& air) {
  double* values = nullptr;
  Doubles made = array({balls.shape(0), 3}, values);
  for (std::size_t i = 0; i < balls.shape(0); ++i) {
    const Ball ball = ball_at(balls.data() + kNumbers * i);
    values = put(values, acceleration(air, ball.velocity, ball.spin));
  }
  return made;
}

Doubles path(const Rows<kNumbers>& balls, double step, std::int64_t count, const Air& air,
             const std::optional<Numbers>& drags) {
  if (count < 0 || static_cast<double>(count) > kMaxSteps) {
    throw nb::value_error("count must be from 0 to 1000000");
  }
  finite(step, "step");
  const std::size_t number = balls.shape(0);
  if (drags && drags->shape(0) != number)
    throw nb::value_error("drags must have one value for each ball");
  const auto rows = static_cast<std::size_t>(count) + 1;
  double* values = nullptr;
  Doubles made = array({rows, number, kNumbers}, values);
  for (std::size_t i = 0; i < number; ++i) {
    Ball ball = ball_at(balls.data() + kNumbers * i);
    Air own = air;
    if (drags) own.drag = (*drags)(i);
    for (std::size_t row = 0; row < rows; ++row) {
      if (row > 0) ball = flown(ball, own, step);
      put(values + kNumbers * (number * row + i), ball);
    }
  }
  return made;
}

Doubles predicted(const Numbers& ball, const Air& air, const Platform* platform, double duration,
                  double step) {
  if (ball.shape(0) != kNumbers) throw nb::value_error("a ball must have 9 numbers");
  if (!(step > 0) || !(duration >= 0) || duration > kMaxSteps * step) {
    throw nb::value_error("step and duration must be positive, with at most 1000000 steps");
  }
  const std::vector<Node> nodes =
      predicted_flight(ball_at(ball.data()), air, platform, duration, step);
  double* values = nullptr;
  Doubles made = array({nodes.size(), kNodeNumbers}, values);
  for (const Node& node : nodes) {
    *values++ = node.time;
    values = put(values, node.ball);
    *values++ = node.bounced ? 1 : 0;
  }
  return made;
}

Doubles bounces(const Rows<kNumbers>& balls, const Platform& platform) {
  double* values = nullptr;
  Doubles made = array({balls.shape(0), kNumbers}, values);
  for (std::size_t i = 0; i < balls.shape(0); ++i) {
    values = put(values, bounced(ball_at(balls.data() + kNumbers * i), platform));
  }
  return made;
}

Doubles bounce(const Numbers& ball, const Three& normal, const Three& velocity,
               const Three& restitution, double friction, double radius, double inertia) {
  if (ball.shape(0) != kNumbers) throw nb::value_error("a ball must have 9 numbers");
  if (std::abs(dot(vector(normal), vector(normal)) - 1) > 1e-6) {
    throw nb::value_error("normal must have the length 1");
  }
  const Directions along =
      Directions::of(vector(normal), {Vector{1, 0, 0}, Vector{0, 1, 0}, Vector{0, 0, 1}});
  double* values = nullptr;
  Doubles made = array({kNumbers}, values);
  put(values, bounced(ball_at(ball.data()), vector(finite(velocity, "velocity")), along,
                      finite(restitution, "restitution"), checked_friction(friction),
                      sphere(radius, inertia)));
  return made;
}

std::vector<Gain> gains(const Rows<24>& rows) {
  std::vector<Gain> made(rows.shape(0));
  for (std::size_t i = 0; i < made.size(); ++i) {
    std::copy_n(rows.data() + 24 * i, 24, made[i].begin());
  }
  return made;
}

/// Indices of a filter's balls; all by default.
class Chosen {
 public:
  Chosen(const BallFilter& filter, const std::optional<Which>& which)
      : which_(which ? which->data() : nullptr), count_(which ? which->shape(0) : filter.count()) {
    for (std::size_t i = 0; which_ != nullptr && i < count_; ++i) {
      if (which_[i] >= 0 && static_cast<std::size_t>(which_[i]) < filter.count()) continue;
      throw nb::index_error("which must name balls of the filter");
    }
  }
  std::size_t count() const { return count_; }
  std::size_t operator[](std::size_t i) const {
    return which_ == nullptr ? i : static_cast<std::size_t>(which_[i]);
  }
  void expect(std::size_t rows) const {
    if (rows != count_) throw nb::value_error("give one measurement for each ball");
  }

 private:
  const std::int64_t* which_;
  std::size_t count_;
};

Seen seen_at(const Rows<6>& seen, std::size_t i) {
  Seen made{};
  std::copy_n(seen.data() + 6 * i, 6, made.begin());
  return made;
}

void begin(BallFilter& filter, const Rows<6>& seen, const std::optional<Which>& which) {
  const Chosen chosen(filter, which);
  chosen.expect(seen.shape(0));
  for (std::size_t i = 0; i < chosen.count(); ++i) filter.begin(chosen[i], seen_at(seen, i));
}

void step(BallFilter& filter, const Rows<6>& seen, const Flags& missed,
          const std::optional<Which>& which) {
  const Chosen chosen(filter, which);
  chosen.expect(seen.shape(0));
  chosen.expect(missed.shape(0));
  for (std::size_t i = 0; i < chosen.count(); ++i) {
    const Seen measured = seen_at(seen, i);
    filter.step(chosen[i], missed(i) ? nullptr : &measured);
  }
}

Doubles estimates(const BallFilter& filter, double plane, const std::optional<Which>& which) {
  const Chosen chosen(filter, which);
  double* values = nullptr;
  Doubles made = array({chosen.count(), 13}, values);
  for (std::size_t i = 0; i < chosen.count(); ++i) {
    const Ball& ball = filter.ball(chosen[i]);
    values = put(put(values, ball.position), ball.velocity);
    *values++ = ball.spin.x;
    const Crossing crossing = filter.crossing(chosen[i], plane);
    values = std::copy(crossing.begin(), crossing.end(), values);
  }
  return made;
}

void bind_laws(nb::module_& module) {
  nb::class_<Air>(module, "Air",
                  "Forces of air and gravity on a ball.\n\n"
                  "a = -drag |v| v + magnus / (1 + saturation |omega| / |v|) omega x v - gravity z")
      .def(
          "__init__",
          [](Air* self, double drag, double magnus, double spin_decay, double gravity,
             double saturation) {
            new (self) Air(air(drag, magnus, spin_decay, gravity, saturation));
          },
          nb::kw_only(), "drag"_a = 0.0, "magnus"_a = 0.0, "spin_decay"_a = 0.0, "gravity"_a = 9.81,
          "saturation"_a = 0.0,
          "drag: 1/2 rho Cd A/m [1/m]; magnus: 1/2 rho Cl A r/m []; spin_decay: share of the spin\n"
          "lost in a second [1/s]; gravity: downwards [m/s^2]; saturation: of the lift [m].");
  nb::class_<Platform>(module, "Platform", "A level rectangle at rest that balls bounce on.")
      .def(
          "__init__",
          [](Platform* self, double height, const std::array<double, 2>& low,
             const std::array<double, 2>& high, const Three& restitution, double friction,
             double radius, double inertia) {
            new (self)
                Platform(platform(height, low, high, restitution, friction, radius, inertia));
          },
          nb::kw_only(), "height"_a, "low"_a, "high"_a, "restitution"_a, "friction"_a = kNoSliding,
          "radius"_a, "inertia"_a = 2.0 / 3.0,
          "height: of the centre of a ball that touches it [m]; low, high: corners, x and y [m];\n"
          "restitution: shares of the velocity along x, y and z that a ball without spin keeps;\n"
          "radius: of the ball [m]; inertia: its moment of inertia / (mass radius^2).")
      .def(
          "bounced",
          [](const Platform& self, const Rows<kNumbers>& balls) { return bounces(balls, self); },
          "balls"_a, "Balls (N, 9) at the platform => after their touch, (N, 9).");
  module.def("accelerations", &accelerations, "balls"_a, "air"_a,
             "Of balls (N, 9) in free flight: (N, 3) [m/s^2].");
  module.def(
      "path", &path, "balls"_a, "step"_a, "count"_a, "air"_a, "drags"_a = nb::none(),
      "Balls (N, 9): position [m], velocity [m/s], spin [rad/s] => (count + 1, N, 9), every\n"
      "`step` [s] of free flight; a negative step goes back. drags (N,) [1/m]: for each\n"
      "ball, instead of that of the air.");
  module.def("predicted_flight", &predicted, "ball"_a, "air"_a, "platform"_a.none(), "duration"_a,
             "step"_a,
             "A ball (9,) => nodes (K, 11) every `step` [s]: time [s], ball, and 1 if it has just\n"
             "bounced. A bounce gives two nodes of the same time.");
  module.def(
      "bounced", &bounce, "ball"_a, "normal"_a, "velocity"_a, "restitution"_a,
      "friction"_a = kNoSliding, nb::kw_only(), "radius"_a, "inertia"_a = 2.0 / 3.0,
      "A ball (9,) => after a bounce off a surface with a unit `normal` (3,), towards the\n"
      "ball, that moves with `velocity` (3,) [m/s]. restitution (3,): shares of the velocity\n"
      "that a ball without spin keeps, along two tangents and the normal.");
}

void bind_filter(nb::module_& module) {
  nb::class_<BallFilter>(module, "BallFilter",
                         "Estimates of flying balls: position, velocity and spin about x.")
      .def(
          "__init__",
          [](BallFilter* self, std::size_t count, const Air& air, const Platform& platform,
             const Rows<24>& before, const Rows<24>& after, double step, double mean_spin) {
            new (self) BallFilter({air, platform, positive(step, "step"),
                                   finite(mean_spin, "mean_spin"), gains(before), gains(after)},
                                  count);
          },
          nb::kw_only(), "count"_a, "air"_a, "platform"_a, "before"_a, "after"_a, "step"_a,
          "mean_spin"_a,
          "before, after (n, 24): gains for each measurement since the first one and since the\n"
          "bounce; step: between measurements [s]; mean_spin: of a ball seen once [rad/s].")
      .def("begin", &begin, "seen"_a, "which"_a = nb::none(),
           "New flights of balls with the numbers `which` (n,), with their first measurements\n"
           "(n, 6): position [m] and velocity [m/s].")
      .def("step", &step, "seen"_a, "missed"_a, "which"_a = nb::none(),
           "A step later; the measurements (n, 6) of `missed` (n,) balls mean nothing.")
      .def("estimates", &estimates, "plane"_a, "which"_a = nb::none(),
           "(n, 13): position, velocity, spin about x; then where the ball goes through the plane\n"
           "y = `plane`: x, z, velocity, and the time until then [s]. 0 if it does not come.");
}

}  // namespace

}  // namespace o80::mujoco

NB_MODULE(_balls, module) {
  module.doc() = "The laws of flight and bounce of simulated balls.";
  o80::mujoco::bind_laws(module);
  o80::mujoco::bind_filter(module);
}
