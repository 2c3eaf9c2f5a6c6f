// SPDX-License-Identifier: Apache-2.0
/// Laws of the weights of bidirectional path tracing, at given paths: walked from both ends, every
/// strategy that can make a path gets its share of it, by its density.
#include "strategy_weights.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "support/learned_guide.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

/// A path with its light end. Directions v_k lead from x_k to x_(k+1).
struct GivenPath {
  Vec3d lens;                          ///< where the sensor's ray begins
  Vec3d coordinate;                    ///< of that ray
  std::vector<SurfaceHit> scattering;  ///< x_1 .. x_(n-1), wi toward the sensor
  std::vector<Vec3d> v;                ///< v_0 .. v_(n-1)
  LightEnd end;
  std::vector<bool> by_delta;  ///< whether x_1, .. scatter by a delta lobe

  int length() const { return static_cast<int>(v.size()); }
  const SurfaceHit& x(int k) const { return scattering[static_cast<std::size_t>(k - 1)]; }
  const Vec3d& direction(int k) const { return v[static_cast<std::size_t>(k)]; }
  bool delta(int k) const { return by_delta[static_cast<std::size_t>(k - 1)]; }
  bool infinite() const { return end.at_infinity(); }
  double inverse_r2(const Scene& scene, int k) const {  // of edge k
    if (k + 1 == length() && infinite()) return 1.0;
    const Vec3d& to = k + 1 == length() ? end.p : x(k + 1).at.p;
    if (k == 0) return 1.0 / scene.camera().spread(coordinate, to, lens);
    return 1.0 / (to - x(k).at.p).squaredNorm();
  }
  /// With v_k at the light end.
  double end_cosine() const {
    return end.kind == LightEnd::Kind::Area ? -end.n.dot(v.back()) : 1.0;
  }
  double falloff() const { return end.falloff(-v.back()); }
  /// Some point of the first ray from the light.
  Vec3d emission_point() const {
    return infinite() && !scattering.empty() ? scattering.back().at.p : end.p;
  }
};

/// Cuts a subpath from the sensor and ends it at an emitter: one that was hit, the environment that
/// it escaped to, or a drawn one.
std::optional<GivenPath> draw_path(const TestScene& test, Rng& rng) {
  const Scene& scene = test.scene;
  const EmissionGuide unguided(scene);
  const SubpathTracer tracer(scene, unguided);
  const Vec2d film = rng.uniform2();
  const Vec3d lens = sample_lens(scene.camera(), rng);
  const Vec3d v = scene.camera().direction(film, lens);
  Subpath subpath;
  const auto escape = tracer.trace(Walk::FromSensor, tracer.leave_sensor(v, lens),
                                   RayFollower(scene, v, lens), test.max_depth, rng, subpath);
  GivenPath path;
  path.lens = lens;
  path.coordinate = v;
  const int last = static_cast<int>(rng.uniform() * (subpath.size() + 1));
  if (last < subpath.size()) {
    for (int i = 0; i <= last; ++i) {
      path.scattering.push_back(subpath[i].surface);
      path.by_delta.push_back(i < last && subpath[i].delta);
    }
    if (const auto end = light_end_at(scene, path.scattering.back())) {
      path.v.emplace_back(-path.scattering.back().wi);
      path.scattering.pop_back();
      path.end = *end;
    } else {
      const SurfaceHit& x = path.scattering.back();
      path.end = sample_light_end(scene, rng);
      const LightEdge edge = edge_to(path.end, x.at.p);
      if (is_delta(*x.bsdf) || !edge.lit() || !passes(x.at, x.wi, edge.direction) ||
          !(scattered(x, x.wi, edge.direction).maxCoeff() > 0.0) ||
          !reaches(scene, path.end, x, edge))
        return std::nullopt;
      path.v.push_back(edge.direction);
    }
  } else {
    const auto end = light_end_toward(scene, escape ? escape->direction : v);
    if (!escape || !end) return std::nullopt;
    for (int i = 0; i < subpath.size(); ++i) {
      path.scattering.push_back(subpath[i].surface);
      path.by_delta.push_back(subpath[i].delta);
    }
    path.v.push_back(escape->direction);
    path.end = *end;
  }
  for (std::size_t k = path.scattering.size(); k-- > 0;)
    path.v.insert(path.v.begin(), -path.scattering[k].wi);
  return path;
}

