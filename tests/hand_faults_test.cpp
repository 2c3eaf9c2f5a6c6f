// SPDX-License-Identifier: Apache-2.0
/// Mutation testing of the gradient checker: single wrong signs and factors in the hand-derived
/// rules, in the other functions under test, and all of them caught.
#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "driftlight/gradient_check.h"
#include "driftlight/hand_derivatives.h"
#include "driftlight/scene_check.h"
#include "support/test_scenes.h"

namespace driftlight::test {
namespace {

/// What one fault does to the results of the rules; empty functions leave them right.
struct Fault {
  std::string name;
  std::function<void(const Bsdf&, Scattering, bool outside, FactorPartials&)> scatter;
  std::function<void(const Bsdf&, Scattering, FactorPartials&)> delta;
  std::function<void(Scattering, HandRules::DeltaMap&)> delta_map;
  std::function<void(const Geometry&, SurfaceDifferential&)> surface;
  std::function<Vec3d(const TangentField&, const Vec3d& p_bar)> tangent_adjoint;
  std::function<double(const Geometry&)> hit_cosine;  ///< a factor
  std::function<Vec3d(const Vec3d& v, const Vec3d& n, double cosine, const Vec3d& q)> hit_adjoint;
  std::function<Vec3d(const Camera&, const Vec3d& v)> camera;
  std::function<Vec3d(const Vec3d& v_bar)> parallel_camera;
  std::function<Vec3d(const Vec3d& w, double r, const Vec3d& w_bar)> connection_adjoint;
  std::function<void(Vec3d&)> environment;
  std::function<void(Vec3d&)> spot;
};

/// The rules with one fault.
struct FaultyRules : HandRules {
  static inline const Fault* fault = nullptr;

