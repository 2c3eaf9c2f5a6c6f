// SPDX-License-Identifier: Apache-2.0
/// The sensor of a scene file.
#pragma once

#include "load_context.h"

namespace driftlight {

/// <sensor type="perspective">, with its film.
Camera read_sensor(const Element& element, LoadContext& context);

}  // namespace driftlight
