// SPDX-License-Identifier: Apache-2.0
/// The perturbations of path_mutation.h.
#include <algorithm>
#include <cmath>
#include <utility>

#include "path_mutation.h"

namespace driftlight {
namespace {

/// At the angle to the axis, anywhere around it.
Vec3d tilted(const Vec3d& axis, double angle, Rng& rng) {
  const double phi = 2.0 * kPi * rng.uniform();
  const double sine = std::sin(angle);
  return to_world({sine * std::cos(phi), sine * std::sin(phi), std::cos(angle)}, axis);
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

}  // namespace

double PathMutation::draw_step(double size, Rng& rng) const {
  return size * limits_.step_max *
         std::exp(rng.uniform() * std::log(limits_.step_min / limits_.step_max));
}

double PathMutation::draw_angle(double size, Rng& rng) const {
  return 2.0 * std::atan(scene_.camera().half_width) * draw_step(size, rng);
}

/// None outside of the film.
std::optional<Vec2d> PathMutation::moved_film(const VertexPath& x, double size, Rng& rng) const {
  const Camera& camera = scene_.camera();
  const double r = draw_step(size, rng);
  const double phi = 2.0 * kPi * rng.uniform();
  const Vec2d film =
      x.contribution().film +
      r * Vec2d(std::cos(phi), std::sin(phi) * camera.half_width / camera.half_height);
  if (!(film.array() >= 0.0).all() || !(film.array() < 1.0).all()) return std::nullopt;
  return film;
}

TraceStatus PathMutation::from_sensor(const VertexPath& x, VertexPath& y,
                                      MutationDensities& densities, Rng& rng, double size) const {
  const auto film = moved_film(x, size, rng);
  if (!film) return TraceStatus::Missed;
  y.edges = x.edges;
  const int last = last_from_sensor(x);
  RayFollower ray(scene_, scene_.camera().direction(*film), scene_.camera().origin);
  TraceStatus status = TraceStatus::Ok;
  for (int k = 1; k <= last && k < x.edges; ++k) {
    status = arrive_as(x, k, ray, y);
    if (status != TraceStatus::Ok) return status;
    if (k == last) break;
    if (x(k).delta) {
      status = follow(y(k).surface, {true, x(k).scattering}, ray);
      if (status != TraceStatus::Ok) return status;
    } else {
      ray.leave(y(k).surface, tilted(x.toward_light(k), draw_angle(size, rng), rng));
    }
  }
  if (last == x.edges) {
    status = end_by_hit(y, ray);
  } else {
    y.take(x, last + 1, x.edges - 1);
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
  if (limits_.manifold_probability > 0.0 && has_manifold(x) &&
      rng.uniform() < limits_.manifold_probability)
    return manifold(x, y, densities, rng, size);
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
  const double angle = draw_angle(size, rng);
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
  y.take(x, m, x.edges - 1);
  y.end = x.end;
  RayFollower ray = moved_from_light(x, m, size, rng);
  for (int k = m - 1; k > 0; --k) {
    TraceStatus status = arrive_as(x, k, ray, y);
    if (status == TraceStatus::Ok)
      status = k > 1 ? follow(y(k).surface, {true, x(k).scattering}, ray) : joined(y, 1);
    if (status != TraceStatus::Ok) return status;
  }
  if (!y.evaluate(scene_)) return TraceStatus::Missed;
  densities = {log_caustic(y), log_caustic(x)};
  return TraceStatus::Ok;
}

// ---- Manifold perturbation --------------------------------------------------------------------

ManifoldSpans manifold_spans(const VertexPath& x) {
  ManifoldSpans spans;
  for (int b = 1; b < x.edges; ++b) {
    if (x(b).delta) continue;
    ManifoldSpan span{b - 1, b, b + 1};
    while (span.a > 0 && is_held(x(span.a))) --span.a;
    while (span.c < x.edges && is_held(x(span.c))) ++span.c;
    if (span.c - span.a > 2) spans.all[static_cast<std::size_t>(spans.count++)] = span;
  }
  return spans;
}

double PathMutation::log_manifold(const VertexPath& x, const ManifoldSpan& span) const {
  const auto& [a, b, c] = span;
  double sum = walk_.log_density(x, std::min(b, c), std::max(b, c));
  if (a < b) {
    if (a == 0) sum += x.log_importance();
    for (int k = a + 1; k <= b; ++k) sum += x.log_arriving(k);
    for (int k = a + 1; k < b; ++k) sum += log_narrowing(x, k, true);
  } else {
    for (int k = b; k < a; ++k) sum += x.log_leaving(k);
    for (int k = b + 1; k < a; ++k)
      sum += x(k).delta ? x.log_spread(k) : log_narrowing(x, k, false);
  }
  return sum;
}

std::optional<RayFollower> PathMutation::moved(const VertexPath& x, const ManifoldSpan& span,
                                               double size, Rng& rng) const {
  if (span.a > span.b) return moved_from_light(x, span.a, size, rng);
  if (span.a > 0)
    return leaving(scene_, x(span.a).surface,
                   tilted(x.toward_light(span.a), draw_angle(size, rng), rng));
  const auto film = moved_film(x, size, rng);
  if (!film) return std::nullopt;
  return RayFollower(scene_, scene_.camera().direction(*film), scene_.camera().origin);
}

TraceStatus PathMutation::manifold(const VertexPath& x, VertexPath& y, MutationDensities& densities,
                                   Rng& rng, double size) const {
  const ManifoldSpans spans = manifold_spans(x);
  const int index = std::min(static_cast<int>(spans.count * rng.uniform()), spans.count - 1);
  ManifoldSpan span = spans.all[static_cast<std::size_t>(index)];
  if (rng.uniform() < 0.5) std::swap(span.a, span.c);
  y.edges = x.edges;
  y.take(x, 1, x.edges - 1);
  y.end = x.end;
  std::optional<RayFollower> ray = moved(x, span, size, rng);
  if (!ray) return TraceStatus::Missed;
  TraceStatus status = walk_.follow_chain(x, span.a, span.b, *ray, y);
  if (status == TraceStatus::Ok) status = arrive_as(x, span.b, *ray, y);
  if (status == TraceStatus::Ok && is_held(y(span.b)) != is_held(x(span.b)))
    status = TraceStatus::OtherLobe;
  if (status == TraceStatus::Ok) status = walk_.connect(x, span.b, span.c, y);
  if (status == TraceStatus::Ok) status = joined(y, span.b < span.c ? span.c : span.c + 1);
  if (status != TraceStatus::Ok) return status;
  if (!y.evaluate(scene_) || !walk_.leads_back(y, span.b, span.c, x)) return TraceStatus::Missed;
  densities = {log_manifold(y, span), log_manifold(x, span)};
  return TraceStatus::Ok;
}

}  // namespace driftlight