  static FactorPartials scatter(const Bsdf& bsdf, const ScatterPoint& x) {
    FactorPartials f = HandRules::scatter(bsdf, x);
    if (fault->scatter) fault->scatter(bsdf, x.scattering, x.cos_i > 0.0, f);
    return f;
  }
  static Vec3d tangent_adjoint(const TangentField& field, const Vec3d& p_bar) {
    return fault->tangent_adjoint ? fault->tangent_adjoint(field, p_bar)
                                  : HandRules::tangent_adjoint(field, p_bar);
  }
  static FactorPartials delta(const Bsdf& bsdf, double cos_i, const Vec2d& uv,
                              Scattering scattering) {
    FactorPartials f = HandRules::delta(bsdf, cos_i, uv, scattering);
    if (fault->delta) fault->delta(bsdf, scattering, f);
    return f;
  }
  static DeltaMap delta_map(const Bsdf& bsdf, double cos_i, Scattering scattering) {
    DeltaMap map = HandRules::delta_map(bsdf, cos_i, scattering);
    if (fault->delta_map) fault->delta_map(scattering, map);
    return map;
  }
  template <class Shape>
  static SurfaceDifferential surface(const Shape& shape, std::uint32_t primitive, const Vec3d& p,
                                     const Vec3d& n_s, bool textured) {
    SurfaceDifferential d = HandRules::surface(shape, primitive, p, n_s, textured);
    if (fault->surface) fault->surface(Geometry(shape), d);
    return d;
  }
  static double hit_cosine(const Geometry& geometry, const Vec3d& origin, const Vec3d& v,
                           const Vec3d& n) {
    const double cosine = HandRules::hit_cosine(geometry, origin, v, n);
    return fault->hit_cosine ? fault->hit_cosine(geometry) * cosine : cosine;
  }
  static Vec3d hit_adjoint(const Vec3d& v, const Vec3d& n, double cosine, const Vec3d& q) {
    return fault->hit_adjoint ? fault->hit_adjoint(v, n, cosine, q)
                              : HandRules::hit_adjoint(v, n, cosine, q);
  }
  static Vec3d camera(const Camera& camera, const Vec3d& v) {
    return fault->camera ? fault->camera(camera, v) : HandRules::camera(camera, v);
  }
  static Vec3d parallel_camera(const Camera& camera, const Vec3d& v, const Vec3d& x_bar) {
    const Vec3d v_bar = HandRules::parallel_camera(camera, v, x_bar);
    return fault->parallel_camera ? fault->parallel_camera(v_bar) : v_bar;
  }
  static Vec3d connection_adjoint(const Vec3d& w, double r, const Vec3d& w_bar) {
    return fault->connection_adjoint ? fault->connection_adjoint(w, r, w_bar)
                                     : HandRules::connection_adjoint(w, r, w_bar);
  }
  static Vec3d environment(const EnvironmentMap& map, const Vec3d& v, const Rgbd& radiance,
                           const Rgbd& shares) {
    Vec3d g = HandRules::environment(map, v, radiance, shares);
    if (fault->environment) fault->environment(g);
    return g;
  }
  static Vec3d spot(const SpotEmitter& spot, const Vec3d& w) {
    Vec3d g = HandRules::spot(spot, w);
    if (fault->spot) fault->spot(g);
    return g;
  }
};

template <class B>
bool is(const Bsdf& bsdf) {
  return std::holds_alternative<B>(bsdf);
}

Fault scatter_fault(const std::string& name,
                    std::function<void(const Bsdf&, Scattering, bool, FactorPartials&)> change) {
  Fault fault{};
  fault.name = name;
  fault.scatter = std::move(change);
  return fault;
}

std::vector<Fault> scatter_faults() {
  const auto distribution = [](const Bsdf& b) {
    return std::get<RoughConductor>(b).microfacets.distribution;
  };
  return {
      scatter_fault("diffuse: sign of d log cos",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Diffuse>(b)) f.cos_o[3] *= -1.0;
                    }),
      scatter_fault("diffuse: slope of a texture doubled",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Diffuse>(b)) f.u[0] *= 2.0;
                    }),
      scatter_fault("Beckmann metal: sign by cos_i",
                    [=](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<RoughConductor>(b) && distribution(b) == Distribution::Beckmann)
                        f.cos_i[3] *= -1.0;
                    }),
      scatter_fault("GGX metal: one per mil by cos_o",
                    [=](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<RoughConductor>(b) && distribution(b) == Distribution::Ggx)
                        f.cos_o[3] *= 1.001;
                    }),
      scatter_fault("rough metal: sign of the Fresnel slope of green",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<RoughConductor>(b)) f.io[1] *= -1.0;
                    }),
      scatter_fault("rough glass: factor of reflection by wi.wo",
                    [](const Bsdf& b, Scattering s, bool, FactorPartials& f) {
                      if (is<RoughDielectric>(b) && s == Scattering::Reflection) f.io[3] *= 0.9;
                    }),
      scatter_fault("rough glass: sign of transmission by wi.wo",
                    [](const Bsdf& b, Scattering s, bool, FactorPartials& f) {
                      if (is<RoughDielectric>(b) && s == Scattering::Transmission) f.io[3] *= -1.0;
                    }),
      scatter_fault("rough glass from within: factor of transmission by cos_i",
                    [](const Bsdf& b, Scattering s, bool outside, FactorPartials& f) {
                      if (is<RoughDielectric>(b) && s == Scattering::Transmission && !outside)
                        f.cos_i[3] *= 1.01;
                    }),
      scatter_fault("Phong: sign of red by cos_i",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Phong>(b)) f.cos_i[0] *= -1.0;
                    }),
      scatter_fault("Phong: factor of d log cos",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Phong>(b)) f.cos_o[3] *= 2.0;
                    }),
      scatter_fault("Phong: sign of the slope of a texture",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Phong>(b)) f.v[1] *= -1.0;
                    }),
      scatter_fault("Ward: sign of red by wi.wo",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Ward>(b)) f.io[0] *= -1.0;
                    }),
      scatter_fault("Ward: factor by cos_i",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Ward>(b)) f.cos_i[1] *= 1.01;
                    }),
      scatter_fault("anisotropic metal: one per mil along the tangent by wi",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<RoughConductor>(b)) f.tangent_i[3] *= 1.001;
                    }),
      scatter_fault("anisotropic glass: sign along the tangent by wo",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<RoughDielectric>(b)) f.tangent_o[3] *= -1.0;
                    }),
      scatter_fault("anisotropic Ward: factor by the tangent's normal part",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Ward>(b)) f.tangent_n *= 1.01;
                    }),
      scatter_fault("coating: factor of the tangent by wi",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Coating>(b)) f.tangent_i *= 1.01;
                    }),
      scatter_fault("plastic: sign of the slope of T by cos_i",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Plastic>(b)) f.cos_i[3] *= -1.0;
                    }),
      scatter_fault("plastic: one per mil of a texture under the coat",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Plastic>(b)) f.u[0] *= 1.001;
                    }),
      scatter_fault("rough plastic: sign by wi.wo",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<RoughPlastic>(b)) f.io[1] *= -1.0;
                    }),
      scatter_fault("rough plastic: factor by cos_o",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<RoughPlastic>(b)) f.cos_o[0] *= 1.01;
                    }),
      scatter_fault("coating: factor by wi.wo",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Coating>(b)) f.io *= 1.01;
                    }),
      scatter_fault("coating: factor by cos_i",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Coating>(b)) f.cos_i *= 1.01;
                    }),
      scatter_fault("mask: slope of the opacity",
                    [](const Bsdf& b, Scattering, bool, FactorPartials& f) {
                      if (is<Mask>(b)) f.v[2] *= 1.01;
                    }),
  };
}

