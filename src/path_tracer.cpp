// SPDX-License-Identifier: Apache-2.0
#include "path_tracer.h"

#include <tbb/blocked_range2d.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "ray_follower.h"

namespace driftlight {
namespace {

class Estimator {
 public:
  Estimator(const Scene& scene, int max_depth) : scene_(scene), max_depth_(max_depth) {}

  Rgbd radiance(const Vec2d& film, Rng& rng) const {
    const Camera& camera = scene_.camera();
    const Vec3d lens = sample_lens(camera, rng);
    RayFollower follower(scene_, camera.direction(film, lens), lens);
    Rgbd result = Rgbd::Zero();
    Rgbd throughput = Rgbd::Ones();
    LastBounce last;
    for (int depth = 1;; ++depth) {
      const Hit hit = follower.next_hit();
      if (!hit.valid()) return result + throughput * environment(follower.ray().direction, last);
      const SurfaceHit surface = follower.surface(hit);
      result += throughput * emission(surface, last);
      if (depth == max_depth_ || surface.bsdf == nullptr) return result;
      if (!is_delta(*surface.bsdf)) result += throughput * direct_light(surface, rng);

      const auto next = sample(*surface.bsdf, surface.surface(), surface.wi, rng.uniform3());
      if (!next || !passes(surface.at, surface.wi, next->wo)) return result;
      throughput *= weight(surface, *next, last);
      last.p = surface.at.p;
      if (depth >= kRouletteDepth) {
        const double survival = std::min(0.95, throughput.maxCoeff());
        if (!(rng.uniform() < survival)) return result;
        throughput /= survival;
      }
      follower.leave(surface, next->wo);
    }
  }

 private:
  static constexpr int kRouletteDepth = 6;

  /// The scattering that the current ray comes from. `pdf` is per solid angle; a delta bounce or
  /// the sensor cannot be found by emitter sampling.
  struct LastBounce {
    Vec3d p = Vec3d::Zero();
    double pdf = 0;
    bool delta = true;
  };

  static double balance(double pdf, double other) { return pdf / (pdf + other); }

  static Rgbd color_of(const ScaledColor<double>& f) { return std::exp(f.log_scale) * f.color; }

  /// f |cos| / pdf of a BSDF sample.
  static Rgbd weight(const SurfaceHit& at, const BsdfSample& next, LastBounce& last) {
    const Bsdf& bsdf = *at.bsdf;
    last.delta = next.delta;
    if (last.delta) {
      last.pdf = delta_probability(bsdf, at.surface(), at.wi, next.scattering);
      return color_of(eval_delta(bsdf, at.surface(), at.wi, next.scattering)) / last.pdf;
    }
    last.pdf = pdf(bsdf, at.surface(), at.wi, next.wo);
    if (!(last.pdf > 0.0)) return Rgbd::Zero();
    return color_of(eval(bsdf, at.surface(), at.wi, next.wo)) / last.pdf;
  }

  Rgbd environment_radiance(const Vec3d& d) const {
    const Emitter& emitter = scene_.emitters()[*scene_.environment()];
    if (const auto* map = std::get_if<EnvironmentMap>(&emitter)) return map->eval(d);
    return std::get<ConstantEnvironment>(emitter).radiance;
  }
  double environment_pdf(const Vec3d& d) const {
    const std::uint32_t index = *scene_.environment();
    const auto* map = std::get_if<EnvironmentMap>(&scene_.emitters()[index]);
    return scene_.emitter_probability(index) * (map != nullptr ? map->pdf(d) : 0.25 * kInvPi);
  }

  Rgbd environment(const Vec3d& d, const LastBounce& last) const {
    if (!scene_.environment()) return Rgbd::Zero();
    const double w = last.delta ? 1.0 : balance(last.pdf, environment_pdf(d));
    return w * environment_radiance(d);
  }

  Rgbd emission(const SurfaceHit& at, const LastBounce& last) const {
    const Shape& shape = scene_.shapes()[at.hit.shape];
    if (!shape.emitter) return Rgbd::Zero();
    if (!at.front) return Rgbd::Zero();
    const auto& light = std::get<AreaEmitter>(scene_.emitters()[*shape.emitter]);
    const double cosine = at.at.n_g.dot(at.wi);
    const Rgbd radiance = light.radiance_at(at.at.uv);
    if (last.delta) return radiance;
    const double r2 = (at.at.p - last.p).squaredNorm();
    const double other =
        scene_.emitter_probability(*shape.emitter) / shape.extent.area * r2 / cosine;
    return balance(last.pdf, other) * radiance;
  }

  /// Next-event estimation with one emitter sample.
  Rgbd direct_light(const SurfaceHit& at, Rng& rng) const {
    double u = rng.uniform();
    const std::uint32_t index = scene_.sample_emitter(u);
    const double choice = scene_.emitter_probability(index);
    const Vec2d square = rng.uniform2();
    const Emitter& emitter = scene_.emitters()[index];
    if (is_environment(emitter)) return direct_environment(at, emitter, square);
    if (const auto* parallel = std::get_if<DirectionalEmitter>(&emitter))
      return direct_parallel(at, *parallel) / choice;
    EmitterPoint y;
    const auto* light = std::get_if<AreaEmitter>(&emitter);
    if (light != nullptr)
      y = scene_.sample_area(*light, square.x(), square.y());
    else
      y.p = position_of(emitter);
    const Vec3d edge = y.p - at.at.p;
    const double r2 = edge.squaredNorm();
    const Vec3d wo = edge / std::sqrt(r2);
    if (!passes(at.at, at.wi, wo)) return Rgbd::Zero();
    const Rgbd f = color_of(eval(*at.bsdf, at.surface(), at.wi, wo));
    if (!(f.maxCoeff() > 0.0)) return Rgbd::Zero();
    if (connection_status(scene_, at, emitter, y) != TraceStatus::Ok) return Rgbd::Zero();
    if (light == nullptr) return f * intensity(emitter, -wo) / (r2 * choice);
    const double cosine = -y.n.dot(wo);
    const double density =
        choice / scene_.shapes()[light->shape].extent.area * r2 / cosine;  // per solid angle
    const double w = balance(density, pdf(*at.bsdf, at.surface(), at.wi, wo));
    return w / density * f * light->radiance_at(y.uv);
  }

