// SPDX-License-Identifier: Apache-2.0
#include "sensor_connection.h"

#include <cmath>

namespace driftlight {

std::optional<SensorConnection> connect_to_sensor(const Scene& scene, const SubpathVertex& y) {
  const Camera& camera = scene.camera();
  const SurfaceHit& x = y.surface;
  const Vec3d v = camera.coordinate<double>(x.at.p);
  const Ray<double> ray = camera.ray<double>(v);
  const Vec3d wi = -ray.direction;
  if (!camera.sees(v) || !passes(x.at, wi, x.wi)) return std::nullopt;
  const double depth = camera.depth(x.at.p);
  if (!(depth > camera.near_clip && depth < camera.far_clip)) return std::nullopt;
  const Rgbd f = scattered(x, wi, x.wi);
  if (!(f.maxCoeff() > 0.0)) return std::nullopt;
  // What lies before the near plane hides nothing.
  const Vec3d front = camera.at_near_plane(ray);
  if (scene.occluded(scene.leave(x.at.p, x.at.n_g, wi), front)) return std::nullopt;

  const double importance = std::exp(camera.log_importance(v));
  const double density = importance * std::abs(x.at.n_g.dot(wi)) / camera.spread<double>(v, x.at.p);
  const Rgbd value = density / std::abs(x.at.n_g.dot(x.wi)) * y.throughput * f;
  return SensorConnection{camera.film_position(v), wi, value, density};
}

}  // namespace driftlight
