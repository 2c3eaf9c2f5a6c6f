// SPDX-License-Identifier: Apache-2.0
/// Microfacet distributions: Beckmann, GGX and Phong.
#pragma once

#include "driftlight/surface_point.h"
#include "driftlight/warp.h"

namespace driftlight {

enum class Distribution { Beckmann, Ggx, Phong };

/// Walter et al., "Microfacet models for refraction through rough surfaces", EGSR 2007; with
/// another roughness along each axis as of E. Heitz, "Understanding the masking-shadowing function
/// in microfacet-based BRDFs", JCGT 3(2), 2014. Where the roughness is the same along both axes,
/// all depends on cosines about the macroscopic normal alone, and no tangent is needed.
struct Microfacets {
  Distribution distribution = Distribution::Beckmann;
  double alpha_u = 0.1;  ///< along the tangent
  double alpha_v = 0.1;  ///< across it

  Microfacets() = default;
  Microfacets(Distribution of, double alpha) : Microfacets(of, alpha, alpha) {}
  Microfacets(Distribution of, double along, double across)
      : distribution(of), alpha_u(along), alpha_v(across) {}

  bool is_isotropic() const { return alpha_u == alpha_v; }

  /// How steep the facet h is for this roughness, t = (slope_u / alpha_u)^2 + (slope_v /
  /// alpha_v)^2, from cos^2 of its angle with the normal. h need not be a unit vector.
  template <Scalar T>
  T steepness(const SurfacePoint<T>& at, const Vec3<T>& h, const T& cos2) const {
    return scaled_tan2(at, h, cos2, 1.0 / (alpha_u * alpha_u), 1.0 / (alpha_v * alpha_v));
  }
  /// How grazing the direction w is for this roughness, q = (alpha_u slope_u)^2 + (alpha_v
  /// slope_v)^2.
  template <Scalar T>
  T grazing(const SurfacePoint<T>& at, const Vec3<T>& w, const T& cosine) const {
    return scaled_tan2(at, w, T(cosine * cosine), alpha_u * alpha_u, alpha_v * alpha_v);
  }

  /// log D(h) from cos^2 of the angle between h and the normal, and its steepness t:
  ///   Beckmann  D = exp(-t) / (pi alpha_u alpha_v cos^4)
  ///   GGX       D = 1 / (pi alpha_u alpha_v cos^4 (1 + t)^2)
  ///   Phong     D = cos^n / (pi alpha_u alpha_v),  n + 2 = 2 t / tan^2: 2 / alpha^2 along an axis
  ///             (M. Ashikhmin and P. Shirley, "An anisotropic Phong BRDF model", JGT 5(2), 2000);
  ///             alpha up to 1, the uniform distribution
  template <Scalar T>
  T log_d(const T& cos2, const T& t) const {
    using std::log;
    const double norm = -std::log(kPi * alpha_u * alpha_v);
    if (distribution == Distribution::Beckmann) return norm - t - 2.0 * log(cos2);
    if (distribution == Distribution::Phong)
      return norm - t * phong_falloff(T((1.0 - cos2) / cos2)) - log(cos2);
    return norm - 2.0 * log(cos2 * (1.0 + t));
  }

  /// log(1 + s) / s of s = tan^2, so that cos^(2 t / s) = exp(-t falloff).
  template <Scalar T>
  static T phong_falloff(const T& s) {
    using std::log;
    if (value(s) < kSmallTan2) return 1.0 - s * (1.0 / 2.0 - s * (1.0 / 3.0 - s * (1.0 / 4.0)));
    return log(1.0 + s) / s;
  }
  /// Where the series of phong_falloff is better than its closed form.
  static constexpr double kSmallTan2 = 1e-4;

  /// Smith's shadowing of one direction, from q of `grazing`.
  ///   GGX       G1 = 2 / (1 + sqrt(1 + q))
  ///   Beckmann  the rational fit of Walter et al. in a = 1 / sqrt(q); it is 1 from a = 1.6 on;
  ///             there the value is continuous and the slope jumps a little: the branch keeps the
  ///             published fit
  ///   Phong     the same, as there
  template <Scalar T>
  T g1(const T& q) const {
    using std::sqrt;
    if (distribution == Distribution::Ggx) return 2.0 / (1.0 + sqrt(1.0 + q));
    if (value(q) * 1.6 * 1.6 <= 1.0) return constant<T>(1.0);
    const T a = 1.0 / sqrt(q);
    return a * (3.535 + 2.181 * a) / (1.0 + a * (2.276 + 2.577 * a));
  }

