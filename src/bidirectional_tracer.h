// SPDX-License-Identifier: Apache-2.0
/// Bidirectional path tracing (Lafortune and Willems 1993; Veach 1997, ch. 10): for each sample a
/// subpath from the sensor, one from the light, or at a lower rate of the guide only for some, and
/// all connections between them and to freshly drawn emitter points.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "driftlight/options.h"
#include "strategy_weights.h"

namespace driftlight {

/// The path x_0 .. x_(s+t-1) that strategy (s, t) has found.
struct FoundPath {
  int s;
  int t;
  const Vec3d& lens;           ///< the point on it that the path begins at (sensor.h)
  const Vec3d& v;              ///< v_0 of the subpath from the sensor
  const Subpath& from_sensor;  ///< x_1 .. x_(t-1) and more
  const Subpath& from_light;   ///< x_(n-1) .. x_t and more, for s > 1
  const LightEnd& end;         ///< x_n
  /// Its value is factor f / q, q the density summed over all strategies: the inverse of the
  /// probability with which roulette has spared it, and its weight over that of the balance
  /// heuristic.
  double factor;
};

/// Where a sample's random numbers come from: for its subpath from the sensor, with the point on
/// the lens first, that from the light, and the points on emitters that the former connects to.
struct SampleNumbers {
  Rng& sensor;
  Rng& light;
  Rng& connection;
};

/// Reports each path that it finds to the sink:
///   add(value, path)           for the film point that the sample was asked for,
///   splat(film, value, path)   for another one, s > 1 and t = 1.
/// Values are weighted by strategy_weights.h.
class BidirectionalTracer {
 public:
  /// Light subpaths begin as the guide says, which must outlive it.
  BidirectionalTracer(const Scene& scene, const EmissionGuide& guide, MisHeuristic heuristic,
                      int max_depth, Roulette roulette = Roulette::On)
      : scene_(scene),
        guide_(guide),
        heuristic_(heuristic),
        tracer_(scene, guide, roulette),
        weights_(guide),
        max_depth_(max_depth) {
    for (std::uint32_t i = 0; i < scene.emitters().size(); ++i)
      if (scene.is_blurred(i)) blurred_.push_back(i);
  }

  template <class Sink>
  void sample(const Vec2d& film, Rng& rng, Sink& sink) {
    sample(film, SampleNumbers{rng, rng, rng}, sink);
  }
  template <class Sink>
  void sample(const Vec2d& film, const SampleNumbers& numbers, Sink& sink) {
    const bool with_light = guide_.rate() == 1.0 || numbers.light.uniform() < guide_.rate();
    sample(film, numbers, with_light, sink);
  }
  /// With a light subpath or without, as its caller has drawn. The values are those at the guide's
  /// rate: what is found by way of the subpath is divided by it.
  template <class Sink>
  void sample(const Vec2d& film, const SampleNumbers& numbers, bool with_light, Sink& sink) {
    draw_lens(numbers.sensor);
    const auto escape = trace_from_sensor(film, max_depth_, numbers.sensor);
    from_light_.clear();
    if (with_light && scene_.samples_emitters()) trace_from_light(max_depth_ - 1, numbers.light);
    for (int t = 2; t < from_sensor_.size() + 2; ++t) {
      const SubpathVertex& z = from_sensor_[t - 2];
      hit_area(z, t, sink);
      if (t > 2) see_blurred(z, t, sink);
      if (!z.connects || t > max_depth_) continue;
      if (scene_.samples_emitters()) connect_to_light(z, t, numbers.connection, sink);
      for (int s = 2; s < from_light_.size() + 2 && s + t <= max_depth_ + 1; ++s)
        if (from_light_[s - 2].connects) connect(z, t, from_light_[s - 2], s, sink);
    }
    if (escape) {
      hit_environment(*escape, sink);
      see_blurred(*escape, sink);
    }
    for (int s = 2; s < from_light_.size() + 2; ++s)
      if (from_light_[s - 2].connects) connect_to_sensor(from_light_[s - 2], s, sink);
  }

