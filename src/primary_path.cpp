// SPDX-License-Identifier: Apache-2.0
#include "primary_path.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <tuple>
#include <utility>

#include "density_visitor.h"
#include "driftlight/constraints.h"
#include "driftlight/contribution.h"
#include "emission_warp.h"
#include "jacobian_rows.h"
#include "primary_sample.h"
#include "visitor_pair.h"

namespace driftlight {
namespace {

/// The blocks of a path (walk.h), from numbers. u(i) is the number i that steers it, as T.
template <Scalar T, class Steering>
class PrimaryBlocks {
 public:
  PrimaryBlocks(const Scene& scene, const StrategyNumbers& numbers, const PrimaryPath& path,
                const Steering& u)
      : scene_(scene),
        numbers_(numbers),
        path_(path),
        u_(u),
        lens_(numbers.has_lens() ? scene.camera().lens_point(Vec2<T>(u(0), u(1)))
                                 : constant<T>(scene.camera().origin)) {
    if (path.strategy.s == 1)
      set_connection();
    else if (path.strategy.s > 1)
      set_emission();
  }

  /// The point on the lens, the coordinate of the first ray, and what leaves the emitter.
  Vec3<T> operator()(int k) const {
    const int lens_blocks = path_.topology.lens_block_count();
    if (k < lens_blocks) return lens_;
    if (k == lens_blocks && path_.strategy.t > 1) {
      const int i = numbers_.film();
      return scene_.camera().direction(Vec2<T>(u_(i), u_(i + 1)), lens_);
    }
    const int first = path_.strategy.s > 1 ? path_.topology.camera_block_count() : k;
    return k == first && has_point_ ? ray_.from.p : ray_.direction;
  }
  Vec3<T> operator()(int, const WalkVertex<T>& x) const {
    const auto k = static_cast<int>(&x.vertex - path_.topology.vertices.data());
    const auto [s, t] = path_.strategy;
    if (s == 1 && k + 1 == path_.topology.scatter_count) return ray_.direction;
    if (k < t - 1) return scattered(x, numbers_.sensor_vertex(k), numbers_.sensor_lobe(k));
    const int j = path_.topology.scatter_count - 1 - k;
    return scattered(x, numbers_.light_vertex(path_.strategy, j), numbers_.light_lobe(j));
  }
  const Vec3<T>& emitter_normal() const { return ray_.from.n; }
  const Vec2<T>& emitter_uv() const { return ray_.from.uv; }

 private:
  Vec3<T> scattered(const WalkVertex<T>& x, int i, double lobe) const {
    const auto next =
        warp<T>(x.bsdf, x.surface(), x.w, Vec3<T>(u_(i), u_(i + 1), constant<T>(lobe)));
    const double nan = std::numeric_limits<double>::quiet_NaN();
    return next ? next->wo : constant<T>(Vec3d(nan, nan, nan));
  }

  void set_connection() {
    const int i = numbers_.sensor_dimension(path_.strategy);
    const T u1 = u_(i);
    const T u2 = u_(i + 1);
    const Emitter& emitter = scene_.emitters()[path_.topology.emitter];
    if (const auto* area = std::get_if<AreaEmitter>(&emitter)) {
      ray_.from = warp_area(scene_.shapes()[area->shape], u1, u2);
      has_point_ = true;
    } else if (is_environment(emitter)) {
      ray_.direction = warp_environment(emitter, u1, u2);
    }
  }
  void set_emission() {
    const int i = numbers_.sensor_dimension(path_.strategy);
    const std::array<T, 4> u{u_(i), u_(i + 1), u_(i + 2), u_(i + 3)};
    const Emitter& emitter = scene_.emitters()[path_.topology.emitter];
    has_point_ = !is_point(emitter);
    if (const auto* area = std::get_if<AreaEmitter>(&emitter))
      ray_ = warp_emission_from_area(scene_.shapes()[area->shape], u);
    else if (is_point(emitter))
      ray_ = warp_emission_from_point(emitter, u);
    else if (const auto* parallel = std::get_if<DirectionalEmitter>(&emitter))
      ray_ = warp_emission_from_infinity(scene_, constant<T>(Vec3d(-parallel->direction)), u);
    else
      ray_ = warp_emission_from_infinity(scene_, warp_environment(emitter, u[0], u[1]), u);
  }

