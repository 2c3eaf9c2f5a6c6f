// SPDX-License-Identifier: Apache-2.0
#include "bidirectional_trace.h"

#include <cmath>
#include <optional>

#include "driftlight/chart_rule.h"
#include "driftlight/walk.h"
#include "ray_follower.h"

namespace driftlight {
namespace {

/// Follows the pattern of a path along other coordinates, from both ends.
class TwoSidedTracer {
 public:
  TwoSidedTracer(const Scene& scene, const PathTopology& pattern,
                 const PathCoordinates& coordinates, PathTopology& result)
      : scene_(scene),
        pattern_(pattern),
        coordinates_(coordinates),
        result_(result),
        lens_(lens_point(scene, pattern, coordinates)),
        next_block_(pattern.lens_block_count()) {
    result_.scatter_count = pattern.scatter_count;
    result_.light_count = pattern.light_count;
    result_.block_count = pattern.block_count;
    result_.has_lens = pattern.has_lens;
    result_.phase_space = pattern.phase_space;
    result_.end = pattern.end;
    result_.emitter = pattern.emitter;
  }

  TraceStatus run() {
    if (pattern_.has_lens && !scene_.camera().is_on_lens(lens_)) return TraceStatus::Missed;
    TraceStatus status = camera_side();
    if (status == TraceStatus::Ok) status = light_side();
    if (status == TraceStatus::Ok) status = join();
    if (status != TraceStatus::Ok) return status;
    const std::span<const Lobe> lobes(lobes_.data(), pattern_.scatter_count);
    const bool same_chart = light_side_of(lobes) == pattern_.light_count;
    return same_chart ? TraceStatus::Ok : TraceStatus::OtherLobe;
  }

 private:
  std::optional<int> light_side_of(std::span<const Lobe> lobes) const {
    return driftlight::light_side(pattern_.phase_space, scene_, lobes, pattern_.emitter);
  }

  TraceStatus camera_side() {
    if (pattern_.camera_count() == 0) return TraceStatus::Ok;
    const Vec3d& v = coordinates_(next_block_++);
    if (!scene_.camera().sees(v, lens_)) return TraceStatus::Missed;
    RayFollower follower(scene_, v, lens_);
    for (int k = 0; k < pattern_.camera_count(); ++k) {
      const TraceStatus status = arrive(k, follower, camera_end_);
      if (status != TraceStatus::Ok) return status;
      if (k + 1 == pattern_.camera_count()) break;
      const TraceStatus left = leave(k, *camera_end_, follower);
      if (left != TraceStatus::Ok) return left;
    }
    return TraceStatus::Ok;
  }

  TraceStatus light_side() {
    std::optional<RayFollower> follower = emit();
    if (!follower) return TraceStatus::Missed;
    for (int k = pattern_.scatter_count - 1; k >= pattern_.camera_count(); --k) {
      const TraceStatus status = arrive(k, *follower, light_end_);
      if (status != TraceStatus::Ok) return status;
      // The emitter point must be on its shape, and nothing in front of it.
      if (k + 1 == pattern_.scatter_count && pattern_.end == PathEnd::AreaEmission) {
        const TraceStatus seen = connection_status(
            scene_, *light_end_, scene_.emitters()[pattern_.emitter], emitter_point_);
        if (seen != TraceStatus::Ok) return seen;
      }
      if (k == pattern_.camera_count()) break;
      const TraceStatus left = leave(k, *light_end_, *follower);
      if (left != TraceStatus::Ok) return left;
    }
    return TraceStatus::Ok;
  }

  /// None if nothing is emitted in that direction.
  std::optional<RayFollower> emit() {
    const Emitter& emitter = scene_.emitters()[pattern_.emitter];
    if (pattern_.end == PathEnd::PointEmission) {
      const Vec3d& y = position_of(emitter);
      return RayFollower(scene_, y, y, coordinates_(next_block_++));
    }
    const Vec3d& y = coordinates_(next_block_++);
    if (const auto* parallel = std::get_if<DirectionalEmitter>(&emitter))
      return RayFollower(scene_, y, y, parallel->direction);
    const Shape& shape = scene_.shapes()[std::get<AreaEmitter>(emitter).shape];
    const Vec3d& v = coordinates_(next_block_++);
    emitter_point_ = {.p = y, .n = emitter_normal(shape, y)};
    if (!(emitter_point_.n.dot(v) > 0.0)) return std::nullopt;
    return RayFollower(scene_, y, scene_.leave(y, emitter_point_.n, v), v);
  }

