// SPDX-License-Identifier: Apache-2.0
/// The contribution f of a light path (DESIGN 1.1), written once for every Scalar.
///
/// In the measure of the path's coordinates (solid angle for free directions, area for an emitter
/// point),
///   f = W(v_0) prod_free f_s(x_k; -v_{k-1}, v_k) |n_k . v_k|
///              prod_delta {R_k or (1 - R_k) eta^-2}  L_end,
///   L_end = L_e                      free direction that hits an emitter or the environment
///           L_e cos_y / r^2          connection to a point y on an area emitter
///           I / r^2                  connection to a point emitter.
/// Factors with a large range enter as a sum of logarithms, colours (of order 1) as a product.
#pragma once

#include "driftlight/walk.h"

namespace driftlight {

/// f = exp(log_scale) * color; the target is its luminance and the potential U = -log target.
template <Scalar T>
class ContributionVisitor : public WalkVisitor<T> {
 public:
  void sensor(const PerspectiveCamera& camera, const Vec3<T>& v) {
    log_scale_ = camera.log_importance(v);
  }
  void scatter(const ScatterEvent<T>& e) { multiply(eval(e.bsdf, e.surface(), e.wi, e.wo)); }
  void connect(const ScatterEvent<T>& e) { scatter(e); }
  void delta(const ScatterEvent<T>& e) {
    multiply(eval_delta(e.bsdf, e.surface(), e.wi, e.scattering));
  }
  void hit(const AreaEmitter& emitter, const T& cosine, const T&) {
    color_ *= emits(cosine) ? constant<T>(emitter.radiance) : constant<T>(Rgbd{0, 0, 0});
  }
  void environment(const Emitter& emitter, const Vec3<T>& v) {
    if (const auto* map = std::get_if<EnvironmentMap>(&emitter))
      color_ *= map->eval(v);
    else
      color_ *= constant<T>(std::get<ConstantEnvironment>(emitter).radiance);
  }
  void area_connection(const AreaEmitter& emitter, const T& cosine, const T& r2) {
    using std::log;
    hit(emitter, cosine, r2);
    if (emits(cosine)) log_scale_ += log(cosine / r2);
  }
  void point_connection(const PointEmitter& emitter, const T& r2) {
    using std::log;
    color_ *= constant<T>(emitter.intensity);
    log_scale_ -= log(r2);
  }

  const T& log_scale() const { return log_scale_; }
  const Rgb<T>& color() const { return color_; }
  /// log of the luminance of f; -infinity for a path without contribution.
  T log_target() const {
    using std::log;
    return log_scale_ + log(luminance(color_));
  }

 private:
  /// One-sided emission. The branch cuts no derivative where f is positive.
  static bool emits(const T& cosine) { return value(cosine) > 0.0; }

  void multiply(const ScaledColor<T>& factor) {
    log_scale_ += factor.log_scale;
    color_ *= factor.color;
  }

  T log_scale_ = constant<T>(0.0);
  Rgb<T> color_ = constant<T>(Rgbd{1, 1, 1});
};

/// The contribution as numbers.
struct Contribution {
  double log_target = 0;      ///< log luminance(f)
  Rgbd color = Rgbd::Zero();  ///< f / luminance(f); what a splat of unit target deposits
};

/// Evaluates f. A path without contribution has log_target = -infinity; a degenerate one may be
/// NaN. Both are for the caller to count and to reject.
Contribution contribution(const Scene& scene, const PathTopology& topology,
                          const PathCoordinates& coordinates);

}  // namespace driftlight
