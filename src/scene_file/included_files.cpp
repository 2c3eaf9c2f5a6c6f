// SPDX-License-Identifier: Apache-2.0
#include "included_files.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <memory>
#include <utility>

namespace driftlight {
namespace {

/// Files that include others several times each could go on for ever.
constexpr std::size_t kMaximumIncludes = 1000;

/// Levels of elements within elements, from the main file on.
constexpr int kMaximumLevels = 32;

/// What may be the outermost element of a file.
constexpr std::array kObjects{"bsdf",    "emitter", "film",    "integrator", "rfilter",
                              "sampler", "sensor",  "texture", "shape",      "spectrum"};

/// How far below the outermost element of the main file an element is.
int level_of(const XmlDocument& document, pugi::xml_node node) {
  int level = 0;
  for (pugi::xml_node at = node; at != document.root(); at = at.parent()) ++level;
  const XmlDocument* const including = document.including();
  return including == nullptr ? level : level + level_of(*including, document.include());
}

int deepest_level(const XmlDocument& document) {
  struct Walker : pugi::xml_tree_walker {
    int deepest = 0;
    bool for_each(pugi::xml_node&) override {
      deepest = std::max(deepest, depth() + 1);
      return true;
    }
  };
  Walker walker;
  document.root().traverse(walker);
  return walker.deepest;
}

void set_dialect(XmlDocument& document, const Element& root) {
  const std::string version = root.text("version");
  const std::optional<Dialect> dialect = dialect_of(version);
  if (!dialect)
    root.fail("scene version '" + version +
              "' is not supported; valid are: 0.5.x, 0.6.x, 2.x.x, 3.x.x");
  document.set_dialect(*dialect);
}

/// Reads the file and checks that it may stand where the <include> is.
std::unique_ptr<XmlDocument> open_included(const Element& include) {
  if (include.dialect() == Dialect::Mitsuba3)
    include.allow_attributes({"filename", "name"});
  else
    include.allow_attributes({"filename"});
  const std::filesystem::path file = include.find_file(include.text("filename"));
  if (!std::filesystem::exists(file))
    include.fail("the file '" + file.string() + "' does not exist");
  for (const XmlDocument* open = &include.document(); open != nullptr; open = open->including())
    if (std::filesystem::equivalent(file, open->file()))
      include.fail("cyclic include: '" + file.string() + "' includes itself");
  auto document = std::make_unique<XmlDocument>(file);
  document->set_include(include.document(), include.node());
  if (level_of(*document, document->root()) + deepest_level(*document) >= kMaximumLevels)
    include.fail("with '" + file.string() + "' elements are nested more than " +
                 std::to_string(kMaximumLevels) + " levels deep");
  const Element root(*document, document->root(), include.surroundings());
  const std::string tag = root.tag();
  const bool is_object = std::find(kObjects.begin(), kObjects.end(), tag) != kObjects.end();
  if (tag != "scene" && include.dialect() != Dialect::Mitsuba3)
    root.fail("the outermost element must be <scene>");
  if (tag != "scene" && !is_object)
    root.fail("the outermost element must be <scene> or an object such as <bsdf>");
  if (tag == "scene") root.allow_attributes({"version", "id"});
  set_dialect(*document, root);
  return document;
}

}  // namespace

Element open_scene(XmlDocument& document, Surroundings& surroundings) {
  Element root(document, document.root(), surroundings);
  if (root.tag() != "scene") root.fail("the outermost element must be <scene>");
  root.allow_attributes({"version", "id"});
  set_dialect(document, root);
  return root;
}

Element included_root(const Element& include) {
  auto& included = include.surroundings().included;
  const void* const key = include.node().internal_object();
  auto found = included.find(key);
  if (found == included.end()) {
    if (included.size() >= kMaximumIncludes)
      include.fail("more than " + std::to_string(kMaximumIncludes) + " files are included");
    found = included.emplace(key, open_included(include)).first;
  }
  return {*found->second, found->second->root(), include.surroundings()};
}

std::vector<Content> contents_of(const Element& object) {
  std::vector<Content> result;
  for (const Element& child : object.children()) {
    std::string name = child.find("name").value_or("");
    if (child.tag() != "include" || child.dialect() != Dialect::Mitsuba3) {
      result.push_back({child, std::move(name)});
      continue;
    }
    const Element root = included_root(child);
    if (root.tag() != "scene") {
      root.check_names();
      result.push_back({root, std::move(name)});
      continue;
    }
    for (Content& content : contents_of(root)) {
      if (!content.element.find("type"))
        content.element.fail("<" + content.element.tag() +
                             "> is not supported in a file that an object includes");
      content.element.check_names();
      result.push_back(std::move(content));
    }
  }
  return result;
}

}  // namespace driftlight
