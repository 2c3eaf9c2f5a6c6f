// SPDX-License-Identifier: Apache-2.0
/// The light tracer: subpaths from the light, seen by the sensor at each of their vertices.
#include <tbb/task_arena.h>

#include "driftlight/render.h"
#include "pass_loop.h"
#include "sample_film.h"
#include "sensor_connection.h"
#include "subpath.h"

namespace driftlight {
namespace {

class LightTracer {
 public:
  LightTracer(const Scene& scene, const EmissionGuide& unguided, int max_depth)
      : scene_(scene), unguided_(unguided), tracer_(scene, unguided), max_depth_(max_depth) {}

  void sample(const Vec2d& film, Rng& rng, SampleFilm::Sink& sink) {
    const Vec3d lens = sample_lens(scene_.camera(), rng);
    sink.add(directly_seen(scene_.camera().direction(film, lens), lens));
    const Emission emission = unguided_.sample(rng);
    tracer_.trace(Walk::FromLight, tracer_.leave_light(emission),
                  RayFollower(scene_, emission.origin, emission.start, emission.direction),
                  max_depth_ - 1, rng, subpath_);
    for (int i = 0; i < subpath_.size(); ++i) {
      if (!subpath_[i].connects) continue;
      if (const auto seen = connect_to_sensor(scene_, subpath_[i], lens))
        sink.splat(seen->film, seen->value);
    }
  }

 private:
  /// Radiance that emitters send along the camera ray of v from a point of the lens.
  Rgbd directly_seen(const Vec3d& v, const Vec3d& lens) const {
    RayFollower follower(scene_, v, lens);
    const Hit hit = follower.next_hit();
    const auto end = hit.valid() ? light_end_at(scene_, follower.surface(hit))
                                 : light_end_toward(scene_, follower.ray().direction);
    return end ? end->emitted : Rgbd::Zero();
  }

  const Scene& scene_;
  const EmissionGuide& unguided_;
  SubpathTracer tracer_;
  int max_depth_;
  Subpath subpath_;  ///< kept between samples for its storage only
};

}  // namespace

PathResult render_light(const Scene& scene, const LightOptions& options,
                        const RenderOptions& render, int samples_per_pixel) {
  options.validate();
  RenderClock clock(render);
  const EmissionGuide unguided(scene);
  const LightTracer tracer(scene, unguided, options.max_depth);
  SampleFilm film(scene.camera(), render.seed, 0);
  tbb::task_arena arena(render.threads > 0 ? render.threads : tbb::task_arena::automatic);
  PathResult result = arena.execute([&] {
    return run_passes(
        render, clock, samples_per_pixel, [&](std::uint64_t index) { film.pass(index, tracer); },
        [&](double passes) { return film.image(passes); });
  });
  result.non_finite = film.non_finite();
  return result;
}

}  // namespace driftlight