  /// Finds vertex k.
  TraceStatus arrive(int k, RayFollower& follower, std::optional<SurfaceHit>& surface) {
    const auto index = static_cast<std::size_t>(k);
    const Hit hit = follower.next_hit();
    if (!hit.valid()) return TraceStatus::Missed;
    surface = follower.surface(hit);
    if (surface->bsdf == nullptr) return TraceStatus::Missed;
    // A ray that just touches a sphere in single precision may pass it in double.
    if (!surface->at.p.allFinite()) return TraceStatus::Missed;
    const PathVertex& wanted = pattern_.vertices[index];
    if (!has_lobe(*surface->bsdf, wanted)) return TraceStatus::OtherLobe;
    lobes_[index] = lobe_of(*surface->bsdf, wanted.delta);
    result_.vertices[index] = wanted;
    result_.vertices[index].hit = hit;
    return TraceStatus::Ok;
  }

  /// The ray that leaves vertex k on its side of the path.
  TraceStatus leave(int k, const SurfaceHit& surface, RayFollower& follower) {
    const PathVertex& wanted = pattern_.vertices[static_cast<std::size_t>(k)];
    Vec3d next;
    if (wanted.delta) {
      next = delta_direction(*surface.bsdf, surface.surface(), surface.wi, wanted.scattering);
      if (!next.allFinite()) return TraceStatus::OtherLobe;  // total reflection
    } else {
      next = coordinates_(next_block_++);
    }
    if (surface.side(next) != wanted.scattering) return TraceStatus::OtherLobe;
    if (!passes(surface.at, surface.wi, next)) return TraceStatus::Missed;
    follower.leave(surface, next);
    return TraceStatus::Ok;
  }

  /// Whether the surface scatters along the edge as vertex k of the pattern does. Between points of
  /// one plane it does not, whatever sign rounding gives to the cosine.
  TraceStatus scatters(int k, const SurfaceHit& surface, const Vec3d& edge) const {
    const PathVertex& wanted = pattern_.vertices[static_cast<std::size_t>(k)];
    if (surface.side(edge) != wanted.scattering) return TraceStatus::OtherLobe;
    const double rounding = 1e-12 * scene_.radius();
    if (!(std::abs(surface.at.n_g.dot(edge)) > rounding)) return TraceStatus::Missed;
    return passes(surface.at, surface.wi, edge) ? TraceStatus::Ok : TraceStatus::Missed;
  }

  TraceStatus join() const {
    const Vec3d& p = light_end_->at.p;
    const Camera& camera = scene_.camera();
    const Vec3d edge = camera_end_ ? Vec3d(p - camera_end_->at.p)
                                   : camera.ray(camera.coordinate(p, lens_), lens_).direction;
    const TraceStatus at_light = scatters(pattern_.camera_count(), *light_end_, -edge);
    if (at_light != TraceStatus::Ok) return at_light;
    const Vec3d to = scene_.leave(p, light_end_->at.n_g, -edge);
    if (!camera_end_) return join_sensor(to);
    const TraceStatus at_camera = scatters(pattern_.camera_count() - 1, *camera_end_, edge);
    if (at_camera != TraceStatus::Ok) return at_camera;
    const Vec3d start = scene_.leave(camera_end_->at.p, camera_end_->at.n_g, edge);
    return scene_.occluded(start, to) ? TraceStatus::Occluded : TraceStatus::Ok;
  }

  /// What lies before the near plane hides nothing.
  TraceStatus join_sensor(const Vec3d& to) const {
    const Camera& camera = scene_.camera();
    const Vec3d v = camera.coordinate(light_end_->at.p, lens_);
    if (!camera.sees(v, lens_)) return TraceStatus::Missed;
    const double depth = camera.depth(light_end_->at.p);
    if (!(depth > camera.near_clip && depth < camera.far_clip)) return TraceStatus::Missed;
    return scene_.occluded(to, camera.at_near_plane(camera.ray(v, lens_))) ? TraceStatus::Occluded
                                                                           : TraceStatus::Ok;
  }

  const Scene& scene_;
  const PathTopology& pattern_;
  const PathCoordinates& coordinates_;
  PathTopology& result_;
  const Vec3d& lens_;
  int next_block_;
  std::array<Lobe, kMaxPathLength> lobes_;
  EmitterPoint emitter_point_;
  std::optional<SurfaceHit> camera_end_;  ///< none: the sensor
  std::optional<SurfaceHit> light_end_;
};

}  // namespace

TraceStatus trace_from_both_ends(const Scene& scene, const PathTopology& pattern,
                                 const PathCoordinates& coordinates, PathTopology& result) {
  return TwoSidedTracer(scene, pattern, coordinates, result).run();
}

}  // namespace driftlight
