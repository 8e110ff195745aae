#include "vision/consensus.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace o80::vision {

namespace {

constexpr double kSizeFactor = 4;  // largest ratio of a blob's size to the ball's expected one

/// Agreeing sightings, one a camera.
struct Chosen {
  std::array<const Sighting*, kMaxCameras> sightings;
  std::size_t count = 0;
};

class Search {
 public:
  Search(std::span<const Camera> cameras, std::span<const Sighting> sightings,
         const ConsensusRule& rule) noexcept
      : cameras_(cameras), sightings_(sightings), rule_(rule) {
    for (std::size_t i = 0; i < sightings.size(); ++i) {
      directions_[i] = camera_of(sightings[i]).direction(sightings[i].pixel);
    }
    for (std::size_t i = 0; i < cameras.size(); ++i) places_[i] = cameras[i].place();
  }

  std::optional<Located> run() const noexcept {
    std::optional<Located> best;
    for (std::size_t i = 0; i < sightings_.size(); ++i) {
      for (std::size_t j = i + 1; j < sightings_.size(); ++j) {
        if (sightings_[i].camera == sightings_[j].camera) continue;
        const std::optional<Located> found = proposed(i, j);
        if (!found || found->count < rule_.least) continue;
        if (!best || found->count > best->count ||
            (found->count == best->count && badness(*found) < badness(*best))) {
          best = found;
        }
      }
    }
    return best;
  }

 private:
  double badness(const Located& found) const noexcept {
    return rule_.expected ? length(found.point - *rule_.expected) : found.residual;
  }

  const Camera& camera_of(const Sighting& sighting) const noexcept {
    return cameras_[static_cast<std::size_t>(sighting.camera)];
  }

  /// Two sightings => middle between their rays, sightings near to it, best point.
  std::optional<Located> proposed(std::size_t i, std::size_t j) const noexcept {
    if (!directions_[i] || !directions_[j]) return std::nullopt;
    Vector point;
    if (!between_rays(i, j, point)) return std::nullopt;
    Chosen chosen = near(point, 3 * rule_.tolerance);
    std::optional<Located> found = refined(point, chosen);
    if (!found) return std::nullopt;
    // drops sightings too far from the better point, and refines the point without them
    const Chosen confirmed = near(found->point, rule_.tolerance);
    found = refined(found->point, confirmed);
    if (!found || near(found->point, rule_.tolerance).count != confirmed.count) return std::nullopt;
    return found;
  }

  bool between_rays(std::size_t i, std::size_t j, Vector& point) const noexcept {
    const Vector& a = *directions_[i];
    const Vector& b = *directions_[j];
    const Vector& place_a = places_[static_cast<std::size_t>(sightings_[i].camera)];
    const Vector& place_b = places_[static_cast<std::size_t>(sightings_[j].camera)];
    const Vector apart = place_b - place_a;
    const double cosine = dot(a, b);
    const double sine2 = 1 - cosine * cosine;
    if (!(sine2 > 1e-6)) return false;  // parallel
    const double along_a = (dot(apart, a) - cosine * dot(apart, b)) / sine2;
    const double along_b = (cosine * dot(apart, a) - dot(apart, b)) / sine2;
    if (!(along_a > 0) || !(along_b > 0)) return false;
    point = 0.5 * (place_a + along_a * a + place_b + along_b * b);
    return true;
  }

  /// Selects each camera's sighting nearest to the projected point, within a distance.
  Chosen near(const Vector& point, double tolerance) const noexcept {
    std::array<const Sighting*, kMaxCameras> nearest{};
    std::array<double, kMaxCameras> distance{};
    for (const Sighting& each : sightings_) {
      const std::optional<Projection> seen = camera_of(each).project(point);
      if (!seen || !has_size(each, seen->depth)) continue;
      const double apart = std::hypot(seen->pixel.x - each.pixel.x, seen->pixel.y - each.pixel.y);
      const auto camera = static_cast<std::size_t>(each.camera);
      if (apart > tolerance || (nearest[camera] && distance[camera] <= apart)) continue;
      nearest[camera] = &each;
      distance[camera] = apart;
    }
    Chosen chosen;
    for (const Sighting* each : nearest) {
      if (each) chosen.sightings[chosen.count++] = each;
    }
    return chosen;
  }

  bool has_size(const Sighting& sighting, double depth) const noexcept {
    if (sighting.area <= 0) return true;
    const Camera& camera = camera_of(sighting);
    const double expected = std::numbers::pi * camera.focal[0] * camera.focal[1] * rule_.radius *
                            rule_.radius / (depth * depth);
    return sighting.area < kSizeFactor * expected && sighting.area * kSizeFactor > expected;
  }

  /// Minimises the squares of distances in the images by Gauss-Newton.
  std::optional<Located> refined(Vector point, const Chosen& chosen) const noexcept {
    if (chosen.count < 2) return std::nullopt;
    Located found;
    constexpr int kSteps = 5;
    for (int step = 0; step < kSteps; ++step) {
      Matrix<3, 3> normal;
      Vector right;
      double squares = 0;
      for (std::size_t k = 0; k < chosen.count; ++k) {
        const Sighting& sighting = *chosen.sightings[k];
        const std::optional<Projection> seen = camera_of(sighting).project(point);
        if (!seen) return std::nullopt;
        const Column<2> rest{{sighting.pixel.x - seen->pixel.x, sighting.pixel.y - seen->pixel.y}};
        const Matrix<3, 2> slope = transposed(seen->slope);
        normal = normal + slope * seen->slope;
        right = right + slope * rest;
        squares += rest[0] * rest[0] + rest[1] * rest[1];
      }
      Matrix<3, 3> inverse;
      if (!invert(normal, inverse)) return std::nullopt;
      const Vector change = inverse * right;
      found.residual = std::sqrt(squares / static_cast<double>(chosen.count));
      found.covariance = (rule_.noise * rule_.noise) * inverse;
      found.point = point;
      if (step > 0 && length(change) < 1e-7) break;
      point = point + change;
    }
    found.count = static_cast<int>(chosen.count);
    for (std::size_t k = 0; k < chosen.count; ++k) {
      found.cameras |= std::uint64_t{1} << chosen.sightings[k]->camera;
    }
    return found;
  }

  std::span<const Camera> cameras_;
  std::span<const Sighting> sightings_;
  const ConsensusRule& rule_;
  std::array<std::optional<Vector>, kMaxSightings> directions_;
  std::array<Vector, kMaxCameras> places_;
};

}  // namespace

std::optional<Located> locate(std::span<const Camera> cameras, std::span<const Sighting> sightings,
                              const ConsensusRule& rule) noexcept {
  return Search(cameras, sightings, rule).run();
}

}  // namespace o80::vision
