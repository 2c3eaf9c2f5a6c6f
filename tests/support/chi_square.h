// SPDX-License-Identifier: Apache-2.0
/// The chi^2 test, and histograms of directions to feed it.
#pragma once

#include <functional>
#include <span>
#include <vector>

#include "driftlight/frame.h"

namespace driftlight::test {

struct ChiSquareResult {
  double statistic = 0;
  int degrees = 0;     ///< degrees of freedom after pooling
  double p_value = 1;  ///< chance of a statistic at least as large under the hypothesis
};

/// Pearson's test of observed counts against expected ones: sum (o - e)^2 / e. Cells are pooled,
/// the smallest expectations first, until each expects at least `minimum`. Both sum to the same
/// total (put what is missing in a cell of its own), so that the degrees are the cells less one.
ChiSquareResult chi_square(std::span<const double> observed, std::span<const double> expected,
                           double minimum = 8);

/// The test of numbers that should be uniform on [0, 1), in `cells` equal cells.
ChiSquareResult chi_square_uniform(std::span<const double> samples, int cells = 50);

/// Integral of f over the rectangle [x0, x1] x [y0, y1], by Gauss-Legendre rules on squares that
/// are halved until the result changes by less than `tolerance`; at most `depth` halvings.
double integrate(const std::function<double(double, double)>& f, double x0, double x1, double y0,
                 double y1, double tolerance, int depth = 8);

/// Cells of the unit sphere in polar coordinates (theta, phi) about an axis. Rings are narrow near
/// the axis, theta = pi (i / rings)^power, so that a sharp lobe there is resolved.
class SphereGrid {
 public:
  SphereGrid(const Vec3d& axis, int rings, int sectors, double power);

  int cell_count() const { return rings_ * sectors_; }
  int cell(const Vec3d& direction) const;
  /// Integrals over all cells of a density per solid angle.
  std::vector<double> integrate(const std::function<double(const Vec3d&)>& density,
                                double tolerance = 1e-6) const;

 private:
  double theta(int ring) const;

  Vec3d axis_;
  int rings_;
  int sectors_;
  double power_;
};

/// Tests directions against their density per solid angle. `draw` returns a direction, or nothing
/// (a zero vector) for an attempt that was lost: the density then integrates to less than one.
ChiSquareResult chi_square_directions(const SphereGrid& grid, int attempts,
                                      const std::function<Vec3d()>& draw,
                                      const std::function<double(const Vec3d&)>& density);

}  // namespace driftlight::test
