// SPDX-License-Identifier: Apache-2.0
/// Shapes and transforms of scene files.
#include <gtest/gtest.h>

#include "driftlight/scene_file.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::expect_near;
using test::lit;
using test::SceneDirectory;
using test::with_sensor;

/// The only shape.
Shape load_shape(const std::string& shape) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(shape));
  EXPECT_EQ(loaded.scene.shapes().size(), 1U);
  return loaded.scene.shapes()[0];
}

Vec3d triangle_normal(const TriangleMesh& mesh, std::size_t triangle) {
  const auto& t = mesh.triangles[triangle];
  const Vec3d a = mesh.positions[t[0]].cast<double>();
  const Vec3d b = mesh.positions[t[1]].cast<double>();
  const Vec3d c = mesh.positions[t[2]].cast<double>();
  return (b - a).cross(c - a).normalized();
}

TEST(TransformXml, AppliesStepsInTheirOrder) {
  const Shape shape = load_shape(
      R"(<shape type="rectangle"><transform name="toWorld">
           <scale x="2" y="3"/><rotate x="1" angle="-90"/><translate y="-1"/>
         </transform></shape>)");
  const auto& mesh = std::get<TriangleMesh>(shape.geometry);
  expect_near(mesh.positions[0], Eigen::Vector3f(-2, -1, 3), 1e-5);
  expect_near(mesh.positions[2], Eigen::Vector3f(2, -1, -3), 1e-5);
  expect_near(triangle_normal(mesh, 0), Vec3d(0, 1, 0), 1e-6);
}

TEST(TransformXml, ReadsMatrices) {
  const Shape shape = load_shape(
      R"(<shape type="sphere"><transform name="toWorld">
           <matrix value="0 -2 0 5  2 0 0 6  0 0 2 7  0 0 0 1"/></transform></shape>)");
  const auto& sphere = std::get<Sphere>(shape.geometry);
  expect_near(sphere.center, Vec3d(5, 6, 7));
  EXPECT_NEAR(sphere.radius, 2.0, 1e-12);
  // The sphere's own x axis points along world y.
  expect_near(Vec3d(sphere.to_local.row(0)), Vec3d(0, 1, 0));
}

TEST(ShapesXml, ReadsSpheres) {
  const Shape shape = load_shape(
      R"(<shape type="sphere"><point name="center" x="1" y="2" z="3"/>
         <float name="radius" value="0.5"/><boolean name="flipNormals" value="true"/></shape>)");
  const auto& sphere = std::get<Sphere>(shape.geometry);
  expect_near(sphere.center, Vec3d(1, 2, 3));
  EXPECT_EQ(sphere.radius, 0.5);
  EXPECT_TRUE(sphere.flip_normals);
}

TEST(ShapesXml, ScalesTheRadiusOfASphereButNotItsCenter) {
  const Shape shape = load_shape(
      R"(<shape type="sphere"><point name="center" x="1" y="0" z="0"/>
         <transform name="toWorld"><scale value="3"/><translate z="1"/></transform></shape>)");
  const auto& sphere = std::get<Sphere>(shape.geometry);
  expect_near(sphere.center, Vec3d(1, 0, 1));
  EXPECT_NEAR(sphere.radius, 3.0, 1e-12);
}

TEST(ShapesXml, RectanglesKeepTheirSideWhenMirrored) {
  const auto normal = [](const std::string& content) {
    const Shape shape = load_shape("<shape type=\"rectangle\">" + content + "</shape>");
    return triangle_normal(std::get<TriangleMesh>(shape.geometry), 1);
  };
  const auto scaled = [](const std::string& axis) {
    return "<transform name=\"toWorld\"><scale " + axis + "=\"-2\"/></transform>";
  };
  const std::string flip = R"(<boolean name="flipNormals" value="true"/>)";
  expect_near(normal(""), Vec3d(0, 0, 1));
  expect_near(normal(flip), Vec3d(0, 0, -1));
  expect_near(normal(scaled("x")), Vec3d(0, 0, 1));
  expect_near(normal(scaled("z")), Vec3d(0, 0, -1));
  expect_near(normal(scaled("z") + flip), Vec3d(0, 0, 1));
}

TEST(ShapesXml, RectanglesHaveTextureCoordinatesOfTheirCorners) {
  const Shape shape = load_shape(R"(<shape type="rectangle"/>)");
  const auto& mesh = std::get<TriangleMesh>(shape.geometry);
  for (std::size_t i = 0; i < 4; ++i) {
    const Eigen::Vector2f xy = mesh.positions[i].head<2>();
    expect_near(mesh.uvs[i], Eigen::Vector2f(0.5F * (xy + Eigen::Vector2f::Ones())));
  }
}

TEST(ShapesXml, CubesFaceOutward) {
  const Shape shape = load_shape(
      R"(<shape type="cube"><transform name="toWorld"><scale x="-1" y="2" z="3"/></transform>
         </shape>)");
  const auto& mesh = std::get<TriangleMesh>(shape.geometry);
  ASSERT_EQ(mesh.triangles.size(), 12U);
  for (std::size_t t = 0; t < 12; ++t) {
    const Vec3d corner = mesh.positions[mesh.triangles[t][0]].cast<double>();
    EXPECT_GT(triangle_normal(mesh, t).dot(corner), 0.9) << "triangle " << t;
  }
  EXPECT_NEAR(shape.extent.area, 8 * (1 * 2 + 2 * 3 + 3 * 1), 1e-4);
}

// Mitsuba 0.6 has nothing but the winding to go by then, which a mirror image reverses.
TEST(ShapesXml, MirroredCubesOfFaceNormalsTurnInsideOut) {
  const auto outward = [](const std::string& axis) {
    const Shape shape =
        load_shape(R"(<shape type="cube"><boolean name="faceNormals" value="true"/>)"
                   R"(<transform name="toWorld"><scale )" +
                   axis + R"(/></transform></shape>)");
    const auto& mesh = std::get<TriangleMesh>(shape.geometry);
    return triangle_normal(mesh, 0).dot(mesh.positions[mesh.triangles[0][0]].cast<double>());
  };
  EXPECT_GT(outward(R"(x="1")"), 0.9);
  EXPECT_LT(outward(R"(x="-1")"), -0.9);
}

TEST(ShapesXml, ReadsDisks) {
  const auto disk = [](const std::string& content) {
    return std::get<Disk>(load_shape("<shape type=\"disk\">" + content + "</shape>").geometry);
  };
  const Disk plain = disk(R"(<transform name="toWorld"><scale value="2"/><translate x="5"/>
                             </transform>)");
  expect_near(plain.center, Vec3d(5, 0, 0));
  expect_near(plain.u, Vec3d(2, 0, 0));
  expect_near(plain.v, Vec3d(0, 2, 0));
  const Disk flipped = disk(R"(<boolean name="flipNormals" value="true"/>)");
  expect_near(Vec3d(flipped.u.cross(flipped.v)), Vec3d(0, 0, -1));
}

TEST(ShapesXml, ShapesWithoutBsdfAreGrey) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(with_sensor(
      R"(<shape type="sphere"/><shape type="rectangle"><emitter type="area"/></shape>)"));
  ASSERT_EQ(loaded.scene.bsdfs().size(), 2U);
  expect_near(std::get<Diffuse>(loaded.scene.bsdfs()[0]).reflectance.color, Rgbd(0.5, 0.5, 0.5));
  expect_near(std::get<Diffuse>(loaded.scene.bsdfs()[1]).reflectance.color, Rgbd(0, 0, 0));
}

}  // namespace
}  // namespace driftlight
