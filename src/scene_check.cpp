// SPDX-License-Identifier: Apache-2.0
#include "driftlight/scene_check.h"

#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <map>

#include "driftlight/contribution.h"
#include "driftlight/error.h"
#include "driftlight/path_class.h"
#include "stopwatch.h"

namespace driftlight {
namespace {

/// To find one path that carries light.
constexpr int kAttempts = 20000;
/// Paths between two calls of `progress`.
constexpr std::uint64_t kRound = 512;
/// A class with fewer paths on which a quantity was compared is rare; as many more are looked for.
constexpr std::uint64_t kRare = 5;

bool has_light(const Scene& scene, const PathSampler::Sample& path) {
  return carries_light(contribution(scene, path.topology, path.coordinates).log_target);
}

PathSampler sampler_of(const Scene& scene, int max_depth, PhaseSpace phase_space) {
  return {scene, max_depth, LangevinOptions{}.large_steps, 1, phase_space};
}

std::optional<PathSampler::Sample> draw(const Scene& scene, const PathSampler& sampler,
                                        std::uint64_t seed, std::uint64_t index) {
  Rng rng(seed, Stream::GradientCheck, index);
  for (int i = 0; i < kAttempts; ++i) {
    auto path = sampler.sample(rng);
    if (path && has_light(scene, *path)) return path;
  }
  return std::nullopt;
}

/// The largest component that a texture of the BSDF takes.
struct Brightness {
  double operator()(const Diffuse& b) const { return b.reflectance.maximum(); }
  double operator()(const Conductor& b) const { return b.specular_reflectance.maximum(); }
  double operator()(const RoughConductor& b) const { return b.specular_reflectance.maximum(); }
  double operator()(const Dielectric& b) const { return largest(b); }
  double operator()(const RoughDielectric& b) const { return largest(b); }
  double operator()(const Phong& b) const { return glossy(b); }
  double operator()(const Ward& b) const { return glossy(b); }
  double operator()(const Plastic& b) const { return coated(b); }
  double operator()(const RoughPlastic& b) const { return coated(b); }
  double operator()(const ThinDielectric& b) const { return largest(b); }
  /// It is dark only if it is opaque and what it masks is.
  double operator()(const Mask& b) const {
    const double nested = b.nested == nullptr ? 0.0 : std::visit(*this, b.nested->bsdf);
    const bool opaque = b.opacity.is_constant() && (b.opacity.color >= 1.0).all();
    return opaque ? nested : 1.0;
  }
  double operator()(const Coating& b) const {
    return std::max(b.specular_reflectance.maximum(), std::visit(*this, b.nested->bsdf));
  }
  double operator()(const Blend& b) const {
    return std::max(std::visit(*this, b.first->bsdf), std::visit(*this, b.second->bsdf));
  }
  template <class B>
  static double glossy(const B& b) {
    return std::max(b.diffuse_reflectance.maximum(), b.specular_reflectance.maximum());
  }
  template <class B>
  static double coated(const B& b) {
    return std::max(b.base.reflectance.maximum(), b.specular_reflectance.maximum());
  }
  template <class B>
  static double largest(const B& b) {
    return std::max(b.specular_reflectance.maximum(), b.specular_transmittance.maximum());
  }
};

/// Names the parts of the scene that a path meets.
class PartsVisitor : public WalkVisitor<double> {
 public:
  PartsVisitor(const Scene& scene, std::uint32_t emitter) : scene_(scene) {
    parts_.insert(emitter_name(scene, emitter));
  }

  static std::string bsdf_name(const Scene& scene, std::size_t i) {
    return "bsdf " + std::to_string(i) + " (" + kind_of(scene.bsdfs()[i]) + ")";
  }
  static std::string emitter_name(const Scene& scene, std::size_t i) {
    const Emitter& emitter = scene.emitters()[i];
    const auto* area = std::get_if<AreaEmitter>(&emitter);
    const std::string on = area != nullptr ? " on " + kind_of(scene.shapes()[area->shape]) : "";
    return "emitter " + std::to_string(i) + " (" + kind_of(emitter) + on + ")";
  }
  static std::string shape_name(const Shape& shape) {
    return "shapes of the kind " + kind_of(shape);
  }

  void position(const Shape& shape, const Vec3d&) { parts_.insert(shape_name(shape)); }
  void scatter(const ScatterEvent<double>& e) { add(e); }
  void connect(const ScatterEvent<double>& e) { add(e); }
  void delta(const ScatterEvent<double>& e) { add(e); }
  void light_scatter(const ScatterEvent<double>& e) { add(e); }
  void light_delta(const ScatterEvent<double>& e) { add(e); }
  void light_connect(const ScatterEvent<double>& e) { add(e); }

  const std::set<std::string>& parts() const { return parts_; }

 private:
  void add(const ScatterEvent<double>& e) {
    parts_.insert(bsdf_name(scene_, static_cast<std::size_t>(&e.bsdf - scene_.bsdfs().data())));
  }

