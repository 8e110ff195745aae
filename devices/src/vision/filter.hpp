#pragma once

#include "vision/flight.hpp"
#include "vision/matrix.hpp"

namespace o80::vision {

/// Noise assumed by the filter.
struct FilterRule {
  double acceleration_noise = 0.02;  // white noise of the acceleration [m^2/s^3]
  double spin_noise = 50;            // of the spin [rad^2/s^3]
  double bounce_velocity = 0.25;     // standard deviation added by a bounce [m/s]
  double bounce_spin = 20;           // [rad/s]
  double first_velocity = 8;         // initial standard deviation in each direction
  double first_spin = 60;            // [rad/s]
  double gate = 25;                  // largest squared distance of a point, in standard deviations
};

/// Extended Kalman filter of position, velocity and spin, with the law of flight and bounce.
class BallFilter {
 public:
  static constexpr std::size_t kSize = 9;
  using Covariance = Matrix<kSize, kSize>;

  BallFilter(const FlightLaw& law, const FilterRule& rule) noexcept : law_(law), rule_(rule) {}

  /// Starts at a point, with unknown velocity and spin.
  void begin(const Vector& point, const Matrix<3, 3>& covariance) noexcept;

  /// Starts with a known velocity; `spread`: its standard deviation in each direction [m/s].
  void begin(const Vector& point, const Matrix<3, 3>& covariance, const Vector& velocity,
             double spread) noexcept;

  /// Predicts over a time [s], at least 0.
  void predict(double duration) noexcept;

  /// Squared distance of a point from the prediction, in standard deviations.
  double distance(const Vector& point, const Matrix<3, 3>& covariance) const noexcept;

  /// Updates the state with a seen point.
  void update(const Vector& point, const Matrix<3, 3>& covariance) noexcept;

  const Ball& ball() const noexcept { return ball_; }
  const Covariance& covariance() const noexcept { return covariance_; }
  const FilterRule& rule() const noexcept { return rule_; }

 private:
  Matrix<kSize, kSize> slope(double duration, int bounces) const noexcept;
  Matrix<3, 3> innovation(const Matrix<3, 3>& covariance) const noexcept;

  FlightLaw law_;
  FilterRule rule_;
  Ball ball_;
  Covariance covariance_;
};

}  // namespace o80::vision
