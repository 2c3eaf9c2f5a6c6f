// SPDX-License-Identifier: Apache-2.0
/// Shapes of scene files.
#pragma once

#include "load_context.h"

namespace driftlight {

/// <shape>, with its bsdf and emitter.
void read_shape(const Element& element, LoadContext& context);

}  // namespace driftlight
