// SPDX-License-Identifier: Apache-2.0
#include <type_traits>

#include "driftlight/constraints.h"
#include "driftlight/contribution.h"
#include "driftlight/linearization.h"
#include "visitor_pair.h"

namespace driftlight {
namespace {

using Jet = ceres::Jet<double, kLocalWidth>;

/// First columns of the local variables.
constexpr int kXi = 0;
constexpr int kOmega = 2;
constexpr int kU = 4;

/// Makes columns (c, c + 1) of v's derivatives the tangents t, b, and all others zero.
void seed(Vec3<Jet>& v, int c, const Vec3d& t, const Vec3d& b) {
  for (int i = 0; i < 3; ++i) {
    v[i].v.setZero();
    v[i].v[c] = t[i];
    v[i].v[c + 1] = b[i];
  }
}

/// The chart's base point, every block in the columns of u.
class LocalBlocks {
 public:
  explicit LocalBlocks(const Chart& chart) : chart_(chart) {}

  Vec3<Jet> operator()(int k) const {
    const Chart::Block& block = chart_.block(k);
    Vec3<Jet> v = constant<Jet>(block.point);
    seed(v, kU, block.t, block.b);
    return v;
  }

 private:
  const Chart& chart_;
};

class RowSink {
 public:
  explicit RowSink(Linearization& result) : result_(result) {}

  void add(const Jet& residual, double precision) {
    result_.rows.row(count_++) = (std::sqrt(precision) / 3.0) * residual.v.transpose().array();
  }
  int count() const { return count_; }

 private:
  Linearization& result_;
  int count_ = 0;
};

/// Local derivatives of log f, stage by stage.
class LocalGradients {
 public:
  /// Takes what the visitor has gathered since the last stage, and empties it.
  void close_stage(ContributionVisitor<Jet>& target) {
    Entry& entry = entries_[static_cast<std::size_t>(count_++)];
    entry.log_scale = target.log_scale().v.transpose().array();
    for (int c = 0; c < 3; ++c) {
      const Jet& color = target.color()[c];
      color_[c] *= color.a;
      // A channel without light has no share in d log luminance.
      const double inverse = color.a != 0.0 ? 1.0 / color.a : 0.0;
      entry.log_color[static_cast<std::size_t>(c)] = inverse * color.v.transpose().array();
    }
    target = ContributionVisitor<Jet>();
  }

  /// d log luminance(f) = d log_scale + sum_c share_c d log color_c, share_c = w_c color_c / sum.
  void set_shares() { shares_ = kLuminance * color_ / luminance(color_); }
  LocalRow row(int stage) const {
    const Entry& entry = entries_[static_cast<std::size_t>(stage)];
    return entry.log_scale + shares_[0] * entry.log_color[0] + shares_[1] * entry.log_color[1] +
           shares_[2] * entry.log_color[2];
  }

 private:
  struct Entry {
    LocalRow log_scale;
    std::array<LocalRow, 3> log_color;
  };

  std::array<Entry, kMaxPathLength + 2> entries_;
  int count_ = 0;
  Rgbd color_{1, 1, 1};
  Rgbd shares_;
};

/// The adjoint sweep: lambda = d log f / d s_k from the last stage back,
///   grad_b = l_u + lambda_omega,   lambda <- l_s + A^T lambda_xi [+ D^T lambda_omega].
Vector adjoint_sweep(const Linearization& path, const LocalGradients& gradients) {
  Vector gradient(2 * path.block_count);
  Eigen::Vector4d lambda = Eigen::Vector4d::Zero();
  int block = path.block_count;
  for (int k = path.stage_count - 1; k >= 0; --k) {
    const Stage& stage = path.stages[static_cast<std::size_t>(k)];
    const LocalRow row = gradients.row(k);
    if (stage.has_block) {
      --block;
      gradient[2 * block] = -(row[kU] + lambda[kOmega]);
      gradient[2 * block + 1] = -(row[kU + 1] + lambda[kOmega + 1]);
    }
    if (k == 0) break;
    Eigen::Vector4d back = row.head<4>().matrix().transpose();
    if (stage.kind != Stage::Kind::Terminal) back += stage.position.transpose() * lambda.head<2>();
    if (stage.kind == Stage::Kind::Delta) back += stage.direction.transpose() * lambda.tail<2>();
    lambda = back;
  }
  return gradient;
}

using NoVisitor = WalkVisitor<Jet>;
using Target = ContributionVisitor<Jet>;
using Constraints = ConstraintVisitor<Jet, RowSink>;

/// Ends each stage where a ray departs: takes the derivatives of the ray as the stage's maps, and
/// seeds the ray afresh. First is Target or NoVisitor, Second Constraints or NoVisitor.
template <class First, class Second>
class StageVisitor : public VisitorPair<Jet, First, Second> {
  using Base = VisitorPair<Jet, First, Second>;

