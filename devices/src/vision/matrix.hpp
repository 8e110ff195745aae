#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace o80::vision {

/// Small dense matrix, row by row.
template <std::size_t Rows, std::size_t Columns>
struct Matrix {
  std::array<double, Rows * Columns> values{};

  double& operator()(std::size_t row, std::size_t column) noexcept {
    return values[row * Columns + column];
  }
  double operator()(std::size_t row, std::size_t column) const noexcept {
    return values[row * Columns + column];
  }
  double& operator[](std::size_t index) noexcept
    requires(Columns == 1)
  {
    return values[index];
  }
  double operator[](std::size_t index) const noexcept
    requires(Columns == 1)
  {
    return values[index];
  }
  static Matrix identity() noexcept
    requires(Rows == Columns)
  {
    Matrix made;
    for (std::size_t i = 0; i < Rows; ++i) made(i, i) = 1;
    return made;
  }
};

template <std::size_t Rows>
using Column = Matrix<Rows, 1>;
using Vector = Column<3>;

template <std::size_t R, std::size_t C>
Matrix<R, C> operator+(Matrix<R, C> a, const Matrix<R, C>& b) noexcept {
  for (std::size_t i = 0; i < R * C; ++i) a.values[i] += b.values[i];
  return a;
}
template <std::size_t R, std::size_t C>
Matrix<R, C> operator-(Matrix<R, C> a, const Matrix<R, C>& b) noexcept {
  for (std::size_t i = 0; i < R * C; ++i) a.values[i] -= b.values[i];
  return a;
}
template <std::size_t R, std::size_t C>
Matrix<R, C> operator*(double factor, Matrix<R, C> a) noexcept {
  for (double& value : a.values) value *= factor;
  return a;
}
template <std::size_t R, std::size_t N, std::size_t C>
Matrix<R, C> operator*(const Matrix<R, N>& a, const Matrix<N, C>& b) noexcept {
  Matrix<R, C> product;
  for (std::size_t i = 0; i < R; ++i) {
    for (std::size_t k = 0; k < N; ++k) {
      for (std::size_t j = 0; j < C; ++j) product(i, j) += a(i, k) * b(k, j);
    }
  }
  return product;
}
template <std::size_t R, std::size_t C>
Matrix<C, R> transposed(const Matrix<R, C>& a) noexcept {
  Matrix<C, R> turned;
  for (std::size_t i = 0; i < R; ++i) {
    for (std::size_t j = 0; j < C; ++j) turned(j, i) = a(i, j);
  }
  return turned;
}

inline double dot(const Vector& a, const Vector& b) noexcept {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
inline double length(const Vector& a) noexcept { return std::sqrt(dot(a, a)); }

/// Inverts a symmetric 3 x 3 matrix by its cofactors; false: not invertible.
inline bool invert(const Matrix<3, 3>& a, Matrix<3, 3>& inverse) noexcept {
  const auto cofactor = [&](std::size_t i, std::size_t j) {
    const std::size_t i1 = (i + 1) % 3;
    const std::size_t i2 = (i + 2) % 3;
    const std::size_t j1 = (j + 1) % 3;
    const std::size_t j2 = (j + 2) % 3;
    return a(i1, j1) * a(i2, j2) - a(i1, j2) * a(i2, j1);
  };
  const double determinant =
      a(0, 0) * cofactor(0, 0) + a(0, 1) * cofactor(0, 1) + a(0, 2) * cofactor(0, 2);
  const double scale = a(0, 0) * a(1, 1) * a(2, 2);
  if (!(std::abs(determinant) > 1e-12 * std::abs(scale))) return false;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) inverse(i, j) = cofactor(j, i) / determinant;
  }
  return true;
}

}  // namespace o80::vision