// ---- The weights as the integrator finds them -------------------------------------------------

/// Vertices x_1, x_2, .. as walked from the sensor, up to the light end.
std::vector<Departure> walk_from_sensor(const SubpathTracer& tracer, const GivenPath& path,
                                        std::vector<SubpathVertex>& vertices) {
  std::vector<Departure> departures{tracer.leave_sensor(path.coordinate, path.lens)};
  for (int k = 1; k < path.length(); ++k) {
    vertices.push_back(tracer.arrive(departures.back(), path.x(k)));
    departures.push_back(
        tracer.depart(Walk::FromSensor, vertices.back(),
                      {path.direction(k), path.x(k).side(path.direction(k)), path.delta(k)}));
  }
  return departures;
}

/// Vertices x_(n-1), x_(n-2), .. as walked from the light.
std::vector<SubpathVertex> walk_from_light(const SubpathTracer& tracer, const GivenPath& path) {
  std::vector<SubpathVertex> vertices;
  const Emission emission{path.end,       path.emission_point(), path.end.p,
                          -path.v.back(), path.end_cosine(),     path.falloff()};
  Departure from = tracer.leave_light(emission);
  for (int k = path.length() - 1; k >= 1; --k) {
    SurfaceHit surface = path.x(k);
    surface.wi = path.direction(k);
    vertices.push_back(tracer.arrive(from, surface));
    const Vec3d& wi = path.x(k).wi;
    from = tracer.depart(Walk::FromLight, vertices.back(), {wi, surface.side(wi), path.delta(k)});
  }
  return vertices;
}

/// Whether strategy t can make the path, by the rules alone.
bool possible(const GivenPath& path, int t) {
  const int n = path.length();
  if (n == 1) return t == 2;
  if (t == n + 1) return path.end.can_be_hit();
  if (t > 1 && path.delta(t - 1)) return false;
  return t == n || !path.delta(t);
}

/// By t = 1 .. n + 1; 0 where impossible.
std::vector<double> weights_by_walking(const Scene& scene, const EmissionGuide& guide,
                                       const GivenPath& path, MisHeuristic heuristic) {
  const SubpathTracer tracer(scene, guide);
  const StrategyWeights weights(guide);
  const int n = path.length();
  std::vector<SubpathVertex> z;
  const std::vector<Departure> departures = walk_from_sensor(tracer, path, z);
  const std::vector<SubpathVertex> y = walk_from_light(tracer, path);
  const auto from_sensor = [&](int k) { return z[static_cast<std::size_t>(k - 1)]; };
  const auto from_light = [&](int k) { return y[static_cast<std::size_t>(n - 1 - k)]; };
  std::vector<double> result;
  for (int t = 1; t <= n + 1; ++t) {
    OfHeuristics w = OfHeuristics::Zero();
    if (!possible(path, t)) {
      w = OfHeuristics::Zero();
    } else if (t == n + 1) {
      SurfaceHit surface{};
      surface.at = {path.end.p, path.end.n, path.end.n, Vec2d::Zero()};
      surface.wi = -path.v.back();
      surface.bsdf = nullptr;
      const Arrival arrival = path.infinite() ? tracer.arrive_at_infinity(departures.back())
                                              : tracer.arrive(departures.back(), surface);
      w = weights.hit(arrival, t, path.end, path.emission_point(), -path.v.back(),
                      path.end_cosine());
    } else if (t == n) {
      w = weights.emitter(
          from_sensor(t - 1), path.end,
          {path.v.back(), path.inverse_r2(scene, n - 1), path.end_cosine(), path.falloff()});
    } else if (t > 1) {
      w = weights.connection(from_sensor(t - 1), from_light(t), path.direction(t - 1),
                             path.inverse_r2(scene, t - 1));
    } else {
      const Vec3d& v = path.direction(0);
      SensorConnection seen;
      seen.wi = -v;
      seen.density = std::exp(scene.camera().log_importance(path.coordinate)) *
                     std::abs(path.x(1).at.n_g.dot(v)) * path.inverse_r2(scene, 0);
      w = weights.sensor(from_light(1), seen);
    }
    result.push_back(w[static_cast<Eigen::Index>(heuristic)]);
  }
  return result;
}