 public:
  StageVisitor(Second constraints, const Chart& chart, const RowSink& sink, Linearization& result)
      : Base({}, constraints), chart_(chart), sink_(sink), result_(result) {}

  void delta(const ScatterEvent<Jet>& e) {
    Base::delta(e);
    delta_ = true;
  }

  void depart(Ray<Jet>& ray, const Vec3<Jet>& normal) {
    Stage& stage = close_stage();
    const TangentBasis plane = tangent_basis(value(normal));
    stage.position = map(ray.origin, plane.t, plane.b);
    seed(ray.origin, kXi, plane.t, plane.b);
    stage.has_block = !delta_;
    if (delta_) {
      stage.kind = Stage::Kind::Delta;
      const TangentBasis basis = tangent_basis(value(ray.direction));
      stage.direction = map(ray.direction, basis.t, basis.b);
      seed(ray.direction, kOmega, basis.t, basis.b);
    } else {
      stage.kind = Stage::Kind::Free;
      const Chart::Block& block = chart_.block(block_++);
      seed(ray.direction, kOmega, block.t, block.b);
    }
    delta_ = false;
  }

  void finish() {
    Stage& stage = close_stage();
    stage.kind = Stage::Kind::Terminal;
    stage.has_block = block_ < chart_.block_count();
    if constexpr (std::is_same_v<First, Target>) {
      gradients_.set_shares();
      result_.gradient = adjoint_sweep(result_, gradients_);
    }
  }

 private:
  Stage& close_stage() {
    if constexpr (std::is_same_v<First, Target>) gradients_.close_stage(this->first);
    Stage& stage = result_.stages[static_cast<std::size_t>(result_.stage_count++)];
    stage.rows_end = sink_.count();
    return stage;
  }

  /// Coordinates in (t, b) of the derivatives by (xi, omega).
  static Stage::Map map(const Vec3<Jet>& x, const Vec3d& t, const Vec3d& b) {
    Stage::Map m;
    m.row(0) = (t.x() * x.x().v + t.y() * x.y().v + t.z() * x.z().v).head<4>();
    m.row(1) = (b.x() * x.x().v + b.y() * x.y().v + b.z() * x.z().v).head<4>();
    return m;
  }

  const Chart& chart_;
  const RowSink& sink_;
  Linearization& result_;
  LocalGradients gradients_;
  int block_ = 0;
  bool delta_ = false;
};

}  // namespace

void linearize_by_jets(const Scene& scene, const PathTopology& topology, const Chart& chart,
                       const DerivativeRequest& request, Linearization& result) {
  result.stage_count = 0;
  result.block_count = chart.block_count();
  result.gradient.resize(0);
  RowSink sink(result);
  const auto run = [&](auto visitor) {
    walk<Jet>(scene, topology, LocalBlocks(chart), visitor);
    visitor.finish();
  };
  if (request.gradient && request.constraints)
    run(StageVisitor<Target, Constraints>(Constraints(sink), chart, sink, result));
  else if (request.gradient)
    run(StageVisitor<Target, NoVisitor>({}, chart, sink, result));
  else if (request.constraints)
    run(StageVisitor<NoVisitor, Constraints>(Constraints(sink), chart, sink, result));
}

}  // namespace driftlight
