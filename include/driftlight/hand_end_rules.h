// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: the rules of what a path ends or is joined at.
///
///   camera           log W = -3 log(forward.v):  -3 forward / forward.v . dv             (H17)
///   orthographic     dx of Camera::origin_differential, and no dv of the ray; a connection
///                    to it has dw = 0 and the constant W / spread                        (H33)
///   connection       w = e / r, e = y - x:  dw = (I - w w^T) de / r, d log r^2 = 2 w.de / r
///                    log cos_y, cos_y = -n_y.w:  d = -(n_y.dw + w.dn_y) / cos_y          (H18)
///   spot             log falloff(-w):  -(d falloff / dv)(-w) / falloff . dw              (H23)
///   blurred lamp     log g (1 - q / 10)^3, as of BlurredAreaEmitter                       (H27)
///   textured emitter log L(u, v):  (L_u du + L_v dv) / L, by add_texture                 (H37)
/// Light side, w_i toward the emitter:
///   free             log |n_g.w_o| / |n_g.w_i|:
///                    (n_g.dw_o + w_o.dn_g) / n_g.w_o - (n_g.dw_i + w_i.dn_g) / n_g.w_i
///   delta            the same minus that with n_s in the place of n_g                    (H24)
///   emission         log n_y.v:  (n_y.dv + v.dn_y) / n_y.v                               (H25)
/// n_g is constant where normals are interpolated, and else n_s: then nothing is left of a delta
/// lobe.
#pragma once

#include "driftlight/emitter.h"
#include "driftlight/sensor.h"

namespace driftlight {

/// The rules (H17), (H18), (H23) to (H25), (H27), (H33).
struct HandEndRules {
  /// (H17): gradient of log W by v.
  static Vec3d camera(const Camera& camera, const Vec3d& v) {
    return -3.0 / camera.cosine(v) * camera.forward;
  }

  /// (H33): the derivative by v, from that by the origin of its ray.
  static Vec3d parallel_camera(const Camera& camera, const Vec3d& v, const Vec3d& x_bar) {
    return camera.origin_adjoint(v, x_bar);
  }

  /// (H18): the transpose of (I - w w^T) / r at w_bar, plus the gradient of -log r^2, by e.
  static Vec3d connection_adjoint(const Vec3d& w, double r, const Vec3d& w_bar) {
    return (w_bar - (w.dot(w_bar) + 2.0) * w) / r;
  }

  /// (H23): gradient of log falloff by w, the direction toward the spot.
  static Vec3d spot(const SpotEmitter& spot, const Vec3d& w) {
    const Vec3d v = -w;
    return -spot.falloff_gradient(v) / spot.falloff(v);
  }

  /// (H27): derivatives of log_share by the two parts of the ray.
  static BlurredAreaEmitter::Gradient blurred(const BlurredAreaEmitter& lamp,
                                              const Ray<double>& ray) {
    return lamp.log_share_gradient(ray);
  }

  /// (H25): gradient of log n.v by v, and with the arguments exchanged by n.
  static Vec3d log_cosine(const Vec3d& n, const Vec3d& v) { return n / n.dot(v); }

  /// Gradients by n_s, w_i and w_o.
  struct LightFactor {
    Vec3d n = Vec3d::Zero();
    Vec3d wi = Vec3d::Zero();
    Vec3d wo = Vec3d::Zero();
  };
  /// (H24)
  static LightFactor light_factor(const Vec3d& n_g, const Vec3d& n_s, const Vec3d& wi,
                                  const Vec3d& wo, bool interpolated, bool delta) {
    if (delta && !interpolated) return {};
    const double cos_i = n_g.dot(wi);
    const double cos_o = n_g.dot(wo);
    LightFactor f{.wi = -n_g / cos_i, .wo = n_g / cos_o};
    if (!interpolated) f.n = wo / cos_o - wi / cos_i;
    if (!delta) return f;
    const double shading_i = n_s.dot(wi);
    const double shading_o = n_s.dot(wo);
    f.n = wi / shading_i - wo / shading_o;
    f.wi += n_s / shading_i;
    f.wo -= n_s / shading_o;
    return f;
  }

  /// Gradient of log L by the direction, for colour shares of the whole path.
  static Vec3d environment(const EnvironmentMap& map, const Vec3d& v, const Rgbd& radiance,
                           const Rgbd& shares) {
    const Rgbd weights = (radiance != 0.0).select(shares / radiance, 0.0);
    return map.gradient(v).transpose() * weights.matrix();
  }
};

}  // namespace driftlight