  /// What strategy (s, t) alone finds, with its weight among all. Blurred lamps are not seen.
  template <class Sink>
  void sample_strategy(int s, int t, const Vec2d& film, const SampleNumbers& numbers, Sink& sink) {
    if (s < 2 && t < 2) return;
    from_sensor_.clear();
    draw_lens(numbers.sensor);
    const auto escape = t > 1 ? trace_from_sensor(film, t - 1, numbers.sensor) : std::nullopt;
    if (s > 1) {
      if (!scene_.samples_emitters()) return;
      trace_from_light(s - 1, numbers.light);
      if (from_light_.size() < s - 1 || !from_light_[s - 2].connects) return;
      if (t == 1) return connect_to_sensor(from_light_[s - 2], s, sink);
    }
    if (s == 0 && escape && from_sensor_.size() == t - 2) return hit_environment(*escape, sink);
    if (from_sensor_.size() < t - 1) return;
    const SubpathVertex& z = from_sensor_[t - 2];
    if (s == 0) return hit_area(z, t, sink);
    if (!z.connects) return;
    if (s > 1) return connect(z, t, from_light_[s - 2], s, sink);
    if (scene_.samples_emitters()) connect_to_light(z, t, numbers.connection, sink);
  }

  /// Of the last sample.
  const Subpath& from_sensor() const { return from_sensor_; }
  const Subpath& from_light() const { return from_light_; }
  /// The first ray of its light subpath.
  const Emission& emission() const { return emission_; }

 private:
  void draw_lens(Rng& rng) { lens_ = sample_lens(scene_.camera(), rng); }
  std::optional<Departure> trace_from_sensor(const Vec2d& film, int max_size, Rng& rng) {
    v_ = scene_.camera().direction(film, lens_);
    return tracer_.trace(Walk::FromSensor, tracer_.leave_sensor(v_, lens_),
                         RayFollower(scene_, v_, lens_), max_size, rng, from_sensor_);
  }
  void trace_from_light(int max_size, Rng& rng) {
    emission_ = guide_.sample(rng);
    tracer_.trace(Walk::FromLight, tracer_.leave_light(emission_),
                  RayFollower(scene_, emission_.origin, emission_.start, emission_.direction),
                  max_size, rng, from_light_);
  }

  template <class Sink>
  void hit_area(const SubpathVertex& z, int t, Sink& sink) const {
    const auto end = light_end_at(scene_, z.surface);
    if (!end) return;
    const Vec3d& v = z.surface.wi;
    const OfHeuristics w = weights_.hit(z, t, *end, end->p, v, end->n.dot(v));
    sink.add(chosen(w) * z.throughput * end->emitted, path(0, t, *end, z.roulette * factor(w)));
  }

  /// Blurred lamps on the way to a vertex, none of which another strategy finds. What the sensor
  /// itself sees of them is left to the scene (TemperedScenes::carry).
  template <class Sink>
  void see_blurred(const SubpathVertex& z, int t, Sink& sink) const {
    const Vec3d& origin = from_sensor_[t - 3].surface.at.p;
    const double distance = (z.surface.at.p - origin).norm();
    see_blurred({origin, -z.surface.wi}, distance, z.throughput, t, z.roulette, sink);
  }
  template <class Sink>
  void see_blurred(const Departure& escape, Sink& sink) const {
    const int t = from_sensor_.size() + 2;
    if (t > 2)
      see_blurred({escape.p, escape.direction}, kInfinity, escape.throughput, t, escape.roulette,
                  sink);
  }
  template <class Sink>
  void see_blurred(const Ray<double>& ray, double distance, const Rgbd& throughput, int t,
                   double roulette, Sink& sink) const {
    for (const std::uint32_t i : blurred_) {
      const auto& lamp = std::get<BlurredAreaEmitter>(scene_.emitters()[i]);
      if (distance < lamp.clearance(ray.origin) || !lamp.shines(ray)) continue;
      LightEnd end;
      end.emitter = i;
      end.p = ray.direction;
      end.emitted = std::exp(lamp.log_share(ray)) * lamp.sharp().radiance;
      sink.add(throughput * end.emitted, path(0, t, end, roulette));
    }
  }

