// SPDX-License-Identifier: Apache-2.0
/// The bidirectional path tracer. Like the path tracer it is a reference: it shares tracing and
/// BSDFs with the samplers, but neither the contribution template nor any of their densities.
#include <fmt/format.h>
#include <tbb/task_arena.h>

#include <cmath>

#include "driftlight/render.h"
#include "pass_loop.h"
#include "sample_film.h"
#include "strategy_weights.h"

namespace driftlight {
namespace {

/// Index of strategy (s, t) among those of all lengths n = s + t - 1: n = 1 has (0, 2) alone, a
/// length n > 1 has (n, 1) .. (0, n + 1).
int strategy_index(int s, int t) {
  const int n = s + t - 1;
  return n * (n + 1) / 2 + t - 3;
}

std::vector<std::string> strategy_names(int max_depth) {
  std::vector<std::string> names{"s0t2"};
  for (int n = 2; n <= max_depth; ++n)
    for (int t = 1; t <= n + 1; ++t) names.push_back(fmt::format("s{}t{}", n + 1 - t, t));
  return names;
}

class BidirectionalTracer {
 public:
  BidirectionalTracer(const Scene& scene, const BdptOptions& options)
      : scene_(scene),
        tracer_(scene, options.heuristic),
        weights_(scene, options.heuristic),
        max_depth_(options.max_depth) {}

  void sample(const Vec2d& film, Rng& rng, SampleFilm::Sink& sink) {
    const Vec3d v = scene_.camera().direction(film);
    const auto escape = tracer_.trace(Walk::FromSensor, tracer_.leave_sensor(v),
                                      RayFollower(scene_, v), max_depth_, rng, from_sensor_);
    trace_from_light(rng);
    for (int t = 2; t < from_sensor_.size() + 2; ++t) {
      const SubpathVertex& z = from_sensor_[t - 2];
      hit_area(z, t, sink);
      if (z.delta || t > max_depth_) continue;
      connect_to_light(z, t, rng, sink);
      for (int s = 2; s < from_light_.size() + 2 && s + t <= max_depth_ + 1; ++s)
        if (!from_light_[s - 2].delta) connect(z, t, from_light_[s - 2], s, sink);
    }
    if (escape) hit_environment(*escape, sink);
    for (int s = 2; s < from_light_.size() + 2; ++s)
      if (!from_light_[s - 2].delta) connect_to_sensor(from_light_[s - 2], s, sink);
  }

 private:
  void trace_from_light(Rng& rng) {
    const LightEnd end = sample_light_end(scene_, rng);
    const Emission emission = sample_emission(scene_, end, rng);
    tracer_.trace(Walk::FromLight, tracer_.leave_light(end, emission),
                  RayFollower(scene_, emission.origin, emission.start, emission.direction),
                  max_depth_ - 1, rng, from_light_);
  }

  void hit_area(const SubpathVertex& z, int t, SampleFilm::Sink& sink) const {
    const auto end = light_end_at(scene_, z.surface);
    if (!end) return;
    const double w = weights_.hit(z, t, *end, end->n.dot(z.surface.wi));
    sink.add(w * z.throughput * end->emitted, strategy_index(0, t));
  }

  void hit_environment(const Departure& escape, SampleFilm::Sink& sink) const {
    const auto end = light_end_toward(scene_, escape.direction);
    if (!end) return;
    const int t = from_sensor_.size() + 2;
    const double w = weights_.hit(tracer_.arrive_at_infinity(escape), t, *end, 1.0);
    sink.add(w * escape.throughput * end->emitted, strategy_index(0, t));
  }

  /// s = 1: f_s |n_s . wo| L cos / (p(y) r^2)
  void connect_to_light(const SubpathVertex& z, int t, Rng& rng, SampleFilm::Sink& sink) const {
    const LightEnd end = sample_light_end(scene_, rng);
    const SurfaceHit& x = z.surface;
    const LightEdge edge = edge_to(end, x.at.p);
    if (!(edge.cosine > 0.0) || !passes(x.at, x.wi, edge.direction)) return;
    const Rgbd f = scattered(x, x.wi, edge.direction);
    if (!(f.maxCoeff() > 0.0) || !reaches(scene_, end, x, edge)) return;
    const double geometry = edge.cosine * edge.inverse_r2 / end.density;
    const double w = weights_.emitter(z, end, edge);
    sink.add(w * geometry * z.throughput * f * end.emitted, strategy_index(1, t));
  }

  /// s > 1, t > 1: f_z f_y |n_g . wi| / (r^2 |n_g . wo|), the cosines those at y, as in
  /// SubpathTracer::depart.
  void connect(const SubpathVertex& z, int t, const SubpathVertex& y, int s,
               SampleFilm::Sink& sink) const {
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
    const double w = weights_.connection(z, y, v, inverse_r2);
    sink.add(w * geometry * z.throughput * f * y.throughput, strategy_index(s, t));
  }

  /// t = 1
  void connect_to_sensor(const SubpathVertex& y, int s, SampleFilm::Sink& sink) const {
    const auto seen = driftlight::connect_to_sensor(scene_, y);
    if (seen) sink.splat(seen->film, weights_.sensor(y, *seen) * seen->value, strategy_index(s, 1));
  }

  const Scene& scene_;
  SubpathTracer tracer_;
  StrategyWeights weights_;
  int max_depth_;
  Subpath from_sensor_;  ///< kept between samples for its storage only
  Subpath from_light_;
};

}  // namespace

PathResult render_bdpt(const Scene& scene, const BdptOptions& options, const RenderOptions& render,
                       int samples_per_pixel) {
  options.validate();
  const BidirectionalTracer tracer(scene, options);
  std::vector<std::string> names;
  if (render.strategies != nullptr) names = strategy_names(options.max_depth);
  SampleFilm film(scene.camera(), render.seed, static_cast<int>(names.size()));
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  PathResult result = arena.execute([&] {
    return run_passes(render, samples_per_pixel,
                      [&](std::uint64_t index) { film.pass(index, tracer); });
  });
  result.image = film.image(result.samples_per_pixel);
  result.non_finite = film.non_finite();
  if (render.strategies != nullptr)
    *render.strategies = film.layers(names, result.samples_per_pixel);
  return result;
}

}  // namespace driftlight
