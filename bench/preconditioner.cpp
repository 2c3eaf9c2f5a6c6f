// SPDX-License-Identifier: Apache-2.0
/// Does the matrix matter? Expected squared jumps and image error of small steps with the identity,
/// over step sizes and a log-uniform mixture of them, against the constraint matrix, without and
/// with drift. Usage: bench_preconditioner [SCENE.xml]
#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <string>
#include <vector>

#include "driftlight/bootstrap.h"
#include "driftlight/chain.h"
#include "driftlight/error.h"
#include "driftlight/scene_file.h"

namespace driftlight {
namespace {

struct Row {
  std::string name;
  KernelOptions kernel;
  double acceptance = 0;
  double directions = 0;  ///< mean over mutations of sum_k |v'_k - v_k|^2
  double film = 0;        ///< mean squared jump in film coordinates
  double relmse = 0;
};

/// Small steps only, from starts in proportion to light. The jump of a rejected mutation is 0.
void measure_jumps(const Scene& scene, const PathSampler& sampler, const Bootstrap& bootstrap,
                   LangevinOptions options, Row& row) {
  constexpr int kChains = 512;
  constexpr int kMutations = 1000;
  options.large_step_probability = 0;
  Film film(16, 16);
  LangevinStatistics statistics;
  std::uint64_t index = 0;
  for (const PathSampler::Sample& start : bootstrap.resample(kChains)) {
    Chain chain(scene, sampler, options, film, start, Rng(7, Stream::Chain, index++));
    for (int i = 0; i < kMutations; ++i) {
      const PathCoordinates before = chain.state().coordinates;
      chain.run(1);
      const ChainState& after = chain.state();
      const int directions =
          after.topology.block_count - (after.topology.end == PathEnd::AreaConnection ? 1 : 0);
      for (int k = 0; k < directions; ++k)
        row.directions += (after.coordinates(k) - before(k)).squaredNorm();
      const auto film_at = [&](const Vec3d& v) {
        return scene.camera().film_position(v, scene.camera().origin);
      };
      row.film += (film_at(after.coordinates(0)) - film_at(before(0))).squaredNorm();
    }
    statistics += chain.statistics();
  }
  row.acceptance = statistics.small_step.acceptance();
  row.directions /= static_cast<double>(statistics.mutations);
  row.film /= static_cast<double>(statistics.mutations);
}

/// relMSE of images of `mutations_per_pixel`, from the spread of independent runs about `mean`.
double measure_error(const std::vector<Image>& images, const Image& mean) {
  double sum = 0;
  for (const Image& image : images) sum += difference(image, mean).relmse_trimmed;
  return sum / static_cast<double>(images.size());
}

std::vector<Row> rows() {
  std::vector<Row> result;
  const auto add = [&](std::string name, PreconditionerKind preconditioner, Drift drift,
                       double scale, double decades) {
    Row row;
    row.name = std::move(name);
    row.kernel.preconditioner = preconditioner;
    row.kernel.drift = drift;
    row.kernel.scale = scale;
    row.kernel.scale_decades = decades;
    result.push_back(row);
  };
  using enum PreconditionerKind;
  for (const Drift drift : {Drift::None, Drift::Gradient}) {
    const std::string suffix = drift == Drift::None ? "" : " + drift";
    for (const double scale : {0.001, 0.002, 0.003, 0.005, 0.008, 0.012, 0.02, 0.04, 0.1})
      add(fmt::format("identity {:.3f}{}", scale, suffix), Identity, drift, scale, 0);
    add("identity, mixture 0.0006 .. 0.06" + suffix, Identity, drift, 0.006, 2);
    for (const double scale : {0.5, 0.75, 1.0})
      add(fmt::format("constraints {:.2f}{}", scale, suffix), Constraints, drift, scale, 0);
    add("constraints, mixture 0.1 .. 1" + suffix, Constraints, drift, 0.3162, 1);
  }
  return result;
}

void run(const std::filesystem::path& file) {
  constexpr int kRuns = 6;
  constexpr double kMutationsPerPixel = 150;
  LoadOptions load;
  load.defines = {{"width", "128"}, {"height", "96"}};
  const LoadedScene loaded = load_scene(file, load);
  LangevinOptions options;
  options.mode = Mode::Chain;
  options.max_depth = loaded.max_depth.value_or(options.max_depth);
  PathSampler sampler(loaded.scene, options.max_depth);
  const Bootstrap bootstrap(sampler, loaded.scene, options.bootstrap, 1);

  // All kernels sample the same image: the mean over all runs of all rows is the reference.
  std::vector<Row> table = rows();
  std::vector<std::vector<Image>> images(table.size());
  Image mean(loaded.scene.camera().film_width, loaded.scene.camera().film_height);
  for (std::size_t r = 0; r < table.size(); ++r) {
    options.kernel = table[r].kernel;
    measure_jumps(loaded.scene, sampler, bootstrap, options, table[r]);
    for (int i = 0; i < kRuns; ++i) {
      RenderOptions render;
      render.seed = 100 * r + static_cast<std::uint64_t>(i);
      images[r].push_back(render_langevin(loaded.scene, options, render, kMutationsPerPixel).image);
      const auto weight = 1.0F / static_cast<float>(kRuns * table.size());
      for (std::size_t k = 0; k < mean.rgb.size(); ++k)
        mean.rgb[k] += weight * images[r].back().rgb[k];
    }
  }
  fmt::print("{}, {} mutations a pixel\n", file.filename().string(), kMutationsPerPixel);
  fmt::print("| kernel | acceptance | jump of directions | jump on film | relMSE |\n");
  fmt::print("| --- | ---: | ---: | ---: | ---: |\n");
  for (std::size_t r = 0; r < table.size(); ++r) {
    Row& row = table[r];
    row.relmse = measure_error(images[r], mean);
    fmt::print("| {} | {:.3f} | {:.2e} | {:.2e} | {:.3f} |\n", row.name, row.acceptance,
               row.directions, row.film, row.relmse);
  }
}

}  // namespace
}  // namespace driftlight

int main(int argc, char** argv) {
  try {
    driftlight::run(argc > 1 ? argv[1] : DRIFTLIGHT_SCENE_DIR "/glossy_chain.xml");
    return 0;
  } catch (const driftlight::InputError& error) {
    fmt::print(stderr, "error: {}\n", error.what());
    return 2;
  }
}
