// SPDX-License-Identifier: Apache-2.0
/// Textures of scene files.
#pragma once

#include "image_file.h"
#include "load_context.h"
#include "properties.h"

namespace driftlight {

/// <texture> of type bitmap, checkerboard, gridtexture or scale, or a <ref> to one.
Texture read_texture(const Element& element, LoadContext& context);

/// A property that may be a colour, a <texture> or a <ref> to one.
Texture read_textured(Properties& properties, std::string_view name, const Rgbd& fallback,
                      LoadContext& context);

/// The same, which may also be given as one <float>.
Texture read_scalar(Properties& properties, std::string_view name, double fallback,
                    LoadContext& context);

/// The same with one number in the place of its colours: their mean in Mitsuba 0.6, their luminance
/// in 3. What exceeds 1 is 1, as in both.
Texture read_share(Properties& properties, std::string_view name, double fallback,
                   LoadContext& context);

void scale(Texture& texture, const Rgbd& factor);

/// The property `gamma` of images: absent or 0 (up to the file), -1 (sRGB) or a positive power.
std::optional<Gamma> read_gamma(Properties& properties);

}  // namespace driftlight
