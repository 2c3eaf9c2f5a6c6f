// SPDX-License-Identifier: Apache-2.0
/// What the parts of a mutation cost, by path length, on glossy_chain and cornell_glossy: trace,
/// value, gradient, gradient with Q, factorisation, and whole small steps with the identity and
/// with constraints and drift. Compare rows of one run only: machines are shared and noisy.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "driftlight/bootstrap.h"
#include "driftlight/chain.h"
#include "driftlight/scene_file.h"

namespace driftlight {
namespace {

constexpr int kMaxLength = 8;
constexpr std::size_t kStates = 256;

/// A scene with light-carrying paths of each length, drawn in proportion to their light.
struct Workload {
  LoadedScene loaded;
  PathSampler sampler;
  std::map<int, std::vector<ChainState>> by_length;

  explicit Workload(const std::string& name)
      : loaded(load_scene(std::filesystem::path(DRIFTLIGHT_SCENE_DIR) / (name + ".xml"))),
        sampler(loaded.scene, kMaxLength) {
    const Bootstrap bootstrap(sampler, loaded.scene, 400000, 1);
    for (const PathSampler::Sample& sample : bootstrap.resample(20000)) {
      auto& states = by_length[sample.topology.length()];
      if (states.size() == kStates) continue;
      ChainState state;
      state.topology = sample.topology;
      state.coordinates = sample.coordinates;
      state.contribution = contribution(loaded.scene, state.topology, state.coordinates);
      prepare_step(loaded.scene, KernelOptions{}, state);
      states.push_back(state);
    }
  }
};

const Workload& workload(const std::string& name) {
  static std::map<std::string, Workload> all;
  return all.try_emplace(name, name).first->second;
}

/// Runs part(scene, state) over the states of one length.
template <class Part>
void over_states(benchmark::State& bench, const std::string& scene, const Part& part) {
  const Workload& work = workload(scene);
  const auto found = work.by_length.find(static_cast<int>(bench.range(0)));
  if (found == work.by_length.end()) {
    bench.SkipWithError("no such paths");
    return;
  }
  std::size_t i = 0;
  for (auto _ : bench) {
    part(work.loaded.scene, found->second[i]);
    i = (i + 1) % found->second.size();
  }
}

void trace_path(benchmark::State& bench, const std::string& name) {
  PathTopology result;
  over_states(bench, name, [&](const Scene& scene, const ChainState& state) {
    benchmark::DoNotOptimize(trace(scene, state.topology, state.coordinates, result));
  });
}

void value_of_path(benchmark::State& bench, const std::string& name) {
  over_states(bench, name, [&](const Scene& scene, const ChainState& state) {
    benchmark::DoNotOptimize(contribution(scene, state.topology, state.coordinates));
  });
}

void derivatives(benchmark::State& bench, const std::string& name,
                 const DerivativeRequest& request) {
  Linearization result;
  over_states(bench, name, [&](const Scene& scene, const ChainState& state) {
    linearize(scene, state.topology, state.chart, KernelOptions{}.derivatives, request, result);
    benchmark::DoNotOptimize(&result);
    benchmark::ClobberMemory();
  });
}

void factorisation(benchmark::State& bench, const std::string& name) {
  std::map<const ChainState*, Linearization> known;
  StepDistribution step;
  over_states(bench, name, [&](const Scene& scene, const ChainState& state) {
    Linearization& path = known[&state];
    if (path.stage_count == 0)
      linearize(scene, state.topology, state.chart, KernelOptions{}.derivatives, {}, path);
    const int dimension = state.chart.dimension();
    benchmark::DoNotOptimize(
        StepDistribution(KernelOptions{}, dimension, RiccatiFactor(path), &path.gradient, nullptr));
  });
}

/// Whole chains, small steps only; path lengths as they come.
void mutations(benchmark::State& bench, const std::string& name, const KernelOptions& kernel) {
  const Workload& work = workload(name);
  LangevinOptions options;
  options.kernel = kernel;
  options.large_step_probability = 0;
  options.max_depth = kMaxLength;
  Film film(256, 256);
  PathSampler sampler(work.loaded.scene, kMaxLength);
  const Bootstrap bootstrap(sampler, work.loaded.scene, 200000, 2);
  std::vector<Chain> chains;
  for (const PathSampler::Sample& start : bootstrap.resample(64))
    chains.emplace_back(work.loaded.scene, sampler, options, film, start,
                        Rng(3, Stream::Chain, chains.size()));
  std::size_t i = 0;
  for (auto _ : bench) {
    chains[i].run(100);
    i = (i + 1) % chains.size();
  }
  bench.SetItemsProcessed(static_cast<std::int64_t>(bench.iterations()) * 100);
  LangevinStatistics statistics;
  for (const Chain& chain : chains) statistics += chain.statistics();
  bench.counters["acceptance"] = statistics.small_step.acceptance();
}

KernelOptions kernel(PreconditionerKind preconditioner, Drift drift, double scale) {
  KernelOptions options;
  options.preconditioner = preconditioner;
  options.drift = drift;
  options.scale = scale;
  options.scale_decades = 0;
  return options;
}

void register_all() {
  for (const std::string scene : {"cornell_glossy", "glossy_chain"}) {
    const auto by_length = [&](const std::string& part, auto function) {
      benchmark::RegisterBenchmark((scene + "/" + part).c_str(), function)
          ->DenseRange(2, kMaxLength);
    };
    by_length("trace", [scene](auto& b) { trace_path(b, scene); });
    by_length("value", [scene](auto& b) { value_of_path(b, scene); });
    by_length("gradient", [scene](auto& b) { derivatives(b, scene, {true, false}); });
    by_length("q", [scene](auto& b) { derivatives(b, scene, {false, true}); });
    by_length("gradient+q", [scene](auto& b) { derivatives(b, scene, {true, true}); });
    by_length("factorisation", [scene](auto& b) { factorisation(b, scene); });
    const auto whole = [&](const std::string& part, const KernelOptions& options) {
      benchmark::RegisterBenchmark((scene + "/mutation/" + part).c_str(),
                                   [=](auto& b) { mutations(b, scene, options); });
    };
    // Step sizes at which about a quarter to a third of the mutations are accepted.
    const double isotropic = scene == "glossy_chain" ? 0.006 : 0.04;
    using enum PreconditionerKind;
    whole("identity", kernel(Identity, Drift::None, isotropic));
    whole("identity+gradient", kernel(Identity, Drift::Gradient, isotropic));
    whole("constraints", kernel(Constraints, Drift::None, 1.0));
    whole("constraints+gradient", kernel(Constraints, Drift::Gradient, 1.0));
    whole("constraints+gradient+divergence", kernel(Constraints, Drift::Full, 1.0));
  }
}

}  // namespace
}  // namespace driftlight

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 2;
  driftlight::register_all();
  benchmark::RunSpecifiedBenchmarks();
  return 0;
}
