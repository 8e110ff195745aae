#include "pam/arm.hpp"

#include <algorithm>
#include <cmath>

namespace o80::pam {
namespace {

Vector operator+(const Vector& a, const Vector& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}
Vector operator*(double s, const Vector& a) { return {s * a[0], s * a[1], s * a[2]}; }
double dot(const Vector& a, const Vector& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vector cross(const Vector& a, const Vector& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

constexpr Vector kUp{0.0, 0.0, 1.0};
constexpr Vector kAcross{0.0, 1.0, 0.0};  // axis of joints 2 and 3

Link ball(double mass, double centre, double radius) {
  const double i = 0.4 * mass * radius * radius;
  return {mass, centre, {i, i, i}};
}

Link tube(double mass, double centre, double radius, double half_length) {
  const double across = mass * (radius * radius / 2.0 + half_length * half_length / 3.0);
  return {mass, centre, {across, across, mass * radius * radius}};
}

Link elliptic_plate(double mass, double centre, double half_width, double half_length,
                    double thickness) {
  const double x = half_width * half_width / 4.0;
  const double y = thickness * thickness / 12.0;
  const double z = half_length * half_length / 4.0;
  return {mass, centre, {mass * (y + z), mass * (x + z), mass * (x + y)}};
}

}  // namespace

// The arm in axes that turn with joint 1: all links lie in the plane of x and z.
struct Arm::Plane {
  explicit Plane(const Joints& q)
      : c1(std::cos(q[0])),
        s1(std::sin(q[0])),
        upper{std::sin(q[1]), 0.0, std::cos(q[1])},
        fore{std::sin(q[1] + q[2]), 0.0, std::cos(q[1] + q[2])},
        c4(std::cos(q[3])),
        s4(std::sin(q[3])) {}

  Vector elbow() const { return Vector{0.0, 0.0, kShoulderHeight} + kUpperArmLength * upper; }
  Vector to_world(const Vector& v) const {
    return {c1 * v[0] - s1 * v[1], s1 * v[0] + c1 * v[1], v[2]};
  }

  double c1, s1;
  Vector upper, fore;  // directions of the upper arm and the forearm
  double c4, s4;
};

namespace {

// Transforms a vector to the axes of a link (x in the plane, z along the link), and back.
Vector into(const Vector& along, const Vector& v) {
  return {along[2] * v[0] - along[0] * v[2], v[1], along[0] * v[0] + along[2] * v[2]};
}
Vector out_of(const Vector& along, const Vector& v) {
  return {along[2] * v[0] + along[0] * v[2], v[1], -along[0] * v[0] + along[2] * v[2]};
}

// Inertia of a link turned about its z by the wrist: the x-y block; z is unchanged.
struct Turned {
  Turned(const Vector& inertia, double c, double s)
      : xx(c * c * inertia[0] + s * s * inertia[1]),
        yy(s * s * inertia[0] + c * c * inertia[1]),
        xy(s * c * (inertia[0] - inertia[1])),
        zz(inertia[2]) {}
  Vector times(const Vector& v) const {
    return {xx * v[0] + xy * v[1], xy * v[0] + yy * v[1], zz * v[2]};
  }
  double xx, yy, xy, zz;
};

// A positive definite matrix as L D L^T: below the diagonal L, on it the inverse of D. Divisions
// are slow, so there is one for each row.
JointMatrix factor(JointMatrix m) {
  for (std::size_t j = 0; j < kJoints; ++j) {
    Joints scaled{};  // row j of L D
    for (std::size_t k = 0; k < j; ++k) {
      scaled[k] = m[j][k];
      m[j][k] *= m[k][k];
      m[j][j] -= m[j][k] * scaled[k];
    }
    m[j][j] = 1.0 / m[j][j];
    for (std::size_t i = j + 1; i < kJoints; ++i) {
      for (std::size_t k = 0; k < j; ++k) m[i][j] -= m[i][k] * m[j][k];
    }
  }
  return m;
}

Joints solve(const JointMatrix& factors, Joints b) {
  for (std::size_t i = 0; i < kJoints; ++i) {
    for (std::size_t k = 0; k < i; ++k) b[i] -= factors[i][k] * b[k];
  }
  for (std::size_t i = 0; i < kJoints; ++i) b[i] *= factors[i][i];
  for (std::size_t i = kJoints; i-- > 0;) {
    for (std::size_t k = i + 1; k < kJoints; ++k) b[i] -= factors[k][i] * b[k];
  }
  return b;
}

// Effect of a unit impulse on each joint.
JointMatrix responses(const JointMatrix& factors) {
  JointMatrix response;
  for (std::size_t j = 0; j < kJoints; ++j) {
    Joints unit{};
    unit[j] = 1.0;
    response[j] = solve(factors, unit);
  }
  return response;
}

// State of dry friction of each joint: 1 or -1 for sliding towards larger or smaller
// angles, 0 for sticking.
using Sliding = std::array<int, kJoints>;

// Computes the speeds after a step with the assumption `sliding`, and whether they are consistent;
// else corrects the first inconsistent joint. `most`: largest impulse of friction [Nm s].
bool slides_so(const JointMatrix& mass, const Joints& momentum, const Joints& most,
               Sliding& sliding, Joints& dq) {
  // a sticking joint has the equation speed = 0
  JointMatrix moving = mass;
  Joints pushed{};
  for (std::size_t j = 0; j < kJoints; ++j) {
    if (sliding[j] != 0 || most[j] == 0.0) {
      pushed[j] = momentum[j] - sliding[j] * most[j];
      continue;
    }
    for (std::size_t i = 0; i < kJoints; ++i) moving[i][j] = moving[j][i] = 0.0;
    moving[j][j] = 1.0;
  }
  dq = solve(factor(moving), pushed);

  for (std::size_t j = 0; j < kJoints; ++j) {
    if (most[j] == 0.0) continue;
    if (sliding[j] != 0) {
      if (sliding[j] * dq[j] >= 0.0) continue;
      sliding[j] = 0;
      return false;
    }
    double needed = -momentum[j];  // impulse
    for (std::size_t i = 0; i < kJoints; ++i) needed += mass[j][i] * dq[i];
    if (std::abs(needed) <= most[j]) continue;
    sliding[j] = needed > 0.0 ? -1 : 1;
    return false;
  }
  return true;
}

// Computes the speeds under dry friction: mass * dq = momentum + impulses of at most
// `most`. A linear complementarity problem with bounds; correcting the first inconsistent joint
// never repeats one of the 3^4 assumptions (Murty's least-index rule).
Joints rubbed(const JointMatrix& mass, const Joints& momentum, const Joints& most,
              const Joints& before) {
  Sliding sliding{};
  for (std::size_t j = 0; j < kJoints; ++j) {
    if (most[j] > 0.0) sliding[j] = (before[j] > 0.0) - (before[j] < 0.0);
  }
  Joints dq{};
  for (int round = 0; round < 81 && !slides_so(mass, momentum, most, sliding, dq); ++round) {
  }
  return dq;
}

// Computes the smallest impulses that keep every joint within its stops for `duration`.
void stop_at_limits(const Joints& q, const JointMatrix& mass, double duration, Joints& dq) {
  const auto passes = [&](std::size_t j) {
    return std::abs(q[j] + duration * dq[j]) > kJointLimit;
  };
  bool any = false;
  for (std::size_t j = 0; j < kJoints; ++j) any = any || passes(j);
  if (!any) return;

  // projected Gauss-Seidel on the impulses; at most one of the two stops of a joint is near
  const JointMatrix response = responses(factor(mass));
  Joints impulse{};
  bool settled = false;
  for (int sweep = 0; sweep < 20 && !settled; ++sweep) {
    settled = true;
    for (std::size_t j = 0; j < kJoints; ++j) {
      const double side = q[j] > 0.0 ? 1.0 : -1.0;
      const double allowed = (kJointLimit - side * q[j]) / duration;  // speed towards the stop
      const double excess = side * dq[j] - allowed;
      const double next = std::max(0.0, impulse[j] + excess / response[j][j]);
      const double change = side * (next - impulse[j]);
      if (change == 0.0) continue;
      settled = false;
      impulse[j] = next;
      for (std::size_t i = 0; i < kJoints; ++i) dq[i] -= response[j][i] * change;
    }
  }
}

}  // namespace

Link joined(const Link& a, const Link& b) noexcept {
  Link whole{.mass = a.mass + b.mass};
  whole.centre = (a.mass * a.centre + b.mass * b.centre) / whole.mass;
  for (const Link& part : {a, b}) {
    const double offset = part.centre - whole.centre;
    const double steiner = part.mass * offset * offset;
    whole.inertia = whole.inertia + part.inertia + Vector{steiner, steiner, 0.0};
  }
  return whole;
}

Link published_forearm() noexcept {
  return joined(tube(0.114, 0.130, 0.013, 0.105), ball(0.02, 0.255, 0.02));
}

Link published_racket() noexcept {
  return elliptic_plate(0.663, kForearmLength, kBladeHalfWidth, kBladeHalfLength, kBladeThickness);
}

Links published_links() noexcept {
  constexpr double fitting = 0.03;  // radius [m]
  const Link shoulder = joined(ball(0.03, 0.0, fitting), ball(0.03, kShoulderHeight, fitting));
  const Link upper_arm =
      joined(joined(ball(0.03, 0.0, fitting), tube(0.148, 0.5 * kUpperArmLength, 0.013, 0.1425)),
             ball(0.03, kUpperArmLength, fitting));
  const Link elbow = ball(0.03, 0.0, fitting);
  return {shoulder, upper_arm, elbow, joined(published_forearm(), published_racket())};
}

JointMatrix Arm::mass_matrix(const Joints& q) const noexcept { return mass_matrix(Plane(q)); }

JointMatrix Arm::mass_matrix(const Plane& plane) const noexcept {
  const auto& [shoulder, upper, elbow, fore] = links_;
  const double u = upper.centre, f = fore.centre, l = kUpperArmLength;
  const double su = plane.upper[0], sf = plane.fore[0], cf = plane.fore[2];
  const Turned i4(fore.inertia, plane.c4, plane.s4);

  // distances from the axis of joint 1, and the lever arms of the forearm on joints 2 and 3
  const double xu = u * su, xe = l * su, xf = xe + f * sf;
  const double bend = f * l * dot(plane.upper, plane.fore);

  JointMatrix m{};
  m[0][0] = upper.mass * xu * xu + elbow.mass * xe * xe + fore.mass * xf * xf +
            shoulder.inertia[2] + su * su * upper.inertia[0] +
            plane.upper[2] * plane.upper[2] * upper.inertia[2] + sf * sf * elbow.inertia[0] +
            cf * cf * elbow.inertia[2] + sf * sf * i4.xx + cf * cf * i4.zz;
  m[1][0] = m[2][0] = -sf * i4.xy;
  m[3][0] = cf * i4.zz;
  m[2][2] = fore.mass * f * f + elbow.inertia[1] + i4.yy;
  m[2][1] = m[2][2] + fore.mass * bend;
  m[1][1] = m[2][2] + upper.mass * u * u + upper.inertia[1] + (elbow.mass + fore.mass) * l * l +
            2.0 * fore.mass * bend;
  m[3][3] = i4.zz;
  for (std::size_t i = 0; i < kJoints; ++i) {
    m[i][i] += config_.armature[i];
    for (std::size_t j = 0; j < i; ++j) m[j][i] = m[i][j];
  }
  return m;
}

Joints Arm::bias(const Joints& q, const Joints& dq) const noexcept { return bias(Plane(q), dq); }

Joints Arm::bias(const Plane& plane, const Joints& dq) const noexcept {
  const auto& [shoulder, upper, elbow, fore] = links_;
  const Vector& zu = plane.upper;
  const Vector& zf = plane.fore;

  // angular velocities and accelerations from the base outwards, at constant joint velocities
  const Vector w1 = dq[0] * kUp;
  const Vector w2 = w1 + dq[1] * kAcross;
  const Vector w3 = w2 + dq[2] * kAcross;
  const Vector w4 = w3 + dq[3] * zf;
  const Vector a2 = dq[1] * cross(w1, kAcross);
  const Vector a3 = (dq[1] + dq[2]) * cross(w1, kAcross);
  const Vector a4 = a3 + dq[3] * cross(w3, zf);
  const auto swing = [](const Vector& w, const Vector& a, const Vector& arm) {
    return cross(a, arm) + cross(w, cross(w, arm));
  };

  // forces and moments of that motion; gravity is an upward acceleration
  const Vector up = config_.gravity * kUp;
  const Vector at_elbow = swing(w2, a2, kUpperArmLength * zu);
  const Vector force2 = upper.mass * (up + swing(w2, a2, upper.centre * zu));
  const Vector force3 = elbow.mass * (up + at_elbow);
  const Vector force4 = fore.mass * (up + at_elbow + swing(w3, a3, fore.centre * zf));
  const auto moment = [](const Turned& inertia, const Vector& z, const Vector& w, const Vector& a) {
    const Vector spin = into(z, w);
    return out_of(z, inertia.times(into(z, a)) + cross(spin, inertia.times(spin)));
  };
  const Vector n2 = moment(Turned(upper.inertia, 1.0, 0.0), zu, w2, a2);
  const Vector n3 = moment(Turned(elbow.inertia, 1.0, 0.0), zf, w3, a3);
  const Vector n4 = moment(Turned(fore.inertia, plane.c4, plane.s4), zf, w4, a4);

  // summed inwards
  const Vector about_elbow = n3 + n4 + cross(fore.centre * zf, force4);
  const Vector about_shoulder = about_elbow + n2 + cross(upper.centre * zu, force2) +
                                cross(kUpperArmLength * zu, force3 + force4);
  return {about_shoulder[2], about_shoulder[1], about_elbow[1], dot(zf, n4)};
}

Joints Arm::acceleration(const Motion& motion, const Joints& torque) const noexcept {
  Joints net = bias(motion.q, motion.dq);
  for (std::size_t j = 0; j < kJoints; ++j) {
    net[j] = torque[j] - net[j] - config_.damping[j] * motion.dq[j];
  }
  return solve(factor(mass_matrix(motion.q)), net);
}

double Arm::energy(const Motion& motion) const noexcept {
  const JointMatrix m = mass_matrix(motion.q);
  double kinetic = 0.0;
  for (std::size_t i = 0; i < kJoints; ++i) {
    for (std::size_t j = 0; j < kJoints; ++j)
      kinetic += 0.5 * motion.dq[i] * m[i][j] * motion.dq[j];
  }
  const Plane plane(motion.q);
  const auto& [shoulder, upper, elbow, fore] = links_;
  const double elbow_height = plane.elbow()[2];
  const double moment = shoulder.mass * shoulder.centre +
                        upper.mass * (kShoulderHeight + upper.centre * plane.upper[2]) +
                        elbow.mass * elbow_height +
                        fore.mass * (elbow_height + fore.centre * plane.fore[2]);
  return kinetic + config_.gravity * moment;
}

void Arm::advance(Motion& motion, const Joints& torque, double duration) const noexcept {
  // (M + h D) dq' = M dq + h (torque - bias) + friction
  const Plane plane(motion.q);
  JointMatrix m = mass_matrix(plane);
  const Joints bias_torque = bias(plane, motion.dq);
  Joints momentum{};
  for (std::size_t i = 0; i < kJoints; ++i) {
    momentum[i] = duration * (torque[i] - bias_torque[i]);
    for (std::size_t j = 0; j < kJoints; ++j) momentum[i] += m[i][j] * motion.dq[j];
  }
  for (std::size_t i = 0; i < kJoints; ++i) m[i][i] += duration * config_.damping[i];
  if (config_.friction == Joints{}) {
    motion.dq = solve(factor(m), momentum);
  } else {
    Joints most{};
    for (std::size_t i = 0; i < kJoints; ++i) most[i] = duration * config_.friction[i];
    motion.dq = rubbed(m, momentum, most, motion.dq);
  }
  stop_at_limits(motion.q, m, duration, motion.dq);
  for (std::size_t i = 0; i < kJoints; ++i) {
    motion.q[i] = std::clamp(motion.q[i] + duration * motion.dq[i], -kJointLimit, kJointLimit);
  }
}

RacketMotion Arm::racket(const Motion& motion) const noexcept {
  const Plane plane(motion.q);
  const Vector& zf = plane.fore;
  const Vector arm = kForearmLength * zf;
  const Vector position = plane.to_world(plane.elbow() + arm);

  // axes of the racket: the forearm's axes, turned by the wrist
  const Vector in_plane{zf[2], 0.0, -zf[0]};
  const Vector x = plane.to_world(plane.c4 * in_plane + plane.s4 * kAcross);
  const Vector y = plane.to_world(-plane.s4 * in_plane + plane.c4 * kAcross);
  const Vector z = plane.to_world(zf);

  const Vector w2 = motion.dq[0] * kUp + motion.dq[1] * kAcross;
  const Vector w3 = w2 + motion.dq[2] * kAcross;
  return {.position = config_.base + position,
          .rotation = {x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]},
          .velocity = plane.to_world(cross(w2, kUpperArmLength * plane.upper) + cross(w3, arm)),
          .angular_velocity = plane.to_world(w3 + motion.dq[3] * zf)};
}

std::optional<Joints> Arm::posture_reaching(const Vector& point, double wrist) const noexcept {
  const Vector target = point + -1.0 * config_.base;
  const double turn = std::atan2(target[1], target[0]);
  const double out = std::hypot(target[0], target[1]);
  const double height = target[2] - kShoulderHeight;

  // triangle of upper arm, forearm and the line from shoulder to racket
  const double a = kUpperArmLength, b = kForearmLength;
  const double square = out * out + height * height;
  const double cosine = (square - a * a - b * b) / (2.0 * a * b);
  if (std::abs(cosine) > 1.0) return std::nullopt;
  const double bend = std::acos(cosine);
  const double lift = std::atan2(out, height) - std::atan2(b * std::sin(bend), a + b * cosine);

  const Joints posture{turn, lift, bend, wrist};
  for (double angle : posture) {
    if (std::abs(angle) > kJointLimit) return std::nullopt;
  }
  return posture;
}

}  // namespace o80::pam
