// SPDX-License-Identifier: Apache-2.0
/// Emitters of scene files.
#pragma once

#include "load_context.h"

namespace driftlight {

/// An <emitter> outside of shapes: any plugin but area. Black ones are left out.
void read_emitter(const Element& element, LoadContext& context);

/// Radiance of an <emitter type="area"> inside of a shape.
Texture read_area_radiance(const Element& element, LoadContext& context);

}  // namespace driftlight
