// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: the rules of scattering by a density.
///
/// The partials f_. of (H1), hand_microfacet_rules.h, are:
///   diffuse          log c_o                                f_o = 1 / c_o                (H2)
///   microfacets      log D G / c_i: (H3) to (H5), (H43), (H46) of hand_microfacet_rules.h
///   rough metal      F(cos = sqrt(h2) / 2):  dF = F' dm / (2 sqrt(h2))                   (H6)
///   rough interface  F(|i| / sqrt(h2)), i = 1 + e m, o = m + e:
///     d(|i| / sqrt(h2)) = sign(i) e (1 - i / h2) / sqrt(h2) dm                           (H7)
///     transmission adds  d log |i o| / (i + e o)^2 = (e / i + 1 / o - 4 e / (i + e o)) dm (H8)
///   Fresnel, interface  with t the cosine beyond, k = 2 eta (1 - 1/eta^2) / t:
///     F' = p k / (eta c + t)^2 + s k / (c + eta t)^2                                     (H9)
///   Fresnel, metal      with S = a^2 + b^2, dS = 2 c D / S dc, da = c a / S dc           (H10)
///   Phong            log c_o + log(rho_d / pi + rho_s P(mu)), mu = 2 c_i c_o - m, P' = n P / mu
///                                                                                        (H11)
///   Ward             log c_o + log(rho_d / pi + rho_s E), with C and h2 as of microfacets:
///     dlog E = dlog D + 2 dC / C - k (dc_i / c_i + dc_o / c_o),  k = 1/2 (Ward), 1 (Duer)
///     dlog E = dlog D - 2 / h2 dm                                balanced               (H38)
///   plastic          log c_o + log T(c_i) T(c_o), T = 1 - F, T' = -F'                   (H29)
///   rough plastic    log(rho_s E + a B), E = F D G / (4 c_i) as rough metal, B = c_o T(c_i)
///   T(c_o):
///                    the partials of log E and log B by their shares                      (H30)
///   coating          log T(c_i) T(c_o) c_o / c_o' - a (1/c_i' + 1/c_o') + log f'(c_i', c_o', m',
///                    p_i', p_o', p_n, p_2),
///     c' = sqrt(1 - (1 - c^2) / eta^2),  dc' = c / (eta^2 c') dc,
///     m' = (m - c_i c_o) / eta^2 + c_i' c_o',  p' = p / eta + (c' - c / eta) p_n         (H39)
///   blend            F = (1 - w) F_1 + w F_2:  dF = (1 - w) F_1 dlog F_1 + w F_2 dlog F_2
///                    + (F_2 - F_1) dw, of densities and of delta lobes                    (H34)
#pragma once

#include <algorithm>
#include <cmath>

#include "driftlight/hand_microfacet_rules.h"

namespace driftlight {

/// The rules (H2), (H6) to (H11), (H29), (H30), (H34), (H38), (H39).
struct HandScatterRules : HandMicrofacetRules {
  // ---- Fresnel ----

  struct Fresnel {
    double value, slope;  ///< of the cosine
  };
  /// (H9); slope 0 under total reflection.
  static Fresnel fresnel(double cosine, double eta) {
    const double inverse2 = 1.0 / (eta * eta);
    const double cos_t2 = 1.0 - (1.0 - cosine * cosine) * inverse2;
    if (cos_t2 <= 0.0) return {1.0, 0.0};
    const double cos_t = std::sqrt(cos_t2);
    const double p_sum = 1.0 / (eta * cosine + cos_t);
    const double s_sum = 1.0 / (cosine + eta * cos_t);
    const double p = (eta * cosine - cos_t) * p_sum;
    const double s = (cosine - eta * cos_t) * s_sum;
    const double k = 2.0 * eta * (1.0 - inverse2) / cos_t;
    return {0.5 * (p * p + s * s), k * (p * p_sum * p_sum + s * s_sum * s_sum)};
  }

