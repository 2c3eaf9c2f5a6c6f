// SPDX-License-Identifier: Apache-2.0
#include "perturbation_chain.h"

#include <cmath>

#include "driftlight/chart_rule.h"

namespace driftlight {
namespace {

MutationLimits limits(int max_depth, double manifold_probability) {
  const PerturbationOptions steps;
  return {1, max_depth, steps.step_min, steps.step_max, manifold_probability};
}

bool passes_through(const VertexPath& x, int k) {
  const Vec3d& n = x(k).surface.at.n_g;
  return n.dot(x.toward_light(k - 1)) * n.dot(x.toward_light(k)) > 0.0;
}

/// Whether evaluated paths have the same lobes, by which they have charts (chart_rule.h), and so
/// the same LobeSequence.
bool have_same_lobes(const VertexPath& x, const VertexPath& y) {
  if (x.end.emitter != y.end.emitter) return false;
  for (int k = 1; k < x.edges; ++k)
    if (lobe_of(*x(k).surface.bsdf, x(k).delta) != lobe_of(*y(k).surface.bsdf, y(k).delta) ||
        passes_through(x, k) != passes_through(y, k))
      return false;
  return true;
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
  current_.path = path;
  if (!current_.path.evaluate(scene_)) return false;
  current_.share = remainder_.share(current_.path);
  return std::isfinite(current_.share.log_remainder);
}

double PerturbationChain::propose(const Visit& from, Visit& to, MutationStage stage, Rng& rng,
                                  Rejections& rejections) const {
  MutationDensities densities;
  const double size = stage == MutationStage::Second ? delayed_rejection_.second_scale : 1.0;
  const TraceStatus status = mutation_.perturb(from.path, to.path, densities, rng, size);
  if (!succeeded(status, rejections)) return 0.0;
  if (!have_same_lobes(from.path, to.path)) {
    ++rejections.other_lobe;
    return 0.0;
  }
  to.share = remainder_.share(to.path);
  if (!std::isfinite(to.share.log_remainder)) {
    ++rejections.hastings;
    return 0.0;
  }
  return acceptance_ratio(from.share.log_remainder, to.share.log_remainder, densities, rejections);
}

}  // namespace driftlight
