// SPDX-License-Identifier: Apache-2.0
/// Isotropic microfacet distributions: Beckmann and GGX.
#pragma once

#include "driftlight/frame.h"

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
  Vec3d sample(const Vec3d& wi, double u1, double u2) const;

  /// Density of `sample` per solid angle of h, from cosines with the normal and wi.h.
  double pdf(double cos_i, double cos_h, double cos_ih) const;
};

}  // namespace driftlight
