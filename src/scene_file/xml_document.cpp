// SPDX-License-Identifier: Apache-2.0
#include "xml_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <utility>

#include "excerpt.h"
#include "nearest_names.h"
#include "text.h"

namespace driftlight {
namespace {

constexpr int kMaximumDepth = 32;

std::string read_text(const std::filesystem::path& file) {
  std::ifstream stream(file, std::ios::binary);
  if (!stream || std::filesystem::is_directory(file))
    throw SceneError({file.string()}, "the file cannot be opened");
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

/// Finds the first element that is nested too deeply. Iterative, as pugixml's parser is.
struct DepthProbe : pugi::xml_tree_walker {
  pugi::xml_node too_deep;

  bool for_each(pugi::xml_node& node) override {
    if (depth() < kMaximumDepth) return true;
    too_deep = node;
    return false;
  }
};

}  // namespace

XmlDocument::XmlDocument(const std::filesystem::path& file)
    : name_(file.string()), text_(read_text(file)) {
  parse();
}

XmlDocument::XmlDocument(const std::filesystem::path& file, std::string text, std::string original)
    : name_(file.string()), text_(std::move(text)), original_(std::move(original)) {
  parse();
}

void XmlDocument::parse() {
  const pugi::xml_parse_result result =
      document_.load_buffer(text_.data(), text_.size(), pugi::parse_default, pugi::encoding_utf8);
  if (!result)
    fail(location(static_cast<std::size_t>(std::max<std::ptrdiff_t>(result.offset, 0))),
         "not well-formed XML: " + std::string(result.description()));
  const pugi::xml_node second = root().next_sibling();
  if (second && second.type() == pugi::node_element)
    fail(location(second), "a second outermost element");
  check_depth();
  collect_ids();
}

void XmlDocument::check_depth() const {
  DepthProbe probe;
  root().parent().traverse(probe);
  if (probe.too_deep)
    fail(location(probe.too_deep),
         "nested more than " + std::to_string(kMaximumDepth) + " levels deep");
}

void XmlDocument::fail(const SourceLocation& place, const std::string& message) const {
  throw SceneError(place, message + excerpt(place));
}

SourceLocation XmlDocument::location(pugi::xml_node node) const {
  const auto name = static_cast<std::size_t>(std::max<std::ptrdiff_t>(node.offset_debug(), 1));
  return location(name - 1);
}

SourceLocation XmlDocument::location(std::size_t offset) const {
  SourceLocation result = location_in(text_, offset);
  result.file = name_;
  if (original_) result.column = 1;
  return result;
}

std::string XmlDocument::excerpt(const SourceLocation& place) const {
  return driftlight::excerpt(original_ ? *original_ : text_, place);
}

/// Of elements with the same id the first.
void XmlDocument::collect_ids() {
  struct Collector : pugi::xml_tree_walker {
    std::map<std::string, pugi::xml_node>* ids = nullptr;

    bool for_each(pugi::xml_node& node) override {
      const pugi::xml_attribute id = node.attribute("id");
      const std::string_view name = node.name();
      if (id && name != "ref" && name != "alias") ids->emplace(id.value(), node);
      return true;
    }
  };
  Collector collector;
  collector.ids = &ids_;
  document_.traverse(collector);
}

pugi::xml_node XmlDocument::find_id(const std::string& id) const {
  const auto found = ids_.find(id);
  return found == ids_.end() ? pugi::xml_node() : found->second;
}

std::string Element::parent_tag() const {
  const XmlDocument* const including = document_->including();
  if (!is_outermost() || including == nullptr) return node_.parent().name();
  return Element(*including, document_->include(), *surroundings_).parent_tag();
}

std::optional<std::string> Element::find(const char* attribute) const {
  const pugi::xml_attribute found = node_.attribute(attribute);
  if (!found) return std::nullopt;
  return with_location(
      *this, [&] { return surroundings_->substitutions.apply(found.value(), dialect()); });
}

std::string Element::text(const char* attribute) const {
  if (auto value = find(attribute)) return *std::move(value);
  std::string message = fmt::format("<{}> lacks the attribute '{}'", tag(), attribute);
  for (const pugi::xml_attribute other : node_.attributes())
    if (is_slip(other.name(), attribute))
      message += fmt::format("; is it meant by '{}'?", other.name());
  fail(message);
}

double Element::number(const char* attribute) const {
  const std::string value = text(attribute);
  if (const auto parsed = parse_number(value)) return *parsed;
  fail("'" + value + "' is not a finite number (attribute '" + attribute + "' of <" + tag() + ">)");
}

double Element::number(const char* attribute, double fallback) const {
  return find(attribute) ? number(attribute) : fallback;
}

std::vector<double> Element::numbers(const char* attribute, std::size_t count) const {
  const std::vector<std::string> parts = split_list(text(attribute));
  std::vector<double> result;
  for (const std::string& part : parts) {
    const auto parsed = parse_number(part);
    if (!parsed) fail("'" + part + "' is not a finite number (attribute '" + attribute + "')");
    result.push_back(*parsed);
  }
  if (result.size() != count)
    fail("attribute '" + std::string(attribute) + "' needs " + std::to_string(count) +
         " numbers, not " + std::to_string(result.size()));
  return result;
}

std::array<double, 3> Element::xyz(std::optional<double> fallback) const {
  constexpr std::array kAxes{"x", "y", "z"};
  if (dialect() == Dialect::Mitsuba3 && find("value")) {
    for (const char* axis : kAxes)
      if (find(axis)) fail("<" + tag() + "> needs either 'value' or 'x', 'y' and 'z'");
    if (split_list(text("value")).size() == 1) {
      const double same = number("value");
      return {same, same, same};
    }
    const std::vector<double> values = numbers("value", 3);
    return {values[0], values[1], values[2]};
  }
  std::array<double, 3> result{};
  for (std::size_t i = 0; i < kAxes.size(); ++i)
    result.at(i) = fallback ? number(kAxes.at(i), *fallback) : number(kAxes.at(i));
  return result;
}

std::vector<Element> Element::children() const {
  std::vector<Element> result;
  for (const pugi::xml_node child : node_.children())
    if (child.type() == pugi::node_element) result.emplace_back(*document_, child, *surroundings_);
  return result;
}

void Element::allow_attributes(std::initializer_list<std::string_view> names) const {
  for (const pugi::xml_attribute attribute : node_.attributes()) {
    const std::string_view name = attribute.name();
    if (std::find(names.begin(), names.end(), name) == names.end())
      unused("unknown attribute '" + std::string(name) + "' of <" + tag() + "> is not used; " +
             hint(name, {names.begin(), names.end()}));
  }
}

void Element::check_names() const {
  std::optional<SceneError> first;
  const auto check = [&](const auto& part) {
    try {
      part();
    } catch (const SceneError& error) {
      surroundings_->messages.error(error);
      if (!first) first = error;
    }
  };
  for (const pugi::xml_attribute attribute : node_.attributes())
    check([&] { find(attribute.name()); });
  for (const Element& child : children()) check([&] { child.check_names(); });
  if (first) throw *first;
}

void Element::fail(const std::string& message) const {
  const SourceLocation place = location();
  const bool shows_a_line = message.find('\n') != std::string::npos;
  throw SceneError(place, shows_a_line ? message : message + document_->excerpt(place));
}

void Element::unused(const std::string& message) const {
  const SourceLocation place = location();
  surroundings_->messages.unused(place, message, document_->excerpt(place));
}

std::optional<Element> Element::find_id(const std::string& id) const {
  const pugi::xml_node node = document_->find_id(id);
  if (!node) return std::nullopt;
  return Element(*document_, node, *surroundings_);
}

std::vector<std::string> Element::ids() const {
  std::vector<std::string> result;
  const std::string_view name = node_.name();
  const pugi::xml_attribute id = node_.attribute("id");
  if (id && name != "ref" && name != "alias") result.emplace_back(id.value());
  for (const Element& child : children())
    for (std::string& nested : child.ids()) result.push_back(std::move(nested));
  return result;
}

bool Element::is_inside(const Element& other) const {
  for (pugi::xml_node node = node_; node; node = node.parent())
    if (node == other.node_) return true;
  return false;
}

}  // namespace driftlight