  const Scene& scene_;
  const StrategyNumbers& numbers_;
  const PrimaryPath& path_;
  const Steering& u_;
  Vec3<T> lens_;
  EmittedRay<T> ray_;  ///< what there is of it
  bool has_point_ = false;
};

template <Scalar T>
struct TargetVisitor : VisitorPair<T, ContributionVisitor<T>, DensityVisitor<T>> {
  TargetVisitor(const Scene& scene, const EmissionGuide& guide, const PathTopology& topology)
      : VisitorPair<T, ContributionVisitor<T>, DensityVisitor<T>>(
            std::piecewise_construct, std::tuple<>(),
            std::forward_as_tuple(scene, guide, topology)) {}
  void vertex(int k) { this->second.vertex(k); }

  /// log f - log sum_s p_s, after the walk. Emitters that are seen directly are left to the
  /// strategy that hits them (strategy_weights.h).
  T log_target(const Scene& scene, const PrimaryPath& path) const {
    using std::log;
    const auto densities = densities_by_light_vertices(
        this->second, path.topology, scene.emitter_probability(path.topology.emitter));
    T sum = densities[0];
    const int edges = path.strategy.edges();
    for (int s = 1; edges > 1 && s <= edges; ++s) sum += densities[static_cast<std::size_t>(s)];
    return this->first.log_target() - log(sum);
  }
};

/// The target with the constraints of the path, which `Sink` takes.
template <Scalar T, class Sink>
struct ConstrainedVisitor : VisitorPair<T, ConstraintVisitor<T, Sink>, TargetVisitor<T>> {
  ConstrainedVisitor(Sink& sink, const Scene& scene, const EmissionGuide& guide,
                     const PathTopology& topology)
      : VisitorPair<T, ConstraintVisitor<T, Sink>, TargetVisitor<T>>(
            std::piecewise_construct, std::forward_as_tuple(sink),
            std::forward_as_tuple(scene, guide, topology)) {}
  void vertex(int k) { this->second.vertex(k); }
};

template <Scalar T, class Steering, class Visitor>
void walk_by_numbers(const Scene& scene, const StrategyNumbers& numbers, const PrimaryPath& path,
                     const Steering& u, Visitor& visitor) {
  const PrimaryBlocks<T, Steering> blocks(scene, numbers, path, u);
  walk<T>(scene, path.topology, blocks, visitor);
}

template <Scalar T, class Steering>
T log_target_of(const Scene& scene, const EmissionGuide& guide, const StrategyNumbers& numbers,
                const PrimaryPath& path, const Steering& u) {
  TargetVisitor<T> visitor(scene, guide, path.topology);
  walk_by_numbers<T>(scene, numbers, path, u, visitor);
  return visitor.log_target(scene, path);
}

/// Which numbers matter: those of delta vertices and of positions that are fixed do not.
struct ActiveNumbers {
  std::array<int, kMaxDimension> indices{};
  int count = 0;

