// SPDX-License-Identifier: Apache-2.0
/// Reconstruction filters: how the light at a film point is spread over the pixels around it.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "driftlight/scalar.h"

namespace driftlight {

/// h(x) h(y) by the distance from the centre of a pixel, in pixels; 0 beyond `radius`. h need not
/// be normalised (FilterWeights does that), and some are negative in places.
struct ReconstructionFilter {
  enum class Kind : std::uint8_t {
    Box,       ///< 1
    Tent,      ///< 1 - |x| / radius
    Gaussian,  ///< exp(-x^2 / 2 sigma^2) - exp(-radius^2 / 2 sigma^2)
    Cubic,     ///< Mitchell and Netravali 1988 with their B and C, spread from radius 2 to `radius`
    Lanczos    ///< sinc(x) sinc(x / radius)
  };
  static constexpr double kMinimumRadius = 0.1;
  static constexpr double kMaximumRadius = 16.0;

  Kind kind = Kind::Box;
  double radius = 0.5;
  double sigma = 0.5;
  double b = 1.0 / 3.0;
  double c = 1.0 / 3.0;

  /// A pixel is the mean over its own square.
  bool is_pixel() const { return kind == Kind::Box && radius == 0.5; }
  double operator()(double x) const;
  /// int_from^to h
  double integral(double from, double to) const;
};

/// Weights of a film point in the pixels around it, as many as `film` pixels are seen: h over its
/// integral over the film. So every pixel is a weighted mean of radiance, with weights that
/// integrate to one also at the edges of the film, beyond which there is none.
class FilterWeights {
 public:
  FilterWeights(const ReconstructionFilter& filter, int width, int height);

  bool is_pixel() const { return filter_.is_pixel(); }

  /// Calls visit(pixel, weight) for the pixels about film coordinates in [0, 1)^2, row by row.
  template <class Visit>
  void spread(const Vec2d& film, const Visit& visit) const {
    Span columns(*this, film.x(), column_scales_);
    Span rows(*this, film.y(), row_scales_);
    for (int y = rows.first; y <= rows.last; ++y)
      for (int x = columns.first; x <= columns.last; ++x)
        visit(static_cast<std::size_t>(y) * column_scales_.size() + static_cast<std::size_t>(x),
              columns[x] * rows[y]);
  }

 private:
  /// Along one axis.
  struct Span {
    Span(const FilterWeights& of, double position, const std::vector<double>& scales);
    double operator[](int i) const { return weights[static_cast<std::size_t>(i - first)]; }

    int first, last;
    std::array<double, 2 * static_cast<std::size_t>(ReconstructionFilter::kMaximumRadius) + 2>
        weights;
  };

  ReconstructionFilter filter_;
  std::vector<double> column_scales_;  ///< 1 / integral of h about each column over the film
  std::vector<double> row_scales_;
};

}  // namespace driftlight