// ---- The weights from densities ---------------------------------------------------------------

/// |d omega_o / d omega_i| of a delta lobe, by central differences.
double solid_angle_ratio(const SurfaceHit& x, Scattering scattering) {
  const double h = 1e-5;
  const TangentBasis basis = tangent_basis(x.wi);
  const auto image = [&](const Vec3d& offset) {
    return delta_direction(*x.bsdf, x.surface(), Vec3d((x.wi + offset).normalized()), scattering);
  };
  const Vec3d a = (image(h * basis.t) - image(-h * basis.t)) / (2.0 * h);
  const Vec3d b = (image(h * basis.b) - image(-h * basis.b)) / (2.0 * h);
  return a.cross(b).norm();
}

/// log of density of x_k, k = 1 .. n, by the walk from the sensor, and of x_k, k = 0 .. n, by that
/// from the light, each with respect to area; narrow lobes in place of delta lobes.
struct Densities {
  std::vector<double> sensor, light;
};

Densities densities(const Scene& scene, const EmissionGuide& guide, const GivenPath& path) {
  const int n = path.length();
  const auto index = [](int k) { return static_cast<std::size_t>(k); };
  Densities p{std::vector<double>(index(n + 1), 0.0), std::vector<double>(index(n + 1), 0.0)};
  // log of cos / r^2 at x_k for edge e.
  const auto geometry = [&](int k, int e) {
    const double cosine = k == 0   ? 1.0
                          : k == n ? path.end_cosine()
                                   : std::abs(path.x(k).at.n_g.dot(path.direction(e)));
    return std::log(cosine * path.inverse_r2(scene, e));
  };
  p.sensor[1] = scene.camera().log_importance(path.coordinate) + geometry(1, 0);
  p.light[index(n)] = std::log(path.end.density);
  p.light[index(n - 1)] =
      std::log(emission_density(scene, path.end, path.end_cosine(), path.falloff()) *
               guide.factor(path.end.emitter, path.emission_point(), -path.v.back())) +
      geometry(n - 1, n - 1);
  for (int k = 1; k < n; ++k) {
    const SurfaceHit& x = path.x(k);
    const Vec3d& wo = path.direction(k);
    const Scattering side = x.side(wo);
    const SurfacePoint<double> at = x.surface();
    const double forward =
        path.delta(k) ? delta_probability(*x.bsdf, at, x.wi, side) : pdf(*x.bsdf, at, x.wi, wo);
    const double backward =
        path.delta(k) ? delta_probability(*x.bsdf, at, wo, side) * solid_angle_ratio(x, side)
                      : pdf(*x.bsdf, at, wo, x.wi);
    p.sensor[index(k + 1)] = std::log(forward) + geometry(k + 1, k);
    p.light[index(k - 1)] = std::log(backward) + geometry(k - 1, k - 1);
  }
  return p;
}

std::vector<double> weights_by_density(const Scene& scene, const EmissionGuide& guide,
                                       const GivenPath& path, MisHeuristic heuristic) {
  const Densities p = densities(scene, guide, path);
  const int n = path.length();
  const double exponent = heuristic == MisHeuristic::Power ? 2.0 : 1.0;
  std::vector<double> logs;
  for (int t = 1; t <= n + 1; ++t) {
    double log_density = -std::numeric_limits<double>::infinity();
    if (possible(path, t)) {
      log_density = 0;
      for (int k = 0; k <= n; ++k)
        log_density += (k < t ? p.sensor : p.light)[static_cast<std::size_t>(k)];
    }
    logs.push_back(exponent * log_density);
  }
  const double largest = *std::max_element(logs.begin(), logs.end());
  double sum = 0;
  for (double& x : logs) sum += x = std::exp(x - largest);
  for (double& x : logs) x /= sum;
  return logs;
}

