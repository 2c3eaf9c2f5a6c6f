// SPDX-License-Identifier: Apache-2.0
#include "driftlight/divergence.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "driftlight/factor.h"

namespace driftlight {

Vector divergence(const Scene& scene, const PathTopology& topology, const Chart& chart,
                  DerivativeMethod method, const Apertures& apertures, double floor) {
  constexpr DerivativeRequest kConstraints{.gradient = false, .constraints = true};
  const int d = chart.dimension();
  Linearization path;
  path.floor = floor;
  linearize(scene, topology, chart, method, kConstraints, path);
  constrain(scene, topology, chart, apertures, path);
  Factor factor;
  if (factorise(path, factor) != FactorStatus::Ok)
    return Vector::Constant(d, std::numeric_limits<double>::quiet_NaN());
  const Vector diagonal = jacobian(path).colwise().squaredNorm().transpose().array() + floor;
  const auto solve = [&](const Vector& x) {
    return std::visit([&](const auto& f) { return Vector(f.solve(f.solve_transposed(x))); },
                      factor);
  };
  Vector delta = Vector::Zero(d);
  Vector sum = Vector::Zero(d);
  for (int j = 0; j < d; ++j) {
    const Vector column = solve(Vector(Vector::Unit(d, j)));
    // A small part of the width that the constraints leave to this coordinate while the others are
    // held, 1 / (3 sqrt(Q_jj)): far above rounding, far below curvature. With the others free it is
    // sqrt(Q^-1_jj) / 3, which can be a hundred times wider: such a step leaves the valley.
    const double h = 1e-4 * std::min(1.0, 1.0 / (3.0 * std::sqrt(diagonal[j])));
    for (const double step : {h, -h}) {
      delta[j] = step;
      const Chart displaced = chart.displaced(delta);
      linearize(scene, topology, displaced, method, kConstraints, path);
      constrain(scene, topology, displaced, apertures, path);
      sum += apply_constraints(path, column) / (2.0 * step);
    }
    delta[j] = 0.0;
  }
  return -solve(sum);
}

}  // namespace driftlight
