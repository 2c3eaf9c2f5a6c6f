// SPDX-License-Identifier: Apache-2.0
#include "driftlight/exact_divergence.h"

#include <Eigen/Cholesky>
#include <limits>
#include <vector>

#include "driftlight/constraints.h"
#include "driftlight/gradient.h"
#include "driftlight/linearization.h"
#include "nested_jets.h"

namespace driftlight {
namespace {

constexpr int kWidth = kNestedWidth;
using Inner = InnerJet;
using Outer = NestedJet;
using InnerPart = Eigen::Matrix<double, kWidth, 1>;
using BlockMatrix = Eigen::Matrix<double, kWidth, kWidth>;
/// All coordinates, with zeros up to a whole number of blocks.
using Padded = Eigen::Matrix<double, kMaxDimension, 1>;

/// A residual's part in the sum.
struct Term {
  double precision = 0;
  Padded gradient = Padded::Zero();  ///< J
  Padded y = Padded::Zero();         ///< P J
  Padded hessian_y = Padded::Zero();
  double trace = 0;            ///< of H P
  double precision_slope = 0;  ///< dw.y
};

/// Walks the path with the constraint visitor over Jets of Jets.
template <class Sink>
void walk_block(const Scene& scene, const PathTopology& topology, const Chart& chart, int outer,
                int inner, Sink& sink) {
  const auto blocks = [&](int k) {
    return chart.retract(k, nested_jet(0.0, 2 * k, outer, inner),
                         nested_jet(0.0, 2 * k + 1, outer, inner));
  };
  ConstraintVisitor<Outer, Sink> visitor(sink);
  walk<Outer>(scene, topology, blocks, visitor);
}

/// Takes J and w, a block of the diagonal at a time.
class GradientSink {
 public:
  GradientSink(std::vector<Term>& terms, int first) : terms_(terms), first_(first) {}

  void add(const Outer& residual, const Inner& precision) {
    if (count_ == terms_.size()) terms_.emplace_back();
    Term& term = terms_[count_++];
    term.precision = precision.a;
    for (int i = 0; i < kWidth; ++i) term.gradient[first_ + i] = residual.v[i].a;
  }

 private:
  std::vector<Term>& terms_;
  int first_;
  std::size_t count_ = 0;
};

/// Takes the block (outer, inner) of H, and for outer = 0 the part of dw.
class HessianSink {
 public:
  HessianSink(std::vector<Term>& terms, const BlockMatrix& inverse, int outer, int inner)
      : terms_(terms), inverse_(inverse), outer_(outer), inner_(inner) {}

  void add(const Outer& residual, const Inner& precision) {
    Term& term = terms_[count_++];
    BlockMatrix hessian;
    double trace = 0;
    for (int i = 0; i < kWidth; ++i) {
      hessian.row(i) = residual.v[i].v.transpose();
      trace += residual.v[i].v.dot(inverse_.row(i));
    }
    const InnerPart y_inner = term.y.segment<kWidth>(inner_);
    term.hessian_y.segment<kWidth>(outer_) += hessian * y_inner;
    term.trace += trace;
    if (outer_ == 0) term.precision_slope += precision.v.dot(y_inner);
    if (outer_ == inner_) return;
    // H is symmetric: its transposed block.
    term.hessian_y.segment<kWidth>(inner_) += hessian.transpose() * term.y.segment<kWidth>(outer_);
    term.trace += trace;
  }

 private:
  std::vector<Term>& terms_;
  const BlockMatrix& inverse_;
  int outer_;
  int inner_;
  std::size_t count_ = 0;
};

}  // namespace

Vector exact_divergence(const Scene& scene, const PathTopology& topology, const Chart& chart,
                        double floor) {
  const int d = chart.dimension();
  std::vector<Term> terms;
  terms.reserve(kMaxResiduals);
  for (int first = 0; first < d; first += kWidth) {
    GradientSink sink(terms, first);
    walk_block(scene, topology, chart, first, first, sink);
  }
  Matrix q = floor * Matrix::Identity(d, d);
  for (const Term& term : terms)
    q += term.precision / 9.0 * term.gradient.head(d) * term.gradient.head(d).transpose();
  const Eigen::LLT<Matrix> cholesky(q);
  if (cholesky.info() != Eigen::Success)
    return Vector::Constant(d, std::numeric_limits<double>::quiet_NaN());
  Eigen::Matrix<double, kMaxDimension, kMaxDimension> inverse;
  inverse.setZero();
  inverse.topLeftCorner(d, d) = cholesky.solve(Matrix::Identity(d, d));
  for (Term& term : terms) term.y = inverse * term.gradient;

  for (int outer = 0; outer < d; outer += kWidth) {
    for (int inner = outer; inner < d; inner += kWidth) {
      const BlockMatrix block = inverse.block<kWidth, kWidth>(outer, inner);
      HessianSink sink(terms, block, outer, inner);
      walk_block(scene, topology, chart, outer, inner, sink);
    }
  }
  Padded sum = Padded::Zero();
  for (const Term& term : terms)
    sum += (term.precision_slope + term.precision * term.trace) * term.gradient +
           term.precision * term.hessian_y;
  return -(inverse * sum).head(d) / 9.0;
}

}  // namespace driftlight
