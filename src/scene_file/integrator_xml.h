// SPDX-License-Identifier: Apache-2.0
/// What counts of the integrator of a scene file.
#pragma once

#include <optional>

#include "load_context.h"

namespace driftlight {

/// The depth of an <integrator> or of one in it: none if it gives none; in it the longest path in
/// edges, or nothing if that is not bounded. Throws SceneError.
std::optional<std::optional<int>> read_integrator(const Element& element, LoadContext& context);

/// An <integer> that is a depth. Mitsuba counts edges, as we do; -1 is without bound: nothing.
std::optional<int> read_max_depth(const Element& element);

}  // namespace driftlight