std::vector<Fault> delta_faults() {
  std::vector<Fault> faults(10);
  faults[0].name = "mirror: sign of the Fresnel slope of red";
  faults[0].delta = [](const Bsdf& b, Scattering, FactorPartials& f) {
    if (is<Conductor>(b)) f.cos_i[0] *= -1.0;
  };
  faults[1].name = "glass: sign of reflection by cos_i";
  faults[1].delta = [](const Bsdf& b, Scattering s, FactorPartials& f) {
    if (is<Dielectric>(b) && s == Scattering::Reflection) f.cos_i[3] *= -1.0;
  };
  faults[2].name = "glass: factor of transmission by cos_i";
  faults[2].delta = [](const Bsdf& b, Scattering s, FactorPartials& f) {
    if (is<Dielectric>(b) && s == Scattering::Transmission) f.cos_i[3] *= 2.0;
  };
  faults[3].name = "reflected direction: sign of dn";
  faults[3].delta_map = [](Scattering s, HandRules::DeltaMap& map) {
    if (s == Scattering::Reflection) map.normal_factor *= -1.0;
  };
  faults[4].name = "reflected direction: factor of n";
  faults[4].delta_map = [](Scattering s, HandRules::DeltaMap& map) {
    if (s == Scattering::Reflection) map.n_factor = 1.0;
  };
  faults[5].name = "refracted direction: sign of n";
  faults[5].delta_map = [](Scattering s, HandRules::DeltaMap& map) {
    if (s == Scattering::Transmission) map.n_factor *= -1.0;
  };
  faults[6].name = "refracted direction: factor of dwi";
  faults[6].delta_map = [](Scattering s, HandRules::DeltaMap& map) {
    if (s == Scattering::Transmission) map.wi_factor *= 0.99;
  };
  faults[7].name = "plastic coat: sign by cos_i";
  faults[7].delta = [](const Bsdf& b, Scattering, FactorPartials& f) {
    if (is<Plastic>(b)) f.cos_i[3] *= -1.0;
  };
  faults[8].name = "pane: factor of transmission by cos_i";
  faults[8].delta = [](const Bsdf& b, Scattering s, FactorPartials& f) {
    if (is<ThinDielectric>(b) && s == Scattering::Transmission) f.cos_i[3] *= 1.01;
  };
  faults[9].name = "mask: sign of what passes by u";
  faults[9].delta = [](const Bsdf& b, Scattering s, FactorPartials& f) {
    if (is<Mask>(b) && s == Scattering::Transmission) f.u[0] *= -1.0;
  };
  return faults;
}

std::vector<Fault> geometry_faults() {
  std::vector<Fault> faults(9);
  faults[7].name = "tangent of spheres: sign of its turn";
  faults[7].tangent_adjoint = [](const TangentField& field, const Vec3d& p_bar) {
    return Vec3d(field.turn.cross(p_bar) + field.spread * p_bar);
  };
  faults[8].name = "tangent of disks: factor of its spread";
  faults[8].tangent_adjoint = [](const TangentField& field, const Vec3d& p_bar) {
    return Vec3d(p_bar.cross(field.turn) + 1.01 * field.spread * p_bar);
  };
  faults[0].name = "interpolated normal: sign along one edge";
  faults[0].surface = [](const Geometry&, SurfaceDifferential& d) {
    if (d.interpolated) d.a1 = Vec3d(-d.a1);
  };
  faults[1].name = "sphere: sign of the curvature";
  faults[1].surface = [](const Geometry& g, SurfaceDifferential& d) {
    if (std::holds_alternative<Sphere>(g)) d.curvature *= -1.0;
  };
  faults[2].name = "sphere: factor of v";
  faults[2].surface = [](const Geometry& g, SurfaceDifferential& d) {
    if (std::holds_alternative<Sphere>(g) && d.textured) d.v *= 2.0;
  };
  faults[3].name = "mesh: sign of u";
  faults[3].surface = [](const Geometry& g, SurfaceDifferential& d) {
    if (std::holds_alternative<TriangleMesh>(g) && d.textured) d.u = Vec3d(-d.u);
  };
  faults[4].name = "hit of a sphere: factor of the cosine";
  faults[4].hit_cosine = [](const Geometry& g) {
    return std::holds_alternative<Sphere>(g) ? 1.001 : 1.0;
  };
  faults[5].name = "hit of a plane: sign of the cosine";
  faults[5].hit_cosine = [](const Geometry& g) {
    return std::holds_alternative<Sphere>(g) ? 1.0 : -1.0;
  };
  faults[6].name = "hit: sign of the projection";
  faults[6].hit_adjoint = [](const Vec3d& v, const Vec3d& n, double cosine, const Vec3d& q) {
    return Vec3d(q + v.dot(q) / cosine * n);
  };
  return faults;
}

