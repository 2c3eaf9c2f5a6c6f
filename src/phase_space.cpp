// SPDX-License-Identifier: Apache-2.0
#include "driftlight/phase_space.h"

#include <cmath>

#include "bidirectional_trace.h"
#include "driftlight/chart_rule.h"
#include "driftlight/walk.h"
#include "ray_follower.h"

namespace driftlight {

bool has_points(const Shape& emitter) {
  // A cylinder may be so thin or flat that its extent is.
  if (std::holds_alternative<Cylinder>(emitter.geometry)) return false;
  if (emitter.bent_emission) return false;
  return emitter.extent.planar || std::holds_alternative<Sphere>(emitter.geometry);
}

bool connects_to_area(Lobe last, const Shape& emitter) {
  return last == Lobe::Wide && has_points(emitter);
}

bool has_lobe(const Bsdf& bsdf, const PathVertex& vertex) {
  return vertex.delta ? has_delta(bsdf, vertex.scattering) : !is_delta(bsdf);
}

bool passes(const Interaction<double>& at, const Vec3d& wi, const Vec3d& wo) {
  return at.n_g.dot(wi) * at.n_s.dot(wi) > 0.0 && at.n_g.dot(wo) * at.n_s.dot(wo) > 0.0;
}

namespace {

/// Follows the pattern of a path along other coordinates.
class Tracer {
 public:
  Tracer(const Scene& scene, const PathTopology& pattern, const PathCoordinates& coordinates,
         PathTopology& result)
      : scene_(scene),
        pattern_(pattern),
        coordinates_(coordinates),
        result_(result),
        lens_(lens_point(scene, pattern, coordinates)),
        next_block_(pattern.lens_block_count()),
        v_(coordinates(next_block_++)),
        follower_(scene, v_, lens_) {
    result_.scatter_count = pattern.scatter_count;
    result_.light_count = 0;
    result_.block_count = pattern.block_count;
    result_.has_lens = pattern.has_lens;
    result_.phase_space = pattern.phase_space;
    result_.end = pattern.end;
    result_.emitter = pattern.emitter;
  }

  TraceStatus run() {
    if (pattern_.has_lens && !scene_.camera().is_on_lens(lens_)) return TraceStatus::Missed;
    if (!scene_.camera().sees(v_, lens_)) return TraceStatus::Missed;
    for (int k = 0; k < pattern_.scatter_count; ++k) {
      const TraceStatus status = scatter(k);
      if (status != TraceStatus::Ok) return status;
    }
    TraceStatus status = TraceStatus::Ok;
    if (pattern_.end == PathEnd::Hit) status = hit_emitter();
    if (pattern_.end == PathEnd::Environment && follower_.next_hit().valid())
      status = TraceStatus::Occluded;
    return status == TraceStatus::Ok && !keeps_chart() ? TraceStatus::OtherLobe : status;
  }

 private:
  /// With PhaseSpace::Directions the lobe before the emitter decides, which is checked there.
  bool keeps_chart() const {
    if (pattern_.phase_space == PhaseSpace::Directions) return true;
    const std::span<const Lobe> lobes(lobes_.data(), pattern_.scatter_count);
    return light_side(pattern_.phase_space, scene_, lobes, result_.emitter) == 0;
  }

  /// Finds vertex k and what lies beyond: the ray that leaves it or the connection to the emitter.
  TraceStatus scatter(int k) {
    const auto index = static_cast<std::size_t>(k);
    const PathVertex& wanted = pattern_.vertices[index];
    const Hit hit = follower_.next_hit();
    if (!hit.valid()) return TraceStatus::Missed;
    const SurfaceHit surface = follower_.surface(hit);
    if (surface.bsdf == nullptr) return TraceStatus::Missed;
    if (!has_lobe(*surface.bsdf, wanted)) return TraceStatus::OtherLobe;
    result_.vertices[index] = wanted;
    result_.vertices[index].hit = hit;
    lobes_[index] = lobe_of(*surface.bsdf, wanted.delta);
    last_ = lobes_[index];
    if (pattern_.ends_in_connection() && k + 1 == pattern_.scatter_count)
      return connect(surface, wanted);

    Vec3d wo;
    if (wanted.delta) {
      wo = delta_direction(*surface.bsdf, surface.surface(), surface.wi, wanted.scattering);
      if (!wo.allFinite()) return TraceStatus::OtherLobe;  // total reflection
    } else {
      wo = coordinates_(next_block_++);
    }
    if (surface.side(wo) != wanted.scattering) return TraceStatus::OtherLobe;
    if (!passes(surface.at, surface.wi, wo)) return TraceStatus::Missed;
    follower_.leave(surface, wo);
    return TraceStatus::Ok;
  }

