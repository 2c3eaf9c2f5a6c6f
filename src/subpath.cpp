// SPDX-License-Identifier: Apache-2.0
#include "subpath.h"

#include <algorithm>
#include <cmath>

namespace driftlight {
namespace {

/// Earlier than in path tracing, since the work grows with the product of the two lengths.
constexpr int kRouletteDepth = 4;

Rgbd color_of(const ScaledColor<double>& f) { return std::exp(f.log_scale) * f.color; }

/// (n_o / n_i)^2 of a delta transmission.
double squared_index_ratio(const Bsdf& bsdf, double cos_i) {
  const double eta = delta_eta(bsdf);
  return cos_i > 0.0 ? eta * eta : 1.0 / (eta * eta);
}

}  // namespace

Rgbd scattered(const SurfaceHit& x, const Vec3d& wi, const Vec3d& wo) {
  return color_of(eval(*x.bsdf, x.surface(), wi, wo));
}

ScatteringDensities density_event(const SurfaceHit& x, const Vec3d& wi, const Vec3d& wo) {
  return {scattered(x, wi, wo), pdf(*x.bsdf, x.surface(), wi, wo),
          pdf(*x.bsdf, x.surface(), wo, wi)};
}

/// Fresnel's equations give P the same value on both sides.
ScatteringDensities delta_event(const SurfaceHit& x, const Vec3d& wi, const Vec3d& wo,
                                Scattering scattering) {
  const SurfacePoint<double> at = x.surface();
  const double p = delta_probability(*x.bsdf, at, wi, scattering);
  double j = 1.0;
  if (scattering == Scattering::Transmission) {
    const double cos_i = at.n.dot(wi);
    j = std::abs(cos_i / at.n.dot(wo)) / squared_index_ratio(*x.bsdf, cos_i);
  }
  return {color_of(eval_delta(*x.bsdf, at, wi, scattering)), p, p * j};
}

/// v is uniform over the film: its density is the importance W(v), by area across parallel rays
/// that over Camera::spread. No strategy gives up the sensor.
Departure SubpathTracer::leave_sensor(const Vec3d& v, const Vec3d& lens) const {
  const Camera& camera = scene_.camera();
  const Ray<double> ray = camera.ray(v, lens);
  Departure from;
  from.p = ray.origin;
  from.direction = ray.direction;
  from.density = std::exp(camera.log_importance(v));
  if (camera.is_orthographic()) {
    from.parallel = true;
    from.density /= camera.spread(v, ray.origin, lens);
  }
  from.throughput = Rgbd::Ones();
  from.connects = true;
  return from;
}

/// L cos / (p(y) p(omega)), with a spot's falloff; the strategy s = 0 gives up y if it can be hit.
Departure SubpathTracer::leave_light(const Emission& emission) const {
  const LightEnd& end = emission.end;
  Departure from;
  from.p = end.p;
  from.direction = emission.direction;
  from.parallel = end.at_infinity();
  from.cosine = emission.cosine;
  from.density = guide_.density(emission);
  from.throughput =
      end.emitted * (emission.falloff * emission.cosine / (end.density * from.density));
  if (end.can_be_hit()) from.others = 1.0 / powers(end.density);
  from.connects = true;
  return from;
}

SubpathVertex SubpathTracer::arrive(const Departure& from, const SurfaceHit& surface) const {
  SubpathVertex x;
  x.surface = surface;
  const double inverse_r2 = from.parallel ? 1.0 : 1.0 / (surface.at.p - from.p).squaredNorm();
  x.density = from.density * std::abs(surface.at.n_g.dot(surface.wi)) * inverse_r2;
  x.others = powers(from.cosine * inverse_r2) * from.others;
  x.previous_connects = from.connects;
  x.throughput = from.throughput;
  x.roulette = from.roulette;
  x.connects = surface.bsdf != nullptr && !is_delta(*surface.bsdf);
  return x;
}

Arrival SubpathTracer::arrive_at_infinity(const Departure& from) const {
  return {from.density, powers(from.cosine) * from.others, from.connects};
}

/// Factors of the throughput, in the measure of path tracing (solid angle about each vertex, toward
/// the light), with f = f_s |n_s . wo|:
///   from the sensor   f / p(wo),
///   from the light    f |n_g . wi| / (|n_g . wo| p(wi)),
/// since there the edge toward the sensor brings its |n_g . wi| / r^2, and the density per area of
/// this vertex had |n_g . wo| / r^2. That is f_s |n_s . wi| / p(wi) times the factor of Veach 1997,
/// 5.3, |n_s . wo| |n_g . wi| / (|n_g . wo| |n_s . wi|), for shading normals.
Departure SubpathTracer::depart(Walk walk, const SubpathVertex& x, const BsdfSample& next) const {
  const SurfaceHit& at = x.surface;
  const bool from_sensor = walk == Walk::FromSensor;
  const Vec3d& wi = from_sensor ? at.wi : next.wo;
  const Vec3d& wo = from_sensor ? next.wo : at.wi;
  const ScatteringDensities e =
      next.delta ? delta_event(at, wi, wo, next.scattering) : density_event(at, wi, wo);
  const double forward = from_sensor ? e.toward_light : e.toward_sensor;
  const double backward = from_sensor ? e.toward_sensor : e.toward_light;
  Departure from;
  from.p = at.at.p;
  from.direction = next.wo;
  from.cosine = std::abs(at.at.n_g.dot(next.wo));
  from.density = forward;
  double factor = forward > 0.0 ? 1.0 / forward : 0.0;
  if (!from_sensor) factor *= from.cosine / std::abs(at.at.n_g.dot(at.wi));
  from.throughput = x.throughput * e.f * factor;
  from.roulette = x.roulette;
  const double connection = x.previous_connects && !next.delta ? 1.0 : 0.0;
  from.others = (powers(backward) * x.others + connection) / powers(x.density);
  from.connects = !next.delta;
  return from;
}

std::optional<Departure> SubpathTracer::trace(Walk walk, const Departure& start,
                                              RayFollower follower, int max_size, Rng& rng,
                                              Subpath& subpath) const {
  subpath.clear();
  if (max_size < 1) return std::nullopt;
  const double power = start.throughput.maxCoeff();
  Departure from = start;
  while (true) {
    const Hit hit = follower.next_hit();
    if (!hit.valid()) return from;
    const SurfaceHit surface = follower.surface(hit);
    if (surface.bsdf == nullptr) return std::nullopt;
    SubpathVertex& x = subpath.add(arrive(from, surface));
    if (subpath.size() == max_size) return std::nullopt;
    const auto next = sample(*surface.bsdf, surface.surface(), surface.wi, rng.uniform3());
    if (!next || !passes(surface.at, surface.wi, next->wo)) return std::nullopt;
    x.delta = next->delta;
    from = depart(walk, x, *next);
    if ((from.throughput == 0.0).all()) return std::nullopt;
    if (roulette_ == Roulette::On && subpath.size() >= kRouletteDepth) {
      const double survival = std::min(0.95, from.throughput.maxCoeff() / power);
      if (!(rng.uniform() < survival)) return std::nullopt;
      from.throughput /= survival;
      from.roulette /= survival;
    }
    follower.leave(surface, next->wo);
  }
}

}  // namespace driftlight
