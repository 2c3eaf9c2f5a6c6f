// SPDX-License-Identifier: Apache-2.0
/// Images: linear sRGB in float, read, written and compared.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace driftlight {

struct ToneMapping;

/// Rows from the top, three channels a pixel.
struct Image {
  int width = 0;
  int height = 0;
  std::vector<float> rgb;

  Image() = default;
  Image(int w, int h)
      : width(w), height(h), rgb(3 * static_cast<std::size_t>(w) * static_cast<std::size_t>(h)) {}

  float* pixel(int x, int y) { return rgb.data() + offset(x, y); }
  const float* pixel(int x, int y) const { return rgb.data() + offset(x, y); }

 private:
  std::size_t offset(int x, int y) const {
    return 3 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                static_cast<std::size_t>(x));
  }
};

/// Mean luminance of the pixels.
double mean_luminance(const Image& image);

/// Reads any format of OpenImageIO, the first three channels (one channel is repeated), as stored
/// linear floats; 8- and 16-bit formats are taken as sRGB. Throws InputError.
Image read_image(const std::filesystem::path& file);

/// Writes an image in the format of the file's ending: floats for .exr, .pfm and .hdr, else 8-bit
/// values (tone_mapping.h), by default sRGB. Written beside the target under a temporary name, then
/// renamed. `metadata` is stored where the format can. Throws InputError for an ending that
/// OpenImageIO does not know, RuntimeError if writing fails.
void write_image(const std::filesystem::path& file, const Image& image,
                 const std::map<std::string, std::string>& metadata = {});
void write_image(const std::filesystem::path& file, const Image& image,
                 const std::map<std::string, std::string>& metadata, const ToneMapping& tones);

/// Named channels of floats, such as diagnostics by pixel.
struct Layers {
  int width = 0;
  int height = 0;
  std::vector<std::string> names;
  std::vector<float> values;  ///< rows from the top, at each pixel a value for each name
};

/// Writes an OpenEXR file with the channels of these names, as `write_image` writes images. Throws
/// InputError if the file does not end in .exr, RuntimeError if writing fails.
void write_layers(const std::filesystem::path& file, const Layers& layers,
                  const std::map<std::string, std::string>& metadata = {});

/// Throws InputError unless `write_image` will know the ending of `file` and its folder exists: to
/// be asked before a long render.
void check_writable(const std::filesystem::path& file);

/// Figures of the difference between an image and a reference, over all pixels and channels.
struct Difference {
  double mse = 0;             ///< mean of (I - R)^2
  double relmse = 0;          ///< mean of (I - R)^2 / (R^2 + 0.01)
  double relmse_trimmed = 0;  ///< without the 0.1 % of pixels with the largest relMSE
  double mape = 0;            ///< mean of |I - R| / (|R| + 0.01)
  double mean = 0;            ///< mean of I over mean of R
};

/// Throws InputError if the sizes differ.
Difference difference(const Image& image, const Image& reference);

}  // namespace driftlight
