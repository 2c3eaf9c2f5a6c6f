// SPDX-License-Identifier: Apache-2.0
/// Energy redistribution (DESIGN 1.9; after Cline, Talbot and Egbert 2005).
#pragma once

#include "driftlight/render.h"

namespace driftlight {

/// The Langevin sampler in Mode::Redistribution, in the current TBB arena. Bidirectional samples
/// put the share min(w, tau) / w of what they find on the film; what is left of that with w > tau
/// is spread by short chains that start there (remainder.h). A remainder r is worth r / epsilon
/// mutations, each of which deposits epsilon, so that all visits of all chains weigh alike; epsilon
/// follows from the mutations per sample that the options allow and from the remainders of the
/// passes before. Unbiased whatever tau, epsilon and the lengths are, without normalization and
/// without burn-in.
LangevinResult render_redistribution(const Scene& scene, const LangevinOptions& options,
                                     const RenderOptions& render, double samples_per_pixel);

}  // namespace driftlight
