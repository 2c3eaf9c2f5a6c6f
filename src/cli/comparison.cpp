// SPDX-License-Identifier: Apache-2.0
#include "cli/comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "driftlight/error.h"
#include "run_figures.h"
#include "stopwatch.h"

namespace driftlight::cli {

namespace {

/// The earliest moment is after about so many seconds.
constexpr double kFirstMoment = 0.75;
constexpr int kFewestHalvings = 3;

/// Sorts the snapshots of a run.
class RunRecorder {
 public:
  RunRecorder(const std::vector<double>& moments, Run& run) : moments_(moments), run_(run) {}

  /// The moments and the ends of all parts.
  std::vector<double> fractions() const {
    std::vector<double> all = moments_;
    for (int i = 1; i <= kParts; ++i) all.push_back(static_cast<double>(i) / kParts);
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    return all;
  }

  void take(Snapshot snapshot) {
    const double parts = snapshot.fraction * kParts;
    if (parts == static_cast<double>(run_.parts.size() + 1)) add_part(snapshot);
    if (std::find(moments_.begin(), moments_.end(), snapshot.fraction) != moments_.end())
      run_.snapshots.push_back(std::move(snapshot));
  }

  /// After the last snapshot.
  void finish() {
    if (run_.parts.size() != kParts) run_.parts.clear();
  }

 private:
  /// The mean since the last part: images are means over the work so far.
  void add_part(const Snapshot& snapshot) {
    std::vector<double> sums = tile_luminances(snapshot.image);
    for (double& sum : sums) sum *= snapshot.work;
    std::vector<double> part = sums;
    if (!sums_.empty())
      for (std::size_t i = 0; i < part.size(); ++i) part[i] -= sums_[i];
    for (double& mean : part) mean /= snapshot.work - work_;
    run_.parts.push_back(std::move(part));
    sums_ = std::move(sums);
    work_ = snapshot.work;
  }

  const std::vector<double>& moments_;
  Run& run_;
  std::vector<double> sums_;  ///< tile luminances times work, at the end of the last part
  double work_ = 0;
};

RenderOptions options_of_run(const CompareCommand& command, const Work& work,
                             const std::atomic<bool>& stop, std::uint64_t seed) {
  RenderOptions how;
  how.threads = command.threads;
  how.seed = seed;
  how.time = work.time;
  how.stop = &stop;
  return how;
}

/// False if it was stopped.
bool render_run(const Scene& scene, const Work& work, const std::vector<double>& moments,
                RenderOptions how, Contender& contender) {
  Run run{.seed = how.seed, .snapshots = {}, .parts = {}, .statistics = {}, .metadata = {}};
  RunRecorder recorder(moments, run);
  how.snapshot_at = recorder.fractions();
  how.snapshot = [&](Snapshot snapshot) { recorder.take(std::move(snapshot)); };
  Rendered rendered = render_with(scene, contender.options, how, work);
  if (rendered.report.stopped) return false;
  recorder.finish();
  run.statistics = std::move(rendered.report.statistics);
  run.metadata = std::move(rendered.report.metadata);
  contender.runs.push_back(std::move(run));
  return true;
}

void check_work(const Contender& contender, const Work& work) {
  if (work.time) return;
  const bool mutations = counts_mutations(contender.options);
  const bool given =
      mutations ? work.mutations_per_pixel.has_value() : work.samples_per_pixel.has_value();
  if (!given)
    throw UsageError(fmt::format("{} takes {}, or all take --time", contender.choice.name,
                                 mutations ? "--mutations-per-pixel" : "--spp"));
}

}  // namespace

std::vector<Contender> contenders_of(const std::vector<IntegratorChoice>& choices,
                                     const Work& work) {
  std::vector<Contender> contenders;
  for (const IntegratorChoice& choice : choices) {
    Contender contender{choice, options_of(choice.integrator), {}};
    apply(choice.settings, contender.options);
    check_work(contender, work);
    contenders.push_back(std::move(contender));
  }
  const auto uses = [&](bool mutations) {
    return std::any_of(contenders.begin(), contenders.end(), [&](const Contender& contender) {
      return counts_mutations(contender.options) == mutations;
    });
  };
  if (work.mutations_per_pixel && !uses(true))
    throw UsageError("--mutations-per-pixel: none of the integrators is langevin with mode=chain");
  if (work.samples_per_pixel && !uses(false))
    throw UsageError("--spp: all of the integrators take --mutations-per-pixel");
  return contenders;
}

std::vector<double> moments_of(const Work& work) {
  std::vector<double> moments{1.0};
  const auto early = [&] { return !work.time || *work.time * moments.back() < 2 * kFirstMoment; };
  for (int halvings = 0; halvings < kFewestHalvings || !early(); ++halvings)
    moments.push_back(0.5 * moments.back());
  std::reverse(moments.begin(), moments.end());
  return moments;
}

void render_runs(const Scene& scene, const CompareCommand& command, const Work& work,
                 const std::atomic<bool>& stop,
                 const std::function<void(const Progress&)>& progress,
                 std::vector<Contender>& contenders) {
  const Stopwatch watch;
  const std::vector<double> moments = moments_of(work);
  const auto rounds = static_cast<std::size_t>(command.runs);
  const double total = static_cast<double>(rounds * contenders.size());
  std::size_t done = 0;
  const auto round_is_complete = [&] {
    for (Contender& contender : contenders) {
      RenderOptions how = options_of_run(command, work, stop, command.seed + done);
      how.progress = [&](const Progress& of_run) {
        progress({(static_cast<double>(done) + of_run.fraction) / total, watch.seconds()});
      };
      if (stop.load() || !render_run(scene, work, moments, how, contender)) return false;
      ++done;
    }
    return true;
  };
  std::size_t complete = 0;
  while (complete < rounds && round_is_complete()) ++complete;
  if (complete < 2)
    throw StoppedTooEarly(
        "stopped before there were two runs of each integrator; nothing is written");
  for (Contender& contender : contenders) contender.runs.resize(complete);
}

}  // namespace driftlight::cli
