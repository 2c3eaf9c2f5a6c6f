// SPDX-License-Identifier: Apache-2.0
#include "support/path_classes.h"

#include "driftlight/walk.h"

namespace driftlight::test {
namespace {

std::string name(const Microfacets& microfacets) {
  return microfacets.distribution == Distribution::Ggx ? "ggx" : "beckmann";
}

std::string name(const Shape& shape) {
  if (std::holds_alternative<Sphere>(shape.geometry)) return "sphere";
  if (std::holds_alternative<Disk>(shape.geometry)) return "disk";
  return shape.extent.planar ? "planar mesh" : "mesh";
}

/// The event of scattering at an interface: which side, and whether it is passed.
std::string passage(const ScatterEvent<double>& e) {
  const std::string side = e.at.n_s.dot(e.wi) > 0.0 ? "outside" : "inside";
  return (e.scattering == Scattering::Reflection ? " reflection " : " transmission ") + side;
}

class Collector : public WalkVisitor<double> {
 public:
  Collector(const Scene& scene, std::set<std::string>& classes)
      : scene_(scene), classes_(classes) {}

  void scatter(const ScatterEvent<double>& e) { add_event(e); }
  void connect(const ScatterEvent<double>& e) { add_event(e); }
  void delta(const ScatterEvent<double>& e) { add_event(e); }
  void hit(const AreaEmitter& emitter, const double&, const double&) {
    end("hit " + name(scene_.shapes()[emitter.shape]));
  }
  void environment(const Emitter& emitter, const Vec3d&) {
    end(std::holds_alternative<EnvironmentMap>(emitter) ? "environment map"
                                                        : "constant environment");
  }
  void area_connection(const AreaEmitter& emitter, const double&, const double&) {
    end("connection to " + name(scene_.shapes()[emitter.shape]));
  }
  void point_connection(const PointEmitter&, const double&) {
    end("connection to point after " + last_);
  }

 private:
  void add_event(const ScatterEvent<double>& e) {
    std::visit([&](const auto& bsdf) { add(bsdf, e); }, e.bsdf);
    const auto* mesh = std::get_if<TriangleMesh>(&e.shape.geometry);
    classes_.insert("on " + (mesh != nullptr ? std::string("mesh") : name(e.shape)));
    if (mesh != nullptr && !mesh->normals.empty()) classes_.insert("on interpolated normals");
    if (e.shape.textured) classes_.insert("on texture");
    const Material& material = scene_.materials()[e.shape.material];
    if (material.back && &e.bsdf == &scene_.bsdfs()[*material.back]) classes_.insert("on back");
  }
  void add(const Diffuse&, const ScatterEvent<double>&) { bsdf("diffuse"); }
  void add(const Conductor&, const ScatterEvent<double>&) { bsdf("conductor"); }
  void add(const RoughConductor& b, const ScatterEvent<double>&) {
    bsdf("rough conductor " + name(b.microfacets));
  }
  void add(const Dielectric&, const ScatterEvent<double>& e) { bsdf("dielectric" + passage(e)); }
  void add(const RoughDielectric& b, const ScatterEvent<double>& e) {
    bsdf("rough dielectric " + name(b.microfacets) + passage(e));
  }
  void add(const Phong& b, const ScatterEvent<double>& e) {
    const double lobe = detail::phong_lobe(b, e.wo.dot(reflect(e.wi, e.at.n_s)));
    const double specular = luminance(b.specular_reflectance.eval(e.at.uv)) * lobe;
    const double diffuse = luminance(b.diffuse_reflectance.eval(e.at.uv)) * kInvPi;
    bsdf(specular > diffuse ? "phong glossy lobe" : "phong diffuse lobe");
  }
  void bsdf(const std::string& what) {
    last_ = what;
    classes_.insert(what);
  }
  void end(const std::string& what) { classes_.insert(what); }

  const Scene& scene_;
  std::set<std::string>& classes_;
  std::string last_ = "nothing";
};

}  // namespace

std::set<std::string> classes_of(const Scene& scene, const PathSampler::Sample& path) {
  std::set<std::string> classes;
  Collector collector(scene, classes);
  walk<double>(scene, path.topology, path.coordinates, collector);
  if (path.topology.length() == 1) classes.insert("emitter seen directly");
  return classes;
}

const std::vector<std::string>& required_classes() {
  static const std::vector<std::string> classes{
      "diffuse",
      "conductor",
      "rough conductor beckmann",
      "rough conductor ggx",
      "dielectric reflection outside",
      "dielectric reflection inside",
      "dielectric transmission outside",
      "dielectric transmission inside",
      "rough dielectric beckmann reflection outside",
      "rough dielectric beckmann reflection inside",
      "rough dielectric beckmann transmission outside",
      "rough dielectric beckmann transmission inside",
      "rough dielectric ggx reflection outside",
      "rough dielectric ggx reflection inside",
      "rough dielectric ggx transmission outside",
      "rough dielectric ggx transmission inside",
      "phong glossy lobe",
      "phong diffuse lobe",
      "on mesh",
      "on sphere",
      "on disk",
      "on interpolated normals",
      "on texture",
      "on back",
      "emitter seen directly",
      "hit planar mesh",
      "hit disk",
      "hit sphere",
      "hit mesh",
      "environment map",
      "constant environment",
      "connection to planar mesh",
      "connection to disk",
      "connection to sphere",
      "connection to point after diffuse",
      "connection to point after phong diffuse lobe",
      "connection to point after rough conductor beckmann"};
  return classes;
}

void ClassCounter::add(const std::set<std::string>& classes) {
  for (const std::string& c : classes) ++counts_[c];
}

std::vector<std::string> ClassCounter::missing(int minimum) const {
  std::vector<std::string> result;
  for (const std::string& c : required_classes()) {
    const auto found = counts_.find(c);
    const int count = found == counts_.end() ? 0 : found->second;
    if (count < minimum) result.push_back(c + ": " + std::to_string(count));
  }
  return result;
}

}  // namespace driftlight::test