  TraceStatus connect(const SurfaceHit& surface, const PathVertex& wanted) {
    const Emitter& emitter = scene_.emitters()[pattern_.emitter];
    if (pattern_.end == PathEnd::DirectionalConnection) return connect_to_infinity(surface, wanted);
    EmitterPoint y;
    if (const auto* light = std::get_if<AreaEmitter>(&emitter)) {
      const Shape& shape = scene_.shapes()[light->shape];
      if (!connects_to_area(last_, shape)) return TraceStatus::OtherLobe;
      y.p = coordinates_(next_block_);
      y.n = emitter_normal(shape, y.p);
    } else {
      y.p = position_of(emitter);
    }
    const Vec3d edge = y.p - surface.at.p;
    if (surface.side(edge) != wanted.scattering) return TraceStatus::OtherLobe;
    if (!passes(surface.at, surface.wi, edge)) return TraceStatus::Missed;
    return connection_status(scene_, surface, emitter, y);
  }

  TraceStatus connect_to_infinity(const SurfaceHit& surface, const PathVertex& wanted) {
    const auto& light = std::get<DirectionalEmitter>(scene_.emitters()[pattern_.emitter]);
    const Vec3d wo = -light.direction;
    if (surface.side(wo) != wanted.scattering) return TraceStatus::OtherLobe;
    if (!passes(surface.at, surface.wi, wo)) return TraceStatus::Missed;
    return infinity_status(scene_, surface, wo);
  }

  TraceStatus hit_emitter() {
    const Emitter& emitter = scene_.emitters()[pattern_.emitter];
    if (const auto* blurred = std::get_if<BlurredAreaEmitter>(&emitter)) return see(*blurred);
    const Hit hit = follower_.next_hit();
    if (!hit.valid()) return TraceStatus::Missed;
    const Shape& shape = scene_.shapes()[hit.shape];
    if (!shape.emitter) return TraceStatus::Missed;
    if (connects_to_area(last_, shape)) return TraceStatus::OtherLobe;
    result_.vertices[result_.scatter_count].hit = hit;
    result_.emitter = *shape.emitter;
    return TraceStatus::Ok;
  }

  TraceStatus see(const BlurredAreaEmitter& lamp) {
    const Shape& shape = scene_.shapes()[lamp.sharp().shape];
    if (connects_to_area(last_, shape)) return TraceStatus::OtherLobe;
    if (!lamp.shines(follower_.ray())) return TraceStatus::Missed;
    return is_clear(lamp, follower_) ? TraceStatus::Ok : TraceStatus::Occluded;
  }