std::vector<Fault> end_faults() {
  std::vector<Fault> faults(9);
  faults[7].name = "orthographic camera: sign";
  faults[7].parallel_camera = [](const Vec3d& v_bar) { return Vec3d(-v_bar); };
  faults[8].name = "orthographic camera: factor";
  faults[8].parallel_camera = [](const Vec3d& v_bar) { return Vec3d(1.01 * v_bar); };
  faults[0].name = "camera: power of the cosine";
  faults[0].camera = [](const Camera& camera, const Vec3d& v) {
    return Vec3d(2.0 / 3.0 * HandRules::camera(camera, v));
  };
  faults[1].name = "connection: power of the length";
  faults[1].connection_adjoint = [](const Vec3d& w, double r, const Vec3d& w_bar) {
    return Vec3d((w_bar - (w.dot(w_bar) + 1.0) * w) / r);
  };
  faults[2].name = "connection: sign of the projection";
  faults[2].connection_adjoint = [](const Vec3d& w, double r, const Vec3d& w_bar) {
    return Vec3d((w_bar - (2.0 - w.dot(w_bar)) * w) / r);
  };
  faults[3].name = "environment: sign of one component";
  faults[3].environment = [](Vec3d& g) { g.y() = -g.y(); };
  faults[4].name = "environment: factor of one component";
  faults[4].environment = [](Vec3d& g) { g.x() *= 1.01; };
  faults[5].name = "spot: sign";
  faults[5].spot = [](Vec3d& g) { g = -g; };
  faults[6].name = "spot: factor";
  faults[6].spot = [](Vec3d& g) { g *= 1.01; };
  return faults;
}

/// The first path that the faulty functions fail on.
struct Caught {
  bool found = false;
  PathCheck check;
};

Caught first_failure(const DerivativeFunctions& functions, const CheckSelection& selection) {
  for (const TestScene& test : test_scenes()) {
    for (const auto& path : light_paths(test, 100, 51)) {
      PathCheck check =
          check_path(test.scene, path.topology, path.coordinates, selection, functions);
      if (!check.passes()) return {true, check};
    }
  }
  return {};
}

// Law: every wrong sign and every wrong factor in the rules is caught, as a difference between hand
// and jets, and the jets are not blamed.
TEST(HandFaults, EverySingleOneIsCaught) {
  std::vector<Fault> faults;
  for (const auto& some : {scatter_faults(), delta_faults(), geometry_faults(), end_faults()})
    faults.insert(faults.end(), some.begin(), some.end());
  ASSERT_GE(faults.size(), 16U);
  DerivativeFunctions functions;
  functions.by_hand = linearize_by_rules<FaultyRules>;
  const CheckSelection selection{.divergence = false};
  for (const Fault& fault : faults) {
    FaultyRules::fault = &fault;
    const Caught caught = first_failure(functions, selection);
    ASSERT_TRUE(caught.found) << fault.name;
    EXPECT_FALSE(caught.check[Quantity::GradientHand].passes(Quantity::GradientHand) &&
                 caught.check[Quantity::JacobianHand].passes(Quantity::JacobianHand))
        << fault.name;
    for (const Quantity quantity : {Quantity::GradientRidders, Quantity::JacobianRidders})
      EXPECT_TRUE(caught.check[quantity].passes(quantity)) << fault.name;
  }
  const Fault none{};
  FaultyRules::fault = &none;
  EXPECT_FALSE(first_failure(functions, selection).found);
}

