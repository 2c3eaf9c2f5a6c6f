// SPDX-License-Identifier: Apache-2.0
/// Image files as bitmaps.
#pragma once

#include <filesystem>
#include <optional>

#include "driftlight/texture.h"

namespace driftlight {

/// How to undo the encoding of an image: a power, or nothing for the sRGB curve.
using Gamma = std::optional<double>;

struct ImageFile {
  Bitmap bitmap;
  Gamma gamma;  ///< that was undone
};

/// Reads an image into linear sRGB; alpha is dropped, grey is spread over three channels, negative
/// values become 0. Without an override, floating-point files are linear, and the others are sRGB
/// unless they name a gamma. Throws InputError.
ImageFile read_image_file(const std::filesystem::path& file,
                          const std::optional<Gamma>& gamma_override);

}  // namespace driftlight