  const Scene& scene_;
  std::set<std::string> parts_;
};

std::set<std::string> parts_of(const Scene& scene, const PathSampler::Sample& path) {
  PartsVisitor visitor(scene, path.topology.emitter);
  walk<double>(scene, path.topology, path.coordinates, visitor);
  return visitor.parts();
}

std::set<std::string> parts_of(const Scene& scene) {
  std::set<std::string> parts;
  for (std::size_t i = 0; i < scene.bsdfs().size(); ++i)
    if (std::visit(Brightness{}, scene.bsdfs()[i]) > 0.0)
      parts.insert(PartsVisitor::bsdf_name(scene, i));
  for (std::size_t i = 0; i < scene.emitters().size(); ++i)
    parts.insert(PartsVisitor::emitter_name(scene, i));
  for (const Shape& shape : scene.shapes()) parts.insert(PartsVisitor::shape_name(shape));
  return parts;
}

/// A drawn path; checked or not.
struct Drawn {
  bool found = false;
  PathSampler::Sample sample;
  std::set<std::string> parts;
  CheckedPath path;
};

class SceneChecker {
 public:
  SceneChecker(const Scene& scene, const SceneCheckOptions& options,
               const DerivativeFunctions& functions)
      : scene_(scene),
        options_(options),
        functions_(functions),
        sampler_(sampler_of(scene, options.max_depth, options.phase_space)),
        missing_(parts_of(scene)) {}

  SceneCheck run() {
    const auto count = static_cast<std::uint64_t>(options_.paths);
    const std::uint64_t first = std::min<std::uint64_t>(count, kRound);
    check(0, first);
    if (result_.table.all().paths() == 0)
      throw InputError("no path from the sensor to an emitter carries light (" +
                       std::to_string(first * kAttempts) + " samples tried)");
    for (std::uint64_t begin = first; begin < count; begin += kRound)
      check(begin, std::min(count, begin + kRound));
    for (std::uint64_t begin = count; begin < 2 * count && has_wishes(); begin += kRound)
      check_wanted(begin, std::min(2 * count, begin + kRound));
    result_.not_reached.assign(missing_.begin(), missing_.end());
    return std::move(result_);
  }

 private:
  void check(std::uint64_t begin, std::uint64_t end) {
    std::vector<Drawn> paths = draw_paths(begin, end);
    check(paths);
    for (const Drawn& path : paths) add(path);
    report(end);
  }

  void check_wanted(std::uint64_t begin, std::uint64_t end) {
    std::vector<Drawn> paths = draw_paths(begin, end);
    std::map<std::string, std::uint64_t> taken;
    const auto unwanted = [&](const Drawn& path) { return !path.found || !is_wanted(path, taken); };
    paths.erase(std::remove_if(paths.begin(), paths.end(), unwanted), paths.end());
    check(paths);
    for (const Drawn& path : paths) add(path);
    report(end);
  }

  /// Draws and names the paths, and counts those that are not found.
  std::vector<Drawn> draw_paths(std::uint64_t begin, std::uint64_t end) {
    std::vector<Drawn> paths(end - begin);
    tbb::parallel_for(begin, end, [&](std::uint64_t index) {
      const auto sample = draw(scene_, sampler_, options_.seed, index);
      if (!sample) return;
      Drawn& path = paths[index - begin];
      path.found = true;
      path.sample = *sample;
      path.parts = parts_of(scene_, *sample);
      path.path.index = index;
      path.path.path_class = path_class(scene_, sample->topology, sample->coordinates);
      path.path.classes = classes_of(scene_, sample->topology, sample->coordinates);
    });
    return paths;
  }

  void check(std::vector<Drawn>& paths) const {
    tbb::parallel_for(std::size_t{0}, paths.size(), [&](std::size_t i) {
      Drawn& path = paths[i];
      if (path.found)
        path.path.results =
            check_path(scene_, path.sample.topology, path.sample.coordinates, {}, functions_)
                .results;
    });
  }

  void add(const Drawn& path) {
    if (!path.found) {
      ++result_.not_found;
      return;
    }
    result_.table.add(path.path);
    for (const std::string& part : path.parts) missing_.erase(part);
  }

  std::uint64_t times_compared(const std::string& feature) const {
    const auto found = result_.table.features().find(feature);
    if (found == result_.table.features().end()) return 0;
    std::uint64_t least = found->second.paths();
    for (const Quantity quantity : kQuantities)
      least = std::min(least, found->second.compared_paths(quantity));
    return least;
  }
  bool has_wishes() const {
    const auto& features = result_.table.features();
    return !missing_.empty() ||
           std::any_of(features.begin(), features.end(),
                       [&](const auto& entry) { return times_compared(entry.first) < kRare; });
  }
  /// `taken` counts what this round has for each wish.
  bool is_wanted(const Drawn& path, std::map<std::string, std::uint64_t>& taken) const {
    bool wanted = false;
    for (const std::string& part : path.parts)
      if (missing_.count(part) > 0) wanted = ++taken[part] <= kRare || wanted;
    for (const std::string& feature : path.path.classes)
      if (times_compared(feature) < kRare) wanted = ++taken[feature] <= kRare || wanted;
    return wanted;
  }

  void report(std::uint64_t done) {
    const double fraction = static_cast<double>(done) / static_cast<double>(options_.paths);
    if (options_.progress) options_.progress({std::min(1.0, fraction), watch_.seconds()});
  }

  const Scene& scene_;
  const SceneCheckOptions& options_;
  const DerivativeFunctions& functions_;
  PathSampler sampler_;
  std::set<std::string> missing_;
  SceneCheck result_;
  Stopwatch watch_;
};

}  // namespace

SceneCheck check_scene(const Scene& scene, const SceneCheckOptions& options,
                       const DerivativeFunctions& functions) {
  SceneCheck result;
  tbb::task_arena arena(options.threads > 0 ? options.threads : tbb::task_arena::automatic);
  arena.execute([&] { result = SceneChecker(scene, options, functions).run(); });
  return result;
}

std::optional<PathSampler::Sample> draw_light_path(const Scene& scene, int max_depth,
                                                   std::uint64_t seed, std::uint64_t index,
                                                   PhaseSpace phase_space) {
  return draw(scene, sampler_of(scene, max_depth, phase_space), seed, index);
}

}  // namespace driftlight
