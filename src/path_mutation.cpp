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

/// At the angle to the axis, anywhere around it.
Vec3d tilted(const Vec3d& axis, double angle, Rng& rng) {
  const double phi = 2.0 * kPi * rng.uniform();
  const double sine = std::sin(angle);
  return to_world({sine * std::cos(phi), sine * std::sin(phi), std::cos(angle)}, axis);
}

RayFollower leaving(const Scene& scene, const SurfaceHit& x, const Vec3d& v) {
  return {scene, x.at.p, scene.leave(x.at.p, x.at.n_g, v), v};
}

/// The ray meets a surface that scatters. Missed, if it does not.
TraceStatus meet(RayFollower& ray, SurfaceHit& surface) {
  const Hit hit = ray.next_hit();
  if (!hit.valid()) return TraceStatus::Missed;
  surface = ray.surface(hit);
  // A ray that just touches a sphere in single precision may pass it in double.
  return surface.bsdf != nullptr && surface.at.p.allFinite() ? TraceStatus::Ok
                                                             : TraceStatus::Missed;
}

/// The last new vertex of the lens or multi-chain perturbation.
int last_from_sensor(const VertexPath& x) {
  for (int k = 1; k < x.edges; ++k)
    if (!x(k).delta && (k + 1 == x.edges || !x(k + 1).delta)) return k;
  return x.edges;
}

/// x_m of the caustic perturbation.
int first_of_caustic(const VertexPath& x) {
  int m = 2;
  while (m < x.edges && x(m).delta) ++m;
  return m;
}

double log_lens(const VertexPath& x) {
  double sum = x.log_importance();
  for (int k = last_from_sensor(x); k > 0; --k) sum += x.log_arriving(k);
  return sum;
}

double log_caustic(const VertexPath& x) {
  double sum = 0;
  for (int k = first_of_caustic(x) - 1; k > 0; --k) {
    sum += x.log_leaving(k);
    if (k > 1) sum += x.log_spread(k);
  }
  return sum;
}

/// Copies x_first .. x_last.
void copy_vertices(const VertexPath& x, int first, int last, VertexPath& y, int shift = 0) {
  for (int k = first; k <= last; ++k) y(k + shift) = x(k);
}

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
    : scene_(scene), limits_(limits) {}

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
  copy_vertices(x, 1, kept.sensor - 1, y);
  copy_vertices(x, x.edges - kept.light + 1, x.edges - 1, y, y.edges - x.edges);
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

// ---- Perturbations ----------------------------------------------------------------------------

double PathMutation::draw_step(double size, Rng& rng) const {
  return size * limits_.step_max *
         std::exp(rng.uniform() * std::log(limits_.step_min / limits_.step_max));
}

TraceStatus PathMutation::arrive_as(const VertexPath& x, int k, RayFollower& ray,
                                    VertexPath& y) const {
  y(k) = x(k);
  const TraceStatus status = meet(ray, y(k).surface);
  if (status != TraceStatus::Ok) return status;
  return has_lobe(*y(k).surface.bsdf, x(k).lobe()) ? TraceStatus::Ok : TraceStatus::OtherLobe;
}

TraceStatus PathMutation::follow_delta(const VertexPath& y, int k, RayFollower& ray) const {
  const SurfaceHit& at = y(k).surface;
  const Vec3d next = delta_direction(*at.bsdf, at.surface(), at.wi, y(k).scattering);
  if (!next.allFinite()) return TraceStatus::OtherLobe;  // total reflection
  if (at.side(next) != y(k).scattering) return TraceStatus::OtherLobe;
  if (!passes(at.at, at.wi, next)) return TraceStatus::Missed;
  ray.leave(at, next);
  return TraceStatus::Ok;
}