  int operator[](int c) const { return indices[static_cast<std::size_t>(c)]; }
  void add_pair(int i) {
    indices[static_cast<std::size_t>(count++)] = i;
    indices[static_cast<std::size_t>(count++)] = i + 1;
  }
};

ActiveNumbers active_numbers(const Scene& scene, const StrategyNumbers& numbers,
                             const PrimaryPath& path) {
  const auto [s, t] = path.strategy;
  const PathTopology& topology = path.topology;
  const Emitter& emitter = scene.emitters()[topology.emitter];
  ActiveNumbers active;
  const auto add_vertex = [&](int k, int i) {
    if (!topology.vertices[static_cast<std::size_t>(k)].delta) active.add_pair(i);
  };
  const int offset = numbers.sensor_dimension(path.strategy);
  if (numbers.has_lens()) active.add_pair(0);
  if (t > 1) active.add_pair(numbers.film());
  for (int k = 0; k < t - 2; ++k) add_vertex(k, numbers.sensor_vertex(k));
  const bool fixed = is_point(emitter) || std::holds_alternative<DirectionalEmitter>(emitter);
  if (s > 0 && !fixed) active.add_pair(offset);
  if (s > 1) active.add_pair(offset + 2);
  for (int j = 0; j < s - 2; ++j)
    add_vertex(topology.scatter_count - 1 - j, numbers.light_vertex(path.strategy, j));
  return active;
}

/// Place of number i among the active ones [first, first + N), which are differentiated by; else
/// -1.
template <int N>
int column_of(const ActiveNumbers& active, int first, int i) {
  for (int c = 0; c < N && first + c < active.count; ++c)
    if (active[first + c] == i) return c;
  return -1;
}

constexpr int kPass = 8;
using PassJet = ceres::Jet<double, kPass>;

/// The numbers that steer a path as Jets by the active ones [first, first + kPass).
class PassNumbers {
 public:
  PassNumbers(const StrategyNumbers& numbers, const Strategy& strategy, const ActiveNumbers& active,
              int first)
      : numbers_(numbers), strategy_(strategy), active_(active), first_(first) {}

  PassJet operator()(int i) const {
    PassJet x(numbers_.steering(strategy_, i));
    const int column = column_of<kPass>(active_, first_, i);
    if (column >= 0) x.v[column] = 1.0;
    return x;
  }