  struct RgbFresnel {
    Rgbd value, slope;
  };
  /// (H10): with s1 = S + c^2, s2 = 2 a c, p1 = c^2 S + s^4, p2 = s2 s^2 (fresnel.h),
  ///   ds1 = 4 c a^2 / S,  ds2 = 2 a (1 + c^2 / S),
  ///   dp1 = 2 c S + 2 c^3 D / S - 4 c s^2,  dp2 = ds2 s^2 - 2 c s2,
  ///   d[(x - y) / (x + y)] = 2 (y dx - x dy) / (x + y)^2.
  static RgbFresnel fresnel(double c, const Rgbd& eta_rgb, const Rgbd& k_rgb) {
    using A = Eigen::Array4d;  // a full vector register; the fourth lane is idle
    A eta(eta_rgb[0], eta_rgb[1], eta_rgb[2], 1.0);
    A k(k_rgb[0], k_rgb[1], k_rgb[2], 1.0);
    const double c2 = c * c;
    const double sin2 = 1.0 - c2;
    const A difference = eta * eta - k * k - sin2;
    const A sum = (difference * difference + 4.0 * eta * eta * k * k).sqrt();
    // a and b are the roots of (S + D) / 2 and (S - D) / 2 with a b = eta k: the larger by its
    // root, the other from the product, so that neither cancels.
    const A larger = (0.5 * (sum + difference.abs())).sqrt();
    const A a = (difference >= 0.0).select(larger, eta * k / larger);
    const A s1 = sum + c2;
    const A s2 = 2.0 * c * a;
    const A p1 = c2 * sum + sin2 * sin2;
    const A p2 = s2 * sin2;
    const A inverse = 1.0 / sum;
    const A s_sum = 1.0 / (s1 + s2);
    const A p_sum = 1.0 / (p1 + p2);
    const A ds1 = 4.0 * c * a * a * inverse;
    const A ds2 = 2.0 * a * (1.0 + c2 * inverse);
    const A dp1 = 2.0 * c * (sum + c2 * difference * inverse - 2.0 * sin2);
    const A dp2 = ds2 * sin2 - 2.0 * c * s2;
    const A perpendicular = (s1 - s2) * s_sum;
    const A ratio = (p1 - p2) * p_sum;
    const A d_perpendicular = 2.0 * (s2 * ds1 - s1 * ds2) * s_sum * s_sum;
    const A d_ratio = 2.0 * (p2 * dp1 - p1 * dp2) * p_sum * p_sum;
    const A value = 0.5 * perpendicular * (1.0 + ratio);
    const A slope = 0.5 * (d_perpendicular * (1.0 + ratio) + perpendicular * d_ratio);
    return {value.head<3>(), slope.head<3>()};
  }

  // ---- BSDFs ----

  /// d log x = dx / x; 0 where x = 0: a colour without light in a channel has no share in f.
  static Rgbd log_slope(const Rgbd& slope, const Rgbd& x) {
    return (x != 0.0).select(slope / x, 0.0);
  }

  static void add_texture(const Texture& texture, const Vec2d& uv, FactorPartials& f) {
    const Rgbd color = texture.eval(uv);
    f.color *= color;
    if (texture.is_constant()) return;
    const Texture::Slopes slopes = texture.slopes(uv);
    f.u.head<3>() += log_slope(slopes.u, color);
    f.v.head<3>() += log_slope(slopes.v, color);
  }

  /// D G / c_i: (H3) to (H5), into the lane of log_scale; e is 1 for reflection.
  static void add_microfacets(const Microfacets& m, double e, const ScatterPoint& x,
                              FactorPartials& f) {
    add_distribution(m, e, x, f);
    add_shadowing(m, x.at, x.wi, x.cos_i, f, f.cos_i, f.tangent_i);
    add_shadowing(m, x.at, x.wo, x.cos_o, f, f.cos_o, f.tangent_o);
    f.cos_i[3] -= 1.0 / x.cos_i;
  }

  static FactorPartials scatter(const Diffuse& b, const ScatterPoint& x) {
    FactorPartials f;
    f.cos_o[3] = 1.0 / x.cos_o;
    add_texture(b.reflectance, x.at.uv, f);
    return f;
  }

  static FactorPartials scatter(const RoughConductor& b, const ScatterPoint& x) {
    FactorPartials f;
    add_microfacets(b.microfacets, 1.0, x, f);
    const double h = std::sqrt(2.0 + 2.0 * x.io);
    const RgbFresnel metal = fresnel(0.5 * h, b.eta, b.k);
    f.color = metal.value;
    f.io.head<3>() = log_slope(metal.slope, metal.value) * (0.5 / h);
    add_texture(b.specular_reflectance, x.at.uv, f);
    return f;
  }

