// SPDX-License-Identifier: Apache-2.0
#include "properties.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <set>

#include "color_xml.h"
#include "included_files.h"
#include "text.h"
#include "transform_xml.h"
#include "unsupported.h"

namespace driftlight {

Properties::Properties(const Element& element)
    : element_(element), type_(lower_case(element.find("type").value_or(""))) {
  if (element.is_outermost())
    element.allow_attributes({"version", "type", "id", "name"});
  else
    element.allow_attributes({"type", "id", "name"});
  std::set<std::string> seen;
  for (const Content& content : contents_of(element)) {
    const std::string name = snake_case(content.name);
    if (!name.empty() && !seen.insert(name).second)
      content.element.fail(fmt::format("'{}' is given twice in {}", content.name, description()));
    children_.push_back({content.element, name});
  }
}

std::string Properties::description() const {
  return type_.empty() ? element_.tag() : element_.tag() + " '" + type_ + "'";
}

std::optional<Element> Properties::find(std::string_view name) {
  const std::string spelt = spelling(name, dialect());
  if (std::find(names_.begin(), names_.end(), spelt) == names_.end()) names_.push_back(spelt);
  const std::string snake = snake_case(name);
  for (Child& child : children_) {
    if (child.name != snake) continue;
    child.used = true;
    return child.element;
  }
  return std::nullopt;
}

std::optional<Element> Properties::find(std::string_view name,
                                        const std::vector<std::string>& tags) {
  const std::optional<Element> child = find(name);
  if (child && std::find(tags.begin(), tags.end(), child->tag()) == tags.end())
    child->fail(fmt::format("'{}' of {} must be <{}>, not <{}>", spelling(name, dialect()),
                            description(), tags.front(), child->tag()));
  return child;
}

std::vector<Element> Properties::nested(std::initializer_list<std::string_view> tags) {
  std::vector<Element> result;
  for (Child& child : children_) {
    if (child.used || std::find(tags.begin(), tags.end(), child.element.tag()) == tags.end())
      continue;
    child.used = true;
    result.push_back(child.element);
  }
  return result;
}

void Properties::ignore(std::initializer_list<std::string_view> names) {
  for (const std::string_view name : names) find(name);
}

std::vector<std::string> Properties::ignore_if(bool (*fits)(const std::string& name)) {
  std::vector<std::string> result;
  for (Child& child : children_) {
    if (child.used || child.name.empty() || !fits(child.name)) continue;
    child.used = true;
    result.push_back(child.element.find("name").value_or(child.name));
  }
  return result;
}

double Properties::number(std::string_view name, double fallback) {
  const auto child = find(name, {"float", "integer"});
  if (!child) return fallback;
  child->allow_attributes({"name", "value"});
  return child->number("value");
}

double Properties::positive(std::string_view name, double fallback) {
  const double result = number(name, fallback);
  if (!(result > 0.0)) fail(name, "must be positive");
  return result;
}

double Properties::non_negative(std::string_view name, double fallback) {
  const double result = number(name, fallback);
  if (!(result >= 0.0)) fail(name, "must not be negative");
  return result;
}

int Properties::integer(std::string_view name, int fallback) {
  const auto child = find(name, {"integer"});
  if (!child) return fallback;
  child->allow_attributes({"name", "value"});
  const std::string value = child->text("value");
  if (const auto parsed = parse_integer(value)) return *parsed;
  child->fail("'" + value + "' is not an integer in range");
}

bool Properties::boolean(std::string_view name, bool fallback) {
  const auto child = find(name, {"boolean"});
  if (!child) return fallback;
  child->allow_attributes({"name", "value"});
  const std::string value = child->text("value");
  const std::string lower = dialect() == Dialect::Mitsuba3 ? lower_case(value) : value;
  if (lower != "true" && lower != "false") child->fail("'" + value + "' is not true or false");
  return lower == "true";
}

std::optional<std::string> Properties::text(std::string_view name) {
  const auto child = find(name, {"string"});
  if (!child) return std::nullopt;
  child->allow_attributes({"name", "value"});
  return child->text("value");
}

std::string Properties::required_text(std::string_view name) {
  if (auto value = text(name)) return *std::move(value);
  std::string message =
      fmt::format("{} lacks the <string> '{}'", description(), spelling(name, dialect()));
  for (const Element& other : unused())
    if (other.find("name") && is_slip(other.text("name"), name))
      message += fmt::format("; is it meant by '{}'?", other.text("name"));
  element_.fail(message);
}

std::string Properties::choice(std::string_view name, const std::string& fallback,
                               const std::vector<std::string>& valid) {
  const std::string value = lower_case(text(name).value_or(fallback));
  if (std::find(valid.begin(), valid.end(), value) == valid.end())
    fail(name, "'" + value + "' is not supported; " + hint(value, valid));
  return value;
}

Rgbd Properties::color(std::string_view name, const Rgbd& fallback) {
  static const std::vector<std::string> tags_06{"rgb", "srgb", "spectrum", "blackbody"};
  static const std::vector<std::string> tags_3{"rgb",       "srgb",  "spectrum",
                                               "blackbody", "float", "integer"};
  const auto child = find(name, dialect() == Dialect::Mitsuba3 ? tags_3 : tags_06);
  return child ? read_color(*child) : fallback;
}

std::optional<Vec3d> Properties::point(std::string_view name) { return coordinates(name, "point"); }
std::optional<Vec3d> Properties::vector(std::string_view name) {
  return coordinates(name, "vector");
}

std::optional<Vec3d> Properties::coordinates(std::string_view name, const std::string& tag) {
  // To Mitsuba 3 points and vectors are the same.
  std::vector<std::string> tags{tag};
  if (dialect() == Dialect::Mitsuba3) tags.emplace_back(tag == "point" ? "vector" : "point");
  const auto child = find(name, tags);
  if (!child) return std::nullopt;
  if (dialect() == Dialect::Mitsuba3)
    child->allow_attributes({"name", "x", "y", "z", "value"});
  else
    child->allow_attributes({"name", "x", "y", "z"});
  const std::array<double, 3> xyz = child->xyz();
  return Vec3d(xyz[0], xyz[1], xyz[2]);
}

Eigen::Affine3d Properties::transform(std::string_view name) {
  const auto child = find(name, {"transform"});
  return child ? read_transform(*child) : Eigen::Affine3d::Identity();
}

std::vector<Element> Properties::unused() const {
  std::vector<Element> result;
  for (const Child& child : children_)
    if (!child.used) result.push_back(child.element);
  return result;
}

void Properties::finish() const {
  for (const Element& child : unused()) {
    const std::vector<std::string> tags = known_tags();
    const std::string tag = child.tag();
    const std::string name = child.find("name").value_or("");
    if (is_part_of_picture(tag) || is_unsupported_property(element_.tag(), type_, snake_case(name)))
      child.fail(fmt::format("{} is not supported in {}",
                             name.empty() ? fmt::format("<{}>", tag) : fmt::format("'{}'", name),
                             description()));
    if (std::find(tags.begin(), tags.end(), tag) == tags.end())
      child.fail(
          fmt::format("unknown element <{}> in {}; {}", tag, description(), hint(tag, tags)));
    if (name.empty())
      child.unused(fmt::format("<{}> is not used in {}", tag, description()));
    else
      child.unused(fmt::format("unknown property '{}' of {} is not used; {}", name, description(),
                               hint(name, names_)));
  }
}

void Properties::fail(std::string_view name, const std::string& message) {
  find(name).value_or(element_).fail("'" + spelling(name, dialect()) + "' of " + description() +
                                     ": " + message);
}

}  // namespace driftlight
