// SPDX-License-Identifier: Apache-2.0
/// Emitters of scene files.
#pragma once

#include "load_context.h"

namespace driftlight {

/// An <emitter> outside of shapes: any plugin, but area only in the newer dialect. Black ones are
/// left out.
void read_emitter(const Element& element, LoadContext& context);

/// True if a child of a shape is an <emitter>, or in the newer dialect a <ref> to one of area.
bool is_area_emitter(const Element& element, LoadContext& context);

/// Its radiance.
Texture read_area_radiance(const Element& element, LoadContext& context);

}  // namespace driftlight
