// SPDX-License-Identifier: Apache-2.0
#include "driftlight/image.h"

#include <OpenImageIO/imageio.h>
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <limits>
#include <memory>

#include "driftlight/error.h"
#include "driftlight/scalar.h"
#include "driftlight/tone_mapping.h"
#include "pending_file.h"

namespace driftlight {

namespace {

/// IEC 61966-2-1: encoded value -> linear light.
float from_srgb(float x) {
  return x <= 0.04045F ? x / 12.92F : std::pow((x + 0.055F) / 1.055F, 2.4F);
}

std::string lower_extension(const std::filesystem::path& file) {
  std::string extension = file.extension().string();
  for (char& c : extension)
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  return extension;
}

/// OpenImageIO reads PFM but does not write it.
bool is_pfm(const std::filesystem::path& file) { return lower_extension(file) == ".pfm"; }

bool stores_floats(const std::filesystem::path& file) {
  const std::string extension = lower_extension(file);
  return extension == ".exr" || extension == ".hdr";
}

/// A message of OpenImageIO without the line ends that it comes with.
std::string one_line(std::string message) {
  std::replace(message.begin(), message.end(), '\n', ' ');
  while (!message.empty() && message.back() == ' ') message.pop_back();
  return message;
}

[[noreturn]] void fail_to_write(const std::filesystem::path& file, const std::string& why) {
  throw RuntimeError(fmt::format("cannot write '{}': {}", file.string(), one_line(why)));
}

std::unique_ptr<OIIO::ImageOutput> make_output(const std::filesystem::path& file) {
  auto output = OIIO::ImageOutput::create(file.string());
  if (!output) {
    OIIO::geterror();  // forgets the message
    throw InputError(
        fmt::format("cannot write '{}': its ending names no image format that can be written; "
                    ".exr, .pfm, .hdr, .png, .jpg and .tif do",
                    file.string()));
  }
  return output;
}

/// Portable float map: rows from the bottom, negative scale for little-endian numbers.
void write_pfm(const PendingFile& file, const Image& image) {
  static_assert(std::endian::native == std::endian::little);
  std::ofstream out(file.temporary(), std::ios::binary);
  out << "PF\n" << image.width << ' ' << image.height << "\n-1.0\n";
  const auto row_bytes = static_cast<std::streamsize>(sizeof(float)) * 3 * image.width;
  for (int y = image.height - 1; y >= 0; --y)
    out.write(reinterpret_cast<const char*>(image.pixel(0, y)), row_bytes);
  out.close();
  if (!out) fail_to_write(file.target(), "the disk is full or the folder is not writable");
}

/// Writes `values`, which have the type of the specification.
void write_oiio(const PendingFile& file, OIIO::ImageSpec spec, const void* values,
                const std::map<std::string, std::string>& metadata) {
  // Without a date here some formats store the present one, and no two files are the same.
  spec.attribute("DateTime", "");
  for (const auto& [name, text] : metadata) spec.attribute(name, text);
  const auto output = make_output(file.temporary());
  if (!output->open(file.temporary().string(), spec))
    fail_to_write(file.target(), output->geterror());
  const bool written = output->write_image(spec.format, values);
  if (!output->close() || !written) fail_to_write(file.target(), output->geterror());
}

void write_oiio(const PendingFile& file, const Image& image,
                const std::map<std::string, std::string>& metadata, const ToneMapping& tones) {
  const bool floats = stores_floats(file.target());
  OIIO::ImageSpec spec(image.width, image.height, 3,
                       floats ? OIIO::TypeDesc::FLOAT : OIIO::TypeDesc::UINT8);
  if (floats || !tones.gamma)
    spec.attribute("oiio:ColorSpace", floats ? "Linear" : "sRGB");
  else
    spec.attribute("oiio:Gamma", static_cast<float>(*tones.gamma));
  if (floats) return write_oiio(file, spec, image.rgb.data(), metadata);
  write_oiio(file, spec, tone_map(image, tones).data(), metadata);
}

}  // namespace

double mean_luminance(const Image& image) {
  Rgbd sum = Rgbd::Zero();
  for (std::size_t i = 0; i < image.rgb.size(); ++i)
    sum[static_cast<Eigen::Index>(i % 3)] += static_cast<double>(image.rgb[i]);
  return 3.0 * luminance(sum) / static_cast<double>(image.rgb.size());
}

Image read_image(const std::filesystem::path& file) {
  const auto fail = [&](const std::string& why) {
    throw InputError(fmt::format("cannot read image '{}': {}", file.string(), one_line(why)));
  };
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) fail("there is no such file");
  const auto input = OIIO::ImageInput::open(file.string());
  if (!input) fail(OIIO::geterror());
  const OIIO::ImageSpec& spec = input->spec();
  const int channels = spec.nchannels >= 3 ? 3 : 1;
  Image image(spec.width, spec.height);
  std::vector<float> data(image.rgb.size() / 3 * static_cast<std::size_t>(channels));
  if (!input->read_image(0, 0, 0, channels, OIIO::TypeDesc::FLOAT, data.data()))
    fail(input->geterror());
  const bool encoded =
      spec.format == OIIO::TypeDesc::UINT8 || spec.format == OIIO::TypeDesc::UINT16;
  if (encoded) std::transform(data.begin(), data.end(), data.begin(), from_srgb);
  if (channels == 3) {
    image.rgb = std::move(data);
  } else {
    for (std::size_t i = 0; i < data.size(); ++i) std::fill_n(&image.rgb[3 * i], 3, data[i]);
  }
  return image;
}

