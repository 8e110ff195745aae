// o80_devices._vision: cameras, detection and consensus, for Python.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "vision/blobs.hpp"
#include "vision/camera.hpp"
#include "vision/consensus.hpp"

namespace nb = nanobind;
using namespace nb::literals;  // NOLINT(google-build-using-namespace)

namespace o80::vision {

namespace {

using Doubles = nb::ndarray<nb::numpy, double>;
using Points = nb::ndarray<const double, nb::shape<-1, 3>, nb::c_contig, nb::device::cpu>;
using Pixels = nb::ndarray<const double, nb::shape<-1, 2>, nb::c_contig, nb::device::cpu>;
using Sightings = nb::ndarray<const double, nb::shape<-1, 4>, nb::c_contig, nb::device::cpu>;
using Table =
    nb::ndarray<const std::uint8_t, nb::shape<32 * 32 * 32>, nb::c_contig, nb::device::cpu>;
using Bytes = nb::ndarray<const std::uint8_t, nb::shape<-1, -1, 3>, nb::c_contig, nb::device::cpu>;
using Place = nb::ndarray<const double, nb::shape<3>, nb::c_contig, nb::device::cpu>;

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

/// Makes a new array for the caller to fill.
Doubles array(std::vector<std::size_t> shape, double*& values) {
  std::size_t count = 1;
  for (const std::size_t each : shape) count *= each;
  values = new double[count > 0 ? count : 1];
  const nb::capsule owner(values, [](void* made) noexcept { delete[] static_cast<double*>(made); });
  return Doubles(values, shape.size(), shape.data(), owner);
}

template <std::size_t R, std::size_t C>
Doubles array_of(const Matrix<R, C>& matrix) {
  double* values = nullptr;
  Doubles made = C == 1 ? array({R}, values) : array({R, C}, values);
  std::copy(matrix.values.begin(), matrix.values.end(), values);
  return made;
}

Camera camera(const std::array<double, 2>& size, const std::array<double, 2>& focal,
              const std::array<double, 2>& centre, const std::array<double, 5>& distortion,
              const std::array<double, 9>& rotation, const std::array<double, 3>& translation) {
  if (!(size[0] >= 1) || !(size[1] >= 1) || !(focal[0] > 0) || !(focal[1] > 0)) {
    throw nb::value_error("the size and the focal lengths of a camera must be positive");
  }
  Camera made{focal, centre, distortion, {rotation}, {translation}};
  const Matrix<3, 3> unit = made.rotation * transposed(made.rotation);
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      if (std::abs(unit(i, j) - (i == j ? 1 : 0)) < 1e-6) continue;
      throw nb::value_error("the rotation of a camera must have rows at right angles, of length 1");
    }
  }
  made.prepare();
  return made;
}

Doubles project(const Camera& camera, const Points& points) {
  double* values = nullptr;
  Doubles made = array({points.shape(0), 3}, values);
  for (std::size_t i = 0; i < points.shape(0); ++i) {
    const Vector point{{points(i, 0), points(i, 1), points(i, 2)}};
    const std::optional<Projection> seen = camera.project(point);
    values[3 * i] = seen ? seen->pixel.x : kNone;
    values[3 * i + 1] = seen ? seen->pixel.y : kNone;
    values[3 * i + 2] = seen ? seen->depth : kNone;
  }
  return made;
}

Doubles directions(const Camera& camera, const Pixels& pixels) {
  double* values = nullptr;
  Doubles made = array({pixels.shape(0), 3}, values);
  for (std::size_t i = 0; i < pixels.shape(0); ++i) {
    const std::optional<Vector> found = camera.direction({pixels(i, 0), pixels(i, 1)});
    for (std::size_t j = 0; j < 3; ++j) values[3 * i + j] = found ? (*found)[j] : kNone;
  }
  return made;
}

BlobFinder blob_finder(const Table& table) {
  ColourTable copy;
  std::copy_n(table.data(), copy.size(), copy.begin());
  return BlobFinder(copy);
}