/// Derivatives by jets with one mistake.
DerivativeFunctions faulty_jets(const std::function<void(Linearization&)>& change) {
  DerivativeFunctions functions;
  functions.by_jets = [change](const Scene& scene, const PathTopology& topology, const Chart& chart,
                               const DerivativeRequest& request, Linearization& result) {
    linearize_by_jets(scene, topology, chart, request, result);
    change(result);
  };
  functions.by_hand = functions.by_jets;
  return functions;
}

// Law: a mistake that hand and jets share is caught by differences, in the gradient and in the
// Jacobian.
TEST(HandFaults, SharedMistakesAreCaughtByDifferences) {
  const CheckSelection selection{.divergence = false};
  const std::vector<std::function<void(Linearization&)>> gradient_faults{
      [](Linearization& path) { path.gradient[0] *= -1.0; },
      [](Linearization& path) { path.gradient[1] *= 1.0001; }};
  for (const auto& fault : gradient_faults) {
    const Caught caught = first_failure(faulty_jets(fault), selection);
    ASSERT_TRUE(caught.found);
    EXPECT_FALSE(caught.check[Quantity::GradientRidders].passes(Quantity::GradientRidders));
    EXPECT_TRUE(caught.check[Quantity::GradientHand].passes(Quantity::GradientHand));
    EXPECT_TRUE(caught.check[Quantity::JacobianRidders].passes(Quantity::JacobianRidders));
  }
  const std::vector<std::function<void(Linearization&)>> row_faults{
      [](Linearization& path) { path.rows(0, 4) *= -1.0; },
      [](Linearization& path) { path.rows.row(path.row_count() - 1) *= 1.0001; }};
  for (const auto& fault : row_faults) {
    const Caught caught = first_failure(faulty_jets(fault), selection);
    ASSERT_TRUE(caught.found);
    EXPECT_FALSE(caught.check[Quantity::JacobianRidders].passes(Quantity::JacobianRidders));
    EXPECT_TRUE(caught.check[Quantity::GradientRidders].passes(Quantity::GradientRidders));
  }
}

// Law: a wrong divergence is caught.
TEST(HandFaults, WrongDivergenceIsCaught) {
  const std::vector<std::function<void(Vector&)>> faults{
      [](Vector& x) { x = -x; }, [](Vector& x) { x[0] *= -1.0; },
      [](Vector& x) { x[x.size() - 1] *= 1.01; }, [](Vector& x) { x *= 0.5; }};
  for (const auto& fault : faults) {
    DerivativeFunctions functions;
    functions.divergence = [&](const Scene& scene, const PathTopology& topology,
                               const Chart& chart) {
      Vector result = divergence(scene, topology, chart);
      fault(result);
      return result;
    };
    const CheckSelection selection{.gradient = false, .constraints = false};
    const Caught caught = first_failure(functions, selection);
    ASSERT_TRUE(caught.found);
    EXPECT_GT(caught.check[Quantity::Divergence].error, tolerance(Quantity::Divergence));
  }
}

// Law: a divergence that is never a number decides nothing on a path, but fails the scene.
TEST(HandFaults, MissingDivergenceIsCaught) {
  DerivativeFunctions functions;
  functions.divergence = [](const Scene&, const PathTopology&, const Chart& chart) {
    return Vector(Vector::Constant(chart.dimension(), std::numeric_limits<double>::quiet_NaN()));
  };
  const TestScene& test = test_scenes().front();
  SceneCheckOptions options;
  options.paths = 50;
  options.max_depth = test.max_depth;
  const auto failures = check_scene(test.scene, options, functions).table.failures();
  ASSERT_FALSE(failures.empty());
  EXPECT_EQ(failures.front().kind, GradientFailure::Kind::NotCompared);
  EXPECT_EQ(failures.front().quantity, Quantity::Divergence);
}

// Law: derivatives that are not numbers never pass.
TEST(HandFaults, NonFiniteDerivativesAreCaught) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const CheckSelection selection{.divergence = false};
  const Caught gradient =
      first_failure(faulty_jets([nan](Linearization& path) { path.gradient[0] = nan; }), selection);
  ASSERT_TRUE(gradient.found);
  EXPECT_FALSE(gradient.check[Quantity::GradientRidders].passes(Quantity::GradientRidders));
  const Caught row =
      first_failure(faulty_jets([nan](Linearization& path) { path.rows(0, 4) = nan; }), selection);
  ASSERT_TRUE(row.found);
  EXPECT_FALSE(row.check[Quantity::JacobianRidders].passes(Quantity::JacobianRidders));
}

}  // namespace
}  // namespace driftlight::test
