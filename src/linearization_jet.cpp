// SPDX-License-Identifier: Apache-2.0
#include <type_traits>

#include "driftlight/constraints.h"
#include "driftlight/contribution.h"
#include "driftlight/linearization.h"
#include "visitor_pair.h"

namespace driftlight {
namespace {

using Jet = ceres::Jet<double, kLocalWidth>;

/// Makes columns (c, c + 1) of v's derivatives the tangents t, b, and all others zero.
void seed(Vec3<Jet>& v, int c, const Vec3d& t, const Vec3d& b) {
  for (int i = 0; i < 3; ++i) {
    v[i].v.setZero();
    v[i].v[c] = t[i];
    v[i].v[c + 1] = b[i];
  }
}

/// The chart's base point, every block in the columns of u of its side.
class LocalBlocks {
 public:
  LocalBlocks(const Chart& chart, int sensor_blocks)
      : chart_(chart), sensor_blocks_(sensor_blocks) {}

  Vec3<Jet> operator()(int k) const {
    const Chart::Block& block = chart_.block(k);
    Vec3<Jet> v = constant<Jet>(block.point);
    seed(v, k < sensor_blocks_ ? kSensorColumns.u : kLightColumns.u, block.t, block.b);
    return v;
  }

 private:
  const Chart& chart_;
  int sensor_blocks_;
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

  std::array<Entry, kMaxStages> entries_;
  int count_ = 0;
  Rgbd color_{1, 1, 1};
  Rgbd shares_;
};

/// The adjoint sweep over stages [begin, end) of a side: lambda = d log f / d s_k from the last
/// stage back,
///   grad_b = l_u + lambda_omega,   lambda <- l_s + A^T lambda_xi [+ D^T lambda_omega],
/// and grad_b = l_u + lambda_xi at a point. `block` is one past that of the last stage.
void adjoint_sweep(const Linearization& path, const LocalGradients& gradients, int begin, int end,
                   const LocalColumns& columns, Eigen::Vector4d lambda, int& block,
                   Vector& gradient) {
  for (int k = end - 1; k >= begin; --k) {
    const Stage& stage = path.stages[static_cast<std::size_t>(k)];
    const LocalRow row = gradients.row(k);
    if (stage.has_block) {
      --block;
      const int from = stage.kind == Stage::Kind::Point ? 0 : 2;
      gradient[2 * block] = -(row[columns.u] + lambda[from]);
      gradient[2 * block + 1] = -(row[columns.u + 1] + lambda[from + 1]);
    }
    if (k == begin) break;
    Eigen::Vector4d back = row.segment<4>(columns.xi).matrix().transpose();
    if (stage.kind != Stage::Kind::Terminal) back += stage.position.transpose() * lambda.head<2>();
    if (stage.kind == Stage::Kind::Delta) back += stage.direction.transpose() * lambda.tail<2>();
    lambda = back;
  }
}

/// The same along each side.
Vector adjoint_sweep(const Linearization& path, const LocalGradients& gradients) {
  Vector gradient(2 * path.block_count);
  int block = path.block_count;
  if (!path.has_light_side) {
    adjoint_sweep(path, gradients, 0, path.stage_count, kSensorColumns, Eigen::Vector4d::Zero(),
                  block, gradient);
    return gradient;
  }
  const int last = path.stage_count - 1;
  const LocalRow row = gradients.row(last);
  const auto state = [&](const LocalColumns& columns) -> Eigen::Vector4d {
    return row.segment<4>(columns.xi).matrix().transpose();
  };
  adjoint_sweep(path, gradients, path.sensor_stages, last, kLightColumns, state(kLightColumns),
                block, gradient);
  adjoint_sweep(path, gradients, 0, path.sensor_stages, kSensorColumns, state(kSensorColumns),
                block, gradient);
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

  void light_delta(const ScatterEvent<Jet>& e) {
    Base::light_delta(e);
    delta_ = true;
  }

  void light_side() {
    columns_ = kLightColumns;
    result_.sensor_stages = result_.stage_count;
  }

  /// What were columns of u are those of xi from here on.
  void leave_point(Vec3<Jet>& y) {
    Stage& stage = close_stage();
    stage.kind = Stage::Kind::Point;
    stage.has_block = true;
    ++block_;
    const auto column = [&](int c) { return Vec3d(y.x().v[c], y.y().v[c], y.z().v[c]); };
    seed(y, columns_.xi, column(columns_.u), column(columns_.u + 1));
  }
  void depart_parallel(Ray<Jet>& ray) { leave_point(ray.origin); }

  void depart(Ray<Jet>& ray, const Vec3<Jet>& normal) {
    Stage& stage = close_stage();
    const TangentBasis plane = tangent_basis(value(normal));
    stage.position = map(ray.origin, plane.t, plane.b);
    seed(ray.origin, columns_.xi, plane.t, plane.b);
    stage.has_block = !delta_;
    if (delta_) {
      stage.kind = Stage::Kind::Delta;
      const TangentBasis basis = tangent_basis(value(ray.direction));
      stage.direction = map(ray.direction, basis.t, basis.b);
      seed(ray.direction, columns_.omega, basis.t, basis.b);
    } else {
      stage.kind = Stage::Kind::Free;
      const Chart::Block& block = chart_.block(block_++);
      seed(ray.direction, columns_.omega, block.t, block.b);
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
  Stage::Map map(const Vec3<Jet>& x, const Vec3d& t, const Vec3d& b) const {
    const int xi = columns_.xi;
    Stage::Map m;
    m.row(0) = (t.x() * x.x().v + t.y() * x.y().v + t.z() * x.z().v).segment<4>(xi);
    m.row(1) = (b.x() * x.x().v + b.y() * x.y().v + b.z() * x.z().v).segment<4>(xi);
    return m;
  }

  const Chart& chart_;
  const RowSink& sink_;
  Linearization& result_;
  LocalGradients gradients_;
  LocalColumns columns_ = kSensorColumns;
  int block_ = 0;
  bool delta_ = false;
};

}  // namespace

void linearize_by_jets(const Scene& scene, const PathTopology& topology, const Chart& chart,
                       const DerivativeRequest& request, Linearization& result) {
  result.stage_count = 0;
  result.block_count = chart.block_count();
  result.has_light_side = topology.has_light_side();
  result.gradient.resize(0);
  RowSink sink(result);
  const auto run = [&](auto visitor) {
    walk<Jet>(scene, topology, LocalBlocks(chart, topology.camera_block_count()), visitor);
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