  /// Variance of the slope of the half vector along an axis of this alpha, in the Gaussian that
  /// stands for D near a facet of steepness t: alpha^2 / 2 for Beckmann, and for Phong, which is
  /// near it; for GGX, which has no variance, the weight of iteratively reweighted least squares,
  /// U'(s) / s = 4 / (alpha^2 (1 + t)).
  template <Scalar T>
  T slope_variance(double alpha, const T& t) const {
    if (distribution == Distribution::Ggx) return 0.25 * alpha * alpha * (1.0 + t);
    return constant<T>(0.5 * alpha * alpha);
  }

  /// Draws a facet normal h on the side of wi, for a view direction with at.n.wi > 0: GGX by
  /// visible normals, the others by D(h) cos(h). u1, u2 in [0, 1).
  template <Scalar T>
  Vec3<T> sample(const SurfacePoint<T>& at, const Vec3<T>& wi, const T& u1, const T& u2) const {
    const TangentBasisOf<T> axes = is_isotropic() ? tangent_basis(at.n) : tangent_axes(at);
    const Vec3<T> local = sample(Vec3<T>{dot(axes.t, wi), dot(axes.b, wi), dot(at.n, wi)}, u1, u2);
    return axes.t * local.x() + axes.b * local.y() + at.n * local.z();
  }

  /// The same in local coordinates (x = tangent, z = macroscopic normal).
  template <Scalar T>
  Vec3<T> sample(const Vec3<T>& wi, const T& u1, const T& u2) const {
    if (distribution == Distribution::Ggx) return sample_visible_ggx(wi, u1, u2);
    return distribution == Distribution::Phong ? sample_phong(u1, u2) : sample_beckmann(u1, u2);
  }

  /// Density of `sample` per solid angle of h, a unit vector.
  template <Scalar T>
  T pdf(const SurfacePoint<T>& at, const Vec3<T>& wi, const Vec3<T>& h) const {
    using std::exp;
    const T cos_h = dot(at.n, h);
    if (value(cos_h) <= 0.0) return constant<T>(0.0);
    const T cos_h2 = cos_h * cos_h;
    const T d = exp(log_d(cos_h2, steepness(at, h, cos_h2)));
    if (distribution != Distribution::Ggx) return d * cos_h;
    const T cos_ih = dot(wi, h);
    if (value(cos_ih) <= 0.0) return constant<T>(0.0);
    const T cos_i = dot(at.n, wi);
    return g1(grazing(at, wi, cos_i)) * d * cos_ih / cos_i;
  }

 private:
  /// k_u slope_u^2 + k_v slope_v^2 = k_v tan^2 + (k_u - k_v) slope_u^2
  template <Scalar T>
  T scaled_tan2(const SurfacePoint<T>& at, const Vec3<T>& w, const T& cos2, double k_u,
                double k_v) const {
    const T tan2 = (1.0 - cos2) / cos2;
    if (is_isotropic()) return tan2 * k_v;
    const T slope_u = tangent_slope(at, w);
    return tan2 * k_v + slope_u * slope_u * (k_u - k_v);
  }

  /// Heitz, "Sampling the GGX distribution of visible normals", JCGT 7(4), 2018: in the space where
  /// the surface is a hemisphere, the visible normals project uniformly onto a clipped disk.
  template <Scalar T>
  Vec3<T> sample_visible_ggx(const Vec3<T>& wi, const T& u1, const T& u2) const {
    const Vec3<T> v = unit<T>({alpha_u * wi.x(), alpha_v * wi.y(), wi.z()});
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
    return unit<T>({alpha_u * h.x(), alpha_v * h.y(), z});
  }

  /// Walter et al. 2007: the slopes are Gaussian, -log(1 - u) = t.
  template <Scalar T>
  Vec3<T> sample_beckmann(const T& u1, const T& u2) const {
    using std::log;
    const Vec2<T> slopes = polar(root_or_zero(T(-log(1.0 - u1))), u2);
    return unit<T>({alpha_u * slopes.x(), alpha_v * slopes.y(), constant<T>(1.0)});
  }

  /// Ashikhmin and Shirley 2000: around the normal as Beckmann's, 1 - u = cos^(n + 2) along there.
  template <Scalar T>
  Vec3<T> sample_phong(const T& u1, const T& u2) const {
    using std::exp;
    using std::log;
    const Vec2<T> circle = polar(constant<T>(1.0), u2);
    const T x = alpha_u * circle.x();
    const T y = alpha_v * circle.y();
    // Along this azimuth 2 / (n + 2) is the squared length of (x, y).
    const T cos2 = exp(log(1.0 - u1) * (x * x + y * y));
    const T slope = root_or_zero(T((1.0 - cos2) / (cos2 * (x * x + y * y))));
    return unit<T>({slope * x, slope * y, constant<T>(1.0)});
  }
};

}  // namespace driftlight
