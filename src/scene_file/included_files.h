// SPDX-License-Identifier: Apache-2.0
/// The files of a scene: its main file and those that <include> names.
#pragma once

#include <string>
#include <vector>

#include "xml_document.h"

namespace driftlight {

/// The outermost element of the main file, whose dialect is then known. Throws SceneError unless it
/// is a <scene> of a version that is supported.
Element open_scene(XmlDocument& document, Surroundings& surroundings);

/// The outermost element of the file that an <include> names, which is read when it is first asked
/// for: a <scene>, or in the newer dialect any object. Throws SceneError, also if files include
/// each other in a circle or too deeply.
Element included_root(const Element& include);

/// A child of an object.
struct Content {
  Element element;
  std::string name;  ///< as written; empty if it has none
};

/// The children of an object. In the newer dialect those that a file has stand in the place of its
/// <include>, which gives the name to a file that is no <scene>.
std::vector<Content> contents_of(const Element& object);

}  // namespace driftlight