  /// Of a point or spot emitter along the unit direction v.
  static Rgbd intensity(const Emitter& emitter, const Vec3d& v) {
    const auto* spot = std::get_if<SpotEmitter>(&emitter);
    if (spot != nullptr) return spot->intensity() * spot->falloff(v);
    return std::get<PointEmitter>(emitter).intensity;
  }

  Rgbd direct_parallel(const SurfaceHit& at, const DirectionalEmitter& emitter) const {
    const Vec3d wo = -emitter.direction;
    if (!passes(at.at, at.wi, wo)) return Rgbd::Zero();
    const Rgbd f = color_of(eval(*at.bsdf, at.surface(), at.wi, wo));
    if (!(f.maxCoeff() > 0.0)) return Rgbd::Zero();
    if (infinity_status(scene_, at, wo) != TraceStatus::Ok) return Rgbd::Zero();
    return f * emitter.irradiance;
  }

  Rgbd direct_environment(const SurfaceHit& at, const Emitter& emitter, const Vec2d& u) const {
    const auto* map = std::get_if<EnvironmentMap>(&emitter);
    const Vec3d wo = map != nullptr ? map->sample(u.x(), u.y()) : square_to_sphere(u.x(), u.y());
    if (!passes(at.at, at.wi, wo)) return Rgbd::Zero();
    const Rgbd f = color_of(eval(*at.bsdf, at.surface(), at.wi, wo));
    if (!(f.maxCoeff() > 0.0)) return Rgbd::Zero();
    if (scene_.occluded_to_infinity(scene_.leave(at.at.p, at.at.n_g, wo), wo)) return Rgbd::Zero();
    const double density = environment_pdf(wo);
    if (!(density > 0.0)) return Rgbd::Zero();
    const double w = balance(density, pdf(*at.bsdf, at.surface(), at.wi, wo));
    return w / density * f * environment_radiance(wo);
  }

  const Scene& scene_;
  int max_depth_;
};

}  // namespace

Rgbd PathTracer::radiance(const Vec2d& film, Rng& rng) const {
  return Estimator(scene_, max_depth_).radiance(film, rng);
}

PixelSums::PixelSums(const Scene& scene, int max_depth, std::uint64_t seed)
    : camera_(scene.camera()),
      weights_(camera_.filter, camera_.film_width, camera_.film_height),
      tracer_(scene, max_depth),
      seed_(seed),
      sums_(static_cast<std::size_t>(camera_.film_width) *
                static_cast<std::size_t>(camera_.film_height),
            Rgbd::Zero()),
      samples_(weights_.is_pixel() ? 0 : sums_.size()) {}

void PixelSums::pass(std::uint64_t index) {
  const auto range =
      tbb::blocked_range2d<int>(0, camera_.film_height, 8, 0, camera_.film_width, 32);
  tbb::parallel_for(range, [&](const auto& tile) {
    for (int y = tile.rows().begin(); y < tile.rows().end(); ++y)
      for (int x = tile.cols().begin(); x < tile.cols().end(); ++x) add(x, y, index);
  });
  if (!samples_.empty()) spread_samples();
}

void PixelSums::spread_samples() {
  for (const Sample& sample : samples_)
    weights_.spread(sample.film, [&](std::size_t pixel, double weight) {
      sums_[pixel] += weight * sample.value;
    });
}

Image PixelSums::image(std::uint64_t passes) const {
  Image result(camera_.film_width, camera_.film_height);
  const double scale = passes > 0 ? 1.0 / static_cast<double>(passes) : 0.0;
  for (std::size_t i = 0; i < sums_.size(); ++i)
    for (int c = 0; c < 3; ++c)
      result.rgb[3 * i + static_cast<std::size_t>(c)] = static_cast<float>(sums_[i][c] * scale);
  return result;
}

void PixelSums::add(int x, int y, std::uint64_t index) {
  const std::size_t pixel =
      static_cast<std::size_t>(y) * static_cast<std::size_t>(camera_.film_width) +
      static_cast<std::size_t>(x);
  Rng rng(seed_, Stream::Pixel, index * sums_.size() + pixel);
  const Vec2d jitter = rng.uniform2();
  const Vec2d film{(x + jitter.x()) / camera_.film_width, (y + jitter.y()) / camera_.film_height};
  const Rgbd sample = tracer_.radiance(film, rng);
  const bool finite = sample.allFinite();
  if (!finite) ++non_finite_;
  if (!samples_.empty())
    samples_[pixel] = {film, finite ? sample : Rgbd(Rgbd::Zero())};
  else if (finite)
    sums_[pixel] += sample;
}

}  // namespace driftlight
