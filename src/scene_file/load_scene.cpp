// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <memory>

#include "bsdfs_xml.h"
#include "driftlight/scene_file.h"
#include "emitters_xml.h"
#include "integrator_xml.h"
#include "load_context.h"
#include "nearest_names.h"
#include "sensor_xml.h"
#include "shapes_xml.h"
#include "text.h"
#include "textures_xml.h"

namespace driftlight {
namespace {

/// Files that include others several times each could go on for ever.
constexpr std::size_t kMaximumIncludes = 1000;

/// Elements that Mitsuba knows but we do not: they would change the picture.
constexpr std::array kUnsupported{"subsurface", "medium",  "volume",   "phase", "animation",
                                  "film",       "sampler", "rfilter",  "ref",   "boolean",
                                  "float",      "integer", "string",   "rgb",   "spectrum",
                                  "point",      "vector",  "transform"};

constexpr std::array kRead{"default", "include", "path",    "alias",   "integrator",
                           "sensor",  "bsdf",    "texture", "emitter", "shape"};

/// True if the element contains one with the tag.
bool contains(const Element& element, std::string_view tag) {
  const std::vector<Element> children = element.children();
  return std::any_of(children.begin(), children.end(),
                     [&](const Element& child) { return child.tag() == tag; });
}

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
        context_{{Substitutions(options.defines), SearchPath(file.parent_path()),
                  Messages(options.strict)},
                 {},
                 {}} {}

  LoadedScene load() {
    const Element root = read_file(file_);
    if (!messages().is_full())
      keep_errors(root, [&] { context_.surroundings.substitutions.check_defines_used(file_); });
    messages().throw_errors();
    if (!has_sensor_) root.fail("the scene has no sensor");
    if (context_.shape_count == 0) root.fail("the scene has no shape");
    if (!has_emitter_) root.fail("the scene has no emitter");
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

  /// Reads all elements of a file, which stays in memory as long as the loader lives. Returns its
  /// outermost element.
  Element read_file(const std::filesystem::path& file) {
    context_.surroundings.files.add(file);
    documents_.push_back(std::make_unique<XmlDocument>(file));
    XmlDocument& document = *documents_.back();
    const Element scene(document, document.root(), context_.surroundings);
    if (scene.tag() != "scene") scene.fail("the outermost element must be <scene>");
    scene.allow_attributes({"version", "id"});
    const std::string version = scene.text("version");
    const std::optional<Dialect> dialect = dialect_of(version);
    if (!dialect)
      scene.fail("scene version '" + version +
                 "' is not supported; valid are: 0.5.x, 0.6.x, 2.x.x, 3.x.x");
    document.set_dialect(*dialect);
    open_files_.push_back(file);
    for (const Element& element : scene.children()) {
      if (messages().is_full()) break;
      keep_errors(element, [&] { read(element); });
    }
    open_files_.pop_back();
    if (!messages().has_errors() && has_backward_spectra(version) && has_wavelengths(scene))
      context_.notice(scene,
                      "spectra are interpolated as Mitsuba 0.5 did, between two samples from "
                      "the wrong ends; version=\"0.6.0\" has straight lines");
    return scene;
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
      has_emitter_ = true;
    } else if (tag == "shape") {
      read_shape(element, context_);
      has_emitter_ |= contains(element, "emitter");
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
    element.allow_attributes({"filename"});
    const std::filesystem::path file = element.find_file(element.text("filename"));
    if (!std::filesystem::exists(file))
      element.fail("the file '" + file.string() + "' does not exist");
    const bool cyclic = std::any_of(open_files_.begin(), open_files_.end(), [&](const auto& other) {
      return std::filesystem::equivalent(file, other);
    });
    if (cyclic) element.fail("cyclic include: '" + file.string() + "' includes itself");
    if (documents_.size() > kMaximumIncludes)
      element.fail("more than " + std::to_string(kMaximumIncludes) + " files are included");
    read_file(file);
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
  std::vector<std::unique_ptr<XmlDocument>> documents_;
  std::vector<std::filesystem::path> open_files_;  ///< the outermost first
  LoadContext context_;
  std::optional<int> max_depth_;
  bool has_sensor_ = false;
  bool has_emitter_ = false;
};

}  // namespace

LoadedScene load_scene(const std::filesystem::path& file, const LoadOptions& options) {
  return SceneLoader(file, options).load();
}

}  // namespace driftlight
