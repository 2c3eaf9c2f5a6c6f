// SPDX-License-Identifier: Apache-2.0
/// What the readers of a scene share.
#pragma once

#include <fmt/format.h>

#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "driftlight/scene.h"
#include "substitutions.h"
#include "xml_document.h"

namespace driftlight {

/// What a <bsdf> stands for.
struct Surface {
  Bsdf front;
  std::optional<Bsdf> back;
  /// Index in the scene, once some shape has needed it.
  std::optional<std::uint32_t> material;
};

/// Elements by id, for <ref>. Only those above a <ref> are known to it, as in Mitsuba.
class NamedObjects {
 public:
  /// Something with an id that no <ref> may ask for.
  struct Other {};
  using Object = std::variant<Other, std::shared_ptr<Surface>, Texture>;

  /// Registers the element if it has an id. Throws SceneError if the id is taken.
  void define(const Element& element, Object object);

  /// The object that <ref id="..."/> names; `kind` ("bsdf") is for messages. Throws SceneError if
  /// there is none, it is of another kind, is defined only further down, or contains the <ref>.
  template <class T>
  T resolve(const Element& ref, const std::string& kind) const {
    const T* const object = std::get_if<T>(&find(ref));
    if (!object) ref.fail(fmt::format("'{}' is not a {}", ref.text("id"), kind));
    return *object;
  }

 private:
  const Object& find(const Element& ref) const;

  std::map<std::string, Object> objects_;
};

struct LoadContext {
  std::filesystem::path directory;  ///< of the main scene file; other files are relative to it
  Substitutions substitutions;
  SceneBuilder builder;
  NamedObjects objects;
  std::vector<std::string> notices;

  void notice(const Element& element, const std::string& message) {
    notices.push_back(to_string(element.location()) + ": " + message);
  }
};

}  // namespace driftlight