// ---- Laws -------------------------------------------------------------------------------------

struct Coverage {
  int paths = 0;
  int hidden = 0;     ///< with a delta vertex
  int refracted = 0;  ///< through a smooth interface
  int kinds[4] = {};  ///< by kind of the light end
};

void count(const GivenPath& path, Coverage& seen) {
  ++seen.paths;
  ++seen.kinds[static_cast<std::size_t>(path.end.kind)];
  bool delta = false;
  bool refracted = false;
  for (int k = 1; k < path.length(); ++k) {
    delta = delta || path.delta(k);
    refracted = refracted ||
                (path.delta(k) && path.x(k).side(path.direction(k)) == Scattering::Transmission);
  }
  seen.hidden += delta ? 1 : 0;
  seen.refracted += refracted ? 1 : 0;
}

/// Calls visit(scene, guide, path) for random paths of all test scenes, guided as a pilot of each
/// has learned; for every other one with few light subpaths.
template <class Visit>
Coverage for_random_paths(const Visit& visit) {
  Coverage seen;
  for (const TestScene& test : test_scenes()) {
    const EmissionGuide guide = learned_guide(test);
    const EmissionGuide rare = guide.at_rate(0.1);
    for (std::uint64_t i = 0; i < 5000; ++i) {
      Rng rng(211, Stream::Test, i);
      const auto path = draw_path(test, rng);
      if (!path) continue;
      // Within 1e-5 of total reflection finite differences of refraction mean nothing.
      bool smooth = true;
      for (int k = 1; k < path->length(); ++k)
        if (path->delta(k)) {
          const SurfaceHit& x = path->x(k);
          smooth = smooth && std::abs(x.at.n_s.dot(x.wi)) > 0.01 &&
                   std::abs(x.at.n_s.dot(path->direction(k))) > 0.01;
        }
      if (!smooth) continue;
      count(*path, seen);
      visit(test.scene, i % 2 == 0 ? guide : rare, *path);
    }
  }
  return seen;
}

// Law: the weights of all strategies that can make a path add up to 1.
TEST(StrategyWeights, AddUpToOne) {
  const Coverage seen =
      for_random_paths([](const Scene& scene, const EmissionGuide& guide, const GivenPath& path) {
        for (const MisHeuristic heuristic : {MisHeuristic::Balance, MisHeuristic::Power}) {
          double sum = 0;
          for (const double w : weights_by_walking(scene, guide, path, heuristic)) sum += w;
          EXPECT_NEAR(sum, 1.0, 1e-9) << path.length() << " edges";
        }
      });
  EXPECT_GT(seen.paths, 2000);
  EXPECT_GT(seen.hidden, 500);
  EXPECT_GT(seen.refracted, 300);
  for (const int kind : seen.kinds) EXPECT_GT(kind, 200);
}

// Law: a strategy's weight is its density, or that squared, over the sum of all. The densities are
// products over the whole path, those of smooth lobes turned round by finite differences.
TEST(StrategyWeights, AreSharesByDensity) {
  int shared = 0;
  for_random_paths([&](const Scene& scene, const EmissionGuide& guide, const GivenPath& path) {
    for (const MisHeuristic heuristic : {MisHeuristic::Balance, MisHeuristic::Power}) {
      const std::vector<double> walked = weights_by_walking(scene, guide, path, heuristic);
      const std::vector<double> expected = weights_by_density(scene, guide, path, heuristic);
      for (std::size_t i = 0; i < walked.size(); ++i)
        EXPECT_NEAR(walked[i], expected[i], 1e-5) << path.length() << " edges, t = " << i + 1
                                                  << ", heuristic " << static_cast<int>(heuristic);
      if (*std::max_element(expected.begin(), expected.end()) < 0.9) ++shared;
    }
  });
  EXPECT_GT(shared, 1000);
}

}  // namespace
}  // namespace driftlight::test
