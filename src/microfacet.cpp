// SPDX-License-Identifier: Apache-2.0
#include "driftlight/microfacet.h"

#include <algorithm>
#include <cmath>

#include "driftlight/warp.h"

namespace driftlight {
namespace {

/// Heitz, "Sampling the GGX distribution of visible normals", JCGT 7(4), 2018: in the space where
/// the surface is a hemisphere, the visible normals project uniformly onto a clipped disk.
Vec3d sample_visible_ggx(const Vec3d& wi, double alpha, double u1, double u2) {
  const Vec3d v = Vec3d(alpha * wi.x(), alpha * wi.y(), wi.z()).normalized();
  const TangentBasis basis = tangent_basis(v);
  const Vec2d disk = square_to_disk(u1, u2);
  // The lower half of the disk, in the plane through v and z, is squeezed by (1 + v.z) / 2.
  const Vec3d to_top = (Vec3d::UnitZ() - v.z() * v);
  const double length = to_top.norm();
  const Vec3d second = length > 1e-9 ? Vec3d(to_top / length) : basis.b;
  const Vec3d first = second.cross(v);
  const double s = 0.5 * (1.0 + v.z());
  const double t1 = disk.x();
  const double t2 = (1.0 - s) * std::sqrt(std::max(0.0, 1.0 - t1 * t1)) + s * disk.y();
  const double t3 = std::sqrt(std::max(0.0, 1.0 - t1 * t1 - t2 * t2));
  const Vec3d h = t1 * first + t2 * second + t3 * v;
  return Vec3d(alpha * h.x(), alpha * h.y(), std::max(1e-9, h.z())).normalized();
}

/// Walter et al. 2007: tan^2 = -alpha^2 log(1 - u).
Vec3d sample_beckmann(double alpha, double u1, double u2) {
  const double tan2 = -alpha * alpha * std::log(1.0 - u1);
  const double z = 1.0 / std::sqrt(1.0 + tan2);
  const double r = std::sqrt(std::max(0.0, 1.0 - z * z));
  const double phi = 2.0 * kPi * u2;
  return {r * std::cos(phi), r * std::sin(phi), z};
}

}  // namespace

Vec3d Microfacets::sample(const Vec3d& wi, double u1, double u2) const {
  if (distribution == Distribution::Ggx) return sample_visible_ggx(wi, alpha, u1, u2);
  return sample_beckmann(alpha, u1, u2);
}

double Microfacets::pdf(double cos_i, double cos_h, double cos_ih) const {
  if (cos_h <= 0.0) return 0.0;
  const double d = std::exp(log_d(cos_h * cos_h));
  if (distribution == Distribution::Ggx) return cos_ih > 0.0 ? g1(cos_i) * d * cos_ih / cos_i : 0.0;
  return d * cos_h;
}

}  // namespace driftlight
