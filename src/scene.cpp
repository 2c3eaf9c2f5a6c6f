// SPDX-License-Identifier: Apache-2.0
#include "driftlight/scene.h"

#include <utility>

#include "emission_warp.h"

namespace driftlight {

Scene::Scene() : surfaces_(std::make_shared<Surfaces>()) {}
Scene::Scene(const Scene&) = default;
Scene::~Scene() = default;
Scene::Scene(Scene&&) noexcept = default;
Scene& Scene::operator=(Scene&&) noexcept = default;

Vec3d Scene::leave(const Vec3d& p, const Vec3d& n_g, const Vec3d& direction) const {
  // Rounding to float moves a point by 6e-8 of its largest coordinate; Embree's plane equations
  // lose a few bits more.
  const double offset = 4e-6 * (p.cwiseAbs().maxCoeff() + 1e-2 * radius_);
  return p + (n_g.dot(direction) > 0.0 ? offset : -offset) * n_g;
}

EmitterPoint Scene::sample_area(const AreaEmitter& emitter, double u1, double u2) const {
  return warp_area<double>(shapes()[emitter.shape], u1, u2);
}

namespace {

/// Power of an emitter up to a common factor; only the choice of emitters depends on it.
double power(const Emitter& emitter, std::span<const Shape> shapes, double scene_radius) {
  struct Visitor {
    std::span<const Shape> shapes;
    double disk;
    double operator()(const AreaEmitter& e) const {
      return luminance(e.radiance) * shapes[e.shape].extent.area * kPi;
    }
    double operator()(const PointEmitter& e) const {
      return luminance(e.intensity) * e.solid_angle();
    }
    double operator()(const SpotEmitter& e) const {
      return luminance(e.intensity()) * e.solid_angle();
    }
    double operator()(const DirectionalEmitter& e) const { return luminance(e.irradiance) * disk; }
    double operator()(const ConstantEnvironment& e) const {
      return luminance(e.radiance) * 4.0 * kPi * disk;
    }
    double operator()(const EnvironmentMap& e) const { return e.total_luminance() * disk; }
    double operator()(const BlurredAreaEmitter&) const { return 0.0; }
  };
  return std::visit(Visitor{shapes, kPi * scene_radius * scene_radius}, emitter);
}

}  // namespace

void Scene::choose_emitters_by_power() {
  std::vector<double> powers;
  for (const Emitter& emitter : emitters_) powers.push_back(power(emitter, shapes(), radius_));
  emitter_choice_ = DiscreteDistribution(powers);
}

Scene Scene::with_emitters(std::vector<Emitter> emitters) const {
  Scene scene(*this);
  scene.emitters_ = std::move(emitters);
  scene.choose_emitters_by_power();
  return scene;
}

Scene Scene::with_bsdfs(std::vector<Bsdf> bsdfs) const {
  Scene scene(*this);
  scene.bsdfs_ = std::move(bsdfs);
  return scene;
}

}  // namespace driftlight
