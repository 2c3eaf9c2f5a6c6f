// SPDX-License-Identifier: Apache-2.0
#include "vertex_path.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "driftlight/error.h"
#include "driftlight/walk.h"

namespace driftlight {

bool VertexPath::evaluate(const Scene& scene) {
  const Camera& camera = scene.camera();
  std::array<double, kMaxPathLength + 1> inverse_r2{};
  Vec3d from = camera.origin;
  for (int k = 1; k < edges; ++k) {
    const Vec3d& p = (*this)(k).surface.at.p;
    const Vec3d edge = p - from;
    const auto index = static_cast<std::size_t>(k);
    inverse_r2[index] = 1.0 / edge.squaredNorm();
    directions_[index - 1] = edge * std::sqrt(inverse_r2[index]);
    from = p;
  }
  const auto n = static_cast<std::size_t>(edges);
  const LightEdge last = edge_to(end, from);
  inverse_r2[n] = last.inverse_r2;
  directions_[n - 1] = last.direction;
  if (!last.lit() || !camera.sees(directions_[0], camera.origin)) return false;

  forward_[0] = camera.log_importance(directions_[0]);
  Rgbd color = end.emitted;
  double log_f = forward_[0] + std::log(last.cosine * last.inverse_r2 * last.falloff);
  for (std::size_t k = 1; k < n; ++k) {
    const Vertex& x = vertices_[k - 1];
    const Vec3d wi = -directions_[k - 1];
    const Vec3d& wo = directions_[k];
    if (!passes(x.surface.at, wi, wo)) return false;
    const ScatteringDensities e =
        x.delta ? delta_event(x.surface, wi, wo, x.scattering) : density_event(x.surface, wi, wo);
    color *= e.f;
    const Vec3d& n_g = x.surface.at.n_g;
    forward_[k] = std::log(e.toward_light);
    backward_[k] = std::log(e.toward_sensor);
    arriving_[k] = std::log(std::abs(n_g.dot(wi)) * inverse_r2[k]);
    leaving_[k] = std::log(std::abs(n_g.dot(wo)) * inverse_r2[k + 1]);
    log_f += arriving_[k];
  }
  arriving_[n] = end.can_be_hit() ? std::log(last.cosine * last.inverse_r2)
                                  : -std::numeric_limits<double>::infinity();
  backward_[n] = std::log(emission_density(scene, end, last.cosine, last.falloff));
  log_end_ = std::log(end.density);
  const double y = luminance(color);
  contribution_ = {log_f + std::log(y), color / y,
                   camera.film_position(directions_[0], camera.origin)};
  return y > 0.0;
}

double VertexPath::log_product(int first, int joint, int last) const {
  if (joint <= edges && !connects(joint)) return -std::numeric_limits<double>::infinity();
  double sum = 0;
  for (int k = first; k < joint; ++k) sum += log_from_sensor(k);
  for (int k = joint; k <= last; ++k) sum += log_from_light(k);
  return sum;
}

double LogSum::value() const {
  const auto end = terms_.begin() + static_cast<std::ptrdiff_t>(count_);
  if (count_ == 0) return -std::numeric_limits<double>::infinity();
  const double largest = *std::max_element(terms_.begin(), end);
  if (!std::isfinite(largest)) return largest;
  double sum = 0;
  for (auto term = terms_.begin(); term != end; ++term) sum += std::exp(*term - largest);
  return largest + std::log(sum);
}

double log_density(const VertexPath& path, const EmissionGuide& guide) {
  const int n = path.edges;
  if (n == 1) return path.log_from_sensor(1);
  const Vec3d v = -path.toward_light(n - 1);
  const Vec3d& p = path.end.at_infinity() ? path(n - 1).surface.at.p : path.end.p;
  const double log_factor = std::log(guide.factor(path.end.emitter, p, v));
  LogSum q;
  for (int s = 0; s <= n; ++s)
    q.add(path.log_product(1, n + 1 - s, n) + (s > 1 ? log_factor : 0.0));
  return q.value();
}

namespace {

/// Takes down the vertices that a walk passes.
class VertexVisitor : public WalkVisitor<double> {
 public:
  VertexVisitor(const Scene& scene, const PathTopology& topology, VertexPath& path)
      : scene_(scene), topology_(topology), path_(path), last_(scene.camera().origin) {
    path_.edges = topology.length();
  }

