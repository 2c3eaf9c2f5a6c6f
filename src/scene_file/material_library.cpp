// SPDX-License-Identifier: Apache-2.0
#include "material_library.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>
#include <optional>
#include <sstream>
#include <utility>
#include <vector>

#include "bsdfs_xml.h"
#include "excerpt.h"
#include "text.h"

namespace driftlight {
namespace {

/// A colour or an image.
struct Paint {
  std::string color = "0, 0, 0";  ///< as written
  std::optional<std::string> image;
};

struct MtlMaterial {
  std::string name;
  int line = 0;  ///< from 1
  Paint diffuse, specular;
  std::string exponent = "0";
  std::optional<std::string> bump;
  std::optional<Paint> mask;  ///< its colour is one number
  int illum = 0;
};

bool is_zero(const std::string& numbers) {
  const std::vector<std::string> parts = split_list(numbers);
  return std::all_of(parts.begin(), parts.end(),
                     [](const std::string& part) { return parse_number(part) == 0.0; });
}

bool is_glass(const MtlMaterial& material) {
  constexpr std::array kGlass{4, 6, 7, 9};
  return std::find(kGlass.begin(), kGlass.end(), material.illum) != kGlass.end();
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if (c == '&')
      result += "&amp;";
    else if (c == '<')
      result += "&lt;";
    else if (c == '"')
      result += "&quot;";
    else
      result += c;
  }
  return result;
}

/// Reads the lines of the file.
class MtlParser {
 public:
  explicit MtlParser(const std::filesystem::path& file) : file_(file.string()) {
    std::ifstream stream(file);
    if (!stream || std::filesystem::is_directory(file))
      throw SceneError({file_}, "the file cannot be opened");
    text_ = {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
    std::istringstream lines(text_);
    std::string line;
    while (std::getline(lines, line)) {
      ++line_;
      parse(line);
    }
  }

  const std::string& text() const { return text_; }

  const std::vector<MtlMaterial>& materials() const { return materials_; }

 private:
  void parse(const std::string& line) {
    std::istringstream words(line);
    std::string key;
    if (!(words >> key)) return;
    if (key == "newmtl") {
      MtlMaterial& material = materials_.emplace_back();
      material.name = trimmed(line.substr(line.find(key) + key.size()));
      material.line = line_;
      return;
    }
    if (materials_.empty()) return;
    MtlMaterial& material = materials_.back();
    if (key == "Kd") {
      material.diffuse = {numbers(words, key, 3), std::nullopt};
    } else if (key == "map_Kd") {
      material.diffuse.image = image(words);
    } else if (key == "Ks") {
      material.specular = {numbers(words, key, 3), std::nullopt};
    } else if (key == "map_Ks") {
      material.specular.image = image(words);
    } else if (key == "bump") {
      material.bump = image(words);
    } else if (key == "map_d") {
      material.mask = Paint{"", image(words)};
    } else if (key == "d") {
      const std::string opacity = numbers(words, key, 1);
      material.mask.reset();
      if (parse_number(opacity) != 1.0) material.mask = Paint{opacity, std::nullopt};
    } else if (key == "Ns") {
      material.exponent = numbers(words, key, 1);
    } else if (key == "illum") {
      material.illum = static_cast<int>(*parse_number(numbers(words, key, 1)));
    }
  }

  static std::string trimmed(const std::string& text) {
    const std::size_t first = text.find_first_not_of(" \t\r");
    if (first == std::string::npos) return {};
    return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
  }
  /// So many numbers, "a, b, c".
  std::string numbers(std::istringstream& words, const std::string& key, int count) const {
    std::vector<std::string> result(static_cast<std::size_t>(count));
    for (std::string& word : result)
      if (!(words >> word) || !parse_number(word) || std::abs(*parse_number(word)) > 1e9)
        throw SceneError({file_, line_, 1},
                         fmt::format("'{}' needs {} numbers, not '{}'", key, count, word) +
                             excerpt(text_, {file_, line_, 1}));
    return join(result);
  }
  static std::string image(std::istringstream& words) {
    std::string name;
    words >> name;
    std::replace(name.begin(), name.end(), '\\', '/');
    return name;
  }

  std::string file_;
  std::string text_;
  int line_ = 0;
  std::vector<MtlMaterial> materials_;
};

/// Writes a material as an XML element on one line.
class XmlWriter {
 public:
  /// Images are looked for as files of `element`, of which notices speak, and beside the file.
  XmlWriter(std::filesystem::path file, const Element& element, LoadContext& context)
      : file_(std::move(file)), element_(element), context_(context) {}

