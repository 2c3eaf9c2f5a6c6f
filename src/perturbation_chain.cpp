// SPDX-License-Identifier: Apache-2.0
#include "perturbation_chain.h"

#include <cmath>

namespace driftlight {
namespace {

MutationLimits limits(int max_depth, double manifold_probability) {
  const PerturbationOptions steps;
  return {1, max_depth, steps.step_min, steps.step_max, manifold_probability};
}

}  // namespace

PerturbationChain::PerturbationChain(const Scene& scene, const DelayedRejection& delayed_rejection,
                                     const Remainder& remainder, int max_depth,
                                     double manifold_probability)
    : scene_(scene),
      delayed_rejection_(delayed_rejection),
      remainder_(remainder),
      mutation_(scene, limits(max_depth, manifold_probability)) {}

bool PerturbationChain::start_at(const VertexPath& path) {
  start_.path = path;
  if (!start_.path.evaluate(scene_)) return false;
  start_.share = remainder_.share(start_.path);
  return std::isfinite(start_.share.log_remainder);
}

double PerturbationChain::propose(const Visit& from, Visit& to, MutationStage stage, Rng& rng,
                                  Rejections& rejections) const {
  MutationDensities densities;
  const double size = stage == MutationStage::Second ? delayed_rejection_.second_scale : 1.0;
  const TraceStatus status = mutation_.perturb(from.path, to.path, densities, rng, size);
  if (!succeeded(status, rejections)) return 0.0;
  to.share = remainder_.share(to.path);
  if (!std::isfinite(to.share.log_remainder)) {
    ++rejections.hastings;
    return 0.0;
  }
  return acceptance_ratio(from.share.log_remainder, to.share.log_remainder, densities, rejections);
}

}  // namespace driftlight
