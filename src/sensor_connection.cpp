// SPDX-License-Identifier: Apache-2.0
#include "sensor_connection.h"

#include <cmath>

namespace driftlight {

bool sensor_sees(const Scene& scene, const SurfaceHit& x) {
  const PerspectiveCamera& camera = scene.camera();
  const Vec3d edge = x.at.p - camera.origin;
  const Vec3d v = edge.normalized();
  if (!camera.sees(v)) return false;
  const double depth = camera.cosine(edge);
  if (!(depth > camera.near_clip && depth < camera.far_clip)) return false;
  // What lies before the near plane hides nothing.
  const Vec3d front = camera.origin + camera.near_clip / camera.cosine(v) * v;
  return !scene.occluded(scene.leave(x.at.p, x.at.n_g, -v), front);
}

std::optional<SensorConnection> connect_to_sensor(const Scene& scene, const SubpathVertex& y) {
  const PerspectiveCamera& camera = scene.camera();
  const SurfaceHit& x = y.surface;
  const Vec3d edge = x.at.p - camera.origin;
  const double r2 = edge.squaredNorm();
  const Vec3d v = edge / std::sqrt(r2);
  const Vec3d wi = -v;
  if (!camera.sees(v) || !passes(x.at, wi, x.wi)) return std::nullopt;
  const Rgbd f = scattered(x, wi, x.wi);
  if (!(f.maxCoeff() > 0.0) || !sensor_sees(scene, x)) return std::nullopt;

  const double importance = std::exp(camera.log_importance(v));
  const double density = importance * std::abs(x.at.n_g.dot(wi)) / r2;
  const Rgbd value = density / std::abs(x.at.n_g.dot(x.wi)) * y.throughput * f;
  return SensorConnection{camera.film_position(v), wi, value, density};
}

}  // namespace driftlight
