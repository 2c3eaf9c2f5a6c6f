// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>

#include "bsdfs_xml.h"
#include "driftlight/scene_file.h"
#include "emitters_xml.h"
#include "included_files.h"
#include "integrator_xml.h"
#include "load_context.h"
#include "nearest_names.h"
#include "sensor_xml.h"
#include "shapes_xml.h"
#include "text.h"
#include "textures_xml.h"

namespace driftlight {
namespace {

/// Elements that Mitsuba knows but we do not: they would change the picture.
constexpr std::array kUnsupported{"subsurface", "medium",  "volume",   "phase", "animation",
                                  "film",       "sampler", "rfilter",  "ref",   "boolean",
                                  "float",      "integer", "string",   "rgb",   "spectrum",
                                  "point",      "vector",  "transform"};

constexpr std::array kRead{"default", "include", "path",    "alias",   "integrator",
                           "sensor",  "bsdf",    "texture", "emitter", "shape"};

/// True if a spectrum in the element is a list of wavelengths or a file of such.
bool has_wavelengths(const Element& element) {
  const std::vector<Element> children = element.children();
  return std::any_of(children.begin(), children.end(), [](const Element& child) {
    const bool lists = child.find("filename").has_value() ||
                       child.find("value").value_or("").find(':') != std::string::npos;
    return (child.tag() == "spectrum" && lists) || has_wavelengths(child);
  });
}

/// Reads one scene: the elements of its file, from top to bottom, into a SceneBuilder. What is
/// wrong with one of them is kept until all have been read.
class SceneLoader {
 public:
  SceneLoader(const std::filesystem::path& file, const LoadOptions& options)
      : file_(file),
        document_(file),
        context_{{Substitutions(options.defines), SearchPath(file.parent_path()),
                  Messages(options.strict)},
                 {},
                 {}} {}

  LoadedScene load() {
    context_.surroundings.files.add(file_);
    const Element root = open_scene(document_, context_.surroundings);
    read_scene(root);
    if (!messages().is_full())
      keep_errors(root, [&] { context_.surroundings.substitutions.check_defines_used(file_); });
    messages().throw_errors();
    if (!has_sensor_) root.fail("the scene has no sensor");
    if (context_.shape_count == 0) root.fail("the scene has no shape");
    if (!context_.has_emitter) root.fail("the scene has no emitter");
    Scene scene = with_location(root, [&] { return context_.builder.build(); });
    return {std::move(scene),      max_depth_,
            context_.sample_count, messages().notices(),
            context_.tone_mapping, context_.surroundings.files.files()};
  }

 private:
  Messages& messages() { return context_.surroundings.messages; }

  /// Runs `read`, which is about the element, and keeps its error.
  template <class Read>
  void keep_errors(const Element& element, Read read) {
    try {
      with_location(element, read);
    } catch (const Unreadable&) {
      // What it needs is an error already.
      context_.objects.define_failed(element);
    } catch (const SceneError& error) {
      messages().error(error);
      context_.objects.define_failed(element);
    }
  }

  /// Reads all elements of a <scene>.
  void read_scene(const Element& scene) {
    for (const Element& element : scene.children()) {
      if (messages().is_full()) break;
      keep_errors(element, [&] { read(element); });
    }
    if (!messages().has_errors() && has_backward_spectra(scene.version()) && has_wavelengths(scene))
      context_.notice(scene,
                      "spectra are interpolated as Mitsuba 0.5 did, between two samples from "
                      "the wrong ends; version=\"0.6.0\" has straight lines");
  }

  void read(const Element& element) {
    element.check_names();
    const std::string tag = element.tag();
    if (tag == "default") {
      read_default(element);
    } else if (tag == "include") {
      read_include(element);
    } else if (tag == "path") {
      read_path(element);
    } else if (tag == "alias") {
      context_.objects.define_alias(element);
    } else if (tag == "integrator") {
      read_the_integrator(element);
    } else if (tag == "sensor") {
      read_the_sensor(element);
    } else if (tag == "bsdf") {
      read_surface(element, context_);
    } else if (tag == "texture") {
      read_texture(element, context_);
    } else if (tag == "emitter") {
      read_emitter(element, context_);
    } else if (tag == "shape") {
      read_shape(element, context_);
    } else {
      read_other(element);
    }
  }

  void read_default(const Element& element) {
    element.allow_attributes({"name", "value"});
    const std::string name = element.text("name");
    if (name.empty()) element.fail("<default> needs a name");
    context_.surroundings.substitutions.add_default(name, element.text("value"));
  }

  /// Reads another file as if its elements stood here.
  void read_include(const Element& element) {
    const Element root = included_root(element);
    if (root.tag() == "scene")
      read_scene(root);
    else
      keep_errors(root, [&] { read(root); });
  }

  /// A directory in which other files are looked for, too.
  void read_path(const Element& element) {
    element.allow_attributes({"value"});
    const std::filesystem::path directory = element.find_file(element.text("value"));
    if (!std::filesystem::is_directory(directory))
      element.fail("the directory '" + directory.string() + "' does not exist");
    context_.surroundings.search_path.add(directory);
  }

  /// Mitsuba 3 lets the user choose one of several sensors, by default the first.
  void read_the_sensor(const Element& element) {
    if (has_sensor_) {
      if (element.dialect() == Dialect::Mitsuba06) element.fail("a second sensor");
      context_.notice(element, "a further sensor is not used: the first one is");
      return;
    }
    context_.builder.set_camera(read_sensor(element, context_));
    has_sensor_ = true;
  }

  /// Of several the last one says how long paths are, if it does.
  void read_the_integrator(const Element& element) {
    if (const auto depth = read_integrator(element, context_)) max_depth_ = *depth;
  }

  /// A block of some other program, which may hold the depth of its integrator. Such blocks have no
  /// type, unlike all that matters to the picture, whose names may be misspelt.
  void read_other(const Element& element) {
    const std::string tag = element.tag();
    const bool of_mitsuba =
        std::find(kUnsupported.begin(), kUnsupported.end(), tag) != kUnsupported.end();
    if (of_mitsuba || element.find("type"))
      element.fail("<" + tag + "> is not supported in a scene; " +
                   hint(tag, {kRead.begin(), kRead.end()}));
    context_.notice(element, "block <" + tag + "> is not ours; only its maxDepth is used");
    for (const Element& child : element.children())
      if (lower_case(child.find("name").value_or("")) == "maxdepth")
        max_depth_ = read_max_depth(child);
  }

  std::filesystem::path file_;
  XmlDocument document_;
  LoadContext context_;
  std::optional<int> max_depth_;
  bool has_sensor_ = false;
};

}  // namespace

LoadedScene load_scene(const std::filesystem::path& file, const LoadOptions& options) {
  return SceneLoader(file, options).load();
}

}  // namespace driftlight
