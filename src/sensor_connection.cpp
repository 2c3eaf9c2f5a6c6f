// SPDX-License-Identifier: Apache-2.0
#include "sensor_connection.h"

#include <cmath>

namespace driftlight {

std::optional<SensorConnection> connect_to_sensor(const Scene& scene, const SubpathVertex& y) {
  const PerspectiveCamera& camera = scene.camera();
  const SurfaceHit& x = y.surface;
  const Vec3d edge = x.at.p - camera.origin;
  const double r2 = edge.squaredNorm();
  const Vec3d v = edge / std::sqrt(r2);
  const Vec3d wi = -v;
  if (!camera.sees(v) || !passes(x.at, wi, x.wi)) return std::nullopt;
  const double depth = camera.cosine(edge);
  if (!(depth > camera.near_clip && depth < camera.far_clip)) return std::nullopt;
  const Rgbd f = scattered(x, wi, x.wi);
  if (!(f.maxCoeff() > 0.0)) return std::nullopt;
  // What lies before the near plane hides nothing.
  const Vec3d front = camera.origin + camera.near_clip / camera.cosine(v) * v;
  if (scene.occluded(scene.leave(x.at.p, x.at.n_g, wi), front)) return std::nullopt;

  const double importance = std::exp(camera.log_importance(v));
  const double density = importance * std::abs(x.at.n_g.dot(wi)) / r2;
  const Rgbd value = density / std::abs(x.at.n_g.dot(x.wi)) * y.throughput * f;
  return SensorConnection{camera.film_position(v), wi, value, density};
}

}  // namespace driftlight
