// SPDX-License-Identifier: Apache-2.0
#include "mixed_chain.h"

namespace driftlight {

MixedChain::MixedChain(const Scene& scene, const LangevinOptions& options,
                       const KernelOptions& kernel, double perturbations,
                       double manifold_probability, const Remainder& remainder, StepLayers* layers)
    : scene_(scene),
      phase_space_(options.phase_space),
      remainder_(remainder),
      perturbations_(perturbations),
      steps_(scene, kernel, options.delayed_rejection, remainder, layers),
      perturbed_(scene, options.delayed_rejection, remainder, options.max_depth,
                 manifold_probability) {}

bool MixedChain::start_at(const FoundPath& path) {
  start_.reset();
  start_by_vertices_.reset();
  if (perturbations_ < 1.0) start_ = remainder_.bright_path(path, phase_space_);
  if (perturbations_ > 0.0) start_by_vertices_ = vertex_path(path);
  return rewind();
}

void MixedChain::start_at(const BrightPath& path) {
  start_ = path;
  start_by_vertices_.reset();
  rewind();
}

bool MixedChain::rewind() {
  in_steps_ = start_.has_value();
  if (in_steps_) steps_.start_at(*start_);
  in_perturbations_ = start_by_vertices_ && perturbed_.start_at(*start_by_vertices_);
  at_start_ = true;
  return in_steps_ || in_perturbations_;
}

bool MixedChain::enter_steps() {
  if (!in_steps_) {
    const auto state = remainder_.bright_path(perturbed_.current(), phase_space_);
    if (state) steps_.start_at(*state);
    in_steps_ = state.has_value();
  }
  return in_steps_;
}

bool MixedChain::enter_perturbations() {
  if (!in_perturbations_) {
    const BrightPath at = steps_.current();
    in_perturbations_ = perturbed_.start_at(vertex_path(scene_, at.topology, at.coordinates));
  }
  return in_perturbations_;
}

ChainFigures MixedChain::take_statistics() {
  ChainFigures figures = steps_.take_statistics();
  figures += perturbed_.take_statistics();
  return figures;
}

}  // namespace driftlight