Doubles find(BlobFinder& finder, const Bytes& image, std::optional<std::array<int, 4>> region,
             int step, double min_area) {
  constexpr std::size_t kLargest = 1 << 14;
  if (image.shape(0) > kLargest || image.shape(1) > kLargest) {
    throw nb::value_error("an image can have at most 16384 rows and columns");
  }
  if (step < 1 || step > 64) throw nb::value_error("step must be from 1 to 64");
  const Image seen{image.data(), static_cast<int>(image.shape(1)),
                   static_cast<int>(image.shape(0))};
  const Region where = region ? Region{(*region)[0], (*region)[1], (*region)[2], (*region)[3]}
                              : Region{0, 0, seen.width, seen.height};
  std::vector<Blob> blobs;
  {
    const nb::gil_scoped_release released;
    blobs = finder.find(seen, where, {.step = step, .min_area = min_area});
  }
  double* values = nullptr;
  Doubles made = array({blobs.size(), 5}, values);
  for (const Blob& blob : blobs) {
    *values++ = blob.centre.x;
    *values++ = blob.centre.y;
    *values++ = blob.area;
    *values++ = blob.weight;
    *values++ = blob.cut ? 1 : 0;
  }
  return made;
}

std::optional<std::tuple<Doubles, Doubles, std::uint64_t, double>> locate_ball(
    const std::vector<Camera>& cameras, const Sightings& sightings, double tolerance, double noise,
    double radius, int least, const std::optional<Place>& expected) {
  if (cameras.size() > kMaxCameras) throw nb::value_error("there can be at most 16 cameras");
  std::vector<Sighting> list;
  for (std::size_t i = 0; i < std::min(sightings.shape(0), kMaxSightings); ++i) {
    const double camera = sightings(i, 0);
    if (!(camera >= 0) || !(camera < static_cast<double>(cameras.size()))) {
      throw nb::value_error("a sighting names a camera that is not in the list");
    }
    list.push_back({static_cast<int>(camera), {sightings(i, 1), sightings(i, 2)}, sightings(i, 3)});
  }
  ConsensusRule rule{tolerance, noise, radius, least, std::nullopt};
  if (expected) rule.expected = Vector{{(*expected)(0), (*expected)(1), (*expected)(2)}};
  const std::optional<Located> found = locate(cameras, list, rule);
  if (!found) return std::nullopt;
  return std::tuple(array_of(found->point), array_of(found->covariance), found->cameras,
                    found->residual);
}

}  // namespace

}  // namespace o80::vision

NB_MODULE(_vision, module) {
  using namespace o80::vision;  // NOLINT(google-build-using-namespace)
  module.doc() = "Cameras, detection of a ball in images, and its place.";
  nb::class_<Camera>(module, "Camera", "A pinhole camera with distortion, as OpenCV writes it.")
      .def(nb::new_(&camera), "size"_a, "focal"_a, "centre"_a, "distortion"_a, "rotation"_a,
           "translation"_a)
      .def("project", &project, "points"_a,
           "(N, 3) [m] => (N, 3): x and y [px] and depth [m]; NaN where it is not seen.")
      .def("directions", &directions, "pixels"_a,
           "(N, 2) [px] => (N, 3) of length 1, in the world; NaN where nothing is seen.")
      .def_prop_ro(
          "place", [](const Camera& self) { return array_of(self.place()); },
          nb::rv_policy::automatic, "(3,) in the world [m].");
  nb::class_<BlobFinder>(module, "BlobFinder", "Finds blobs of the colour of a ball.")
      .def(nb::new_(&blob_finder), "table"_a,
           "table: (32768,) probabilities, 0 to 255, by 5 bits of red, green, blue.")
      .def("find", &find, "image"_a, "region"_a = nb::none(), "step"_a = 1, "min_area"_a = 6.0,
           "(n, 5): x, y [px], area [px^2], weight, 1 if the region cuts it; the largest first.");
  module.def("locate", &locate_ball, "cameras"_a, "sightings"_a, "tolerance"_a = 3.0,
             "noise"_a = 0.3, "radius"_a = 0.02, "least"_a = 2, "expected"_a = nb::none(),
             "sightings (n, 4): camera, x, y, area => point, covariance, cameras as bits, residual "
             "[px] of the largest consistent subset; None: no cameras agree.");
}