  const Scene& scene_;
  const PathTopology& pattern_;
  const PathCoordinates& coordinates_;
  PathTopology& result_;
  const Vec3d& lens_;
  int next_block_;
  const Vec3d& v_;  ///< coordinate of the first ray
  RayFollower follower_;
  Lobe last_ = Lobe::Delta;  ///< of the last scattering vertex so far; a sensor connects to nothing
  std::array<Lobe, kMaxPathLength> lobes_;
};

}  // namespace

TraceStatus trace(const Scene& scene, const PathTopology& pattern,
                  const PathCoordinates& coordinates, PathTopology& result) {
  if (pattern.has_light_side()) return trace_from_both_ends(scene, pattern, coordinates, result);
  return Tracer(scene, pattern, coordinates, result).run();
}

// ---- Chart ----------------------------------------------------------------------------------

namespace {

/// A block that is a point on the lens.
void set_lens_point(const Camera& camera, Chart::Block& block) {
  block.radius = 0.0;
  block.normal = camera.forward;
  block.length = camera.lens_radius;
}

/// A block that is a point on an emitter, or on the disk across parallel light.
void set_point(const Scene& scene, const Emitter& emitter, Chart::Block& block) {
  if (const auto* parallel = std::get_if<DirectionalEmitter>(&emitter)) {
    block.radius = 0.0;
    block.normal = parallel->direction;
    block.length = scene.radius();
    return;
  }
  const Shape& shape = scene.shapes()[std::get<AreaEmitter>(emitter).shape];
  const auto* sphere = std::get_if<Sphere>(&shape.geometry);
  block.radius = sphere != nullptr ? sphere->radius : 0.0;
  block.normal = sphere != nullptr ? Vec3d((block.point - sphere->center).normalized())
                                   : emitter_normal(shape, block.point);
  block.length = shape.extent.radius;
}

}  // namespace

Chart::Chart(const Scene& scene, const PathTopology& topology, const PathCoordinates& coordinates)
    : count_(topology.block_count) {
  const int point_block = topology.point_block();
  for (int k = 0; k < count_; ++k) {
    Block& block = blocks_[static_cast<std::size_t>(k)];
    block.point = coordinates(k);
    block.normal = block.point;
    block.radius = 1.0;
    block.length = 1.0;
    if (k < topology.lens_block_count()) set_lens_point(scene.camera(), block);
    if (k == point_block) set_point(scene, scene.emitters()[topology.emitter], block);
    const TangentBasis basis = tangent_basis(block.normal);
    block.t = block.length * basis.t;
    block.b = block.length * basis.b;
  }
}

void Chart::rotate(int k, double angle) {
  Block& block = blocks_[static_cast<std::size_t>(k)];
  const Vec3d t = std::cos(angle) * block.t + std::sin(angle) * block.b;
  block.b = std::cos(angle) * block.b - std::sin(angle) * block.t;
  block.t = t;
}

PathCoordinates Chart::retract(const Vector& delta) const {
  PathCoordinates result;
  for (int k = 0; k < count_; ++k) result(k) = retract(k, delta[2 * k], delta[2 * k + 1]);
  return result;
}

/// On a sphere y = c + R m, m = x / |x|, x = R n + t d0 + b d1:  dy = R (I - m m^T) dx / |x|.
Chart Chart::displaced(const Vector& delta) const {
  Chart result = *this;
  for (int k = 0; k < count_; ++k) {
    Block& block = result.blocks_[static_cast<std::size_t>(k)];
    if (delta[2 * k] == 0.0 && delta[2 * k + 1] == 0.0) continue;
    const Vec3d step = delta[2 * k] * block.t + delta[2 * k + 1] * block.b;
    if (block.radius == 0.0) {
      block.point += step;
      continue;
    }
    const Vec3d x = block.radius * block.normal + step;
    const double length = x.norm();
    const Vec3d m = x / length;
    block.point += block.radius * (m - block.normal);
    block.normal = m;
    const double scale = block.radius / length;
    block.t = scale * (block.t - m.dot(block.t) * m);
    block.b = scale * (block.b - m.dot(block.b) * m);
  }
  return result;
}

std::optional<Chart::Inverse> Chart::inverse(const PathCoordinates& to) const {
  Inverse result;
  result.delta.resize(dimension());
  result.log_jacobian = 0;
  for (int k = 0; k < count_; ++k) {
    const Block& block = this->block(k);
    Vec3d step = to(k) - block.point;
    if (block.radius > 0.0) {
      // to - center = R n' and n' / (n.n') is the gnomonic image of n'.
      const Vec3d n = block.normal + step / block.radius;
      const double cosine = block.normal.dot(n);
      if (!(cosine > 0.0)) return std::nullopt;
      step = block.radius / cosine * n;
      result.log_jacobian -= 3.0 * std::log(cosine);
    }
    const double inverse_square = 1.0 / (block.length * block.length);
    result.log_jacobian += std::log(inverse_square);
    result.delta[2 * k] = block.t.dot(step) * inverse_square;
    result.delta[2 * k + 1] = block.b.dot(step) * inverse_square;
  }
  return result;
}

}  // namespace driftlight