  static FactorPartials scatter(const RoughDielectric& b, const ScatterPoint& x) {
    FactorPartials f;
    const bool reflection = x.scattering == Scattering::Reflection;
    const double eta = x.cos_i > 0.0 ? b.eta : 1.0 / b.eta;
    const double e = reflection ? 1.0 : eta;
    add_microfacets(b.microfacets, e, x, f);
    const double h2 = 1.0 + e * e + 2.0 * e * x.io;
    const double i = 1.0 + e * x.io;
    const double o = x.io + e;
    const double h = std::sqrt(h2);
    const Fresnel glass = fresnel(std::abs(i) * (1.0 / h), eta);
    const double d_cosine = std::copysign(e, i) * (1.0 - i / h2) / h;
    if (reflection) {
      f.io[3] += glass.slope / glass.value * d_cosine;
      add_texture(b.specular_reflectance, x.at.uv, f);
    } else {
      f.io[3] -= glass.slope / (1.0 - glass.value) * d_cosine;
      f.io[3] += e / i + 1.0 / o - 4.0 * e / (i + e * o);
      add_texture(b.specular_transmittance, x.at.uv, f);
    }
    return f;
  }

  /// (H11)
  static FactorPartials scatter(const Phong& b, const ScatterPoint& x) {
    FactorPartials f;
    f.cos_o[3] = 1.0 / x.cos_o;
    const double mu = 2.0 * x.cos_i * x.cos_o - x.io;
    const double lobe = detail::phong_lobe(b, mu);
    const Rgbd specular = b.specular_reflectance.eval(x.at.uv);
    f.color = b.diffuse_reflectance.eval(x.at.uv) * kInvPi + specular * lobe;
    if (lobe > 0.0) {
      const Rgbd d_mu = log_slope(specular * (b.exponent * lobe / mu), f.color);
      f.cos_i.head<3>() = 2.0 * x.cos_o * d_mu;
      f.cos_o.head<3>() = 2.0 * x.cos_i * d_mu;
      f.io.head<3>() = -d_mu;
    }
    add_gloss_textures(b, lobe, x.at.uv, f);
    return f;
  }

  /// Of Phong and Ward: by the two reflectances.
  template <class B>
  static void add_gloss_textures(const B& b, double lobe, const Vec2d& uv, FactorPartials& f) {
    const Texture::Slopes d = b.diffuse_reflectance.slopes(uv);
    const Texture::Slopes s = b.specular_reflectance.slopes(uv);
    f.u.head<3>() = log_slope(d.u * kInvPi + s.u * lobe, f.color);
    f.v.head<3>() = log_slope(d.v * kInvPi + s.v * lobe, f.color);
  }

  /// (H38)
  static FactorPartials scatter(const Ward& b, const ScatterPoint& x) {
    const double lobe = detail::ward_lobe(b, x.at, x.wi, x.wo);
    FactorPartials log_lobe;
    add_distribution(b.microfacets(), 1.0, x, log_lobe);
    if (b.variant == Ward::Variant::Balanced) {
      log_lobe.io[3] -= 1.0 / (1.0 + x.io);
    } else {
      const double cos2 = (x.cos_i + x.cos_o) * (x.cos_i + x.cos_o) / (2.0 + 2.0 * x.io);
      add_cos2(2.0 / cos2, 1.0, x, log_lobe);
      const double k = b.variant == Ward::Variant::Ward ? 0.5 : 1.0;
      log_lobe.cos_i[3] -= k / x.cos_i;
      log_lobe.cos_o[3] -= k / x.cos_o;
    }
    const Rgbd specular = b.specular_reflectance.eval(x.at.uv) * lobe;
    FactorPartials f;
    f.color = b.diffuse_reflectance.eval(x.at.uv) * kInvPi + specular;
    for (const auto by : kDirectionPartials)
      (f.*by).head<3>() = log_slope(specular * (log_lobe.*by)[3], f.color);
    f.cos_o[3] = 1.0 / x.cos_o;
    add_gloss_textures(b, lobe, x.at.uv, f);
    return f;
  }

