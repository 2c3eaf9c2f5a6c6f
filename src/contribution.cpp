// SPDX-License-Identifier: Apache-2.0
#include "driftlight/contribution.h"

namespace driftlight {
namespace {

struct FilmVisitor : ContributionVisitor<double> {
  Vec2d film;

  void sensor(const Camera& camera, const Vec3d& v, const Vec3d& lens) {
    ContributionVisitor<double>::sensor(camera, v, lens);
    film = camera.film_position(v, lens);
  }
};

}  // namespace

Contribution contribution(const Scene& scene, const PathTopology& topology,
                          const PathCoordinates& coordinates) {
  FilmVisitor visitor;
  walk<double>(scene, topology, coordinates, visitor);
  const double light = luminance(visitor.color());
  return {visitor.log_scale() + std::log(light), visitor.color() / light, visitor.film};
}

}  // namespace driftlight
