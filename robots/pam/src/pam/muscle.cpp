#include "pam/muscle.hpp"

#include <algorithm>
#include <cmath>

#include "pam/bracketed_root.hpp"

namespace o80::pam {

Pull LinearMuscle::pull(double length, double, double, double activation) const noexcept {
  return {.force = resting_force(length, activation)};
}

double LinearMuscle::resting_fibre_length(double, double) const noexcept { return 0.0; }

double LinearMuscle::resting_force(double length, double activation) const noexcept {
  const double contraction = full_force_length - length;
  return maximum_force * activation * std::max(0.0, 1.0 - contraction / stroke);
}

HillMuscle::HillMuscle(const Parameters& parameters) noexcept
    : p_(parameters),
      parallel_stiffness_(
          p_.parallel_force * p_.maximum_force /
          std::pow(p_.optimal_length * (p_.width_descending + 1.0 - p_.parallel_rest),
                   p_.parallel_exponent)),
      series_exponent_(p_.series_toe / p_.series_linear),
      series_stiffness_toe_(p_.series_force /
                            std::pow(p_.series_toe * p_.series_rest, series_exponent_)),
      series_stiffness_(p_.series_force / (p_.series_linear * p_.series_rest)),
      largest_damping_(p_.damping * p_.maximum_force * p_.hill_a /
                       (p_.optimal_length * p_.hill_b)) {}

double HillMuscle::isometric(double fibre_length) const noexcept {
  const double stretch = fibre_length / p_.optimal_length - 1.0;
  const bool descending = stretch >= 0.0;
  const double width = descending ? p_.width_descending : p_.width_ascending;
  const double exponent = descending ? p_.exponent_descending : p_.exponent_ascending;
  return std::exp(-std::pow(std::abs(stretch) / width, exponent));
}

double HillMuscle::parallel_force(double fibre_length) const noexcept {
  const double stretch = fibre_length - p_.parallel_rest * p_.optimal_length;
  return stretch > 0.0 ? parallel_stiffness_ * std::pow(stretch, p_.parallel_exponent) : 0.0;
}

double HillMuscle::series_force(double series_length) const noexcept {
  const double stretch = series_length - p_.series_rest;
  const double toe = p_.series_toe * p_.series_rest;
  if (stretch <= 0.0) return 0.0;
  if (stretch < toe) return series_stiffness_toe_ * std::pow(stretch, series_exponent_);
  return p_.series_force + series_stiffness_ * (stretch - toe);
}

HillMuscle::Fibre HillMuscle::fibre(double fibre_length, double activation) const noexcept {
  const double active = std::max(activation, p_.minimum_activation);
  const double bell = isometric(fibre_length);
  const double shape = fibre_length < p_.optimal_length ? 1.0 : bell;
  return {.isometric = bell,
          .parallel = parallel_force(fibre_length),
          .drive = active * bell,
          .hill_a = shape * 0.25 * p_.hill_a * (1.0 + 3.0 * active),
          .hill_b = p_.hill_b / 7.0 * (3.0 + 4.0 * active)};
}

HillMuscle::Curve HillMuscle::eccentric(const Fibre& fibre) const noexcept {
  return {.a = -p_.eccentric_force * fibre.drive,
          .b = fibre.drive * (1.0 - p_.eccentric_force) / (fibre.drive + fibre.hill_a) *
               fibre.hill_b / p_.eccentric_slope};
}

double HillMuscle::contractile(const Fibre& fibre, double fibre_velocity) const noexcept {
  const Curve curve =
      fibre_velocity > 0.0 ? eccentric(fibre) : Curve{.a = fibre.hill_a, .b = fibre.hill_b};
  return p_.maximum_force *
         ((fibre.drive + curve.a) / (1.0 - fibre_velocity / (curve.b * p_.optimal_length)) -
          curve.a);
}

double HillMuscle::contractile_force(double fibre_length, double fibre_velocity,
                                     double activation) const noexcept {
  return contractile(fibre(fibre_length, activation), fibre_velocity);
}

double HillMuscle::damping_force(double contractile_and_parallel,
                                 double stretching) const noexcept {
  const double load = contractile_and_parallel / p_.maximum_force;
  return largest_damping_ * ((1.0 - p_.damping_at_rest) * load + p_.damping_at_rest) * stretching;
}

// series + damping = contractile + parallel, quadratic in the velocity of the fibre
double HillMuscle::velocity_in_balance(const Fibre& fibre, const Curve& curve, double sign,
                                       double velocity, double series) const noexcept {
  const double rest = p_.damping_at_rest;
  const double passive = fibre.parallel / p_.maximum_force;
  const double d0 = p_.optimal_length * curve.b * largest_damping_ *
                    (rest + (1.0 - rest) * (fibre.drive + passive));
  const double c2 = largest_damping_ * (rest - (curve.a - passive) * (1.0 - rest));
  const double c1 = -(c2 * velocity + d0 + series - fibre.parallel + p_.maximum_force * curve.a);
  const double c0 = d0 * velocity + p_.optimal_length * curve.b *
                                        (series - fibre.parallel - p_.maximum_force * fibre.drive);
  const double discriminant = std::max(0.0, c1 * c1 - 4.0 * c2 * c0);
  return (-c1 + sign * std::sqrt(discriminant)) / (2.0 * c2);
}

double HillMuscle::fibre_velocity(const Fibre& fibre, double velocity,
                                  double series) const noexcept {
  const double shortening =
      velocity_in_balance(fibre, {.a = fibre.hill_a, .b = fibre.hill_b}, -1.0, velocity, series);
  if (shortening <= 0.0) return shortening;
  return velocity_in_balance(fibre, eccentric(fibre), +1.0, velocity, series);
}

Pull HillMuscle::pull(double length, double velocity, double fibre_length,
                      double activation) const noexcept {
  const Fibre now = fibre(fibre_length, activation);
  const double series = series_force(length - fibre_length);
  const double fibre_speed = fibre_velocity(now, velocity, series);
  const double damping =
      damping_force(contractile(now, fibre_speed) + now.parallel, velocity - fibre_speed);
  return {.force = std::max(0.0, series + damping), .fibre_velocity = fibre_speed};
}

double HillMuscle::resting_fibre_length(double length, double activation) const noexcept {
  const auto excess = [&](double fibre_length) {
    const Fibre now = fibre(fibre_length, activation);
    return series_force(length - fibre_length) - p_.maximum_force * now.drive - now.parallel;
  };
  return bracketed_root(excess, 0.0, length);
}

double HillMuscle::resting_force(double length, double activation) const noexcept {
  return series_force(length - resting_fibre_length(length, activation));
}

Muscle make_muscle(MuscleModel model, double maximum_force, double stroke) noexcept {
  if (model == MuscleModel::linear) {
    return LinearMuscle{.maximum_force = maximum_force, .stroke = stroke};
  }
  // all forces in the same proportion
  HillMuscle::Parameters parameters;
  parameters.series_force *= maximum_force / parameters.maximum_force;
  parameters.maximum_force = maximum_force;
  return HillMuscle(parameters);
}

}  // namespace o80::pam