 private:
  const StrategyNumbers& numbers_;
  const Strategy& strategy_;
  const ActiveNumbers& active_;
  int first_;
};

void store_gradient(const PassJet& log_target, const ActiveNumbers& active, int first,
                    Vector& gradient) {
  for (int c = 0; c < kPass && first + c < active.count; ++c)
    gradient[active[first + c]] = log_target.v[c];
}

PathEnd end_of(const Emitter& emitter, int s) {
  if (is_environment(emitter)) return PathEnd::Environment;
  if (std::holds_alternative<AreaEmitter>(emitter)) {
    if (s == 0) return PathEnd::Hit;
    return s == 1 ? PathEnd::AreaConnection : PathEnd::AreaEmission;
  }
  if (is_point(emitter)) return s == 1 ? PathEnd::PointConnection : PathEnd::PointEmission;
  return s == 1 ? PathEnd::DirectionalConnection : PathEnd::DirectionalEmission;
}

/// Blocks of the chart that the walk runs in.
int count_blocks(const PathTopology& topology, int s) {
  int count = topology.camera_block_count();
  if (!topology.has_light_side()) {
    count = topology.lens_block_count() + 1;
    for (int k = 0; k < topology.scatter_count; ++k)
      if (!topology.vertices[static_cast<std::size_t>(k)].delta) ++count;
    return topology.ends_at_delta_emitter() ? count - 1 : count;
  }
  count += topology.end == PathEnd::PointEmission || topology.end == PathEnd::DirectionalEmission
               ? 1
               : 2;
  for (int j = 0; j < s - 2; ++j)
    if (!topology.vertices[static_cast<std::size_t>(topology.scatter_count - 1 - j)].delta) ++count;
  return count;
}

}  // namespace

// ---- StrategyNumbers ------------------------------------------------------------------------

StrategyNumbers::StrategyNumbers(int edges, bool has_lens, Rng& rng)
    : edges_(edges), lens_(has_lens ? 2 : 0) {
  for (int i = 0; i < count(); ++i) numbers_[static_cast<std::size_t>(i)] = rng.uniform();
}

Strategy StrategyNumbers::strategy() const {
  const int count = edges_ + 1;
  const int s = std::min(static_cast<int>(count * numbers_[0]), edges_);
  return {s, count - s};
}

std::size_t StrategyNumbers::index(const Strategy& strategy, int i) const {
  const int from_sensor = sensor_dimension(strategy);
  const int vertices = sensor_vertex(0);
  const auto place = [&] {
    if (i < lens_) return kSensor + 2 + i;
    if (i < vertices && i < from_sensor) return kSensor + i - lens_;
    if (i < from_sensor) return kSensor + vertices + 3 * ((i - vertices) / 2) + i % 2;
    const int j = i - from_sensor;
    if (strategy.s == 1) return connection_begin() + 1 + j;
    if (j < 4) return light_begin() + 1 + j;
    return light_begin() + 5 + 3 * ((j - 4) / 2) + j % 2;
  };
  return static_cast<std::size_t>(place());
}

void StrategyNumbers::move(const PrimaryOptions& options, Rng& rng) {
  for (int i = 0; i < count(); ++i) {
    double& u = numbers_[static_cast<std::size_t>(i)];
    u = moved(u, options, rng);
  }
}

void StrategyNumbers::move_within(const Strategy& strategy, const PrimaryOptions& options,
                                  Rng& rng) {
  const auto move_range = [&](int first, int size) {
    for (int i = first; i < first + size; ++i) {
      double& u = numbers_[static_cast<std::size_t>(i)];
      u = moved(u, options, rng);
    }
  };
  const auto [s, t] = strategy;
  if (t > 1) move_range(kSensor, 2 + lens_ + 3 * (t - 2));
  if (t == 1) move_range(kSensor + 2, lens_);
  if (s > 1) move_range(light_begin(), 5 + 3 * (s - 2));
  if (s == 1) move_range(connection_begin(), kConnection);
}

void StrategyNumbers::shift(const StrategyNumbers& from, const StrategyNumbers& to) {
  for (std::size_t i = 0; i < static_cast<std::size_t>(count()); ++i)
    numbers_[i] = wrapped(numbers_[i] + (to.numbers_[i] - from.numbers_[i]));
}

void StrategyNumbers::move_choices(const Strategy& strategy, const PrimaryOptions& options,
                                   Rng& rng) {
  const StrategyNumbers before = *this;
  move_within(strategy, options, rng);
  for (int i = 0; i < dimension(strategy); ++i)
    steering(strategy, i) = before.steering(strategy, i);
}

// ---- PrimaryPath ----------------------------------------------------------------------------

PrimaryPath primary_path(const Scene& scene, const FoundPath& found) {
  PrimaryPath path{{found.s, found.t}, {}};
  PathTopology& topology = path.topology;
  topology.emitter = found.end.emitter;
  topology.has_lens = scene.camera().has_lens();
  const auto add = [&](const SubpathVertex& x, const Vec3d& onward, bool connects) {
    PathVertex& vertex = topology.vertices[topology.scatter_count++];
    vertex.hit = x.surface.hit;
    vertex.delta = x.delta && !connects;
    vertex.scattering = x.surface.side(onward);
  };
  topology.end = end_of(scene.emitters()[topology.emitter], found.s);
  const int from_sensor = found.s == 0 ? found.t - 2 : found.t - 1;
  // The subpaths of the sample may go on, and have left a vertex that connects by a delta lobe.
  // Where such a vertex scatters to does not matter.
  for (int i = 0; i < from_sensor; ++i) {
    const SubpathVertex& x = found.from_sensor[i];
    const bool last = i + 1 == found.from_sensor.size();
    add(x, last ? found.end.p : Vec3d(-found.from_sensor[i + 1].surface.wi),
        found.s > 0 && i + 1 == from_sensor);
  }
  if (topology.end == PathEnd::Hit)
    topology.vertices[topology.scatter_count].hit = found.from_sensor[from_sensor].surface.hit;
  for (int i = found.s - 2; i >= 0; --i) {
    const SubpathVertex& x = found.from_light[i];
    const bool last = i == found.s - 2;
    add(x, last ? x.surface.wi : Vec3d(-found.from_light[i + 1].surface.wi), last);
    ++topology.light_count;
  }
  topology.block_count = static_cast<std::uint8_t>(count_blocks(topology, found.s));
  return path;
}

// ---- PrimaryFunction ------------------------------------------------------------------------

double PrimaryFunction::log_target(const StrategyNumbers& numbers, const PrimaryPath& path) const {
  const auto u = [&](int i) { return numbers.steering(path.strategy, i); };
  return log_target_of<double>(scene_, guide_, numbers, path, u);
}

bool PrimaryFunction::gradient(const StrategyNumbers& numbers, const PrimaryPath& path,
                               PrimaryDerivatives& result) const {
  const ActiveNumbers active = active_numbers(scene_, numbers, path);
  result.gradient.setZero(numbers.dimension(path.strategy));
  for (int first = 0; first < active.count; first += kPass)
    store_gradient(log_target_of<PassJet>(scene_, guide_, numbers, path,
                                          PassNumbers(numbers, path.strategy, active, first)),
                   active, first, result.gradient);
  return result.gradient.allFinite();
}

bool PrimaryFunction::gradient_and_constraints(const StrategyNumbers& numbers,
                                               const PrimaryPath& path,
                                               PrimaryDerivatives& result) const {
  const ActiveNumbers active = active_numbers(scene_, numbers, path);
  const int d = numbers.dimension(path.strategy);
  result.gradient.setZero(d);
  JacobianRows rows;
  for (int first = 0; first < active.count; first += kPass) {
    rows.begin_pass(first);
    ConstrainedVisitor<PassJet, JacobianRows> visitor(rows, scene_, guide_, path.topology);
    walk_by_numbers<PassJet>(scene_, numbers, path,
                             PassNumbers(numbers, path.strategy, active, first), visitor);
    store_gradient(visitor.second.log_target(scene_, path), active, first, result.gradient);
  }
  Matrix of_active;
  rows.accumulate(active.count, of_active);
  result.constraints.setZero(d, d);
  for (int r = 0; r < active.count; ++r)
    for (int c = 0; c < active.count; ++c)
      result.constraints(active[r], active[c]) = of_active(r, c);
  return result.gradient.allFinite() && result.constraints.allFinite();
}

std::vector<PrimaryFunction::Residual> PrimaryFunction::residuals(const StrategyNumbers& numbers,
                                                                  const PrimaryPath& path) const {
  struct Sink {
    std::vector<Residual> all;
    void add(double value, double precision) { all.push_back({value, precision}); }
  } sink;
  ConstraintVisitor<double, Sink> visitor(sink);
  walk_by_numbers<double>(
      scene_, numbers, path, [&](int i) { return numbers.steering(path.strategy, i); }, visitor);
  return std::move(sink.all);
}

bool PrimaryFunction::gradient_and_hessian(const StrategyNumbers& numbers, const PrimaryPath& path,
                                           PrimaryDerivatives& result) const {
  constexpr int kWidth = 4;
  using Inner = ceres::Jet<double, kWidth>;
  using T = ceres::Jet<Inner, kWidth>;
  const ActiveNumbers active = active_numbers(scene_, numbers, path);
  const int d = numbers.dimension(path.strategy);
  result.gradient.setZero(d);
  result.hessian.setZero(d, d);
  for (int outer = 0; outer < active.count; outer += kWidth) {
    for (int inner = outer; inner < active.count; inner += kWidth) {
      const auto u = [&](int i) {
        T x(Inner(numbers.steering(path.strategy, i)));
        const int row = column_of<kWidth>(active, outer, i);
        const int column = column_of<kWidth>(active, inner, i);
        if (row >= 0) x.v[row] = Inner(1.0);
        if (column >= 0) x.a.v[column] = 1.0;
        return x;
      };
      const T y = log_target_of<T>(scene_, guide_, numbers, path, u);
      for (int r = 0; r < kWidth && outer + r < active.count; ++r) {
        const int i = active[outer + r];
        result.gradient[i] = y.v[r].a;
        for (int c = 0; c < kWidth && inner + c < active.count; ++c) {
          const int j = active[inner + c];
          result.hessian(i, j) = y.v[r].v[c];
          result.hessian(j, i) = y.v[r].v[c];
        }
      }
    }
  }
  return result.gradient.allFinite() && result.hessian.allFinite();
}

}  // namespace driftlight
