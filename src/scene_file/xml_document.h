// SPDX-License-Identifier: Apache-2.0
/// XML files whose elements know where they stand.
#pragma once

#include <array>
#include <filesystem>
#include <initializer_list>
#include <map>
#include <memory>
#include <optional>
#include <pugixml.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "dialect.h"
#include "driftlight/error.h"
#include "file_list.h"
#include "messages.h"
#include "search_path.h"
#include "substitutions.h"

namespace driftlight {

/// A parsed file. Elements refer to it and must not outlive it.
class XmlDocument {
 public:
  /// Throws SceneError if the file cannot be read, is not well-formed, has not exactly one
  /// outermost element, or is nested deeper than any scene needs.
  explicit XmlDocument(const std::filesystem::path& file);
  /// The same of a text that stands for the file line by line, whose own text messages show.
  XmlDocument(const std::filesystem::path& file, std::string text, std::string original);
  XmlDocument(const XmlDocument&) = delete;
  XmlDocument& operator=(const XmlDocument&) = delete;

  pugi::xml_node root() const { return document_.document_element(); }
  Dialect dialect() const { return dialect_; }
  void set_dialect(Dialect dialect) { dialect_ = dialect; }
  std::filesystem::path file() const { return name_; }
  std::filesystem::path directory() const { return file().parent_path(); }
  /// The file in which this one is included, and the element that does it; none of the main file.
  const XmlDocument* including() const { return including_; }
  pugi::xml_node include() const { return include_; }
  void set_include(const XmlDocument& including, pugi::xml_node include) {
    including_ = &including;
    include_ = include;
  }
  /// Of the '<' that opens the element.
  SourceLocation location(pugi::xml_node node) const;
  /// The line at a place of the file, for messages, see excerpt.h.
  std::string excerpt(const SourceLocation& place) const;
  /// The first element with this id, as written.
  pugi::xml_node find_id(const std::string& id) const;

 private:
  /// Of a byte of the text; columns count characters.
  SourceLocation location(std::size_t offset) const;
  [[noreturn]] void fail(const SourceLocation& place, const std::string& message) const;
  void parse();
  void check_depth() const;
  void collect_ids();

  std::string name_;
  std::string text_;
  std::optional<std::string> original_;  ///< none if it is the text
  pugi::xml_document document_;
  std::map<std::string, pugi::xml_node> ids_;
  Dialect dialect_ = Dialect::Mitsuba06;
  const XmlDocument* including_ = nullptr;
  pugi::xml_node include_;
};

/// What the texts of attributes mean depends on these, which change as elements are read.
struct Surroundings {
  Substitutions substitutions;
  SearchPath search_path;
  Messages messages;
  FileList files = {};
  /// By the nodes of the elements that include them.
  std::map<const void*, std::unique_ptr<XmlDocument>> included = {};
};

/// One element; attributes are read after substitution of $names.
class Element {
 public:
  Element(const XmlDocument& document, pugi::xml_node node, Surroundings& surroundings)
      : document_(&document), node_(node), surroundings_(&surroundings) {}

  std::string tag() const { return node_.name(); }
  /// Tag of the element around this one, or around what includes its file; empty if there is none.
  std::string parent_tag() const;
  /// True if it is not within another element of its file.
  bool is_outermost() const { return node_ == document_->root(); }
  const XmlDocument& document() const { return *document_; }
  pugi::xml_node node() const { return node_; }
  Surroundings& surroundings() const { return *surroundings_; }
  Dialect dialect() const { return document_->dialect(); }
  /// Of the file, as its outermost element says.
  std::string version() const {
    return Element(*document_, document_->root(), *surroundings_).text("version");
  }
  std::optional<std::string> find(const char* attribute) const;
  /// The same, and throws SceneError if it is missing.
  std::string text(const char* attribute) const;
  double number(const char* attribute) const;
  double number(const char* attribute, double fallback) const;
  /// `count` numbers, separated by commas or blanks.
  std::vector<double> numbers(const char* attribute, std::size_t count) const;
  /// Three numbers: the attributes x, y and z, or in the newer dialect a `value` of one or three.
  /// What is missing is the fallback; without one that is an error.
  std::array<double, 3> xyz(std::optional<double> fallback = std::nullopt) const;
  /// A file by its name, wherever the scene's files are looked for. It counts as one of them.
  std::filesystem::path find_file(const std::string& name) const {
    std::filesystem::path file = surroundings_->search_path.find(name, document_->directory());
    surroundings_->files.add(file);
    return file;
  }

  std::vector<Element> children() const;
  /// Says of an attribute with another name that it is not used.
  void allow_attributes(std::initializer_list<std::string_view> names) const;

  /// Keeps an error of each $name in the element or in anything inside of it that has no value, and
  /// throws the first. Also marks the names as used, which matters for elements that nobody reads.
  void check_names() const;

  SourceLocation location() const { return document_->location(node_); }
  /// Throws SceneError with the line of the element, unless the message shows a line already.
  [[noreturn]] void fail(const std::string& message) const;
  /// Says that nobody uses the element or a part of it: a notice, or an error if the user wants
  /// none of that.
  void unused(const std::string& message) const;

  /// The element of the same file with this id, if any.
  std::optional<Element> find_id(const std::string& id) const;
  /// All ids of the element and of those in it, as written, but for those that are referred to.
  std::vector<std::string> ids() const;
  bool is_inside(const Element& other) const;
  /// True if both are the same element of the same file.
  bool operator==(const Element& other) const { return node_ == other.node_; }

 private:
  const XmlDocument* document_;
  pugi::xml_node node_;
  Surroundings* surroundings_;
};

/// Runs `read` and gives its InputErrors, which know no place, the place of the element.
template <class Read>
auto with_location(const Element& element, Read read) {
  try {
    return read();
  } catch (const SceneError&) {
    throw;
  } catch (const InputError& error) {
    element.fail(error.what());
  }
}

}  // namespace driftlight
