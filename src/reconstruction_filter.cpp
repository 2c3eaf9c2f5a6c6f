// SPDX-License-Identifier: Apache-2.0
#include "driftlight/reconstruction_filter.h"

#include <algorithm>
#include <boost/math/quadrature/gauss.hpp>

namespace driftlight {
namespace {

double sinc(double x) {
  if (std::abs(x) < 1e-8) return 1.0;
  return std::sin(kPi * x) / (kPi * x);
}

/// Mitchell and Netravali, "Reconstruction filters in computer graphics", SIGGRAPH 1988, for
/// x in [0, 2].
double cubic(double x, double b, double c) {
  if (x < 1.0)
    return ((12.0 - 9.0 * b - 6.0 * c) * x * x * x + (-18.0 + 12.0 * b + 6.0 * c) * x * x + 6.0 -
            2.0 * b) /
           6.0;
  return ((-b - 6.0 * c) * x * x * x + (6.0 * b + 30.0 * c) * x * x + (-12.0 * b - 48.0 * c) * x +
          8.0 * b + 24.0 * c) /
         6.0;
}

/// By column or row.
std::vector<double> scales(const ReconstructionFilter& filter, int size) {
  std::vector<double> result;
  result.reserve(static_cast<std::size_t>(size));
  for (int i = 0; i < size; ++i) {
    const double to_start = -(i + 0.5);
    result.push_back(1.0 / filter.integral(to_start, to_start + size));
  }
  return result;
}

}  // namespace

double ReconstructionFilter::operator()(double x) const {
  const double distance = std::abs(x);
  if (distance > radius) return 0.0;
  switch (kind) {
    case Kind::Box:
      return 1.0;
    case Kind::Tent:
      return 1.0 - distance / radius;
    case Kind::Gaussian: {
      const double k = -0.5 / (sigma * sigma);
      return std::exp(k * x * x) - std::exp(k * radius * radius);
    }
    case Kind::Cubic:
      return cubic(2.0 * distance / radius, b, c);
    case Kind::Lanczos:
      return sinc(x) * sinc(x / radius);
  }
  return 0.0;
}

/// Piece by piece between multiples of a quarter of the radius, where the pieces of tents and
/// cubics meet.
double ReconstructionFilter::integral(double from, double to) const {
  double sum = 0.0;
  for (int piece = -4; piece < 4; ++piece) {
    const double a = std::max(from, 0.25 * radius * piece);
    const double b_end = std::min(to, 0.25 * radius * (piece + 1));
    if (!(a < b_end)) continue;
    sum += boost::math::quadrature::gauss<double, 30>::integrate(*this, a, b_end);
  }
  return sum;
}

FilterWeights::FilterWeights(const ReconstructionFilter& filter, int width, int height)
    : filter_(filter) {
  column_scales_ = scales(filter, width);
  row_scales_ = scales(filter, height);
}

FilterWeights::Span::Span(const FilterWeights& of, double position,
                          const std::vector<double>& scales) {
  const int size = static_cast<int>(scales.size());
  const double x = position * size - 0.5;
  const double radius = of.filter_.radius;
  first = std::clamp(static_cast<int>(std::ceil(x - radius)), 0, size);
  last = std::clamp(static_cast<int>(std::floor(x + radius)), -1, size - 1);
  for (int i = first; i <= last; ++i)
    weights[static_cast<std::size_t>(i - first)] =
        of.filter_(x - i) * scales[static_cast<std::size_t>(i)];
}

}  // namespace driftlight
