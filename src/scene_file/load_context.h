// SPDX-License-Identifier: Apache-2.0
/// What the readers of a scene share.
#pragma once

#include <fmt/format.h>

#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "driftlight/scene.h"
#include "driftlight/tone_mapping.h"
#include "xml_document.h"

namespace driftlight {

/// What a <bsdf> stands for.
struct Surface {
  Bsdf front;
  std::optional<Bsdf> back;
  /// Index in the scene, once some shape has needed it.
  std::optional<std::uint32_t> material;
  std::shared_ptr<const Relief> relief = nullptr;
};

/// What a <shape> consists of.
struct ShapePart {
  Geometry geometry;
  std::shared_ptr<Surface> surface = nullptr;
  std::vector<Eigen::Vector3f> colors =
      {};  ///< linear, of a mesh's vertices; empty, or one for each
};

/// What a <shape type="shapegroup"> stands for, in its own space.
struct ShapeGroup {
  std::vector<ShapePart> parts;
  std::size_t triangles = 0;
};

/// Something refers to an element that could not be read, which is an error already.
class Unreadable : public SceneError {
 public:
  using SceneError::SceneError;
};

/// Elements by id, for <ref>. In the older dialect only those above a <ref> are known to it, as in
/// Mitsuba; in the newer one a bsdf or texture further down is read when it is needed.
class NamedObjects {
 public:
  /// Something with an id that no <ref> may ask for.
  struct Other {};
  /// Something that could not be read.
  struct Failed {};
  /// <emitter type="area">
  struct Radiance {
    Texture texture;
  };
  using Object = std::variant<Other, Failed, std::shared_ptr<Surface>,
                              std::shared_ptr<const ShapeGroup>, Texture, Radiance>;

  /// Registers the element if it has an id. Throws SceneError if the id is taken.
  void define(const Element& element, Object object);
  /// Registers the element, and all in it that has an id, as what could not be read.
  void define_failed(const Element& element);
  /// <alias id="..." as="...">: a second id. Throws SceneError.
  void define_alias(const Element& alias);

  /// What the element stands for if it was read before its turn.
  template <class T>
  const T* find_read(const Element& element) const {
    const auto found = objects_.find(element.find("id").value_or(""));
    if (found == objects_.end() || !(found->second.element == element)) return nullptr;
    return std::get_if<T>(&found->second.object);
  }

  bool is_read(const Element& element) const {
    const auto found = objects_.find(element.find("id").value_or(""));
    return found != objects_.end() && found->second.element == element;
  }

  /// Reads the element that the <ref> names before its turn, by `read`, if it has the tag and the
  /// dialect allows it. Throws SceneError if elements need each other in a circle.
  template <class Read>
  void read_ahead(const Element& ref, std::string_view tag, Read read) {
    const std::optional<Element> target = find_ahead(ref, tag);
    if (!target) return;
    pending_.push_back(*target);
    try {
      read(*target);
    } catch (...) {
      pending_.pop_back();
      throw;
    }
    pending_.pop_back();
  }

  /// True if <ref id="..."/> names a T. Throws SceneError if it names nothing, Unreadable if that
  /// could not be read.
  template <class T>
  bool names(const Element& ref) const {
    return std::holds_alternative<T>(find(ref));
  }

  /// The object that <ref id="..."/> names; `kind` ("bsdf") is for messages. Throws SceneError if
  /// there is none, it is of another kind, is defined only further down, or contains the <ref>;
  /// Unreadable if it could not be read.
  template <class T>
  T resolve(const Element& ref, const std::string& kind) const {
    const T* const object = std::get_if<T>(&find(ref));
    if (!object) ref.fail(fmt::format("'{}' is not a {}", ref.text("id"), kind));
    return *object;
  }

 private:
  struct Entry {
    Element element;
    Object object;
  };

  const Object& find(const Element& ref) const;
  std::optional<Element> find_ahead(const Element& ref, std::string_view tag) const;
  [[noreturn]] void fail_unknown(const Element& element) const;

  std::map<std::string, Entry> objects_;
  std::vector<Element> pending_;  ///< being read before their turn
};

struct LoadContext {
  Surroundings surroundings;
  SceneBuilder builder;
  NamedObjects objects;
  ToneMapping tone_mapping = {};
  std::optional<int> sample_count = {};  ///< samples per pixel that the scene asks for
  std::size_t shape_count = 0;
  std::size_t instanced_triangles = 0;
  bool has_emitter = false;
  /// Decoded as sRGB, though the scene does not ask for it.
  std::set<std::shared_ptr<const Bitmap>> assumed_srgb = {};

  void notice(const Element& element, const std::string& message) {
    notice(element.location(), message);
  }
  void notice(const SourceLocation& at, const std::string& message) {
    surroundings.messages.notice(at, message);
  }
};

}  // namespace driftlight
