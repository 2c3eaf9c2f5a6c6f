// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: what they are by, and the rules of microfacets.
///
/// With c_i = n.wi, c_o = n.wo, m = wi.wo and, where the roughness is not isotropic, p_i = P.wi,
/// p_o = P.wo, p_n = P.n, p_2 = P.P of the vector P along the tangent,
///   d log f_s = f_i dc_i + f_o dc_o + f_m dm + f_u du + f_v dv
///               + f_pi dp_i + f_po dp_o + f_pn dp_n + f_p2 dp_2                          (H1)
///   dc_i = wi.dn + n.dwi,  dc_o = wo.dn + n.dwo,  dm = wo.dwi + wi.dwo,
///   dp_i = wi.dP + P.dwi,  dp_o = wo.dP + P.dwo,  dp_n = P.dn + n.dP,  dp_2 = 2 P.dP,
/// and the partials f_. are:
///   tangent slope    sigma of a direction w with c = n.w, p = P.w:  (p / c - p_n) / L,
///     L^2 = p_2 - p_n^2:  dsigma = (dp / c - p / c^2 dc - dp_n) / L
///                                  + sigma (p_n dp_n - dp_2 / 2) / L^2                   (H43)
///   microfacets      log D(C, t), C = cos^2 h = (c_i + e c_o)^2 / h2, h2 = 1 + e^2 + 2 e m:
///     dC = 2 (c_i + e c_o) / h2 (dc_i + e dc_o) - 2 e C / h2 dm
///     dt = -dC / (alpha_v^2 C^2) + 2 (1 / alpha_u^2 - 1 / alpha_v^2) sigma_h dsigma_h    (H3)
///     Beckmann  d log D = -dt - 2 dC / C
///     GGX       d log D = -2 dt / (1 + t) - 2 dC / C                                     (H4)
///     Phong     d log D = -g dt - t dg - dC / C,  g = log(1 + s) / s,  s = 1 / C - 1:
///               dg = [log(1 + s) - s / (1 + s)] / s^2 dC / C^2                           (H46)
///     Smith     dq = -2 alpha_v^2 / c^3 dc + 2 (alpha_u^2 - alpha_v^2) sigma dsigma:
///     GGX       d log G1 = -dq / (2 s (1 + s)),  s = sqrt(1 + q)
///     Beckmann  d log G1 = -[num'(a) / num - den'(a) / den] a / (2 q) dq,  a = 1 / sqrt q (H5)
#pragma once

#include <array>
#include <cmath>

#include "driftlight/bsdf.h"

namespace driftlight {

/// A factor of the contribution and its partials (H1). Lanes 0 to 2 are of the logarithms of its
/// colour, lane 3 of its log_scale.
struct FactorPartials {
  using Lanes = Eigen::Array4d;

  Rgbd color{1, 1, 1};
  Lanes cos_i = Lanes::Zero();
  Lanes cos_o = Lanes::Zero();
  Lanes io = Lanes::Zero();
  Lanes u = Lanes::Zero();
  Lanes v = Lanes::Zero();
  // Zero where the roughness is isotropic.
  Lanes tangent_i = Lanes::Zero();  ///< by P.wi
  Lanes tangent_o = Lanes::Zero();  ///< by P.wo
  Lanes tangent_n = Lanes::Zero();  ///< by P.n
  Lanes tangent_2 = Lanes::Zero();  ///< by P.P
};
/// Those by directions.
inline constexpr std::array kDirectionPartials{
    &FactorPartials::cos_i,     &FactorPartials::cos_o,     &FactorPartials::io,
    &FactorPartials::tangent_i, &FactorPartials::tangent_o, &FactorPartials::tangent_n,
    &FactorPartials::tangent_2};

/// Scattering by a density, as f_s sees it: wi toward the sensor.
struct ScatterPoint {
  SurfacePoint<double> at;
  Vec3d wi, wo;
  double cos_i, cos_o, io;
  Scattering scattering;
};

/// The rules (H3) to (H5), (H43), (H46).
struct HandMicrofacetRules {
  /// (H43) of a direction with this cosine.
  struct TangentSlope {
    double value, by_projection, by_cosine, by_lift, by_square;
  };
  static TangentSlope tangent_slope(const SurfacePoint<double>& at, double projection,
                                    double cosine) {
    const double lift = at.tangent.dot(at.n);
    const double length2 = at.tangent.squaredNorm() - lift * lift;
    const double inverse = 1.0 / std::sqrt(length2);
    const double slope = (projection / cosine - lift) * inverse;
    return {slope, inverse / cosine, -projection * inverse / (cosine * cosine),
            slope * lift / length2 - inverse, -0.5 * slope / length2};
  }

