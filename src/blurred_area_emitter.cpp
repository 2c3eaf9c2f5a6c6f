// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "driftlight/emitter.h"

namespace driftlight {
namespace {

/// q of the lamp itself is at most this.
constexpr double kLampSpread = 5;
/// For the rounding of points on the lamp.
constexpr double kReachMargin = 1.001;

}  // namespace

BlurredAreaEmitter::BlurredAreaEmitter(const AreaEmitter& sharp, const LampExtent& lamp,
                                       double sigma)
    : sharp_(sharp),
      lamp_(lamp),
      sigma2_(sigma * sigma),
      core_(std::max(1.0, lamp.spread / kLampSpread) * lamp.variance) {}

bool BlurredAreaEmitter::shines(const Ray<double>& ray) const {
  const Vec3d from_center = ray.origin - lamp_.center;
  if (!lamp_.normal.isZero(0.0) && lamp_.normal.dot(from_center) <= 0.0) return false;
  const Vec3d u = principal(from_center);
  const Vec3d m = variances(u.squaredNorm());
  const Vec3d y = nearest(u, principal(ray.direction), m);
  return y.cwiseAbs2().cwiseQuotient(m).sum() < kSupport && across(u, lamp_.variance) > 0.0;
}

double BlurredAreaEmitter::clearance(const Vec3d& origin) const {
  return std::max(0.0, (origin - lamp_.center).norm() - kReachMargin * lamp_.reach);
}

/// S has the gradient 2 u_i M_j M_k, and dS / dM_i = u_j^2 M_k + u_k^2 M_j.
BlurredAreaEmitter::Gradient BlurredAreaEmitter::log_share_gradient(const Ray<double>& ray) const {
  const Vec3d u = principal(Vec3d(ray.origin - lamp_.center));
  const Vec3d v = principal(ray.direction);
  const Vec3d m = variances(u.squaredNorm());
  const Vec3d y = nearest(u, v, m);
  const Vec3d dy = y.cwiseQuotient(m);
  const double t = (y - u).dot(v);
  const double lobe = -3.0 / (kSupport - y.dot(dy));
  const auto others = [](const Vec3d& x) {
    return Vec3d(x.y() * x.z(), x.z() * x.x(), x.x() * x.y());
  };
  const Vec3d u2 = u.cwiseAbs2();
  const double by_variances =
      u2.x() * (m.y() + m.z()) + u2.y() * (m.z() + m.x()) + u2.z() * (m.x() + m.y());
  const Vec3d sharp = u.cwiseProduct(others(lamp_.variance)) / across(u, lamp_.variance);
  const Vec3d blurred = (u.cwiseProduct(others(m)) + sigma2_ * by_variances * u) / across(u, m);
  const Vec3d by_u = lobe * 2.0 * (dy - sigma2_ * dy.squaredNorm() * u) + sharp - blurred;
  return {lamp_.axes.transpose() * by_u, lamp_.axes.transpose() * (lobe * 2.0 * t * dy)};
}

/// t = -B / E, B = u.Dv, E = v.Dv, and D follows the distance, dM = 2 sigma^2 u.du I:
///   dt = -((Dv - 2 sigma^2 (Dy.Dv) u).du + (Du + 2 t Dv).dv) / E
BlurredAreaEmitter::ApproachDifferential BlurredAreaEmitter::approach_differential(
    const Ray<double>& ray) const {
  const Vec3d u = principal(Vec3d(ray.origin - lamp_.center));
  const Vec3d v = principal(ray.direction);
  const Vec3d m = variances(u.squaredNorm());
  const Vec3d du = u.cwiseQuotient(m);
  const Vec3d dv = v.cwiseQuotient(m);
  const double along = u.dot(dv);
  if (along >= 0.0) return {0.0, Vec3d::Zero(), Vec3d::Zero()};
  const double square = v.dot(dv);
  const double t = -along / square;
  const double by_distance = 2.0 * sigma2_ * (du + t * dv).dot(dv);
  return {t, lamp_.axes.transpose() * ((by_distance * u - dv) / square),
          lamp_.axes.transpose() * (-(du + 2.0 * t * dv) / square)};
}

}  // namespace driftlight
