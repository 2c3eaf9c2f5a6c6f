// SPDX-License-Identifier: Apache-2.0
#include "driftlight/path_class.h"

#include <array>

#include "driftlight/walk.h"

namespace driftlight {
namespace {

std::string name(const Microfacets& microfacets) {
  const std::string distribution = microfacets.distribution == Distribution::Beckmann ? "beckmann"
                                   : microfacets.distribution == Distribution::Ggx    ? "ggx"
                                                                                      : "phong";
  return microfacets.is_isotropic() ? distribution : "anisotropic " + distribution;
}

struct BsdfKind {
  std::string operator()(const Diffuse&) const { return "diffuse"; }
  std::string operator()(const Conductor&) const { return "conductor"; }
  std::string operator()(const RoughConductor& b) const {
    return "rough conductor " + name(b.microfacets);
  }
  std::string operator()(const Dielectric&) const { return "dielectric"; }
  std::string operator()(const RoughDielectric& b) const {
    return "rough dielectric " + name(b.microfacets);
  }
  std::string operator()(const Phong&) const { return "phong"; }
  std::string operator()(const Ward& b) const {
    return b.microfacets().is_isotropic() ? "ward" : "anisotropic ward";
  }
  std::string operator()(const Plastic&) const { return "plastic"; }
  std::string operator()(const RoughPlastic& b) const {
    return "rough plastic " + name(b.microfacets);
  }
  std::string operator()(const ThinDielectric&) const { return "thin dielectric"; }
  std::string operator()(const Mask& b) const {
    return b.nested == nullptr ? "null" : "masked " + kind_of(b.nested->bsdf);
  }
  std::string operator()(const Coating& b) const { return "coated " + kind_of(b.nested->bsdf); }
  std::string operator()(const Blend& b) const {
    return "blend of " + kind_of(b.first->bsdf) + " and " + kind_of(b.second->bsdf);
  }
};

/// The event of scattering at an interface: which side, and whether it is passed.
std::string passage(const ScatterEvent<double>& e) {
  const std::string side = e.at.n_s.dot(e.wi) > 0.0 ? "outside" : "inside";
  return (e.scattering == Scattering::Reflection ? " reflection " : " transmission ") + side;
}

/// Which of two lobes is the brighter one.
template <class B>
bool is_glossy(const B& b, const ScatterEvent<double>& e) {
  const auto lobes = detail::lobes<double>(b, e.surface(), e.wi, e.wo);
  return lobes.glossy > lobes.diffuse;
}

std::string lobe(const Phong& b, const ScatterEvent<double>& e) {
  return is_glossy(b, e) ? " glossy lobe" : " diffuse lobe";
}

std::string lobe(const Ward& b, const ScatterEvent<double>& e) {
  return is_glossy(b, e) ? " glossy lobe" : " diffuse lobe";
}

std::string lobe(const RoughPlastic& b, const ScatterEvent<double>& e) {
  return is_glossy(b, e) ? " coat" : " base";
}

std::string lobe(const Blend& b, const ScatterEvent<double>& e) {
  const auto shares = detail::blend_shares<double>(b, e.surface(), e.wi, e.wo);
  return shares.second > shares.first ? ", the second" : ", the first";
}

/// The BSDF with what it does at this event.
std::string lobe(const ScatterEvent<double>& e, bool delta) {
  const std::string kind = kind_of(e.bsdf);
  if (std::holds_alternative<Mask>(e.bsdf) && delta && e.scattering == Scattering::Transmission)
    return kind + " passed";
  if (std::holds_alternative<Plastic>(e.bsdf) || std::holds_alternative<Coating>(e.bsdf))
    return kind + (delta ? " coat" : " base");
  const auto* blend = std::get_if<Blend>(&e.bsdf);
  if (blend != nullptr && delta) return kind + ", smooth" + passage(e);
  if (is_transmissive(e.bsdf)) return kind + passage(e);
  if (blend != nullptr) return kind + lobe(*blend, e);
  if (const auto* phong = std::get_if<Phong>(&e.bsdf)) return kind + lobe(*phong, e);
  if (const auto* ward = std::get_if<Ward>(&e.bsdf)) return kind + lobe(*ward, e);
  if (const auto* plastic = std::get_if<RoughPlastic>(&e.bsdf)) return kind + lobe(*plastic, e);
  return kind;
}

std::string surface(const Shape& shape) {
  return std::holds_alternative<TriangleMesh>(shape.geometry) ? "mesh" : kind_of(shape);
}

class Collector : public WalkVisitor<double> {
 public:
  explicit Collector(const Scene& scene) : scene_(scene) {}

  const std::set<std::string>& classes() const { return classes_; }
  /// Scattering events and the end, runs of equal ones collapsed.
  std::string sequence() const {
    std::string text;
    for (std::size_t i = 0; i < count_;) {
      std::size_t run = 1;
      while (i + run < count_ && events_[i + run] == events_[i]) ++run;
      text += events_[i] + (run > 1 ? " x" + std::to_string(run) : "") + " > ";
      i += run;
    }
    return text + end_;
  }

