// SPDX-License-Identifier: Apache-2.0
#include "sensor_connection.h"

#include <cmath>

namespace driftlight {

bool sensor_sees(const Scene& scene, const SurfaceHit& x, const Vec3d& lens) {
  const Camera& camera = scene.camera();
  const Vec3d v = camera.coordinate<double>(x.at.p, lens);
  if (!camera.sees(v, lens)) return false;
  const double depth = camera.depth(x.at.p);
  if (!(depth > camera.near_clip && depth < camera.far_clip)) return false;
  // What lies before the near plane hides nothing.
  const Ray<double> ray = camera.ray<double>(v, lens);
  return !scene.occluded(scene.leave(x.at.p, x.at.n_g, Vec3d(-ray.direction)),
                         camera.at_near_plane(ray));
}

std::optional<SensorConnection> connect_to_sensor(const Scene& scene, const SubpathVertex& y,
                                                  const Vec3d& lens) {
  const Camera& camera = scene.camera();
  const SurfaceHit& x = y.surface;
  const Vec3d v = camera.coordinate<double>(x.at.p, lens);
  const Vec3d wi = -camera.ray<double>(v, lens).direction;
  if (!camera.sees(v, lens) || !passes(x.at, wi, x.wi)) return std::nullopt;
  const Rgbd f = scattered(x, wi, x.wi);
  if (!(f.maxCoeff() > 0.0) || !sensor_sees(scene, x, lens)) return std::nullopt;

  const double importance = std::exp(camera.log_importance(v));
  const double density =
      importance * std::abs(x.at.n_g.dot(wi)) / camera.spread<double>(v, x.at.p, lens);
  const Rgbd value = density / std::abs(x.at.n_g.dot(x.wi)) * y.throughput * f;
  return SensorConnection{camera.film_position(v, lens), wi, value, density};
}

}  // namespace driftlight
