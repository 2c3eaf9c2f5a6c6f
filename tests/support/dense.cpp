// SPDX-License-Identifier: Apache-2.0
#include "support/dense.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <Eigen/LU>

namespace driftlight::test {

Matrix inverse(const Matrix& a) { return a.inverse(); }

Matrix cholesky(const Matrix& a) { return a.llt().matrixL(); }

bool is_positive_definite(const Matrix& a) { return a.llt().info() == Eigen::Success; }

Vector eigenvalues(const Matrix& a) {
  return Eigen::SelfAdjointEigenSolver<Matrix>(a, Eigen::EigenvaluesOnly).eigenvalues();
}

}  // namespace driftlight::test