  std::string bsdf(const MtlMaterial& material) {
    std::string result = scattering(material);
    if (material.bump)
      if (const auto texture = bitmap(*material.bump, "", true))
        result = "<bsdf type=\"bumpmap\">" + *texture + result + "</bsdf>";
    if (material.mask && is_glass(material)) {
      context_.notice(SourceLocation{file_.string(), material.line, 1},
                      "the opacity of the glass '" + material.name +
                          "' is not used: a smooth dielectric cannot be masked");
    } else if (material.mask) {
      const Paint& mask = *material.mask;
      const std::string opacity =
          mask.image ? paint(mask, "opacity")
                     : fmt::format(R"(<float name="opacity" value="{}"/>)", mask.color);
      result = "<bsdf type=\"mask\">" + opacity + result + "</bsdf>";
    }
    return result;
  }

 private:
  std::string scattering(const MtlMaterial& material) {
    const bool has_gloss = (material.specular.image || !is_zero(material.specular.color)) &&
                           !is_zero(material.exponent);
    if (is_glass(material)) return "<bsdf type=\"dielectric\"/>";
    switch (material.illum) {
      case 2:
        if (!has_gloss) break;
        return "<bsdf type=\"phong\">" + paint(material.diffuse, "diffuseReflectance") +
               paint(material.specular, "specularReflectance") +
               fmt::format(R"(<float name="exponent" value="{}"/></bsdf>)", material.exponent);
      case 5:
      case 8:
        return R"(<bsdf type="conductor"><string name="material" value="Al"/></bsdf>)";
      default:
        break;
    }
    return "<bsdf type=\"diffuse\">" + paint(material.diffuse, "reflectance") + "</bsdf>";
  }

  std::string paint(const Paint& paint, const std::string& name) {
    if (paint.image)
      return bitmap(*paint.image, name, false)
          .value_or(fmt::format(R"(<rgb name="{}" value="0"/>)", name));
    return fmt::format(R"(<srgb name="{}" value="{}"/>)", name, paint.color);
  }

  /// None if there is no such file.
  std::optional<std::string> bitmap(const std::string& image, const std::string& name, bool raw) {
    if (const auto file = find_image(image))
      return fmt::format(R"(<texture name="{}" type="bitmap"><string name="filename" value="{}"/>)"
                         R"(<string name="filterType" value="bilinear"/>{}</texture>)",
                         name, escaped(std::filesystem::absolute(*file).string()),
                         raw ? R"(<float name="gamma" value="1"/>)" : "");
    context_.notice(element_, "the image '" + image +
                                  "' of a material cannot be found and is taken as black, as in "
                                  "Mitsuba");
    return std::nullopt;
  }

  std::optional<std::filesystem::path> find_image(const std::string& image) const {
    const std::filesystem::path whole(image);
    const std::filesystem::path directory = file_.parent_path();
    for (const auto& file : {directory / whole, directory / whole.filename()})
      if (std::filesystem::is_regular_file(file)) return file;
    for (const std::string& name : {image, whole.filename().string()})
      if (const auto file = element_.find_file(name); std::filesystem::is_regular_file(file))
        return file;
    return std::nullopt;
  }

  std::filesystem::path file_;
  const Element& element_;
  LoadContext& context_;
};

}  // namespace

/// By way of the elements that would stand for the materials in a scene file. Each is on the line
/// of its material, which messages then name.
MaterialLibrary read_material_library(const std::filesystem::path& file, const Element& element,
                                      LoadContext& context) {
  context.surroundings.files.add(file);
  const MtlParser parser(file);
  XmlWriter writer(file, element, context);
  std::string text = "<materials>";
  int line = 1;
  for (const MtlMaterial& material : parser.materials()) {
    text.append(static_cast<std::size_t>(material.line - line), '\n');
    line = material.line;
    text += writer.bsdf(material);
  }
  const XmlDocument document(file, text + "</materials>", parser.text());
  const std::vector<Element> elements =
      Element(document, document.root(), context.surroundings).children();
  MaterialLibrary result;
  for (std::size_t i = 0; i < elements.size(); ++i)
    result[parser.materials()[i].name] = read_surface(elements[i], context);
  return result;
}

}  // namespace driftlight
