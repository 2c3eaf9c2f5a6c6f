// SPDX-License-Identifier: Apache-2.0
#include "driftlight/precision.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>

#include "driftlight/hessian.h"

namespace driftlight {
namespace {

Matrix precision_at(const Scene& scene, const PathTopology& topology, const Chart& chart,
                    PreconditionerKind kind, const Vector& delta, double floor) {
  if (kind == PreconditionerKind::Hessian)
    return hessian_precision(scene, topology, chart, delta, floor);
  Matrix q;
  constraint_matrix(scene, topology, chart, delta, q);
  return (q.diagonal().array() + (floor - kConstraintFloor)).matrix().asDiagonal();
}

}  // namespace

Matrix diagonal_precision(const Linearization& path) {
  Vector diagonal = jacobian(path).colwise().squaredNorm().transpose();
  diagonal.array() += path.floor;
  return diagonal.asDiagonal();
}

Matrix hessian_precision(const Scene& scene, const PathTopology& topology, const Chart& chart,
                         const Vector& delta, double floor) {
  const Matrix h = hessian(scene, topology, chart, delta);
  if (!h.allFinite()) return h;
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(h);
  const Matrix& axes = eigen.eigenvectors();
  Matrix q = axes * (eigen.eigenvalues().cwiseAbs() / 9.0).asDiagonal() * axes.transpose();
  q.diagonal().array() += floor;
  return q;
}

// div(Q^-1) = -Q^-1 sum_j (d_j Q) Q^-1 e_j
Vector dense_divergence(const Scene& scene, const PathTopology& topology, const Chart& chart,
                        PreconditionerKind kind, double floor) {
  const int d = chart.dimension();
  const Vector origin = Vector::Zero(d);
  const Matrix q = precision_at(scene, topology, chart, kind, origin, floor);
  const Eigen::LLT<Matrix> cholesky(q);
  if (!q.allFinite() || cholesky.info() != Eigen::Success)
    return Vector::Constant(d, std::numeric_limits<double>::quiet_NaN());
  const Matrix inverse = cholesky.solve(Matrix::Identity(d, d));
  Vector sum = origin;
  Vector delta = origin;
  for (int j = 0; j < d; ++j) {
    // A small part of the width of this coordinate while the others are held.
    const double h = 1e-4 * std::min(1.0, 1.0 / (3.0 * std::sqrt(q(j, j))));
    for (const double step : {h, -h}) {
      delta[j] = step;
      sum +=
          precision_at(scene, topology, chart, kind, delta, floor) * inverse.col(j) / (2.0 * step);
    }
    delta[j] = 0.0;
  }
  return -(inverse * sum);
}

}  // namespace driftlight