  void vertex(int k) { index_ = static_cast<std::size_t>(k); }
  void scatter(const ScatterEvent<double>& e) { add_event(e); }
  void connect(const ScatterEvent<double>& e) { add_event(e); }
  void delta(const ScatterEvent<double>& e) { add_event(e, true); }
  void light_scatter(const ScatterEvent<double>& e) { add_light_event(e); }
  void light_delta(const ScatterEvent<double>& e) { add_light_event(e, true); }
  void light_connect(const ScatterEvent<double>& e) {
    classes_.insert(index_ == 0 ? "joined to the sensor" : "joined between surfaces");
    add_light_event(e);
  }
  void area_emission(const AreaEmitter& emitter, const Vec3d&, const Vec3d&) {
    end("emission from " + kind_of(scene_.shapes()[emitter.shape]));
  }
  void point_emission(const Emitter& emitter, const Vec3d&) {
    end(std::holds_alternative<SpotEmitter>(emitter) ? "emission from spot"
                                                     : "emission from point");
  }
  void directional_emission(const DirectionalEmitter&, const Vec3d&) {
    end("emission from directional");
  }
  void hit(const AreaEmitter& emitter, const double&, const double&) {
    end("hit " + kind_of(scene_.shapes()[emitter.shape]));
  }
  void blurred_hit(const BlurredAreaEmitter&, const Ray<double>&) { end("blurred area"); }
  void environment(const Emitter& emitter, const Vec3d&) { end(kind_of(emitter)); }
  void area_connection(const AreaEmitter& emitter, const double&, const double&) {
    end("connection to " + kind_of(scene_.shapes()[emitter.shape]));
  }
  void point_connection(const Emitter& emitter, const Vec3d&, const double&) {
    delta_end(std::holds_alternative<SpotEmitter>(emitter) ? "spot" : "point");
  }
  void directional_connection(const DirectionalEmitter&) { delta_end("directional"); }

 private:
  void add_event(const ScatterEvent<double>& e, bool delta = false) {
    last_lobe_ = lobe(e, delta);
    const std::string on = " on " + surface(e.shape);
    events_.at(index_) = last_lobe_ + on;
    ++count_;
    classes_.insert(last_lobe_);
    classes_.insert(on.substr(1));
    const auto* mesh = std::get_if<TriangleMesh>(&e.shape.geometry);
    if (mesh != nullptr && !mesh->normals.empty()) classes_.insert("on interpolated normals");
    if (e.shape.textured) classes_.insert("on texture");
    const Material& material = scene_.materials()[e.shape.material];
    if (material.back && &e.bsdf == &scene_.bsdfs()[*material.back]) classes_.insert("on back");
  }
  void add_light_event(const ScatterEvent<double>& e, bool delta = false) {
    add_event(e, delta);
    events_.at(index_) += " by light";
    classes_.insert(last_lobe_ + " by light");
  }
  void delta_end(const std::string& emitter) {
    end("connection to " + emitter);
    classes_.insert("connection to " + emitter + " after " + last_lobe_);
  }
  void end(const std::string& what) {
    end_ = what;
    classes_.insert(what);
  }

  const Scene& scene_;
  std::set<std::string> classes_;
  std::array<std::string, kMaxPathLength> events_;
  std::size_t count_ = 0;
  std::size_t index_ = 0;
  std::string last_lobe_;
  std::string end_;
};

Collector collect(const Scene& scene, const PathTopology& topology,
                  const PathCoordinates& coordinates) {
  Collector collector(scene);
  walk<double>(scene, topology, coordinates, collector);
  return collector;
}

std::string length_class(const PathTopology& topology) {
  return "length " + std::to_string(topology.length());
}

}  // namespace

std::string kind_of(const Bsdf& bsdf) { return std::visit(BsdfKind{}, bsdf); }

std::string kind_of(const Shape& shape) {
  if (std::holds_alternative<Sphere>(shape.geometry)) return "sphere";
  if (std::holds_alternative<Disk>(shape.geometry)) return "disk";
  if (std::holds_alternative<Cylinder>(shape.geometry)) return "cylinder";
  return shape.extent.planar ? "planar mesh" : "mesh";
}

std::string kind_of(const Emitter& emitter) {
  struct Kind {
    std::string operator()(const AreaEmitter&) const { return "area emitter"; }
    std::string operator()(const PointEmitter&) const { return "point emitter"; }
    std::string operator()(const ConstantEnvironment&) const { return "constant environment"; }
    std::string operator()(const EnvironmentMap&) const { return "environment map"; }
    std::string operator()(const SpotEmitter&) const { return "spot emitter"; }
    std::string operator()(const DirectionalEmitter&) const { return "directional emitter"; }
    std::string operator()(const BlurredAreaEmitter&) const { return "blurred area emitter"; }
  };
  return std::visit(Kind{}, emitter);
}

std::set<std::string> classes_of(const Scene& scene, const PathTopology& topology,
                                 const PathCoordinates& coordinates) {
  std::set<std::string> classes = collect(scene, topology, coordinates).classes();
  classes.insert(length_class(topology));
  if (topology.length() == 1) classes.insert("emitter seen directly");
  return classes;
}

std::string path_class(const Scene& scene, const PathTopology& topology,
                       const PathCoordinates& coordinates) {
  return length_class(topology) + ": " + collect(scene, topology, coordinates).sequence();
}

}  // namespace driftlight
