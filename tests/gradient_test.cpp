// SPDX-License-Identifier: Apache-2.0
/// Laws of the derivatives of a path: they equal what finite differences say, and no choice of
/// tangents or of pass width shows in them.
#include "driftlight/gradient.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "driftlight/constraints.h"
#include "driftlight/contribution.h"
#include "support/finite_difference.h"
#include "support/path_classes.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

using Path = PathSampler::Sample;

constexpr int kPathsPerScene = 250;

/// The potential along coordinate j of the chart.
double potential(const Scene& scene, const Path& path, const Chart& chart, int j, double x) {
  Vector delta = Vector::Zero(chart.dimension());
  delta[j] = x;
  return -contribution(scene, path.topology, chart.retract(delta)).log_target;
}

/// How far a gradient is from finite differences.
struct GradientReport {
  std::vector<double> errors;  ///< relative, by coordinate
  int kinks = 0;               ///< coordinates left out, with a kink next to the path

  double worst() const {
    return errors.empty() ? 0.0 : *std::max_element(errors.begin(), errors.end());
  }
};

/// Compares each coordinate in units of the width w_j = 1 / (3 sqrt(Q_jj)) in which U changes by
/// about one: |g - f| / max(|g|, |f|, 0.01 / w).
GradientReport compare(const Scene& scene, const Path& path, const Chart& chart,
                       const Vector& gradient, const Matrix& q) {
  GradientReport report;
  for (int j = 0; j < chart.dimension(); ++j) {
    const auto f = [&](double x) { return potential(scene, path, chart, j, x); };
    const double width = std::min(1.0, 1.0 / (3.0 * std::sqrt(q(j, j))));
    const double h = 0.01 * width;
    const Derivative expected = ridders(f, h);
    const double scale =
        std::max({std::abs(gradient[j]), std::abs(expected.value), 0.01 / width});
    const OneSidedSlopes slopes = one_sided_slopes(f, h);
    const OneSidedSlopes fine = one_sided_slopes(f, 0.25 * h);
    // Smooth: the difference of the slopes shrinks sixteen times. A kink keeps it, or moves it.
    const double coarse_gap = std::abs(slopes.right - slopes.left);
    const double fine_gap = std::abs(fine.right - fine.left);
    const bool smooth = coarse_gap < 1e-6 * scale || fine_gap < 0.15 * coarse_gap;
    if (!smooth || !(expected.error < 1e-6 * scale)) {
      ++report.kinks;
      continue;
    }
    report.errors.push_back(std::abs(gradient[j] - expected.value) / scale);
  }
  return report;
}

/// Chart and derivatives of a path.
struct Prepared {
  Chart chart;
  PathDerivatives derivatives;

  Prepared(const Scene& scene, const Path& path)
      : chart(scene, path.topology, path.coordinates) {
    differentiate(scene, path.topology, chart, {}, derivatives);
  }
};

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// Law: grad U of differentiate is the derivative of -log_target along the chart, in every class.
TEST(Gradient, EqualsRiddersDifferencesInEveryClass) {
  ClassCounter classes;
  std::vector<double> errors;
  int kinks = 0;
  for (const TestScene& test : test_scenes()) {
    for (const Path& path : light_paths(test, kPathsPerScene, 11)) {
      const Prepared p(test.scene, path);
      ASSERT_TRUE(p.derivatives.all_finite({}));
      const GradientReport report =
          compare(test.scene, path, p.chart, p.derivatives.gradient, p.derivatives.q);
      EXPECT_LT(report.worst(), 1e-5) << test.name;
      errors.insert(errors.end(), report.errors.begin(), report.errors.end());
      kinks += report.kinks;
      if (report.kinks == 0) classes.add(classes_of(test.scene, path));
    }
  }
  EXPECT_LT(median(errors), 1e-9);
  EXPECT_LT(kinks, static_cast<int>(errors.size()) / 25);
  for (const std::string& missing : classes.missing(1)) ADD_FAILURE() << missing;
}

}  // namespace
}  // namespace driftlight::test
