// SPDX-License-Identifier: Apache-2.0
#include "spectrum_xml.h"

#include <array>
#include <fstream>
#include <iterator>
#include <sstream>

#include "color_values.h"
#include "color_xml.h"
#include "excerpt.h"
#include "properties.h"
#include "spectrum.h"
#include "text.h"

namespace driftlight {
namespace {

/// Takes samples one by one and says at the element what is wrong with them.
class SpectrumReader {
 public:
  explicit SpectrumReader(const Element& element) : element_(element) {}

  void add(const std::string& wavelength, const std::string& value) {
    const double nm = read_color_value(element_, wavelength);
    if (!spectrum_.empty() && nm <= spectrum_.back().wavelength)
      element_.fail("wavelengths must grow, but " + wavelength + " follows");
    add(nm, value);
  }
  void add(double wavelength, const std::string& value) {
    spectrum_.push_back({wavelength, read_color_value(element_, value)});
  }

  /// The colour of all samples.
  Rgbd color() {
    if (spectrum_.size() < 2) element_.fail("a spectrum needs at least two wavelengths");
    if (element_.dialect() == Dialect::Mitsuba06) {
      const Spectrum spectrum = ramp_to_zero(std::move(spectrum_));
      return spectrum_to_rgb(
          has_backward_spectra(element_.version()) ? interpolated_backwards(spectrum) : spectrum);
    }
    return element_.parent_tag() == "emitter" ? spectrum_to_rgb(spectrum_)
                                              : reflectance_to_rgb(spectrum_);
  }

 private:
  const Element& element_;
  Spectrum spectrum_;
};

Rgbd read_pairs(const Element& element, const std::vector<std::string>& parts) {
  SpectrumReader reader(element);
  for (const std::string& part : parts) {
    const std::vector<std::string> pair = split(part, ":");
    if (pair.size() != 2) element.fail("'" + part + "' is not of the form wavelength:value");
    reader.add(pair[0], pair[1]);
  }
  return reader.color();
}

/// A file of lines "wavelength value"; what follows a # is a comment.
Rgbd read_spectrum_file(const Element& element) {
  const std::filesystem::path file = element.find_file(element.text("filename"));
  std::ifstream stream(file);
  if (!stream || std::filesystem::is_directory(file))
    element.fail("the spectrum '" + file.string() + "' cannot be opened");
  const std::string text{std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
  std::istringstream lines(text);
  SpectrumReader reader(element);
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    const std::vector<std::string> parts = split_list(line.substr(0, line.find('#')));
    if (parts.empty()) continue;
    if (parts.size() != 2 || !parse_number(parts[0]) || !parse_number(parts[1]))
      element.fail(
          problem_in_line(file, text, number, "this is not of the form \"wavelength value\""));
    reader.add(parts[0], parts[1]);
  }
  return reader.color();
}

/// Equal energy is not white light to Mitsuba 3, but for surfaces it means grey.
Rgbd uniform(const Element& element, double value) {
  const bool emits = element.dialect() == Dialect::Mitsuba3 && element.parent_tag() == "emitter";
  static const Rgbd equal_energy = spectrum_to_rgb({{300.0, 1.0}, {900.0, 1.0}});
  return value * (emits ? equal_energy : kWhite);
}

Rgbd read_uniform(Properties& properties) {
  return uniform(properties.element(), properties.non_negative("value", 1.0));
}

Rgbd read_d65(Properties& properties) {
  return properties.non_negative("scale", 1.0) * properties.color("color", kWhite);
}

Rgbd read_rgb(Properties& properties) { return properties.color("color", kWhite); }

Rgbd read_regular(Properties& properties) {
  const double first = properties.positive("wavelengthMin", 360.0);
  const double last = properties.positive("wavelengthMax", 830.0);
  if (!(first < last)) properties.fail("wavelengthMax", "must exceed 'wavelength_min'");
  const std::vector<std::string> values = split_list(properties.required_text("values"));
  if (values.size() < 2) properties.fail("values", "there must be at least two");
  SpectrumReader reader(properties.element());
  for (std::size_t i = 0; i < values.size(); ++i)
    reader.add(
        first + (last - first) * static_cast<double>(i) / static_cast<double>(values.size() - 1),
        values[i]);
  return reader.color();
}

Rgbd read_irregular(Properties& properties) {
  const std::vector<std::string> wavelengths = split_list(properties.required_text("wavelengths"));
  const std::vector<std::string> values = split_list(properties.required_text("values"));
  if (wavelengths.size() != values.size())
    properties.fail(
        "values", "there must be as many as 'wavelengths', " + std::to_string(wavelengths.size()));
  SpectrumReader reader(properties.element());
  for (std::size_t i = 0; i < values.size(); ++i) reader.add(wavelengths[i], values[i]);
  return reader.color();
}

Rgbd read_blackbody_type(Properties& properties) {
  return spectrum_to_rgb(blackbody(properties.positive("temperature", 5000.0))) *
         properties.non_negative("scale", 1.0);
}

using TypeReader = Rgbd (*)(Properties&);
constexpr std::array<std::pair<std::string_view, TypeReader>, 7> kTypes{{
    {"uniform", &read_uniform},
    {"d65", &read_d65},
    {"rgb", &read_rgb},
    {"srgb", &read_rgb},
    {"regular", &read_regular},
    {"irregular", &read_irregular},
    {"blackbody", &read_blackbody_type},
}};

Rgbd read_typed(const Element& element) {
  Properties properties(element);
  const Rgbd color = find_plugin(kTypes, properties)(properties);
  properties.finish();
  return color;
}

}  // namespace

Rgbd read_spectrum(const Element& element) {
  if (element.dialect() == Dialect::Mitsuba3 && element.find("type")) return read_typed(element);
  element.allow_attributes({"name", "value", "filename", "intent"});
  if (element.find("filename").has_value() == element.find("value").has_value())
    element.fail("<spectrum> needs either 'value' or 'filename'");
  if (element.find("filename")) return read_spectrum_file(element);
  const std::string text = element.text("value");
  const std::vector<std::string> parts = split_list(text);
  if (text.find(':') != std::string::npos) return read_pairs(element, parts);
  if (parts.size() == 1) return uniform(element, read_color_value(element, parts[0]));
  return read_color_values(element, parts);
}

Rgbd read_blackbody(const Element& element) {
  element.allow_attributes({"name", "temperature", "scale"});
  std::string text = element.text("temperature");
  if (text.ends_with('K') || text.ends_with('k')) text.pop_back();
  const std::optional<double> kelvin = parse_number(text);
  if (!kelvin || !(*kelvin > 0.0))
    element.fail("'temperature' must be a positive number of kelvin, such as \"5000K\"");
  const double scale = element.number("scale", 1.0);
  if (!(scale >= 0.0)) element.fail("'scale' must not be negative");
  return scale * spectrum_to_rgb(blackbody(*kelvin));
}

}  // namespace driftlight