  /// Delta BSDFs do not scatter into free directions.
  static FactorPartials scatter(const Conductor&, const ScatterPoint&) {
    FactorPartials f;
    f.color.setZero();
    return f;
  }
  static FactorPartials scatter(const Dielectric&, const ScatterPoint&) {
    FactorPartials f;
    f.color.setZero();
    return f;
  }

  static FactorPartials scatter(const ThinDielectric&, const ScatterPoint&) {
    FactorPartials f;
    f.color.setZero();
    return f;
  }

  /// The reflectance a = rho / (1 - rho r) of a base under a coat, and its derivatives by u and v:
  ///   da = drho / (1 - rho r)^2  nonlinear,  drho / (1 - r)  else
  struct Albedo {
    Rgbd value, u, v;
  };
  static Albedo albedo(const DiffuseBase& b, const Vec2d& uv) {
    const Rgbd rho = b.reflectance.eval(uv);
    const Texture::Slopes slopes = b.reflectance.slopes(uv);
    const double r = b.internal_reflectance;
    const Rgbd inverse = 1.0 / (1.0 - r * (b.nonlinear ? rho : Rgbd::Ones()));
    const Rgbd slope = b.nonlinear ? Rgbd(inverse * inverse) : inverse;
    return {rho * inverse, slope * slopes.u, slope * slopes.v};
  }

  /// (H29)
  static FactorPartials scatter(const Plastic& b, const ScatterPoint& x) {
    FactorPartials f;
    const Fresnel in = fresnel(x.cos_i, b.eta);
    const Fresnel out = fresnel(x.cos_o, b.eta);
    f.cos_i[3] = -in.slope / (1.0 - in.value);
    f.cos_o[3] = 1.0 / x.cos_o - out.slope / (1.0 - out.value);
    const Albedo a = albedo(b.base, x.at.uv);
    f.color = a.value;
    f.u.head<3>() = log_slope(a.u, a.value);
    f.v.head<3>() = log_slope(a.v, a.value);
    return f;
  }

  /// (H30)
  static FactorPartials scatter(const RoughPlastic& b, const ScatterPoint& x) {
    const auto part = detail::rough_plastic_parts(b, x.at, x.wi, x.wo);
    FactorPartials coat;
    add_microfacets(b.microfacets, 1.0, x, coat);
    const double h = std::sqrt(2.0 + 2.0 * x.io);
    const Fresnel fresnel_h = fresnel(0.5 * h, b.eta);
    coat.io[3] += fresnel_h.slope / fresnel_h.value * (0.5 / h);
    const RoughTransmittance& t = b.transmittance;
    const double base_i = t.slope(x.cos_i) / t.eval(x.cos_i);
    const double base_o = t.slope(x.cos_o) / t.eval(x.cos_o) + 1.0 / x.cos_o;
    const Rgbd specular = b.specular_reflectance.eval(x.at.uv) * part.specular;
    const Texture::Slopes slopes = b.specular_reflectance.slopes(x.at.uv);
    const Albedo a = albedo(b.base, x.at.uv);
    const Rgbd diffuse = a.value * part.diffuse;
    FactorPartials f;
    f.color = specular + diffuse;
    const auto by = [&](double d_coat, double d_base) {
      return log_slope(specular * d_coat + diffuse * d_base, f.color);
    };
    f.cos_i.head<3>() = by(coat.cos_i[3], base_i);
    f.cos_o.head<3>() = by(coat.cos_o[3], base_o);
    f.io.head<3>() = by(coat.io[3], 0.0);
    f.u.head<3>() = log_slope(slopes.u * part.specular + a.u * part.diffuse, f.color);
    f.v.head<3>() = log_slope(slopes.v * part.specular + a.v * part.diffuse, f.color);
    return f;
  }

  static FactorPartials scatter(const Mask& b, const ScatterPoint& x) {
    FactorPartials f;
    if (b.nested == nullptr) {
      f.color.setZero();
      return f;
    }
    f = scatter(b.nested->bsdf, x);
    add_texture(b.opacity, x.at.uv, f);
    return f;
  }

