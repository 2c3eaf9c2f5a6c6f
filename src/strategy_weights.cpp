// SPDX-License-Identifier: Apache-2.0
#include "strategy_weights.h"

#include <cmath>

namespace driftlight {
namespace {

/// Density per solid angle with which a walk that comes from `from` goes on to `to`.
double direction_density(const SurfaceHit& x, const Vec3d& from, const Vec3d& to) {
  return pdf(*x.bsdf, x.surface(), from, to);
}

double cosine_at(const SurfaceHit& x, const Vec3d& v) { return std::abs(x.at.n_g.dot(v)); }

}  // namespace

/// The light's walk makes the end by emitter sampling, and the vertex before it by emission.
OfHeuristics StrategyWeights::hit(const Arrival& z, int t, const LightEnd& end, const Vec3d& p,
                                  const Vec3d& v, double cosine) const {
  if (t == 2) return OfHeuristics::Ones();
  return 1.0 / (1.0 + others(z, end.density, guide_.density(end, p, v, cosine, 1.0)));
}

OfHeuristics StrategyWeights::emitter(const SubpathVertex& z, const LightEnd& end,
                                      const LightEdge& edge) const {
  const SurfaceHit& x = z.surface;
  const Vec3d& wo = edge.direction;
  const Vec3d& p = end.at_infinity() ? x.at.p : end.p;
  const double to_z = guide_.density(end, p, -wo, edge.cosine, edge.falloff) * cosine_at(x, wo);
  OfHeuristics sum = others(z, to_z * edge.inverse_r2, direction_density(x, wo, x.wi));
  if (end.can_be_hit()) {
    const double to_end = direction_density(x, x.wi, wo) * edge.cosine * edge.inverse_r2;
    sum += powers(to_end / end.density);
  }
  return 1.0 / (1.0 + sum);
}

OfHeuristics StrategyWeights::connection(const SubpathVertex& z, const SubpathVertex& y,
                                         const Vec3d& v, double inverse_r2) const {
  const SurfaceHit& a = z.surface;
  const SurfaceHit& b = y.surface;
  const Vec3d back = -v;
  const double to_z = direction_density(b, b.wi, back) * cosine_at(a, v) * inverse_r2;
  const double to_y = direction_density(a, a.wi, v) * cosine_at(b, v) * inverse_r2;
  return 1.0 / (1.0 + others(z, to_z, direction_density(a, v, a.wi)) +
                others(y, to_y, direction_density(b, back, b.wi)));
}

OfHeuristics StrategyWeights::sensor(const SubpathVertex& y, const SensorConnection& seen) const {
  const SurfaceHit& x = y.surface;
  return 1.0 / (1.0 + others(y, seen.density, direction_density(x, seen.wi, x.wi)));
}

}  // namespace driftlight