  /// dC of (H3), times this.
  static void add_cos2(double factor, double e, const ScatterPoint& x, FactorPartials& f) {
    const double h2 = 1.0 + e * e + 2.0 * e * x.io;
    const double root = x.cos_i + e * x.cos_o;
    f.cos_i[3] += factor * 2.0 * root / h2;
    f.cos_o[3] += factor * 2.0 * root * e / h2;
    f.io[3] -= factor * 2.0 * e * (root * root / h2) / h2;
  }

  /// dg / dC: (H46), near s = 0 by its series
  static double d_phong_falloff(double cos2) {
    const double s = (1.0 - cos2) / cos2;
    const double slope = s < Microfacets::kSmallTan2 ? 1.0 / 2.0 - s * (2.0 / 3.0 - s * (3.0 / 4.0))
                                                     : (std::log1p(s) - s / (1.0 + s)) / (s * s);
    return slope / (cos2 * cos2);
  }

  /// d log D: (H3), (H4), (H46)
  static void add_distribution(const Microfacets& m, double e, const ScatterPoint& x,
                               FactorPartials& f) {
    const double root = x.cos_i + e * x.cos_o;
    const double cos2 = root * root / (1.0 + e * e + 2.0 * e * x.io);
    const double k_u = 1.0 / (m.alpha_u * m.alpha_u);
    const double k_v = 1.0 / (m.alpha_v * m.alpha_v);
    double t = k_v * (1.0 - cos2) / cos2;
    TangentSlope slope{};
    if (!m.is_isotropic()) {
      slope = tangent_slope(x.at, x.at.tangent.dot(x.wi + e * x.wo), root);
      t += (k_u - k_v) * slope.value * slope.value;
    }
    double by_t = -1.0;
    double by_cos2 = -2.0 / cos2;
    if (m.distribution == Distribution::Ggx) {
      by_t = -2.0 / (1.0 + t);
    } else if (m.distribution == Distribution::Phong) {
      by_t = -Microfacets::phong_falloff((1.0 - cos2) / cos2);
      by_cos2 = -t * d_phong_falloff(cos2) - 1.0 / cos2;
    }
    add_cos2(by_cos2 - by_t * k_v / (cos2 * cos2), e, x, f);
    if (m.is_isotropic()) return;
    const double by_slope = by_t * 2.0 * (k_u - k_v) * slope.value;
    f.cos_i[3] += by_slope * slope.by_cosine;
    f.cos_o[3] += by_slope * slope.by_cosine * e;
    f.tangent_i[3] += by_slope * slope.by_projection;
    f.tangent_o[3] += by_slope * slope.by_projection * e;
    f.tangent_n[3] += by_slope * slope.by_lift;
    f.tangent_2[3] += by_slope * slope.by_square;
  }

  /// d log G1 by q: (H5)
  static double d_log_g1(const Microfacets& m, double q) {
    if (m.distribution == Distribution::Ggx) {
      const double s = std::sqrt(1.0 + q);
      return -0.5 / (s * (1.0 + s));
    }
    if (q * 1.6 * 1.6 <= 1.0) return 0.0;
    const double a = 1.0 / std::sqrt(q);
    const double num = a * (3.535 + 2.181 * a);
    const double den = 1.0 + a * (2.276 + 2.577 * a);
    const double slope = (3.535 + 4.362 * a) / num - (2.276 + 5.154 * a) / den;
    return -0.5 * slope * a / q;
  }
  /// d log G1 of w, whose cosine and projection these partials are by: (H5); odd in the cosine.
  static void add_shadowing(const Microfacets& m, const SurfacePoint<double>& at, const Vec3d& w,
                            double cosine, FactorPartials& f, FactorPartials::Lanes& by_cosine,
                            FactorPartials::Lanes& by_projection) {
    const double by_q = d_log_g1(m, m.grazing(at, w, cosine));
    const double alpha2 = m.alpha_v * m.alpha_v;
    by_cosine[3] += by_q * -2.0 * alpha2 / (cosine * cosine * cosine);
    if (m.is_isotropic()) return;
    const TangentSlope slope = tangent_slope(at, at.tangent.dot(w), cosine);
    const double by_slope = by_q * 2.0 * (m.alpha_u * m.alpha_u - alpha2) * slope.value;
    by_cosine[3] += by_slope * slope.by_cosine;
    by_projection[3] += by_slope * slope.by_projection;
    f.tangent_n[3] += by_slope * slope.by_lift;
    f.tangent_2[3] += by_slope * slope.by_square;
  }
};

}  // namespace driftlight
