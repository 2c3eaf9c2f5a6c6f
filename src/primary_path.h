// SPDX-License-Identifier: Apache-2.0
/// A path as a function of the numbers that it is drawn from, with derivatives.
///
/// Of one strategy (s, t) of bidirectional path tracing the numbers that steer a path are, two for
/// each,
///   the point on the lens                                    (if there is one),
///   the film point, and the directions at x_1 .. x_(t-2)               (t > 1),
///   the emitted ray, four, and the directions at x_(n-1) .. x_(t+1)    (s > 1),
///   the point on the emitter                                           (s = 1),
/// 2 n in all for any strategy at paths of n edges, 2 n + 2 with a lens. Those of a delta vertex,
/// or of a point emitter's position, steer nothing. The others choose: the emitter, the lobe at
/// each vertex, the strategy.
///
/// With the balance heuristic the target is
///   I(u) = (n + 1) w_s f / p_s = (n + 1) f(X) / sum_s' p_s'(X),   X = X(u),
/// in which f and p are those of contribution.h and path_density.h, and the measure cancels: for
/// given choices a smooth function of the numbers.
#pragma once

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "bidirectional_tracer.h"
#include "driftlight/phase_space.h"
#include "driftlight/random.h"

namespace driftlight {

/// The strategy (s, t), of paths of s + t - 1 edges.
struct Strategy {
  int s = 0;
  int t = 0;

  int edges() const { return s + t - 1; }
  bool operator==(const Strategy&) const = default;
};

/// All numbers that strategies of paths of so many edges, or fewer, may ask for.
class StrategyNumbers {
 public:
  StrategyNumbers() = default;
  /// Uniform, for a camera with or without a lens.
  StrategyNumbers(int edges, bool has_lens, Rng& rng);

  int edges() const { return edges_; }
  bool has_lens() const { return lens_ > 0; }
  /// How many steer a path of the strategy, and the path's subpath from the sensor.
  int dimension(const Strategy& strategy) const { return lens_ + 2 * strategy.edges(); }
  int sensor_dimension(const Strategy& strategy) const {
    return lens_ + 2 * std::max(strategy.t - 1, 0);
  }
  /// The first of those of the film point, and of vertex i of the subpath from the sensor and from
  /// the light.
  int film() const { return lens_; }
  int sensor_vertex(int i) const { return lens_ + 2 + 2 * i; }
  int light_vertex(const Strategy& strategy, int i) const {
    return sensor_dimension(strategy) + 4 + 2 * i;
  }
  /// Of so many edges, chosen by a number of its own.
  Strategy strategy() const;
  /// Number i of those that steer a path of the strategy, in the order above.
  double& steering(const Strategy& strategy, int i) { return numbers_[index(strategy, i)]; }
  double steering(const Strategy& strategy, int i) const { return numbers_[index(strategy, i)]; }
  /// That which chooses the lobe at vertex i of the subpath from the sensor, or from the light.
  double sensor_lobe(int i) const { return at(kSensor + lens_ + 4 + 3 * i); }
  double light_lobe(int i) const { return at(light_begin() + 7 + 3 * i); }
  /// Moves all of them as PrimarySample does.
  void move(const PrimaryOptions& options, Rng& rng);
  /// Moves those that a path of the strategy is drawn from; that which chooses it remains.
  void move_within(const Strategy& strategy, const PrimaryOptions& options, Rng& rng);
  /// Moves those of them that do not steer the path.
  void move_choices(const Strategy& strategy, const PrimaryOptions& options, Rng& rng);

  /// Moves each by as much as between the two others, modulo 1.
  void shift(const StrategyNumbers& from, const StrategyNumbers& to);

  /// Hands out numbers from a first one on; the first `period` of them again and again, if there is
  /// one.
  class Reader final : public UniformSource {
   public:
    explicit Reader(const double* first, int period = 0) : first_(first), period_(period) {}
    double next() override {
      if (period_ > 0 && next_ == period_) next_ = 0;
      return first_[next_++];
    }

   private:
    const double* first_;
    int period_;
    int next_ = 0;
  };
  /// Those of the sensor's subpath, of the light's, and of the connection.
  Reader sensor() const { return Reader(&at(kSensor)); }
  Reader light() const { return Reader(&at(light_begin())); }
  /// All connections to emitters are to the same point.
  Reader connection() const { return Reader(&at(connection_begin()), kConnection); }

 private:
  // Places of the numbers: the strategy; the film, the lens, then three for each vertex; the
  // emitter and the ray, then likewise; the emitter and the point.
  static constexpr int kSensor = 1;
  static constexpr int kConnection = 3;  ///< of a connection
  static constexpr int kMaxCount = 1 + 9 + 6 * kMaxPathLength + 3;
  int light_begin() const { return kSensor + 2 + lens_ + 3 * edges_; }
  int connection_begin() const { return light_begin() + 5 + 3 * edges_; }
  int count() const { return connection_begin() + kConnection; }

  const double& at(int i) const { return numbers_[static_cast<std::size_t>(i)]; }
  std::size_t index(const Strategy& strategy, int i) const;

  int edges_ = 0;
  int lens_ = 0;  ///< numbers of the point on the lens
  std::array<double, kMaxCount> numbers_{};
};

/// What a strategy has found, but for what the numbers say.
struct PrimaryPath {
  Strategy strategy;
  PathTopology topology;
};
PrimaryPath primary_path(const Scene& scene, const FoundPath& found);

/// Derivatives by the numbers that steer the path, as far as they were asked for.
struct PrimaryDerivatives {
  Vector gradient;  ///< of log I
  Matrix hessian;   ///< of log I
  /// 1/9 sum_k w_k J_k^T J_k, J_k = d r_k / du, over the constraints of the path (constraints.h):
  /// (E63.13) in primary space, without its floor.
  Matrix constraints;
};

class PrimaryFunction {
 public:
  /// Light subpaths are those of the guide, which must outlive it.
  PrimaryFunction(const Scene& scene, const EmissionGuide& guide) : scene_(scene), guide_(guide) {}

  /// log(I / (n + 1)) by the walk along the path; NaN if a number leads off it.
  double log_target(const StrategyNumbers& numbers, const PrimaryPath& path) const;
  /// By Jets, and nested ones. False if something is not finite.
  bool gradient(const StrategyNumbers& numbers, const PrimaryPath& path,
                PrimaryDerivatives& result) const;
  bool gradient_and_hessian(const StrategyNumbers& numbers, const PrimaryPath& path,
                            PrimaryDerivatives& result) const;
  bool gradient_and_constraints(const StrategyNumbers& numbers, const PrimaryPath& path,
                                PrimaryDerivatives& result) const;

  /// What a constraint says of the path, and its precision w.
  struct Residual {
    double value;
    double precision;
  };
  /// Of all constraints, in the order of the walk.
  std::vector<Residual> residuals(const StrategyNumbers& numbers, const PrimaryPath& path) const;

 private:
  const Scene& scene_;
  const EmissionGuide& guide_;
};

}  // namespace driftlight
