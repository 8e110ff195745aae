#include "vision/filter.hpp"

#include <array>

namespace o80::vision {

namespace {

using State = Column<BallFilter::kSize>;

State state_of(const Ball& ball) noexcept {
  State state;
  for (std::size_t i = 0; i < 3; ++i) {
    state[i] = ball.position[i];
    state[3 + i] = ball.velocity[i];
    state[6 + i] = ball.spin[i];
  }
  return state;
}

Ball ball_of(const State& state) noexcept {
  Ball ball;
  for (std::size_t i = 0; i < 3; ++i) {
    ball.position[i] = state[i];
    ball.velocity[i] = state[3 + i];
    ball.spin[i] = state[6 + i];
  }
  return ball;
}

}  // namespace

void BallFilter::begin(const Vector& point, const Matrix<3, 3>& covariance) noexcept {
  begin(point, covariance, {}, rule_.first_velocity);
}

void BallFilter::begin(const Vector& point, const Matrix<3, 3>& covariance, const Vector& velocity,
                       double spread) noexcept {
  ball_ = {point, velocity, {}};
  covariance_ = {};
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) covariance_(i, j) = covariance(i, j);
    covariance_(3 + i, 3 + i) = spread * spread;
    covariance_(6 + i, 6 + i) = rule_.first_spin * rule_.first_spin;
  }
}

Matrix<BallFilter::kSize, BallFilter::kSize> BallFilter::slope(double duration,
                                                               int bounces) const noexcept {
  Matrix<kSize, kSize> made;
  const State middle = state_of(ball_);
  int none = 0;
  const State ahead = state_of(advanced(ball_, law_, duration, none));
  for (std::size_t j = 0; j < kSize; ++j) {
    const double reach = j < 3 ? 1e-5 : (j < 6 ? 1e-4 : 1e-2);
    // a side with another number of bounces gives no slope
    std::array<State, 2> sides{ahead, ahead};
    double apart = 0;
    for (std::size_t side = 0; side < 2; ++side) {
      State moved = middle;
      moved[j] += side == 0 ? -reach : reach;
      int bounced = 0;
      const State end = state_of(advanced(ball_of(moved), law_, duration, bounced));
      if (bounced != bounces) continue;
      sides[side] = end;
      apart += reach;
    }
    if (apart == 0) {
      made(j, j) = 1;
      continue;
    }
    for (std::size_t i = 0; i < kSize; ++i) made(i, j) = (sides[1][i] - sides[0][i]) / apart;
  }
  return made;
}

void BallFilter::predict(double duration) noexcept {
  if (!(duration > 0)) return;
  int bounces = 0;
  const Ball next = advanced(ball_, law_, duration, bounces);
  const Matrix<kSize, kSize> change = slope(duration, bounces);
  covariance_ = change * covariance_ * transposed(change);
  ball_ = next;

  const double velocity =
      rule_.acceleration_noise * duration + bounces * rule_.bounce_velocity * rule_.bounce_velocity;
  const double spin = rule_.spin_noise * duration + bounces * rule_.bounce_spin * rule_.bounce_spin;
  for (std::size_t i = 0; i < 3; ++i) {
    covariance_(i, i) += velocity * duration * duration / 3;
    covariance_(i, 3 + i) += velocity * duration / 2;
    covariance_(3 + i, i) += velocity * duration / 2;
    covariance_(3 + i, 3 + i) += velocity;
    covariance_(6 + i, 6 + i) += spin;
  }
}

Matrix<3, 3> BallFilter::innovation(const Matrix<3, 3>& covariance) const noexcept {
  Matrix<3, 3> sum = covariance;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) sum(i, j) += covariance_(i, j);
  }
  return sum;
}

double BallFilter::distance(const Vector& point, const Matrix<3, 3>& covariance) const noexcept {
  Matrix<3, 3> inverse;
  if (!invert(innovation(covariance), inverse)) return 1e300;
  const Vector apart = point - ball_.position;
  return dot(apart, inverse * apart);
}

void BallFilter::update(const Vector& point, const Matrix<3, 3>& covariance) noexcept {
  Matrix<3, 3> inverse;
  if (!invert(innovation(covariance), inverse)) return;
  Matrix<kSize, 3> seen;  // covariance of state and point
  for (std::size_t i = 0; i < kSize; ++i) {
    for (std::size_t j = 0; j < 3; ++j) seen(i, j) = covariance_(i, j);
  }
  const Matrix<kSize, 3> gain = seen * inverse;
  ball_ = ball_of(state_of(ball_) + gain * (point - ball_.position));

  // Joseph's form keeps the covariance symmetric and positive
  Matrix<kSize, kSize> rest = Matrix<kSize, kSize>::identity();
  for (std::size_t i = 0; i < kSize; ++i) {
    for (std::size_t j = 0; j < 3; ++j) rest(i, j) -= gain(i, j);
  }
  covariance_ = rest * covariance_ * transposed(rest) + gain * covariance * transposed(gain);
}

}  // namespace o80::vision
