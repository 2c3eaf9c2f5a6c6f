// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: the rules of delta lobes.
///
///   thin pane        log 2 R / (1 + R):  dR / (R (1 + R));
///                    log (1 - R) / (1 + R):  -2 dR / (1 - R^2)                           (H31)
///   mask             w = 1 - o + o p, p of a pane within:  dw = (p - 1) do + o dp        (H32)
///   coating          F rho_s + U, U = T^2 exp(-2 a / c') R'(c'):
///                    rho_s F' + U (-2 F' / T + (2 a / c'^2 + dlog R'/dc') dc'/dc)        (H41)
/// and of the directions that they send light into:
///   mirror           dv = 2 c dn + 2 n (wi.dn + n.dwi) - dwi                             (H12)
///   refraction       v = k n - wi / eta, k = c / eta - s r, r = sqrt(1 - (1 - c^2) / eta^2):
///                    dv = k dn + n k' dc - dwi / eta,  k' = 1 / eta - s c / (eta^2 r)    (H13)
#pragma once

#include "driftlight/hand_scatter_rules.h"

namespace driftlight {

/// The rules (H12), (H13), (H31), (H32), (H41), and (H34) of delta lobes.
struct HandDeltaRules : HandScatterRules {
  /// Weight of a delta lobe: R or 1 - R, and its texture.
  static FactorPartials delta_lobe(const Conductor& b, double cos_i, const Vec2d& uv, Scattering) {
    FactorPartials f;
    const RgbFresnel r = fresnel(cos_i, b.eta, b.k);
    f.color = r.value;
    f.cos_i.head<3>() = log_slope(r.slope, r.value);
    add_texture(b.specular_reflectance, uv, f);
    return f;
  }
  static FactorPartials delta_lobe(const Dielectric& b, double cos_i, const Vec2d& uv,
                                   Scattering scattering) {
    FactorPartials f;
    const Fresnel r = fresnel(std::abs(cos_i), cos_i > 0.0 ? b.eta : 1.0 / b.eta);
    const double slope = std::copysign(1.0, cos_i) * r.slope;
    if (scattering == Scattering::Reflection) {
      f.cos_i[3] = slope / r.value;
      add_texture(b.specular_reflectance, uv, f);
    } else {
      f.cos_i[3] = -slope / (1.0 - r.value);
      add_texture(b.specular_transmittance, uv, f);
    }
    return f;
  }
  /// (H31)
  static FactorPartials delta_lobe(const ThinDielectric& b, double cos_i, const Vec2d& uv,
                                   Scattering scattering) {
    FactorPartials f;
    const Fresnel r = fresnel(std::abs(cos_i), b.eta);
    const double slope = std::copysign(1.0, cos_i) * r.slope / (1.0 + r.value);
    if (scattering == Scattering::Reflection) {
      f.cos_i[3] = slope / r.value;
      add_texture(b.specular_reflectance, uv, f);
    } else {
      f.cos_i[3] = -2.0 * slope / (1.0 - r.value);
      add_texture(b.specular_transmittance, uv, f);
    }
    return f;
  }
  static FactorPartials delta_lobe(const Plastic& b, double cos_i, const Vec2d& uv, Scattering) {
    FactorPartials f;
    const Fresnel r = fresnel(cos_i, b.eta);
    f.cos_i[3] = r.slope / r.value;
    add_texture(b.specular_reflectance, uv, f);
    return f;
  }
  /// (H32)
  static FactorPartials delta_lobe(const Mask& b, double cos_i, const Vec2d& uv,
                                   Scattering scattering) {
    const bool has_lobe = b.nested != nullptr && has_delta(b.nested->bsdf, scattering);
    FactorPartials f;
    Rgbd weight = Rgbd::Zero();
    if (has_lobe) {
      f = delta(b.nested->bsdf, cos_i, uv, scattering);
      if (scattering == Scattering::Reflection) {
        add_texture(b.opacity, uv, f);
        return f;
      }
      // Straight on, the same from any normal: wi itself matters only through its cosine.
      const Vec3d wi(std::sqrt(std::max(0.0, 1.0 - cos_i * cos_i)), 0.0, cos_i);
      const ScaledColor<double> w =
          eval_delta(b.nested->bsdf, SurfacePoint<double>{Vec3d::UnitZ(), uv}, wi, scattering);
      weight = std::exp(w.log_scale) * w.color;
    }
    const Rgbd opacity = b.opacity.eval(uv);
    const Texture::Slopes slopes = b.opacity.slopes(uv);
    f.color = 1.0 - opacity + opacity * weight;
    const Rgbd d_cosine = opacity * weight * (f.cos_i.head<3>() + f.cos_i[3]);
    f.cos_i << log_slope(d_cosine, f.color), 0.0;
    const Rgbd d_u = (weight - 1.0) * slopes.u + opacity * weight * f.u.head<3>();
    const Rgbd d_v = (weight - 1.0) * slopes.v + opacity * weight * f.v.head<3>();
    f.u.head<3>() = log_slope(d_u, f.color);
    f.v.head<3>() = log_slope(d_v, f.color);
    return f;
  }
  /// (H41)
  static FactorPartials delta_lobe(const Coating& b, double cos_i, const Vec2d& uv,
                                   Scattering scattering) {
    FactorPartials f;
    const Fresnel coat = fresnel(cos_i, b.eta);
    const Rgbd rho = b.specular_reflectance.eval(uv);
    const Texture::Slopes slopes = b.specular_reflectance.slopes(uv);
    f.color = coat.value * rho;
    Rgbd d_cos = coat.slope * rho;
    Rgbd d_u = coat.value * slopes.u;
    Rgbd d_v = coat.value * slopes.v;
    if (has_delta(b.nested->bsdf, scattering)) {
      const double in = b.inner_cosine(cos_i);
      const double d_in = cos_i / (b.eta * b.eta * in);
      const FactorPartials below = delta(b.nested->bsdf, in, uv, scattering);
      const Vec3d wi(std::sqrt(std::max(0.0, 1.0 - in * in)), 0.0, in);
      const ScaledColor<double> r =
          eval_delta(b.nested->bsdf, SurfacePoint<double>{Vec3d::UnitZ(), uv}, wi, scattering);
      const double t = 1.0 - coat.value;
      const Rgbd under =
          t * t * std::exp(r.log_scale) * r.color * detail::coat_attenuation(b, cos_i, cos_i);
      f.color += under;
      d_cos += under * (2.0 * b.absorption * (d_in / (in * in)) - 2.0 * coat.slope / t +
                        (below.cos_i.head<3>() + below.cos_i[3]) * d_in);
      d_u += under * below.u.head<3>();
      d_v += under * below.v.head<3>();
    }
    f.cos_i.head<3>() = log_slope(d_cos, f.color);
    f.u.head<3>() = log_slope(d_u, f.color);
    f.v.head<3>() = log_slope(d_v, f.color);
    return f;
  }
  /// (H34)
  static FactorPartials delta_lobe(const Blend& b, double cos_i, const Vec2d& uv,
                                   Scattering scattering) {
    const Vec3d wi(std::sqrt(std::max(0.0, 1.0 - cos_i * cos_i)), 0.0, cos_i);
    const SurfacePoint<double> at{Vec3d::UnitZ(), uv};
    const Bsdf& first = b.first->bsdf;
    const Bsdf& second = b.second->bsdf;
    return blend(b, uv, eval_delta(first, at, wi, scattering), delta(first, cos_i, uv, scattering),
                 eval_delta(second, at, wi, scattering), delta(second, cos_i, uv, scattering));
  }
  /// Those that have no delta lobe.
  template <class B>
  static FactorPartials delta_lobe(const B&, double, const Vec2d&, Scattering) {
    FactorPartials f;
    f.color.setZero();
    return f;
  }
  static FactorPartials delta(const Bsdf& bsdf, double cos_i, const Vec2d& uv,
                              Scattering scattering) {
    return std::visit([&](const auto& b) { return delta_lobe(b, cos_i, uv, scattering); }, bsdf);
  }

  // ---- Directions of delta lobes ----

  /// dv = normal_factor dn + n_factor n (wi.dn + n.dwi) + wi_factor dwi, for (H12) and (H13) alike.
  struct DeltaMap {
    double normal_factor, n_factor, wi_factor;
  };
  static DeltaMap delta_map(const Bsdf& bsdf, double cos_i, Scattering scattering) {
    if (scattering == Scattering::Reflection) return {2.0 * cos_i, 2.0, -1.0};
    const double glass = delta_eta(bsdf);
    if (glass == 1.0) return {0.0, 0.0, -1.0};
    const double inverse = cos_i > 0.0 ? 1.0 / glass : glass;
    const double root = std::sqrt(1.0 - (1.0 - cos_i * cos_i) * inverse * inverse);
    const double s = cos_i > 0.0 ? 1.0 : -1.0;
    return {cos_i * inverse - s * root, inverse - s * cos_i * inverse * inverse / root, -inverse};
  }
};

}  // namespace driftlight