  template <class Sink>
  void hit_environment(const Departure& escape, Sink& sink) const {
    const auto end = light_end_toward(scene_, escape.direction);
    if (!end) return;
    const int t = from_sensor_.size() + 2;
    const OfHeuristics w =
        weights_.hit(tracer_.arrive_at_infinity(escape), t, *end, escape.p, -escape.direction, 1.0);
    sink.add(chosen(w) * escape.throughput * end->emitted,
             path(0, t, *end, escape.roulette * factor(w)));
  }

  /// s = 1: f_s |n_s . wo| L cos / (p(y) r^2), with a spot's falloff
  template <class Sink>
  void connect_to_light(const SubpathVertex& z, int t, Rng& rng, Sink& sink) const {
    const LightEnd end = sample_light_end(scene_, rng);
    const SurfaceHit& x = z.surface;
    const LightEdge edge = edge_to(end, x.at.p);
    if (!edge.lit() || !passes(x.at, x.wi, edge.direction)) return;
    const Rgbd f = scattered(x, x.wi, edge.direction);
    if (!(f.maxCoeff() > 0.0) || !reaches(scene_, end, x, edge)) return;
    const double geometry = edge.falloff * edge.cosine * edge.inverse_r2 / end.density;
    const OfHeuristics w = weights_.emitter(z, end, edge);
    sink.add(chosen(w) * geometry * z.throughput * f * end.emitted,
             path(1, t, end, z.roulette * factor(w)));
  }

  /// s > 1, t > 1: f_z f_y |n_g . wi| / (r^2 |n_g . wo|), the cosines those at y, as in
  /// SubpathTracer::depart.
  template <class Sink>
  void connect(const SubpathVertex& z, int t, const SubpathVertex& y, int s, Sink& sink) const {
    const SurfaceHit& a = z.surface;
    const SurfaceHit& b = y.surface;
    const Vec3d edge = b.at.p - a.at.p;
    const double inverse_r2 = 1.0 / edge.squaredNorm();
    const Vec3d v = edge * std::sqrt(inverse_r2);
    const Vec3d back = -v;
    if (!passes(a.at, a.wi, v) || !passes(b.at, back, b.wi)) return;
    const Rgbd f = scattered(a, a.wi, v) * scattered(b, back, b.wi);
    if (!(f.maxCoeff() > 0.0)) return;
    if (scene_.occluded(scene_.leave(a.at.p, a.at.n_g, v), scene_.leave(b.at.p, b.at.n_g, back)))
      return;
    const double geometry = std::abs(b.at.n_g.dot(v) / b.at.n_g.dot(b.wi)) * inverse_r2;
    const OfHeuristics w = weights_.connection(z, y, v, inverse_r2);
    sink.add(chosen(w) * geometry * z.throughput * f * y.throughput,
             path(s, t, emission_.end, z.roulette * y.roulette * factor(w)));
  }

  /// t = 1
  template <class Sink>
  void connect_to_sensor(const SubpathVertex& y, int s, Sink& sink) const {
    const auto seen = driftlight::connect_to_sensor(scene_, y, lens_);
    if (!seen) return;
    const OfHeuristics w = weights_.sensor(y, *seen);
    sink.splat(seen->film, chosen(w) * seen->value,
               path(s, 1, emission_.end, y.roulette * factor(w)));
  }

  double chosen(const OfHeuristics& w) const { return w[static_cast<Eigen::Index>(heuristic_)]; }
  /// Over that of the balance heuristic.
  double factor(const OfHeuristics& w) const { return w[0] > 0.0 ? chosen(w) / w[0] : 1.0; }
  FoundPath path(int s, int t, const LightEnd& end, double factor) const {
    return {s, t, lens_, v_, from_sensor_, from_light_, end, factor};
  }

  const Scene& scene_;
  const EmissionGuide& guide_;
  MisHeuristic heuristic_;
  SubpathTracer tracer_;
  StrategyWeights weights_;
  int max_depth_;
  std::vector<std::uint32_t> blurred_;  ///< emitters
  // Of the sample in hand.
  Vec3d lens_{0, 0, 0};
  Vec3d v_{0, 0, 0};
  Emission emission_;  ///< that `from_light_` starts with
  Subpath from_sensor_;
  Subpath from_light_;
};

}  // namespace driftlight
