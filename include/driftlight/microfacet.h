// SPDX-License-Identifier: Apache-2.0
/// Isotropic microfacet distributions: Beckmann and GGX.
#pragma once

#include "driftlight/frame.h"
#include "driftlight/warp.h"

namespace driftlight {

enum class Distribution { Beckmann, Ggx };

/// Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007. All
/// functions work with cosines about the macroscopic normal, so that they need no tangent frame.
struct Microfacets {
  Distribution distribution = Distribution::Beckmann;
  double alpha = 0.1;

  /// log D(h) from cos^2 of the angle between h and the normal, with t = tan^2 / alpha^2:
  ///   Beckmann  D = exp(-t) / (pi alpha^2 cos^4)
  ///   GGX       D = 1 / (pi alpha^2 cos^4 (1 + t)^2)
  template <Scalar T>
  T log_d(const T& cos2) const {
    using std::log;
    const T t = (1.0 - cos2) / cos2 * (1.0 / (alpha * alpha));
    const double norm = -std::log(kPi * alpha * alpha);
    if (distribution == Distribution::Beckmann) return norm - t - 2.0 * log(cos2);
    return norm - 2.0 * log(cos2 * (1.0 + t));
  }

  /// Smith's shadowing of one direction from its cosine with the normal.
  ///   GGX       G1 = 2 / (1 + sqrt(1 + alpha^2 tan^2))
  ///   Beckmann  the rational fit of Walter et al. in a = 1 / (alpha tan); it is 1 from a = 1.6 on;
  ///             there the value is continuous and the slope jumps a little: the branch keeps the
  ///             published fit.
  template <Scalar T>
  T g1(const T& cosine) const {
    using std::sqrt;
    const T cos2 = cosine * cosine;
    const T tan2 = (1.0 - cos2) / cos2;
    if (distribution == Distribution::Ggx) return 2.0 / (1.0 + sqrt(1.0 + alpha * alpha * tan2));
    if (value(tan2) * alpha * alpha * 1.6 * 1.6 <= 1.0) return constant<T>(1.0);
    const T a = 1.0 / (alpha * sqrt(tan2));
    return a * (3.535 + 2.181 * a) / (1.0 + a * (2.276 + 2.577 * a));
  }

  /// Variance of the slopes of the half vector (per axis) in the Gaussian that stands for D near
  /// the point with squared slope s2: alpha^2 / 2 for Beckmann; for GGX, which has no variance, the
  /// weight of iteratively reweighted least squares, U'(s) / s = 4 / (alpha^2 + s^2).
  template <Scalar T>
  T slope_variance(const T& s2) const {
    if (distribution == Distribution::Beckmann) return constant<T>(0.5 * alpha * alpha);
    return 0.25 * (s2 + alpha * alpha);
  }

  /// Draws a facet normal h in local coordinates (z = macroscopic normal), for a view direction
  /// with wi.z > 0: GGX by visible normals, Beckmann by D(h) cos(h). u1, u2 in [0, 1).
  template <Scalar T>
  Vec3<T> sample(const Vec3<T>& wi, const T& u1, const T& u2) const {
    if (distribution == Distribution::Ggx) return sample_visible_ggx(wi, u1, u2);
    return sample_beckmann(u1, u2);
  }

  /// Density of `sample` per solid angle of h, from cosines with the normal and wi.h.
  template <Scalar T>
  T pdf(const T& cos_i, const T& cos_h, const T& cos_ih) const {
    using std::exp;
    if (value(cos_h) <= 0.0) return constant<T>(0.0);
    const T d = exp(log_d(T(cos_h * cos_h)));
    if (distribution == Distribution::Beckmann) return d * cos_h;
    return value(cos_ih) > 0.0 ? T(g1(cos_i) * d * cos_ih / cos_i) : constant<T>(0.0);
  }

 private:
  /// Heitz, "Sampling the GGX distribution of visible normals", JCGT 7(4), 2018: in the space where
  /// the surface is a hemisphere, the visible normals project uniformly onto a clipped disk.
  template <Scalar T>
  Vec3<T> sample_visible_ggx(const Vec3<T>& wi, const T& u1, const T& u2) const {
    const Vec3<T> v = unit<T>({alpha * wi.x(), alpha * wi.y(), wi.z()});
    const Vec2<T> disk = square_to_disk(u1, u2);
    // The lower half of the disk, in the plane through v and z, is squeezed by (1 + v.z) / 2.
    const Vec3<T> to_top = constant<T>(Vec3d(Vec3d::UnitZ())) - v.z() * v;
    // Seen from straight above there is no such plane: any will do.
    const bool tilted = value(to_top).norm() > 1e-9;
    const Vec3<T> second = tilted ? unit(to_top) : tangent_basis(v).b;
    const Vec3<T> first = second.cross(v);
    const T s = 0.5 * (1.0 + v.z());
    const T& t1 = disk.x();
    const T t2 = (1.0 - s) * root_or_zero(T(1.0 - t1 * t1)) + s * disk.y();
    const T t3 = root_or_zero(T(1.0 - t1 * t1 - t2 * t2));
    const Vec3<T> h = t1 * first + t2 * second + t3 * v;
    const T z = value(h.z()) > 1e-9 ? T(h.z()) : constant<T>(1e-9);
    return unit<T>({alpha * h.x(), alpha * h.y(), z});
  }

  /// Walter et al. 2007: tan^2 = -alpha^2 log(1 - u).
  template <Scalar T>
  Vec3<T> sample_beckmann(const T& u1, const T& u2) const {
    using std::log;
    using std::sqrt;
    const T tan2 = -alpha * alpha * log(1.0 - u1);
    const T z = 1.0 / sqrt(1.0 + tan2);
    const Vec2<T> xy = polar(root_or_zero(T(1.0 - z * z)), u2);
    return {xy.x(), xy.y(), z};
  }
};

}  // namespace driftlight
