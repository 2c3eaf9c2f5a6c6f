// SPDX-License-Identifier: Apache-2.0
#include "path_mutation.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "driftlight/small_step.h"
#include "sensor_connection.h"

namespace driftlight {
namespace {

/// Share of the bidirectional mutations that delete the whole path: without it long paths hardly
/// ever would, and a chain that is alone on an island of light would stay there.
constexpr double kWhole = 0.1;

/// Veach's preference for short subpaths, by the number of edges that are deleted: 1/4, 1/2, and
/// 2^-k from k = 3 on.
double preference(int deleted_edges) {
  if (deleted_edges == 1) return 0.25;
  return deleted_edges == 2 ? 0.5 : std::ldexp(1.0, -deleted_edges);
}

/// Pairs (a, b) that delete so many vertices. The sensor stays; where nothing is deleted there must
/// be an edge to break, b > 0.
int pairs(int edges, int deleted) { return deleted == 0 ? edges : edges + 1 - deleted; }

/// Probability of deleting so many vertices. The preferences add up to 1 - 2^-(n + 1).
double deletion_probability(int edges, int deleted) {
  const double sum = 1.0 - std::ldexp(1.0, -(edges + 1));
  return (1.0 - kWhole) * preference(deleted + 1) / sum + (deleted == edges ? kWhole : 0.0);
}

/// Of changing a number by so much; not normalised.
double change_weight(int change) { return std::ldexp(1.0, -std::abs(change)); }

}  // namespace

double acceptance_ratio(double log_pi_x, double log_pi_y, const MutationDensities& densities,
                        Rejections& rejections) {
  if (!std::isfinite(log_pi_y) || !std::isfinite(densities.forward) ||
      std::isnan(densities.reverse)) {
    ++rejections.non_finite;
    return 0.0;
  }
  return acceptance_ratio(log_pi_x, log_pi_y, densities.forward, densities.reverse);
}

PathMutation::PathMutation(const Scene& scene, const MutationLimits& limits)
    : scene_(scene), limits_(limits), walk_(scene) {}

// ---- Bidirectional ----------------------------------------------------------------------------

double PathMutation::probability(const KeptEnds& kept, int edges) const {
  const int deleted = kept.deleted(edges);
  return deletion_probability(edges, deleted) / pairs(edges, deleted);
}

KeptEnds PathMutation::draw_kept(int edges, Rng& rng) const {
  double u = rng.uniform();
  int deleted = 0;
  while (deleted < edges && u >= deletion_probability(edges, deleted))
    u -= deletion_probability(edges, deleted++);
  const int count = pairs(edges, deleted);
  const int sensor = 1 + std::min(static_cast<int>(count * rng.uniform()), count - 1);
  return {sensor, edges + 1 - deleted - sensor};
}

double PathMutation::probability(int count, const KeptEnds& kept, int deleted) const {
  const int ends = kept.sensor + kept.light;
  const int most = limits_.max_edges + 1 - ends;
  const int least = std::max(kept.light == 0 ? 1 : 0, limits_.min_edges + 1 - ends);
  double sum = 0;
  for (int k = least; k <= most; ++k) sum += change_weight(k - deleted);
  return count < least || count > most ? 0.0 : change_weight(count - deleted) / sum;
}

int PathMutation::draw_count(const KeptEnds& kept, int deleted, Rng& rng) const {
  double u = rng.uniform();
  const int most = limits_.max_edges + 1 - kept.sensor - kept.light;
  int count = 0;
  for (; count < most; ++count) {
    const double p = probability(count, kept, deleted);
    if (u < p) break;
    u -= p;
  }
  return count;
}

double PathMutation::log_regrowth(const VertexPath& y, const KeptEnds& kept, int deleted) const {
  const int count = kept.deleted(y.edges);
  LogSum ways;
  for (int i = 0; i <= count; ++i) ways.add(log_way(y, kept, i));
  return ways.value() + std::log(probability(count, kept, deleted) / (count + 1));
}

TraceStatus PathMutation::bidirectional(const VertexPath& x, VertexPath& y,
                                        MutationDensities& densities, Rng& rng) const {
  const KeptEnds kept = draw_kept(x.edges, rng);
  const int deleted = kept.deleted(x.edges);
  const int count = draw_count(kept, deleted, rng);
  const int from_sensor = std::min(static_cast<int>((count + 1) * rng.uniform()), count);
  const TraceStatus status = regrow(x, kept, from_sensor, count - from_sensor, y, rng);
  if (status != TraceStatus::Ok) return status;
  if (!y.evaluate(scene_)) return TraceStatus::Missed;
  densities.forward = std::log(probability(kept, x.edges)) + log_regrowth(y, kept, deleted);
  densities.reverse = std::log(probability(kept, y.edges)) + log_regrowth(x, kept, count);
  return TraceStatus::Ok;
}

TraceStatus PathMutation::regrow(const VertexPath& x, const KeptEnds& kept, int from_sensor,
                                 int from_light, VertexPath& y, Rng& rng) const {
  y.edges = kept.sensor + kept.light + from_sensor + from_light - 1;
  y.take(x, 1, kept.sensor - 1);
  y.take(x, x.edges - kept.light + 1, x.edges - 1, y.edges - x.edges);
  if (kept.light > 0) y.end = x.end;
  const int joint = kept.sensor + from_sensor;
  const bool hits = joint > y.edges;
  TraceStatus status = grow_from_sensor(y, kept.sensor, from_sensor, hits, rng);
  if (hits || status != TraceStatus::Ok) return status;
  status = grow_from_light(y, y.edges - kept.light, from_light, rng);
  if (status != TraceStatus::Ok) return status;
  // Neither end of the joining edge goes on by a delta lobe.
  for (const int k : {joint - 1, joint}) {
    if (k < 1 || k >= y.edges) continue;
    if (is_delta(*y(k).surface.bsdf)) return TraceStatus::OtherLobe;
    y(k).delta = false;
  }
  return joined(y, joint);
}

/// x_first and those behind it, `count` in all; with `hits` the last one is the end.
TraceStatus PathMutation::grow_from_sensor(VertexPath& y, int first, int count, bool hits,
                                           Rng& rng) const {
  Vec3d wi = Vec3d::Zero();
  if (first > 1) {
    const Vec3d& before = first > 2 ? y(first - 2).surface.at.p : scene_.camera().origin;
    wi = (before - y(first - 1).surface.at.p).normalized();
  }
  for (int k = first; k < first + count; ++k) {
    Vec3d v;
    if (k == 1) {
      v = scene_.camera().direction(rng.uniform2());
    } else {
      VertexPath::Vertex& from = y(k - 1);
      const SurfaceHit& at = from.surface;
      const auto next = sample(*at.bsdf, at.surface(), wi, rng.uniform3());
      if (!next || !passes(at.at, wi, next->wo)) return TraceStatus::Missed;
      from.delta = next->delta;
      from.scattering = next->scattering;
      v = next->wo;
    }
    RayFollower ray = k == 1 ? RayFollower(scene_, v, scene_.camera().origin)
                             : leaving(scene_, y(k - 1).surface, v);
    if (hits && k == y.edges) return end_by_hit(y, ray);
    const TraceStatus status = meet(ray, y(k).surface);
    if (status != TraceStatus::Ok) return status;
    wi = -v;
  }
  return TraceStatus::Ok;
}

/// x_last and those before it, `count` in all.
TraceStatus PathMutation::grow_from_light(VertexPath& y, int last, int count, Rng& rng) const {
  if (count == 0) return TraceStatus::Ok;
  int k = last;
  if (k == y.edges) {
    y.end = sample_light_end(scene_, rng);
    --k;
  }
  const int first = last - count;
  Vec3d wo = Vec3d::Zero();
  if (k + 1 < y.edges) {
    const Vec3d& p = y(k + 1).surface.at.p;
    wo = k + 2 < y.edges ? Vec3d((y(k + 2).surface.at.p - p).normalized())
                         : edge_to(y.end, p).direction;
  }
  for (; k > first; --k) {
    const bool emits = k + 1 == y.edges;
    Emission emission;
    Vec3d v;
    if (emits) {
      emission = emit_from(scene_, y.end, rng.uniform2());
      v = emission.direction;
    } else {
      VertexPath::Vertex& from = y(k + 1);
      const SurfaceHit& at = from.surface;
      const auto next = sample(*at.bsdf, at.surface(), wo, rng.uniform3());
      if (!next || !passes(at.at, wo, next->wo)) return TraceStatus::Missed;
      from.delta = next->delta;
      from.scattering = next->scattering;
      v = next->wo;
    }
    RayFollower ray = emits ? RayFollower(scene_, emission.origin, emission.start, v)
                            : leaving(scene_, y(k + 1).surface, v);
    const TraceStatus status = meet(ray, y(k).surface);
    if (status != TraceStatus::Ok) return status;
    wo = -v;
  }
  return TraceStatus::Ok;
}

TraceStatus PathMutation::end_by_hit(VertexPath& y, RayFollower ray) const {
  const Hit hit = ray.next_hit();
  const auto end = hit.valid() ? light_end_at(scene_, ray.surface(hit))
                               : light_end_toward(scene_, ray.ray().direction);
  if (!end) return TraceStatus::Missed;
  y.end = *end;
  return TraceStatus::Ok;
}

/// Whether light passes along the edge from x_(k-1) to x_k, none of which is a delta vertex. It
/// does not between points of one plane, whatever sign rounding gives to a cosine, nor between a
/// vertex and itself, which a delta lobe has found again.
TraceStatus PathMutation::joined(const VertexPath& y, int k) const {
  if (y.edges == 1) return TraceStatus::Missed;
  if (k == 1)
    return sensor_sees(scene_, y(1).surface, scene_.camera().origin) ? TraceStatus::Ok
                                                                     : TraceStatus::Occluded;
  const SurfaceHit& from = y(k - 1).surface;
  const Interaction<double>& a = from.at;
  const auto leaves = [&](const Interaction<double>& x, const Vec3d& edge) {
    return std::abs(x.n_g.dot(edge)) > 1e-12 * scene_.radius();
  };
  bool clear = false;
  if (k == y.edges) {
    if (!y.end.at_infinity() && !leaves(a, y.end.p - a.p)) return TraceStatus::Missed;
    const LightEdge edge = edge_to(y.end, a.p);
    clear = edge.lit() && reaches(scene_, y.end, from, edge);
  } else {
    const Interaction<double>& b = y(k).surface.at;
    const Vec3d edge = b.p - a.p;
    if (!leaves(a, edge) || !leaves(b, edge)) return TraceStatus::Missed;
    clear =
        !scene_.occluded(scene_.leave(a.p, a.n_g, edge), scene_.leave(b.p, b.n_g, Vec3d(-edge)));
  }
  return clear ? TraceStatus::Ok : TraceStatus::Occluded;
}

}  // namespace driftlight
