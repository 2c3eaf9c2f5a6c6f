// SPDX-License-Identifier: Apache-2.0
/// BSDFs of scene files.
#pragma once

#include <memory>

#include "load_context.h"

namespace driftlight {

/// <bsdf>, or a <ref> to one.
std::shared_ptr<Surface> read_surface(const Element& element, LoadContext& context);

/// The material of the surface, added to the scene when it is first needed.
std::uint32_t material_index(Surface& surface, LoadContext& context);

/// True if some BSDF of the surface has a texture that is not one colour.
bool is_textured(const Surface& surface);
/// False if some BSDF of the surface looks at the tangent.
bool is_isotropic(const Surface& surface);

}  // namespace driftlight