TraceStatus PathMutation::from_sensor(const VertexPath& x, VertexPath& y,
                                      MutationDensities& densities, Rng& rng, double size) const {
  const Camera& camera = scene_.camera();
  const double angle_of_step = 2.0 * std::atan(camera.half_width);
  const double r = draw_step(size, rng);
  const double phi = 2.0 * kPi * rng.uniform();
  const Vec2d film =
      x.contribution().film +
      r * Vec2d(std::cos(phi), std::sin(phi) * camera.half_width / camera.half_height);
  if (!(film.array() >= 0.0).all() || !(film.array() < 1.0).all()) return TraceStatus::Missed;

  y.edges = x.edges;
  const int last = last_from_sensor(x);
  RayFollower ray(scene_, camera.direction(film), camera.origin);
  TraceStatus status = TraceStatus::Ok;
  for (int k = 1; k <= last && k < x.edges; ++k) {
    status = arrive_as(x, k, ray, y);
    if (status != TraceStatus::Ok) return status;
    if (k == last) break;
    if (x(k).delta) {
      status = follow_delta(y, k, ray);
      if (status != TraceStatus::Ok) return status;
    } else {
      ray.leave(y(k).surface, tilted(x.toward_light(k), angle_of_step * draw_step(size, rng), rng));
    }
  }
  if (last == x.edges) {
    status = end_by_hit(y, ray);
  } else {
    copy_vertices(x, last + 1, x.edges - 1, y);
    y.end = x.end;
    status = joined(y, last + 1);
  }
  if (status != TraceStatus::Ok) return status;
  if (!y.evaluate(scene_)) return TraceStatus::Missed;
  densities = {log_lens(y), log_lens(x)};
  return TraceStatus::Ok;
}

bool PathMutation::has_caustic(const VertexPath& x) { return x.edges > 1 && !x(1).delta; }

TraceStatus PathMutation::perturb(const VertexPath& x, VertexPath& y, MutationDensities& densities,
                                  Rng& rng, double size) const {
  return has_caustic(x) && rng.uniform() < 0.5 ? caustic(x, y, densities, rng, size)
                                               : from_sensor(x, y, densities, rng, size);
}

double PathMutation::propose(const VertexPath& x, VertexPath& y, double size, Rng& rng,
                             Rejections& rejections) const {
  MutationDensities densities;
  if (!succeeded(perturb(x, y, densities, rng, size), rejections)) return 0.0;
  return acceptance_ratio(x.contribution().log_target, y.contribution().log_target, densities,
                          rejections);
}

/// The ray from x_m toward the sensor, moved.
RayFollower PathMutation::moved_from_light(const VertexPath& x, int m, double size,
                                           Rng& rng) const {
  const double angle = 2.0 * std::atan(scene_.camera().half_width) * draw_step(size, rng);
  if (m == x.edges && x.end.at_infinity()) {
    const Vec3d& toward = x.end.p;
    const Vec3d across = tangent_basis(toward).t;
    const Vec3d offset = angle * scene_.radius() *
                         (Eigen::AngleAxisd(2.0 * kPi * rng.uniform(), toward) * across).eval();
    const Vec3d origin = x(m - 1).surface.at.p + offset + 2.0 * scene_.radius() * toward;
    return {scene_, origin, origin, Vec3d(-toward)};
  }
  const Vec3d v = tilted(Vec3d(-x.toward_light(m - 1)), angle, rng);
  if (m < x.edges) return leaving(scene_, x(m).surface, v);
  const bool area = x.end.kind == LightEnd::Kind::Area;
  return {scene_, x.end.p, area ? scene_.leave(x.end.p, x.end.n, v) : x.end.p, v};
}

TraceStatus PathMutation::caustic(const VertexPath& x, VertexPath& y, MutationDensities& densities,
                                  Rng& rng, double size) const {
  const int m = first_of_caustic(x);
  y.edges = x.edges;
  copy_vertices(x, m, x.edges - 1, y);
  y.end = x.end;
  RayFollower ray = moved_from_light(x, m, size, rng);
  for (int k = m - 1; k > 0; --k) {
    TraceStatus status = arrive_as(x, k, ray, y);
    if (status == TraceStatus::Ok) status = k > 1 ? follow_delta(y, k, ray) : joined(y, 1);
    if (status != TraceStatus::Ok) return status;
  }
  if (!y.evaluate(scene_)) return TraceStatus::Missed;
  densities = {log_caustic(y), log_caustic(x)};
  return TraceStatus::Ok;
}

}  // namespace driftlight
