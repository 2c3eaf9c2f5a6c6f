// SPDX-License-Identifier: Apache-2.0
#include "light_end.h"

#include <cmath>

#include "emission_warp.h"

namespace driftlight {
namespace {

LightEnd environment_end(const Scene& scene, std::uint32_t index, const Vec3d& direction) {
  LightEnd end;
  end.kind = LightEnd::Kind::Environment;
  end.emitter = index;
  end.p = direction;
  const Emitter& emitter = scene.emitters()[index];
  const double choice = scene.emitter_probability(index);
  if (const auto* map = std::get_if<EnvironmentMap>(&emitter)) {
    end.emitted = map->eval(direction);
    end.density = choice * map->pdf(direction);
  } else {
    end.emitted = std::get<ConstantEnvironment>(emitter).radiance;
    end.density = choice * 0.25 * kInvPi;
  }
  return end;
}

/// A point, spot or directional emitter.
LightEnd delta_end(const Scene& scene, std::uint32_t index) {
  const Emitter& emitter = scene.emitters()[index];
  LightEnd end;
  end.emitter = index;
  end.density = scene.emitter_probability(index);
  if (const auto* light = std::get_if<DirectionalEmitter>(&emitter)) {
    end.kind = LightEnd::Kind::Directional;
    end.p = -light->direction;
    end.emitted = light->irradiance;
    return end;
  }
  end.kind = LightEnd::Kind::Point;
  end.p = position_of(emitter);
  end.spot = std::get_if<SpotEmitter>(&emitter);
  end.emitted =
      end.spot != nullptr ? end.spot->intensity() : std::get<PointEmitter>(emitter).intensity;
  return end;
}

}  // namespace

LightEnd area_end(const Scene& scene, std::uint32_t index, const EmitterPoint& y) {
  const auto& light = std::get<AreaEmitter>(scene.emitters()[index]);
  LightEnd end;
  end.kind = LightEnd::Kind::Area;
  end.emitter = index;
  end.p = y.p;
  end.n = y.n;
  end.emitted = light.radiance_at(y.uv);
  end.density = scene.emitter_probability(index) / scene.shapes()[light.shape].extent.area;
  return end;
}

LightEnd sample_light_end(const Scene& scene, Rng& rng) {
  double u = rng.uniform();
  const std::uint32_t index = scene.sample_emitter(u);
  return light_end_from(scene, index, rng.uniform2());
}

LightEnd light_end_from(const Scene& scene, std::uint32_t index, const Vec2d& square) {
  const Emitter& emitter = scene.emitters()[index];
  if (is_environment(emitter))
    return environment_end(scene, index, warp_environment(emitter, square.x(), square.y()));
  if (const auto* light = std::get_if<AreaEmitter>(&emitter))
    return area_end(scene, index, scene.sample_area(*light, square.x(), square.y()));
  return delta_end(scene, index);
}

std::optional<LightEnd> light_end_at(const Scene& scene, const SurfaceHit& surface) {
  const auto& emitter = scene.shapes()[surface.hit.shape].emitter;
  if (!emitter || !surface.front) return std::nullopt;
  if (!std::holds_alternative<AreaEmitter>(scene.emitters()[*emitter])) return std::nullopt;
  return area_end(scene, *emitter, {surface.at.p, surface.at.n_g, surface.at.uv});
}

std::optional<LightEnd> light_end_toward(const Scene& scene, const Vec3d& direction) {
  if (!scene.environment()) return std::nullopt;
  return environment_end(scene, *scene.environment(), direction);
}

LightEdge edge_to(const LightEnd& end, const Vec3d& p) {
  if (end.at_infinity()) return {end.p, 1.0, 1.0, 1.0};
  const Vec3d edge = end.p - p;
  const double inverse_r2 = 1.0 / edge.squaredNorm();
  const Vec3d direction = edge * std::sqrt(inverse_r2);
  const double cosine = end.kind == LightEnd::Kind::Area ? -end.n.dot(direction) : 1.0;
  return {direction, inverse_r2, cosine, end.falloff(-direction)};
}

bool reaches(const Scene& scene, const LightEnd& end, const SurfaceHit& surface,
             const LightEdge& edge) {
  if (end.at_infinity()) return infinity_status(scene, surface, edge.direction) == TraceStatus::Ok;
  return connection_status(scene, surface, scene.emitters()[end.emitter],
                           {.p = end.p, .n = end.n}) == TraceStatus::Ok;
}

}  // namespace driftlight
