// SPDX-License-Identifier: Apache-2.0
#include "image_file.h"

#include <OpenImageIO/imageio.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>

#include "driftlight/error.h"
#include "spectrum.h"

namespace driftlight {
namespace {

/// Texels that we are willing to hold: 3 GiB of them.
constexpr std::int64_t kMaximumTexels = std::int64_t{1} << 28;

Gamma gamma_of_file(const OIIO::ImageSpec& spec) {
  if (spec.format.is_floating_point()) return 1.0;
  const bool says_srgb = spec.get_string_attribute("oiio:ColorSpace") == "sRGB";
  const float gamma = spec.get_float_attribute("oiio:Gamma", 0.0F);
  if (says_srgb || !(gamma > 0.0F)) return std::nullopt;
  return static_cast<double>(gamma);
}

float decode(float encoded, const Gamma& gamma) {
  const double value = std::max(static_cast<double>(encoded), 0.0);
  if (!gamma) return static_cast<float>(srgb_to_linear(value));
  return *gamma == 1.0 ? static_cast<float>(value) : static_cast<float>(std::pow(value, *gamma));
}

}  // namespace

ImageFile read_image_file(const std::filesystem::path& file,
                          const std::optional<Gamma>& gamma_override) {
  // Mitsuba does not multiply colours by alpha.
  OIIO::ImageSpec config;
  config["oiio:UnassociatedAlpha"] = 1;
  const auto input = OIIO::ImageInput::open(file.string(), &config);
  if (!input)
    throw InputError("the image '" + file.string() + "' cannot be opened: " + OIIO::geterror());
  const OIIO::ImageSpec& spec = input->spec();
  if (spec.width <= 0 || spec.height <= 0 ||
      std::int64_t{spec.width} * spec.height > kMaximumTexels)
    throw InputError("the image '" + file.string() + "' has an impossible size");

  const int channels = spec.nchannels < 3 ? 1 : 3;
  Bitmap bitmap{spec.width, spec.height, {}};
  bitmap.texels.resize(static_cast<std::size_t>(spec.width) *
                       static_cast<std::size_t>(spec.height));
  std::vector<float> values(bitmap.texels.size() * static_cast<std::size_t>(channels));
  if (!input->read_image(0, 0, 0, channels, OIIO::TypeFloat, values.data()))
    throw InputError("the image '" + file.string() + "' cannot be read: " + input->geterror());

  const Gamma gamma = gamma_override ? *gamma_override : gamma_of_file(spec);
  const std::size_t stride = channels == 3 ? 1 : 0;  // grey: the same value three times
  for (std::size_t i = 0; i < bitmap.texels.size(); ++i) {
    const float* const texel = &values[i * static_cast<std::size_t>(channels)];
    for (std::size_t c = 0; c < 3; ++c)
      bitmap.texels[i][static_cast<Eigen::Index>(c)] = decode(texel[c * stride], gamma);
    if (!bitmap.texels[i].isFinite().all())
      throw InputError("the image '" + file.string() + "' has a value that is not finite");
  }
  return {std::move(bitmap), gamma};
}

}  // namespace driftlight
