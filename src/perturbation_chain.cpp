// SPDX-License-Identifier: Apache-2.0
#include "perturbation_chain.h"

#include <cmath>

namespace driftlight {
namespace {

MutationLimits limits(int max_depth) {
  const PerturbationOptions steps;
  return {1, max_depth, steps.step_min, steps.step_max};
}

}  // namespace

PerturbationChain::PerturbationChain(const Scene& scene, const Remainder& remainder, int max_depth)
    : scene_(scene), remainder_(remainder), mutation_(scene, limits(max_depth)) {}

bool PerturbationChain::start_at(const FoundPath& path) {
  start_.path = vertex_path(path);
  if (!start_.path.evaluate(scene_)) return false;
  start_.share = remainder_.share(start_.path);
  return std::isfinite(start_.share.log_remainder);
}

double PerturbationChain::propose(const Visit& from, Visit& to, Rng& rng) {
  ++figures_.small_step.proposed;
  MutationDensities densities;
  const TraceStatus status = mutation_.perturb(from.path, to.path, densities, rng);
  if (!succeeded(status, figures_.rejections)) return 0.0;
  to.share = remainder_.share(to.path);
  if (!std::isfinite(to.share.log_remainder)) {
    ++figures_.rejections.hastings;
    return 0.0;
  }
  const double acceptance = acceptance_of(from.share.log_remainder, to.share.log_remainder,
                                          densities, figures_.rejections);
  figures_.small_step.accepted += acceptance;
  return acceptance;
}

}  // namespace driftlight
