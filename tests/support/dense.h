// SPDX-License-Identifier: Apache-2.0
/// Decompositions of dense matrices, compiled once: Eigen's take seconds in each source.
#pragma once

#include "driftlight/phase_space.h"

namespace driftlight::test {

/// By LU with partial pivoting.
Matrix inverse(const Matrix& a);

/// Lower triangular L with a = L L^T, a positive definite.
Matrix cholesky(const Matrix& a);

/// Whether Cholesky's decomposition of the symmetric matrix succeeds.
bool is_positive_definite(const Matrix& a);

/// Of a symmetric matrix, from the least on.
Vector eigenvalues(const Matrix& a);

}  // namespace driftlight::test
