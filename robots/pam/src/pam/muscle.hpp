#pragma once

#include <array>
#include <concepts>
#include <cstdint>
#include <variant>

namespace o80::pam {

/// Force of a muscle, and velocity of its contractile element.
struct Pull {
  double force = 0.0;           ///< [N], never negative: a muscle cannot push
  double fibre_velocity = 0.0;  ///< [m/s], 0 for a muscle without a contractile element
};

/// Law of a muscle: length, velocity, length of the contractile element (fibre) and
/// activation from 0 to 1 => pull. The law is constant; the caller holds the state.
template <class T>
concept MuscleLaw = requires(const T& law, double x) {
  { law.pull(x, x, x, x) } noexcept -> std::same_as<Pull>;  // length, velocity, fibre, act.
  { law.resting_fibre_length(x, x) } noexcept -> std::same_as<double>;  // length, activation
  { law.resting_force(x, x) } noexcept -> std::same_as<double>;         // length, activation
};

/// Length of a muscle with its tendon at a joint angle of zero [m].
inline constexpr double kRestLength = 0.68;

/// Pneumatic muscle whose force is linear in the pressure and in the contraction:
/// F = F_max a (1 - contraction / stroke), slack beyond the stroke.
struct LinearMuscle {
  double maximum_force = 1500.0;    ///< [N], at full pressure, not contracted
  double full_force_length = 0.70;  ///< [m], at which the contraction is zero
  double stroke = 0.10;             ///< [m], contraction at which the force is zero

  Pull pull(double length, double velocity, double fibre_length, double activation) const noexcept;
  double resting_fibre_length(double length, double activation) const noexcept;
  double resting_force(double length, double activation) const noexcept;
};

/// Muscle of Hill type after Haeufle et al. (2014): a contractile and a parallel elastic element,
/// in series with an elastic and a damping one. Concentric and eccentric force-velocity relation.
class HillMuscle {
 public:
  struct Parameters {
    double maximum_force = 1500.0;         ///< [N]
    double optimal_length = 0.2552835868;  ///< [m], of the contractile element
    double width_descending = 0.469110;    ///< of the force-length bell, beyond the optimum
    double width_ascending = 0.328754;
    double exponent_descending = 6.268913;
    double exponent_ascending = 3.506187;
    double hill_a = 0.246955;
    double hill_b = 2.372502;  ///< [1/s]
    double eccentric_slope = 7.539560;
    double eccentric_force = 1.185253;
    double parallel_rest = 0.929294;  ///< share of the optimal length
    double parallel_exponent = 2.625216;
    double parallel_force = 17.559679;  ///< share of the maximum force
    double damping = 0.999776;
    double damping_at_rest = 0.1;       ///< share of the largest damping
    double series_rest = 0.458792;      ///< [m]
    double series_toe = 0.042700;       ///< stretch at the end of the curved part
    double series_linear = 0.017204;    ///< further stretch that adds `series_force` once more
    double series_force = 1499.576;     ///< [N], at the end of the curved part
    double minimum_activation = 0.005;  ///< of a muscle that is not stimulated
  };

  HillMuscle() noexcept : HillMuscle(Parameters{}) {}
  explicit HillMuscle(const Parameters& parameters) noexcept;

  const Parameters& parameters() const noexcept { return p_; }

  /// Isometric force at full activation as a share of the maximum force; 1 at the optimal length.
  double isometric(double fibre_length) const noexcept;
  double parallel_force(double fibre_length) const noexcept;  ///< [N]
  double series_force(double series_length) const noexcept;   ///< [N]
  double contractile_force(double fibre_length, double fibre_velocity,
                           double activation) const noexcept;                               ///< [N]
  double damping_force(double contractile_and_parallel, double stretching) const noexcept;  ///< [N]

  Pull pull(double length, double velocity, double fibre_length, double activation) const noexcept;
  double resting_fibre_length(double length, double activation) const noexcept;
  double resting_force(double length, double activation) const noexcept;

 private:
  struct Fibre {  // values that depend on length and activation only
    double isometric, parallel;
    double drive;           // activation x isometric
    double hill_a, hill_b;  // of the concentric curve, relative to maximum force and length
  };
  struct Curve {  // force over velocity: one hyperbola for each direction
    double a, b;
  };
  Fibre fibre(double fibre_length, double activation) const noexcept;
  Curve eccentric(const Fibre& fibre) const noexcept;
  double contractile(const Fibre& fibre, double fibre_velocity) const noexcept;
  double velocity_in_balance(const Fibre& fibre, const Curve& curve, double sign, double velocity,
                             double series) const noexcept;
  double fibre_velocity(const Fibre& fibre, double velocity, double series) const noexcept;

  Parameters p_;
  double parallel_stiffness_;
  double series_exponent_;
  double series_stiffness_toe_;
  double series_stiffness_;
  double largest_damping_;
};

static_assert(MuscleLaw<LinearMuscle> && MuscleLaw<HillMuscle>);

/// The law of the muscles of a plant.
enum class MuscleModel : std::uint8_t { linear, hill };

/// Law chosen at run time.
using Muscle = std::variant<LinearMuscle, HillMuscle>;

/// Muscles of all joints; the two of a joint are equal. All joints have the same law with
/// different numbers, so that the law is chosen once.
using Muscles = std::array<Muscle, 4>;

/// `stroke`: of the linear law; the Hill law has none.
Muscle make_muscle(MuscleModel model, double maximum_force = 1500.0, double stroke = 0.10) noexcept;

}  // namespace o80::pam