  void vertex(int k) { index_ = k; }
  void position(const Shape&, const Vec3d& p) {
    before_last_ = last_;
    last_ = p;
  }
  void scatter(const ScatterEvent<double>& e) { add(e, false); }
  void delta(const ScatterEvent<double>& e) { add(e, true); }
  void connect(const ScatterEvent<double>& e) { add(e, false); }
  void light_scatter(const ScatterEvent<double>& e) { add(e, false); }
  void light_delta(const ScatterEvent<double>& e) { add(e, true); }
  void light_connect(const ScatterEvent<double>& e) { add(e, false); }

  void hit(const AreaEmitter&, const double&, const double&) {
    const Ray<double> ray{before_last_, (last_ - before_last_).normalized()};
    const Hit& hit = topology_.vertices[topology_.scatter_count].hit;
    const Interaction<double> at = scene_.interact(hit, ray);
    end_on_area({last_, at.n_g, at.uv});
  }
  void area_connection(const AreaEmitter& light, const double&, const double&) {
    end_on_area(light, emitter_normal(scene_.shapes()[light.shape], last_));
  }
  void area_emission(const AreaEmitter& light, const Vec3d& normal, const Vec3d&) {
    end_on_area(light, normal);
  }
  void environment(const Emitter&, const Vec3d& v) {
    path_.end = light_end_toward(scene_, v).value();
  }
  void point_connection(const Emitter&, const Vec3d&, const double&) { end_on_delta(); }
  void point_emission(const Emitter&, const Vec3d&) { end_on_delta(); }
  void directional_connection(const DirectionalEmitter&) { end_on_delta(); }
  void directional_emission(const DirectionalEmitter&, const Vec3d&) { end_on_delta(); }

 private:
  void add(const ScatterEvent<double>& e, bool delta) {
    const Hit& hit = topology_.vertices[static_cast<std::size_t>(index_)].hit;
    path_(index_ + 1) = {{hit, e.at, e.wi, true, &e.bsdf}, delta, e.scattering};
  }
  void end_on_area(const EmitterPoint& y) { path_.end = area_end(scene_, topology_.emitter, y); }
  void end_on_area(const AreaEmitter& light, const Vec3d& normal) {
    EmitterPoint y{.p = last_, .n = normal};
    if (light.texture != nullptr) y.uv = emitter_uv(scene_.shapes()[light.shape], last_);
    end_on_area(y);
  }
  void end_on_delta() { path_.end = light_end_from(scene_, topology_.emitter, {0.0, 0.0}); }

  const Scene& scene_;
  const PathTopology& topology_;
  VertexPath& path_;
  int index_ = 0;
  Vec3d last_;
  Vec3d before_last_{0, 0, 0};
};

}  // namespace

bool is_pinhole(const Camera& camera) { return !camera.is_orthographic() && !camera.has_lens(); }

void require_pinhole(const Scene& scene, const std::string& who) {
  const Camera& camera = scene.camera();
  if (!is_pinhole(camera))
    throw InputError(who + " needs a pinhole; this scene's sensor " +
                     (camera.has_lens() ? "has a lens" : "is orthographic"));
}

VertexPath vertex_path(const Scene& scene, const PathTopology& topology,
                       const PathCoordinates& coordinates) {
  VertexPath path;
  VertexVisitor visitor(scene, topology, path);
  walk<double>(scene, topology, coordinates, visitor);
  return path;
}

VertexPath vertex_path(const Scene& scene, const PathSampler::Sample& sample) {
  return vertex_path(scene, sample.topology, sample.coordinates);
}

VertexPath vertex_path(const FoundPath& found) {
  VertexPath path;
  path.edges = found.s + found.t - 1;
  path.end = found.end;
  const int from_sensor = found.s == 0 ? found.t - 2 : found.t - 1;
  const auto set = [&](int k, const SubpathVertex& x, const Vec3d& next, bool connected) {
    path(k) = {x.surface, x.delta && !connected, x.surface.side(next)};
  };
  for (int k = 1; k <= from_sensor; ++k) {
    const bool connected = found.s > 0 && k == from_sensor;
    const bool leaves = k == found.from_sensor.size();
    set(k, found.from_sensor[k - 1], leaves ? found.end.p : Vec3d(-found.from_sensor[k].surface.wi),
        connected);
  }
  for (int i = 0; i + 1 < found.s; ++i) {
    const bool connected = i + 2 == found.s;
    set(path.edges - 1 - i, found.from_light[i],
        connected ? found.from_light[i].surface.wi : Vec3d(-found.from_light[i + 1].surface.wi),
        connected);
  }
  return path;
}

}  // namespace driftlight
