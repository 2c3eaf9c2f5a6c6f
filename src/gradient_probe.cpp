// SPDX-License-Identifier: Apache-2.0
#include "driftlight/gradient_probe.h"

#include <cmath>

#include "driftlight/contribution.h"
#include "driftlight/path_class.h"

namespace driftlight {
namespace {

/// Of one chain.
constexpr std::size_t kMostChecks = 32;
/// Of a state to be checked.
constexpr double kProbability = 1e-3;

}  // namespace

GradientProbe::GradientProbe(const Scene& scene, const KernelOptions& options, std::uint64_t seed,
                             std::uint64_t chain, std::uint64_t skip)
    : scene_(scene),
      rng_(seed, Stream::GradientCheck, chain),
      first_index_(chain * kMostChecks),
      wait_(static_cast<double>(skip)) {
  selection_.gradient = options.drift != Drift::None;
  const PreconditionerKind kind = options.preconditioner;
  selection_.constraints =
      kind == PreconditionerKind::Constraints || kind == PreconditionerKind::Diagonal;
  selection_.divergence = kind == PreconditionerKind::Constraints && options.drift == Drift::Full;
  selection_.hand = options.derivatives == DerivativeMethod::Hand;
  const DerivativeMethod method = options.derivatives;
  functions_.divergence = [method](const Scene& s, const PathTopology& t, const Chart& c) {
    return divergence(s, t, c, method);
  };
}

void GradientProbe::visit(const PathTopology& topology, const PathCoordinates& coordinates) {
  if (wait_-- > 0.0 || paths_.size() == kMostChecks) return;
  if (!carries_light(contribution(scene_, topology, coordinates).log_target)) return;
  wait_ = std::floor(std::log(rng_.uniform()) / std::log1p(-kProbability));
  CheckedPath& path = paths_.emplace_back();
  path.index = first_index_ + paths_.size() - 1;
  path.path_class = path_class(scene_, topology, coordinates);
  path.classes = classes_of(scene_, topology, coordinates);
  path.results = check_path(scene_, topology, coordinates, selection_, functions_).results;
}

}  // namespace driftlight