void write_image(const std::filesystem::path& file, const Image& image,
                 const std::map<std::string, std::string>& metadata) {
  write_image(file, image, metadata, ToneMapping{});
}

void write_image(const std::filesystem::path& file, const Image& image,
                 const std::map<std::string, std::string>& metadata, const ToneMapping& tones) {
  PendingFile pending(file);
  if (is_pfm(file))
    write_pfm(pending, image);
  else
    write_oiio(pending, image, metadata, tones);
  pending.commit();
}

void write_layers(const std::filesystem::path& file, const Layers& layers,
                  const std::map<std::string, std::string>& metadata) {
  if (lower_extension(file) != ".exr")
    throw InputError(fmt::format("cannot write '{}': layers go into .exr only", file.string()));
  OIIO::ImageSpec spec(layers.width, layers.height, static_cast<int>(layers.names.size()),
                       OIIO::TypeDesc::FLOAT);
  spec.channelnames = layers.names;
  PendingFile pending(file);
  write_oiio(pending, spec, layers.values.data(), metadata);
  pending.commit();
}

void check_writable(const std::filesystem::path& file) {
  if (!is_pfm(file)) make_output(file);
  check_target(file);
}

Difference difference(const Image& image, const Image& reference) {
  if (image.width != reference.width || image.height != reference.height)
    throw InputError(fmt::format("the images differ in size: {} x {} against {} x {}", image.width,
                                 image.height, reference.width, reference.height));
  double sum_squared = 0;
  double sum_relative = 0;
  double sum_absolute = 0;
  double sum_image = 0;
  double sum_reference = 0;
  const std::size_t pixels = image.rgb.size() / 3;
  std::vector<double> relative(pixels);
  for (std::size_t i = 0; i < image.rgb.size(); ++i) {
    const auto x = static_cast<double>(image.rgb[i]);
    const auto r = static_cast<double>(reference.rgb[i]);
    const double squared = (x - r) * (x - r);
    sum_squared += squared;
    relative[i / 3] += squared / (r * r + 0.01);
    sum_absolute += std::abs(x - r) / (std::abs(r) + 0.01);
    sum_image += x;
    sum_reference += r;
  }
  for (const double x : relative) sum_relative += x;

  // The smallest 99.9 % come first; what is not a number counts as the largest.
  const std::size_t kept = pixels - pixels / 1000;
  for (double& x : relative)
    if (std::isnan(x)) x = std::numeric_limits<double>::infinity();
  if (kept < pixels)
    std::nth_element(relative.begin(), relative.begin() + static_cast<std::ptrdiff_t>(kept),
                     relative.end());
  double sum_trimmed = 0;
  for (std::size_t i = 0; i < kept; ++i) sum_trimmed += relative[i];

  const auto values = static_cast<double>(image.rgb.size());
  return {.mse = sum_squared / values,
          .relmse = sum_relative / values,
          .relmse_trimmed = sum_trimmed / (3.0 * static_cast<double>(kept)),
          .mape = sum_absolute / values,
          .mean = sum_image / sum_reference};
}

}  // namespace driftlight
