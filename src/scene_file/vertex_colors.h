// SPDX-License-Identifier: Apache-2.0
/// Colours of the vertices of meshes, as textures.
#pragma once

#include <vector>

#include "load_context.h"

namespace driftlight {

/// Stands for the colours of whatever mesh it comes to lie on, until it is `painted`.
Texture vertex_color_texture();
bool is_vertex_colors(const Texture& texture);
/// True if some texture of the surface's BSDFs is.
bool looks_at_vertex_colors(const Surface& surface);

/// The surface with the colours (linear, one for each vertex) as a bitmap, of which every triangle
/// has four texels: on the patch between them a bilinear function is as linear as colours over a
/// triangle. The mesh gets three vertices of its own for each triangle, and their places on the
/// bitmap as texture coordinates, so nothing else may need these: throws InputError if the surface
/// has another texture, a relief or anisotropic roughness.
Surface painted(TriangleMesh& mesh, const std::vector<Eigen::Vector3f>& colors,
                const Surface& surface);

}  // namespace driftlight
