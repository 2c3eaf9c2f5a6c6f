// SPDX-License-Identifier: Apache-2.0
#include "probed_starts.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace driftlight {
namespace {

/// Starts of the first pass to be chosen.
constexpr double kStarts = 1024;

/// Steele, Lea and Flood 2014: the finalizer of SplitMix.
std::uint64_t mix(std::uint64_t x) {
  x = (x ^ (x >> 30U)) * 0xbf58476d1ce4e5b9U;
  x = (x ^ (x >> 27U)) * 0x94d049bb133111ebU;
  return x ^ (x >> 31U);
}

/// Of a path, by its brightness and where it is seen; even, and small enough that 32 times it is
/// exact in JSON.
std::uint64_t key(const Contribution& start) {
  std::uint64_t hash = 0;
  for (const double x : {start.log_target, start.film.x(), start.film.y()})
    hash = mix(hash + std::bit_cast<std::uint64_t>(x));
  return (hash >> 17U) << 1U;
}

}  // namespace

ProbedStarts::ProbedStarts(const Scene& scene, const LangevinOptions& options,
                           double mutations_of_pass, std::uint64_t seed)
    : scene_(scene),
      options_(options),
      starts_of_pass_(mutations_of_pass / options.redistribution.chain_length),
      seed_(seed) {}

void ProbedStarts::begin_pass(std::uint64_t index) {
  chance_ = kStarts / (starts_of_pass_ * static_cast<double>(index + 1));
}

std::optional<GradientProbe> ProbedStarts::probe(const Contribution& start,
                                                 double mutations) const {
  const std::uint64_t index = key(start);
  // The even streams are those of the probes.
  Rng rng(seed_, Stream::GradientCheck, index + 1);
  if (rng.uniform() >= chance_) return std::nullopt;
  const auto skip = static_cast<std::uint64_t>(rng.uniform() * mutations);
  return GradientProbe(scene_, options_.kernel, seed_, index, skip);
}

void ProbedStarts::take(const GradientProbe& probe) {
  const std::lock_guard lock(mutex_);
  paths_.insert(paths_.end(), probe.paths().begin(), probe.paths().end());
}

GradientTable ProbedStarts::table() const {
  std::vector<CheckedPath> sorted = paths_;
  std::sort(sorted.begin(), sorted.end(),
            [](const CheckedPath& a, const CheckedPath& b) { return a.index < b.index; });
  GradientTable table;
  for (std::size_t i = 0; i < sorted.size(); ++i) {
    sorted[i].index = i;
    table.add(sorted[i]);
  }
  return table;
}

}  // namespace driftlight
