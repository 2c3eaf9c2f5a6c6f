// SPDX-License-Identifier: Apache-2.0
#include "manifold_walk.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "driftlight/bsdf_delta.h"
#include "driftlight/walk.h"

namespace driftlight {
namespace {

using Jet2 = ceres::Jet<double, 2>;

constexpr int kMaxIterations = 20;
constexpr int kMaxHalvings = 5;
/// Of a step of Newton's method, in radians.
constexpr double kLongestStep = 0.5;
/// In units of the scene's radius, or radians.
constexpr double kConverged = 1e-8;
constexpr double kSame = 1e-6;

int step_toward(int from, int to) { return to > from ? 1 : -1; }

const Microfacets* microfacets_of(const Bsdf& bsdf) {
  if (const auto* metal = std::get_if<RoughConductor>(&bsdf)) return &metal->microfacets;
  const auto* glass = std::get_if<RoughDielectric>(&bsdf);
  return glass != nullptr ? &glass->microfacets : nullptr;
}

/// The hit of a ray that comes to the surface point, maybe from the other side than the one that
/// found it: of a sphere or a cylinder it is the root that is nearer.
Hit hit_of(const Scene& scene, const SurfaceHit& x, const Ray<double>& ray) {
  const Geometry& geometry = scene.shapes()[x.hit.shape].geometry;
  if (!std::holds_alternative<Sphere>(geometry) && !std::holds_alternative<Cylinder>(geometry))
    return x.hit;
  const Hit first{x.hit.shape, 0};
  const Hit second{x.hit.shape, 1};
  const auto distance = [&](const Hit& hit) {
    return (scene.interact(hit, ray).p - x.at.p).squaredNorm();
  };
  return distance(first) < distance(second) ? first : second;
}

/// Index behind n over that before it; 1 where light passes straight on, or not at all.
double index_behind(const Bsdf& bsdf) {
  const auto* glass = std::get_if<RoughDielectric>(&bsdf);
  return glass != nullptr ? glass->eta : delta_eta(bsdf);
}

template <Scalar T>
Vec3<T> next_direction(const Bsdf& bsdf, const SurfacePoint<T>& at, const Vec3<T>& w,
                       const HeldLobe& lobe) {
  if (lobe.delta) return delta_direction(bsdf, at, w, lobe.scattering);
  const Vec3<T> h = to_world(constant<T>(lobe.half), at.n);
  if (lobe.scattering == Scattering::Reflection) return reflect(w, h);
  const double eta = index_behind(bsdf);
  return refract(w, h, value(dot(h, w)) > 0.0 ? eta : 1.0 / eta);
}

}  // namespace

bool is_narrow(const Bsdf& bsdf) {
  const Microfacets* facets = microfacets_of(bsdf);
  return facets != nullptr && std::max(facets->alpha_u, facets->alpha_v) <= kHeldRoughness;
}

HeldLobe held_lobe(const VertexPath& path, int k) {
  const VertexPath::Vertex& x = path(k);
  if (x.delta) return {true, x.scattering};
  const Vec3d wi = -path.toward_light(k - 1);
  const Vec3d& wo = path.toward_light(k);
  const Vec3d n = x.surface.surface().n;
  HeldLobe lobe{false, x.surface.at.n_g.dot(wi) * x.surface.at.n_g.dot(wo) > 0.0
                           ? Scattering::Reflection
                           : Scattering::Transmission};
  Vec3d h = wi + wo;
  if (lobe.scattering == Scattering::Transmission) {
    const double behind = index_behind(*x.surface.bsdf);
    h = (n.dot(wi) > 0.0 ? 1.0 : behind) * wi + (n.dot(wo) > 0.0 ? 1.0 : behind) * wo;
  }
  h.normalize();
  lobe.half = to_local(n.dot(h) > 0.0 ? h : Vec3d(-h), n);
  return lobe;
}

double log_narrowing(const VertexPath& path, int k, bool toward_light) {
  const HeldLobe lobe = held_lobe(path, k);
  if (lobe.delta) return 0.0;
  const SurfaceHit& at = path(k).surface;
  const Vec3d h = to_world(lobe.half, at.surface().n);
  double known = -h.dot(path.toward_light(k - 1));
  double next = h.dot(path.toward_light(k));
  if (!toward_light) std::swap(known, next);
  if (lobe.scattering == Scattering::Reflection) return -std::log(4.0 * std::abs(next));
  const double behind = index_behind(*at.bsdf);
  const double eta = known > 0.0 ? behind : 1.0 / behind;
  return std::log(eta * eta * std::abs(next)) - 2.0 * std::log(std::abs(known + eta * next));
}

TraceStatus arrive_as(const VertexPath& x, int k, RayFollower& ray, VertexPath& y) {
  y(k) = x(k);
  const TraceStatus status = meet(ray, y(k).surface);
  if (status != TraceStatus::Ok) return status;
  return has_lobe(*y(k).surface.bsdf, x(k).lobe()) ? TraceStatus::Ok : TraceStatus::OtherLobe;
}

TraceStatus follow(const SurfaceHit& at, const HeldLobe& lobe, RayFollower& ray) {
  const Vec3d next = next_direction(*at.bsdf, at.surface(), at.wi, lobe);
  if (!next.allFinite()) return TraceStatus::OtherLobe;  // total reflection
  if (at.side(next) != lobe.scattering) return TraceStatus::OtherLobe;
  if (!passes(at.at, at.wi, next)) return TraceStatus::Missed;
  ray.leave(at, next);
  return TraceStatus::Ok;
}

ManifoldWalk::Lobes ManifoldWalk::lobes_between(const VertexPath& x, int from, int to) {
  Lobes lobes;
  const int step = step_toward(from, to);
  for (int k = from + step; k != to; k += step)
    lobes[static_cast<std::size_t>(k)] = held_lobe(x, k);
  return lobes;
}

TraceStatus ManifoldWalk::follow_lobes(const VertexPath& x, const Lobes& lobes, int from, int to,
                                       RayFollower& ray, VertexPath& y) const {
  const int step = step_toward(from, to);
  for (int k = from + step; k != to; k += step) {
    TraceStatus status = arrive_as(x, k, ray, y);
    if (status == TraceStatus::Ok && !is_held(y(k))) status = TraceStatus::OtherLobe;
    if (status == TraceStatus::Ok)
      status = follow(y(k).surface, lobes[static_cast<std::size_t>(k)], ray);
    if (status != TraceStatus::Ok) return status;
  }
  return TraceStatus::Ok;
}

TraceStatus ManifoldWalk::follow_chain(const VertexPath& x, int from, int to, RayFollower& ray,
                                       VertexPath& y) const {
  return follow_lobes(x, lobes_between(x, from, to), from, to, ray, y);
}

std::optional<ManifoldWalk::Passing> ManifoldWalk::pass(const VertexPath& y, const Lobes& lobes,
                                                        int from, int to, const Vec3d& v) const {
  const TangentBasis tangents = tangent_basis(v);
  Ray<Jet2> ray;
  for (int i = 0; i < 3; ++i) {
    ray.origin[i] = Jet2(y.position(scene_, from)[i]);
    ray.direction[i] = Jet2(v[i], Vec2d(tangents.t[i], tangents.b[i]));
  }
  const int step = step_toward(from, to);
  for (int k = from + step; k != to; k += step) {
    PathVertex vertex = y(k).lobe();
    vertex.hit = hit_of(scene_, y(k).surface, {value(ray.origin), value(ray.direction)});
    const WalkVertex<Jet2> x = arrive(scene_, vertex, ray);
    ray = {x.at.p, next_direction(x.bsdf, x.surface(), x.w, lobes[static_cast<std::size_t>(k)])};
  }
  const bool at_infinity = to == y.edges && y.end.at_infinity();
  const Vec3d goal = y.position(scene_, to);
  const Vec3d axis = at_infinity ? goal : value(ray.direction);
  Vec3<Jet2> passed = ray.direction;
  if (at_infinity) {
    if (!(goal.dot(value(passed)) > 0.0)) return std::nullopt;
  } else {
    const Vec3<Jet2> ahead = constant<Jet2>(goal) - ray.origin;
    const Jet2 t = dot(axis, ahead) / dot(axis, ray.direction);
    if (!(t.a > 0.0)) return std::nullopt;
    passed = along(ray.origin, t, ray.direction) - constant<Jet2>(goal);
  }
  const TangentBasis across = tangent_basis(axis);
  const Jet2 first = dot(across.t, passed);
  const Jet2 second = dot(across.b, passed);
  Passing result{{first.a, second.a}};
  result.slope.row(0) = first.v;
  result.slope.row(1) = second.v;
  if (!result.miss.allFinite() || !result.slope.allFinite()) return std::nullopt;
  return result;
}

TraceStatus ManifoldWalk::solve(const VertexPath& x, const Lobes& lobes, int from, int to,
                                VertexPath& y) const {
  const int next = from + step_toward(from, to);
  const bool at_infinity = to == y.edges && y.end.at_infinity();
  const Vec3d ahead = x.position(scene_, next);
  const Vec3d origin = at_infinity ? x(from).surface.at.p : y(from).surface.at.p;
  Vec3d v = (ahead - origin).normalized();
  const double converged = kConverged * (at_infinity ? 1.0 : scene_.radius());
  const auto walk_along = [&](const Vec3d& direction) -> std::optional<Passing> {
    RayFollower ray = leaving(scene_, y(from).surface, direction);
    if (follow_lobes(x, lobes, from, to, ray, y) != TraceStatus::Ok) return std::nullopt;
    return pass(y, lobes, from, to, direction);
  };
  std::optional<Passing> passing = walk_along(v);
  for (int i = 0; passing && i < kMaxIterations; ++i) {
    const double miss = passing->miss.norm();
    if (miss < converged) return TraceStatus::Ok;
    Vec2d move = -passing->slope.inverse() * passing->miss;
    if (!move.allFinite()) break;
    move *= std::min(1.0, kLongestStep / move.norm());
    const TangentBasis tangents = tangent_basis(v);
    std::optional<Passing> better;
    for (int half = 0; !better && half < kMaxHalvings; ++half, move *= 0.5) {
      const Vec3d moved = (v + tangents.t * move.x() + tangents.b * move.y()).normalized();
      better = walk_along(moved);
      if (better && !(better->miss.norm() < miss)) better.reset();
      if (better) v = moved;
    }
    passing = better;
  }
  return TraceStatus::Missed;
}

TraceStatus ManifoldWalk::connect(const VertexPath& x, int from, int to, VertexPath& y) const {
  if (from + step_toward(from, to) == to) return TraceStatus::Ok;
  return solve(x, lobes_between(x, from, to), from, to, y);
}

bool ManifoldWalk::leads_back(const VertexPath& y, int from, int to, const VertexPath& x) const {
  const int next = from + step_toward(from, to);
  if (next == to) return true;
  VertexPath found;
  found.edges = x.edges;
  found.end = x.end;
  found(from) = x(from);
  if (to > 0 && to < x.edges) found(to) = x(to);
  if (solve(y, lobes_between(y, from, to), from, to, found) != TraceStatus::Ok) return false;
  const double distance = (found(next).surface.at.p - x(next).surface.at.p).norm();
  return distance < kSame * scene_.radius();
}

double ManifoldWalk::log_density(const VertexPath& path, int p, int q) const {
  if (q == p + 1) return 0.0;
  double sum = 0;
  for (int k = p + 1; k < q; ++k) sum += path.log_arriving(k) + log_narrowing(path, k, true);
  const Lobes lobes = lobes_between(path, p, q);
  const auto passing = pass(path, lobes, p, q, path.toward_light(p));
  if (!passing) return -std::numeric_limits<double>::infinity();
  sum += std::log(std::abs(passing->slope.determinant()));
  if (q == path.edges && path.end.at_infinity()) return sum;
  const Vec3d edge = path.position(scene_, q) - path.position(scene_, q - 1);
  return sum - std::log(edge.squaredNorm());
}

}  // namespace driftlight
