// SPDX-License-Identifier: Apache-2.0
/// Cylinders, and shapes that are made of others: shapegroups and their instances.
#include <gtest/gtest.h>

#include "driftlight/scene_file.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::expect_contains;
using test::expect_near;
using test::kEmitter;
using test::kSensor;
using test::lit;
using test::SceneDirectory;

std::string error_of(const std::string& body) {
  const SceneDirectory directory;
  return test::scene_error([&] { directory.load(lit(body)); });
}

std::string transform(const std::string& steps) {
  return "<transform name=\"toWorld\">" + steps + "</transform>";
}

// --- Cylinders -----------------------------------------------------------------------------------

Cylinder load_cylinder(const std::string& content) {
  const SceneDirectory directory;
  const LoadedScene loaded =
      directory.load(lit("<shape type=\"cylinder\">" + content + "</shape>"));
  return std::get<Cylinder>(loaded.scene.shapes()[0].geometry);
}

TEST(CylinderXml, HasItsDefaults) {
  const Cylinder cylinder = load_cylinder("");
  expect_near(cylinder.base, Vec3d(0, 0, 0));
  expect_near(cylinder.axis(), Vec3d(0, 0, 1));
  EXPECT_EQ(cylinder.length, 1);
  EXPECT_EQ(cylinder.radius, 1);
  EXPECT_FALSE(cylinder.flip_normals);
}

TEST(CylinderXml, IsScaledAlongAndAcrossItsAxis) {
  const Cylinder cylinder = load_cylinder(
      R"(<point name="p0" x="1" y="0" z="0"/><point name="p1" x="3" y="0" z="0"/>
         <float name="radius" value="0.5"/><boolean name="flipNormals" value="true"/>)" +
      transform(R"(<scale x="3" y="2" z="2"/><rotate z="1" angle="90"/><translate z="5"/>)"));
  expect_near(cylinder.base, Vec3d(0, 3, 5));
  expect_near(cylinder.axis(), Vec3d(0, 1, 0));
  EXPECT_NEAR(cylinder.length, 6, 1e-12);
  EXPECT_NEAR(cylinder.radius, 1, 1e-12);
  EXPECT_TRUE(cylinder.flip_normals);
  expect_near(Eigen::Matrix3d(cylinder.to_local * cylinder.to_local.transpose()),
              Eigen::Matrix3d(Eigen::Matrix3d::Identity()));
}

TEST(CylinderXml, RefusesOvalsAndPoints) {
  const auto bad = [](const std::string& content) {
    return error_of("<shape type=\"cylinder\">" + content + "</shape>");
  };
  expect_contains(bad(transform(R"(<scale x="2"/>)")), "evenly across its axis");
  expect_contains(bad(R"(<point name="p1" x="0" y="0" z="0"/>)"), "'p1'");
  expect_contains(bad(R"(<float name="radius" value="1e-6"/><emitter type="area"/>)"),
                  "10000 times");
}

// --- Instances -----------------------------------------------------------------------------------

const std::string kGroup = R"(<shape type="shapegroup" id="g">
    <shape type="rectangle"><bsdf type="phong"/></shape>
    <shape type="sphere"><float name="radius" value="2"/></shape>
    <shape type="disk"/><shape type="cylinder"/></shape>)";

std::string instance(const std::string& steps) {
  return R"(<shape type="instance"><ref id="g"/>)" + transform(steps) + "</shape>";
}

Vec3d normal_of(const TriangleMesh& mesh) {
  const auto& t = mesh.triangles[0];
  const Eigen::Vector3f a = mesh.positions[t[0]];
  return (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a).cast<double>().normalized();
}

TEST(Instances, AreTransformedCopies) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(
      lit(kGroup + instance(R"(<scale value="3"/><rotate x="1" angle="90"/><translate x="7"/>)") +
          instance("")));
  ASSERT_EQ(loaded.scene.shapes().size(), 8U);
  ASSERT_EQ(loaded.notices.size(), 1U);
  expect_contains(loaded.notices[0], "2 triangles");
  const auto& shapes = loaded.scene.shapes();
  EXPECT_EQ(shapes[0].material, shapes[4].material);
  expect_near(normal_of(std::get<TriangleMesh>(shapes[0].geometry)), Vec3d(0, -1, 0));
  expect_near(normal_of(std::get<TriangleMesh>(shapes[4].geometry)), Vec3d(0, 0, 1));
  EXPECT_NEAR(shapes[0].extent.area, 36.0, 1e-4);
  const auto& sphere = std::get<Sphere>(shapes[1].geometry);
  expect_near(sphere.center, Vec3d(7, 0, 0));
  EXPECT_NEAR(sphere.radius, 6.0, 1e-12);
  expect_near(Vec3d(sphere.to_local.row(2)), Vec3d(0, -1, 0));
  const auto& disk = std::get<Disk>(shapes[2].geometry);
  expect_near(Vec3d(disk.u.cross(disk.v)), Vec3d(0, -9, 0));
  const auto& cylinder = std::get<Cylinder>(shapes[3].geometry);
  expect_near(cylinder.axis(), Vec3d(0, -1, 0));
  EXPECT_NEAR(cylinder.radius, 3.0, 1e-12);
}

TEST(Instances, KeepTheirOutsideWhenMirrored) {
  const SceneDirectory directory;
  const LoadedScene loaded = directory.load(lit(kGroup + instance(R"(<scale x="-1"/>)")));
  const auto& shapes = loaded.scene.shapes();
  expect_near(normal_of(std::get<TriangleMesh>(shapes[0].geometry)), Vec3d(0, 0, 1));
  const auto& disk = std::get<Disk>(shapes[2].geometry);
  expect_near(Vec3d(disk.u.cross(disk.v)), Vec3d(0, 0, 1));
  EXPECT_LT(std::get<Cylinder>(shapes[3].geometry).to_local.determinant(), 0.0);
}

TEST(Instances, OfAGroupFurtherDownNeedMitsuba3) {
  const SceneDirectory directory;
  const std::string copy = R"(<shape type="instance"><ref id="g"/></shape>)";
  const LoadedScene loaded =
      directory.load("<scene version=\"3.0.0\">" + copy + kGroup + kSensor + kEmitter + "</scene>");
  EXPECT_EQ(loaded.scene.shapes().size(), 4U);
  expect_contains(error_of(copy + kGroup), "further down");
}

TEST(Instances, SayWhatTheyCannotDo) {
  expect_contains(error_of(kGroup + instance(R"(<scale x="2"/>)")), "evenly");
  expect_contains(error_of(kGroup + R"(<shape type="instance"/>)"), "one <ref>");
  expect_contains(error_of(R"(<bsdf type="diffuse" id="g"/>)" + instance("")), "not a shapegroup");
  expect_contains(error_of(kGroup), "no shape");
  expect_contains(error_of(R"(<shape type="shapegroup" id="g"/>)"), "without shapes");
  const auto group_of = [](const std::string& content) {
    return error_of("<shape type=\"shapegroup\" id=\"g\">" + content + "</shape>");
  };
  expect_contains(group_of(R"(<shape type="instance"/>)"), "nested");
  expect_contains(group_of(R"(<shape type="sphere"><emitter type="area"/></shape>)"), "emitter");
  expect_contains(group_of(R"(<shape type="torus"/>)"), "shapegroup, instance");
}

}  // namespace
}  // namespace driftlight
