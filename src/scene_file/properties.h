// SPDX-License-Identifier: Apache-2.0
/// The parameters of one plugin.
#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "driftlight/scalar.h"
#include "nearest_names.h"
#include "text.h"
#include "xml_document.h"

namespace driftlight {

/// The children of an element such as <bsdf type="diffuse">, each to be asked for by its reader.
/// What nobody asked for is named by `finish`. Readers ask in camel case ("toWorld"); files of
/// either dialect may also write "to_world".
class Properties {
 public:
  /// Throws SceneError if two children have the same name.
  explicit Properties(const Element& element);

  const Element& element() const { return element_; }
  /// In lower case; empty if the element has none.
  const std::string& type() const { return type_; }
  /// "bsdf 'diffuse'", for messages.
  std::string description() const;

  /// The child with this name.
  std::optional<Element> find(std::string_view name);
  bool has(std::string_view name) { return find(name).has_value(); }
  Dialect dialect() const { return element_.dialect(); }
  /// The children with one of these tags that have not been asked for by name.
  std::vector<Element> nested(std::initializer_list<std::string_view> tags);
  /// Allows properties that have no bearing on the picture.
  void ignore(std::initializer_list<std::string_view> names);
  /// Allows those whose name, in snake case, fits and that nobody has asked for; their names as
  /// written.
  std::vector<std::string> ignore_if(bool (*fits)(const std::string& name));

  double number(std::string_view name, double fallback);
  double positive(std::string_view name, double fallback);
  double non_negative(std::string_view name, double fallback);
  int integer(std::string_view name, int fallback);
  bool boolean(std::string_view name, bool fallback);
  std::optional<std::string> text(std::string_view name);
  /// The same, and throws SceneError if it is missing, naming what may be meant by it.
  std::string required_text(std::string_view name);
  /// A text out of a few, in lower case.
  std::string choice(std::string_view name, const std::string& fallback,
                     const std::vector<std::string>& valid);
  Rgbd color(std::string_view name, const Rgbd& fallback);
  std::optional<Vec3d> point(std::string_view name);
  std::optional<Vec3d> vector(std::string_view name);
  /// Identity if there is none.
  Eigen::Affine3d transform(std::string_view name);

  /// The children that were not asked for.
  std::vector<Element> unused() const;

  /// Says of each child that was not asked for that it is not used, with the names nearest to its
  /// own of all that were. Throws SceneError if Mitsuba would use it and the picture would change.
  void finish() const;

  /// Throws SceneError about a property that `find` has found, or about the plugin.
  [[noreturn]] void fail(std::string_view name, const std::string& message);

 private:
  struct Child {
    Element element;
    std::string name;  ///< in snake case
    bool used = false;
  };

  std::optional<Vec3d> coordinates(std::string_view name, const std::string& tag);
  /// The child with this name, which must have one of the tags.
  std::optional<Element> find(std::string_view name, const std::vector<std::string>& tags);

  Element element_;
  std::string type_;
  std::vector<Child> children_;
  std::vector<std::string> names_;  ///< all that were asked for, as the dialect spells them
};

/// The entry of a table of plugins, (name, what to do) pairs, for the type of this one. Throws
/// SceneError naming valid types.
template <class Table>
auto find_plugin(const Table& table, const Properties& properties) {
  std::vector<std::string> names;
  for (const auto& [name, entry] : table) {
    if (name == properties.type()) return entry;
    names.emplace_back(name);
  }
  const Element& element = properties.element();
  element.fail("unknown " + properties.description() + "; " + hint(properties.type(), names));
}

}  // namespace driftlight