  /// (H39)
  static FactorPartials scatter(const Coating& b, const ScatterPoint& x) {
    const double inverse_eta = 1.0 / b.eta;
    const double inverse_eta2 = inverse_eta * inverse_eta;
    const double in = b.inner_cosine(x.cos_i);
    const double out = b.inner_cosine(x.cos_o);
    const double d_in = x.cos_i * inverse_eta2 / in;
    const double d_out = x.cos_o * inverse_eta2 / out;
    const FactorPartials below = scatter(
        b.nested->bsdf, {x.at, b.inner(x.at.n, x.wi, x.cos_i), b.inner(x.at.n, x.wo, x.cos_o), in,
                         out, (x.io - x.cos_i * x.cos_o) * inverse_eta2 + in * out, x.scattering});
    FactorPartials f = below;
    f.color *= detail::coat_attenuation(b, x.cos_i, x.cos_o);
    const double lift = x.at.tangent.dot(x.at.n);
    f.cos_i = below.cos_i * d_in + below.io * (out * d_in - x.cos_o * inverse_eta2) +
              below.tangent_i * (lift * (d_in - inverse_eta));
    f.cos_o = below.cos_o * d_out + below.io * (in * d_out - x.cos_i * inverse_eta2) +
              below.tangent_o * (lift * (d_out - inverse_eta));
    f.io = below.io * inverse_eta2;
    f.tangent_i = below.tangent_i * inverse_eta;
    f.tangent_o = below.tangent_o * inverse_eta;
    f.tangent_n += below.tangent_i * (in - x.cos_i * inverse_eta) +
                   below.tangent_o * (out - x.cos_o * inverse_eta);
    const Fresnel enter = fresnel(x.cos_i, b.eta);
    const Fresnel leave = fresnel(x.cos_o, b.eta);
    f.cos_i[3] -= enter.slope / (1.0 - enter.value);
    f.cos_o[3] += 1.0 / x.cos_o - d_out / out - leave.slope / (1.0 - leave.value);
    f.cos_i.head<3>() += b.absorption * (d_in / (in * in));
    f.cos_o.head<3>() += b.absorption * (d_out / (out * out));
    return f;
  }

  /// (H34) from the values and the partials of both.
  static FactorPartials blend(const Blend& b, const Vec2d& uv, const ScaledColor<double>& f1,
                              const FactorPartials& partials1, const ScaledColor<double>& f2,
                              const FactorPartials& partials2) {
    FactorPartials f;
    const double w = b.weight.eval(uv)[0];
    const bool has_first = f1.color.maxCoeff() > 0.0;
    const bool has_second = f2.color.maxCoeff() > 0.0;
    double unit = has_first ? f1.log_scale : f2.log_scale;
    if (has_second) unit = std::max(unit, f2.log_scale);
    Rgbd first = Rgbd::Zero();
    Rgbd second = Rgbd::Zero();
    if (has_first) first = std::exp(f1.log_scale - unit) * f1.color;
    if (has_second) second = std::exp(f2.log_scale - unit) * f2.color;
    f.color = (1.0 - w) * first + w * second;
    const auto by = [&](const FactorPartials::Lanes& by1, const FactorPartials::Lanes& by2,
                        double d_w) {
      Rgbd slope = d_w * (second - first);
      // What has no value may have no slope either.
      if (has_first) slope += (1.0 - w) * first * (by1.head<3>() + by1[3]);
      if (has_second) slope += w * second * (by2.head<3>() + by2[3]);
      FactorPartials::Lanes lanes;
      lanes << log_slope(slope, f.color), 0.0;
      return lanes;
    };
    const Texture::Slopes slopes = b.weight.slopes(uv);
    for (const auto direction : kDirectionPartials)
      f.*direction = by(partials1.*direction, partials2.*direction, 0.0);
    f.u = by(partials1.u, partials2.u, slopes.u[0]);
    f.v = by(partials1.v, partials2.v, slopes.v[0]);
    return f;
  }
  static FactorPartials scatter(const Blend& b, const ScatterPoint& x) {
    const Bsdf& first = b.first->bsdf;
    const Bsdf& second = b.second->bsdf;
    return blend(b, x.at.uv, eval(first, x.at, x.wi, x.wo), scatter(first, x),
                 eval(second, x.at, x.wi, x.wo), scatter(second, x));
  }

  static FactorPartials scatter(const Bsdf& bsdf, const ScatterPoint& x) {
    return std::visit([&](const auto& b) { return scatter(b, x); }, bsdf);
  }
};

}  // namespace driftlight
