// SPDX-License-Identifier: Apache-2.0
/// Meshes of obj and serialized files.
#include <fmt/core.h>
#include <gtest/gtest.h>
#include <zlib.h>

#include <array>
#include <cmath>
#include <cstring>

#include "driftlight/scene_file.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::expect_contains;
using test::expect_near;
using test::lit;
using test::SceneDirectory;

std::string shape_element(const std::string& type, const std::string& content) {
  return "<shape type=\"" + type + "\"><string name=\"filename\" value=\"mesh\"/>" + content +
         "</shape>";
}

/// The meshes of a scene with one shape, whose file is "mesh".
std::vector<TriangleMesh> load_meshes(const std::string& type, const std::string& file,
                                      const std::string& content = "") {
  const SceneDirectory directory;
  directory.write("mesh", file);
  const LoadedScene loaded = directory.load(lit(shape_element(type, content)));
  std::vector<TriangleMesh> meshes;
  for (const Shape& shape : loaded.scene.shapes())
    meshes.push_back(std::get<TriangleMesh>(shape.geometry));
  return meshes;
}

TriangleMesh load_mesh(const std::string& type, const std::string& file,
                       const std::string& content = "") {
  const std::vector<TriangleMesh> meshes = load_meshes(type, file, content);
  EXPECT_EQ(meshes.size(), 1U);
  return meshes.at(0);
}

/// The message of the error that loading the file must raise; it stands at the shape.
std::string mesh_error(const std::string& type, const std::string& file,
                       const std::string& content = "") {
  try {
    load_meshes(type, file, content);
  } catch (const SceneError& error) {
    EXPECT_EQ(error.location().line, 2);
    EXPECT_EQ(error.location().column, 1);
    return error.what();
  }
  ADD_FAILURE() << "loaded without an error";
  return {};
}

Eigen::Vector3f winding_normal(const TriangleMesh& mesh, std::size_t triangle) {
  const auto& t = mesh.triangles[triangle];
  const Eigen::Vector3f a = mesh.positions[t[0]];
  return (mesh.positions[t[1]] - a).cross(mesh.positions[t[2]] - a).normalized();
}

std::string transform(const std::string& step) {
  return "<transform name=\"toWorld\">" + step + "</transform>";
}

const std::string kFaceNormals = R"(<boolean name="faceNormals" value="true"/>)";
const std::string kFlipNormals = R"(<boolean name="flipNormals" value="true"/>)";

// --- obj -----------------------------------------------------------------------------------------

const std::string kSquare = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3 4\n";
/// Two unit squares that meet at a right angle along the y axis.
const std::string kRoof =
    "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 -1\nv 0 1 -1\nf 1 2 3 4\nf 5 1 4 6\n";

TEST(ObjFile, TriangulatesPolygons) {
  const TriangleMesh mesh = load_mesh("obj", kSquare);
  ASSERT_EQ(mesh.triangles.size(), 2U);
  EXPECT_EQ(mesh.positions.size(), 4U);
  EXPECT_TRUE(mesh.uvs.empty());
  expect_near(winding_normal(mesh, 0), Eigen::Vector3f(0, 0, 1));
  expect_near(winding_normal(mesh, 1), Eigen::Vector3f(0, 0, 1));
}

TEST(ObjFile, NegativeIndicesCountFromTheEnd) {
  const TriangleMesh mesh = load_mesh("obj", "v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n");
  ASSERT_EQ(mesh.positions.size(), 3U);
  expect_near(mesh.positions[mesh.triangles[0][1]], Eigen::Vector3f(1, 0, 0));
}

TEST(ObjFile, MergesEqualVertices) {
  // The second triangle has a corner of its own, three that equal the first's, and a copy of one
  // with another texture coordinate.
  const TriangleMesh mesh =
      load_mesh("obj",
                "v 0 0 0\nv 1 0 0\nv 0 1 0\nv -0 0 0\nv 1 0 0\nv 1 1 0\nvt 0 0\nvt 1 1\n"
                "f 1/1 2/1 3/1\nf 4/1 5/1 6/1\nf 4/2 2/1 6/1\n");
  EXPECT_EQ(mesh.positions.size(), 5U);
  const std::vector<std::array<std::uint32_t, 3>> expected{{0, 1, 2}, {0, 1, 3}, {4, 1, 3}};
  EXPECT_EQ(mesh.triangles, expected);
}

// Files are parsed in pieces, here cut amid squares, whose indices count from the end.
TEST(ObjFile, LargeFilesAreReadInOrder) {
  constexpr int kSquares = 40000;
  std::string file;
  for (int i = 0; i < kSquares; ++i)
    file += fmt::format("v {0} 0 0\nv {0}.5 0 0\nv {0}.5 1 0\nv {0} 1 0\nf -4 -3 -2 -1\n", i);
  const std::vector<TriangleMesh> parts = load_meshes("obj", file + "g last\nf 1 2 3\n");
  ASSERT_EQ(parts.size(), 2U);
  ASSERT_EQ(parts[0].positions.size(), 4U * kSquares);
  ASSERT_EQ(parts[0].triangles.size(), 2U * kSquares);
  for (std::uint32_t i = 0; i < kSquares; ++i) {
    const std::array<std::uint32_t, 3> first{4 * i, 4 * i + 1, 4 * i + 2};
    ASSERT_EQ(parts[0].triangles[2 * i], first);
    ASSERT_EQ(parts[0].positions[4 * i].x(), static_cast<float>(i));
  }
  ASSERT_EQ(parts[1].positions.size(), 3U);
  EXPECT_EQ(parts[1].positions[1].x(), 0.5F);
}

TEST(ObjFile, FlipsTextureCoordinatesByDefault) {
  const std::string file = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.25 0.1\nf 1/1 2/1 3/1\n";
  expect_near(load_mesh("obj", file).uvs.at(0), Eigen::Vector2f(0.25F, 0.9F));
  const std::string keep = R"(<boolean name="flipTexCoords" value="false"/>)";
  expect_near(load_mesh("obj", file, keep).uvs.at(0), Eigen::Vector2f(0.25F, 0.1F));
}

TEST(ObjFile, SmoothsMeshesWithoutNormals) {
  const TriangleMesh mesh = load_mesh("obj", kRoof);
  // At the ridge both squares have equal angles; elsewhere one square counts.
  const float half = std::sqrt(0.5F);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const Eigen::Vector3f& p = mesh.positions[i];
    const Eigen::Vector3f expected = p.x() == 1.0F    ? Eigen::Vector3f(0, 0, 1)
                                     : p.z() == -1.0F ? Eigen::Vector3f(-1, 0, 0)
                                                      : Eigen::Vector3f(-half, 0, half);
    expect_near(mesh.normals.at(i), expected);
  }
}

TEST(ObjFile, KeepsCreases) {
  const auto vertices = [](const std::string& angle) {
    const std::string property = "<float name=\"maxSmoothAngle\" value=\"" + angle + "\"/>";
    const TriangleMesh mesh = load_mesh("obj", kRoof, property);
    EXPECT_EQ(mesh.normals.size(), mesh.positions.size());
    EXPECT_EQ(mesh.triangles.size(), 4U);
    return mesh.positions.size();
  };
  EXPECT_EQ(vertices("89"), 8U);
  EXPECT_EQ(vertices("91"), 6U);
  const TriangleMesh sharp =
      load_mesh("obj", kRoof, R"(<float name="maxSmoothAngle" value="30"/>)");
  for (std::size_t t = 0; t < sharp.triangles.size(); ++t)
    for (const std::uint32_t vertex : sharp.triangles[t])
      expect_near(sharp.normals[vertex], winding_normal(sharp, t));
}

TEST(ObjFile, DropsNormalsOnDemand) {
  const TriangleMesh plain = load_mesh("obj", kSquare, kFaceNormals);
  EXPECT_TRUE(plain.normals.empty());
  expect_near(winding_normal(plain, 0), Eigen::Vector3f(0, 0, 1));
  const TriangleMesh flipped = load_mesh("obj", kSquare, kFaceNormals + kFlipNormals);
  expect_near(winding_normal(flipped, 0), Eigen::Vector3f(0, 0, -1));
}

TEST(ObjFile, FlipsNormals) {
  const std::string file = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvn 0 0 2\nf 1//1 2//1 3//1\n";
  expect_near(load_mesh("obj", file).normals.at(0), Eigen::Vector3f(0, 0, 1));
  expect_near(load_mesh("obj", file, kFlipNormals).normals.at(0), Eigen::Vector3f(0, 0, -1));
  expect_near(load_mesh("obj", kSquare, kFlipNormals).normals.at(0), Eigen::Vector3f(0, 0, -1));
}

TEST(ObjFile, TransformsNormalsByTheInverseTranspose) {
  const std::string file = "v 0 0 0\nv 1 0 1\nv 0 1 0\nvn -1 0 1\nf 1//1 2//1 3//1\n";
  const TriangleMesh mesh = load_mesh("obj", file, transform(R"(<scale x="2"/>)"));
  const Eigen::Vector3f edge = mesh.positions[1] - mesh.positions[0];
  EXPECT_NEAR(mesh.normals.at(0).dot(edge), 0.0F, 1e-6F);
  expect_near(mesh.normals.at(0), Eigen::Vector3f(-1, 0, 2).normalized().eval());
}

TEST(ObjFile, GroupsAreSmoothedApart) {
  const std::string groups =
      "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 -1\nv 0 1 -1\n"
      "g top\nf 1 2 3 4\ng side\nf 5 1 4 6\n";
  const std::vector<TriangleMesh> meshes = load_meshes("obj", groups);
  ASSERT_EQ(meshes.size(), 2U);
  for (const auto& normal : meshes[1].normals) expect_near(normal, Eigen::Vector3f(-1, 0, 0));
  EXPECT_EQ(load_meshes("obj", groups, R"(<boolean name="collapse" value="true"/>)").size(), 1U);
  const std::string index = R"(<integer name="shapeIndex" value=")";
  expect_near(load_mesh("obj", groups, index + R"(1"/>)").normals.at(0), Eigen::Vector3f(-1, 0, 0));
  EXPECT_EQ(load_meshes("obj", groups, index + R"(-1"/>)").size(), 2U);
}

/// Five squares: without a material, red, glass, gold, red again.
const std::string kPainted =
    "mtllib some.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\n"
    "f 1/1 2/1 3/1 4/1\nusemtl red \nf 1/1 2/1 3/1 4/1\nusemtl wine glass\nf 1/1 2/1 3/1 4/1\n"
    "g other\nusemtl gold\nf 1/1 2/1 3/1 4/1\nusemtl red\nf 1/1 2/1 3/1 4/1\n";

/// The scene of that file.
LoadedScene load_painted(const SceneDirectory& directory, const std::string& content = "") {
  directory.write("mesh", kPainted);
  return directory.load(lit(shape_element("obj", content)));
}

/// The front of each of its squares.
std::vector<Bsdf> fronts(const Scene& scene) {
  std::vector<Bsdf> result;
  for (const Shape& shape : scene.shapes())
    result.push_back(scene.bsdfs()[scene.materials()[shape.material].front]);
  return result;
}

TEST(ObjFile, TakesMaterialsFromItsLibrary) {
  const SceneDirectory directory;
  directory.write("some.mtl",
                  "# paint\nnewmtl red\n  Kd 0.5 0 1\n Ks .2 .2 .2\nNs 40\nillum 2\r\nTr 1\n\n"
                  "newmtl wine glass\nillum 7\nnewmtl gold\nillum 2\nKd 1 1 0\nNs 40\nd 0.25\n");
  const std::vector<Bsdf> bsdfs = fronts(load_painted(directory).scene);
  ASSERT_EQ(bsdfs.size(), 5U);
  expect_near(std::get<Diffuse>(bsdfs[0]).reflectance.color, Rgbd(0.5, 0.5, 0.5));
  for (const std::size_t i : {1U, 4U}) {
    const auto& red = std::get<Phong>(bsdfs[i]);
    expect_near(red.diffuse_reflectance.color, Rgbd(Rgbd(0.2140411, 0, 1) * (0.99 / 1.0331048)),
                1e-6);
    EXPECT_EQ(red.exponent, 40.0);
  }
  EXPECT_TRUE(std::holds_alternative<Dielectric>(bsdfs[2]));
  const auto& gold = std::get<Mask>(bsdfs[3]);
  expect_near(gold.opacity.color, Rgbd(0.25, 0.25, 0.25));
  EXPECT_TRUE(std::holds_alternative<Diffuse>(gold.nested->bsdf));
}

TEST(ObjFile, TheSceneMayNameItsMaterials) {
  const SceneDirectory directory;
  directory.write("some.mtl", "newmtl red\nKd 1 0 0\nnewmtl gold\nillum 5\n");
  const std::string metal = R"(<bsdf name="red" type="conductor"/>)";
  const LoadedScene named = load_painted(directory, metal + R"(<bsdf name="blue" type="phong"/>)");
  const std::vector<Bsdf> bsdfs = fronts(named.scene);
  EXPECT_TRUE(std::holds_alternative<Conductor>(bsdfs[1]));
  EXPECT_TRUE(std::holds_alternative<Diffuse>(bsdfs[2]));
  EXPECT_TRUE(std::holds_alternative<Conductor>(bsdfs[3]));
  expect_contains(named.notices.back(), "'blue'");
  for (const Bsdf& bsdf : fronts(load_painted(directory, R"(<bsdf type="plastic"/>)").scene))
    EXPECT_TRUE(std::holds_alternative<Plastic>(bsdf));
  const std::string off = R"(<boolean name="loadMaterials" value="false"/>)";
  for (const Bsdf& bsdf : fronts(load_painted(directory, off).scene))
    EXPECT_TRUE(std::holds_alternative<Diffuse>(bsdf));
}

TEST(ObjFile, SaysWhatIsWrongWithALibrary) {
  const SceneDirectory directory;
  ASSERT_EQ(load_painted(directory).notices.size(), 1U);
  expect_contains(load_painted(directory).notices[0], "some.mtl");
  directory.write("some.mtl", "newmtl red\nmap_Kd nowhere.png\n");
  expect_contains(load_painted(directory).notices.at(0), "nowhere.png");
  const auto location = [&](const std::string& library) {
    directory.write("some.mtl", library);
    try {
      load_painted(directory);
    } catch (const SceneError& error) {
      EXPECT_EQ(std::filesystem::path(error.location().file).filename(), "some.mtl");
      return static_cast<int>(error.location().line);
    }
    return 0;
  };
  EXPECT_EQ(location("newmtl red\n\nKd 1 zero 0\n"), 3);
  EXPECT_EQ(location("newmtl red\n\nnewmtl glass\nillum 2\nKd -1 0 0\n"), 3);
}

// Smooth glass under a mask would have two ways to transmit.
TEST(ObjFile, GlassOfALibraryHasNoOpacity) {
  const SceneDirectory directory;
  directory.write("some.mtl", "newmtl red\n\nnewmtl wine glass\nillum 4\nd 0.5\nnewmtl gold\n");
  const LoadedScene loaded = load_painted(directory);
  EXPECT_TRUE(std::holds_alternative<Dielectric>(fronts(loaded.scene)[2]));
  ASSERT_EQ(loaded.notices.size(), 1U);
  expect_contains(loaded.notices[0], "some.mtl:3:1: the opacity of the glass 'wine glass'");
}

TEST(ObjFile, RefusesBadFiles) {
  expect_contains(mesh_error("obj", "v 0 0 0\n"), "no faces");
  expect_contains(mesh_error("obj", ""), "no faces");
  expect_contains(mesh_error("obj", "v 0 0 0\nv 1 0 0\nf 1 2 3\n"), "vertex 3");
  expect_contains(mesh_error("obj", "v 0 0 0\nf 1 1 -2\n"), "vertex -2");
  expect_contains(mesh_error("obj", "v 0 0 0\nf a b c\n"), "vertex 0");
  expect_contains(mesh_error("obj", "v 0 0 0\nf 1//2 1//2 1//2\n"), "normal 2");
  expect_contains(mesh_error("obj", "v 0 0 0\nf 1/5 1/5 1/5\n"), "texture coordinate 5");
  expect_contains(mesh_error("obj", "v 0 0 0\nf 1 1\n"), "three corners");
  expect_contains(mesh_error("obj", "v 1e999 0 0\nf 1 1 1\n"), "finite");
  expect_contains(mesh_error("obj", "v 0 0 0\nvn 0 0 1\nf 1//1 1//1 1//1\nf 1 1 1\n"), "normals");
}

// --- serialized ----------------------------------------------------------------------------------

template <class T>
void append(std::string& bytes, T value) {
  const auto* const begin = reinterpret_cast<const char*>(&value);
  bytes.append(begin, sizeof(T));
}

template <class T>
void append_all(std::string& bytes, std::initializer_list<T> values) {
  for (const T value : values) append(bytes, value);
}

std::string compress_bytes(const std::string& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::string result(size, '\0');
  EXPECT_EQ(
      compress(reinterpret_cast<Bytef*>(result.data()), &size,
               reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uLong>(bytes.size())),
      Z_OK);
  result.resize(size);
  return result;
}

std::string mesh_header(std::uint16_t version) {
  std::string bytes;
  append_all<std::uint16_t>(bytes, {0x041C, version});
  return bytes;
}

/// What comes before the vertices, uncompressed.
std::string mesh_preamble(std::uint16_t version, std::uint32_t flags, std::uint64_t vertices,
                          std::uint64_t triangles) {
  std::string bytes;
  append(bytes, flags);
  if (version == 4) bytes += std::string("name") + '\0';
  append_all<std::uint64_t>(bytes, {vertices, triangles});
  return bytes;
}

/// One triangle (0, 0, 0), (size, 0, 0), (0, size, 0).
std::string one_triangle(std::uint16_t version, float size) {
  std::string bytes = mesh_preamble(version, 0x1000, 3, 1);
  append_all<float>(bytes, {0, 0, 0, size, 0, 0, 0, size, 0});
  append_all<std::uint32_t>(bytes, {0, 1, 2});
  return mesh_header(version) + compress_bytes(bytes);
}

template <class Offset>
std::string join_meshes(const std::vector<std::string>& meshes) {
  std::string bytes, offsets;
  for (const std::string& mesh : meshes) {
    append(offsets, static_cast<Offset>(bytes.size()));
    bytes += mesh;
  }
  append(offsets, static_cast<std::uint32_t>(meshes.size()));
  return bytes + offsets;
}

std::string shape_index(int index) {
  return "<integer name=\"shapeIndex\" value=\"" + std::to_string(index) + "\"/>";
}

TEST(SerializedFile, ReadsSinglePrecision) {
  const TriangleMesh mesh = load_mesh("serialized", one_triangle(4, 2.0F));
  ASSERT_EQ(mesh.triangles.size(), 1U);
  expect_near(mesh.positions.at(1), Eigen::Vector3f(2, 0, 0));
  expect_near(mesh.normals.at(0), Eigen::Vector3f(0, 0, 1));  // computed
  EXPECT_TRUE(mesh.uvs.empty());
}

TEST(SerializedFile, ReadsDoublePrecisionWithAllArrays) {
  std::string bytes = mesh_preamble(4, 0x2000 | 0x1 | 0x2 | 0x8, 3, 1);
  append_all<double>(bytes, {0, 0, 0, 1, 0, 0, 0, 1, 0});
  append_all<double>(bytes, {0, 0, -1, 0, 0, -1, 0, 0, -1});
  append_all<double>(bytes, {0.1, 0.2, 0.3, 0.4, 0.5, 0.6});
  append_all<double>(bytes, {7, 7, 7, 7, 7, 7, 7, 7, 7});
  append_all<std::uint32_t>(bytes, {2, 1, 0});
  const TriangleMesh mesh = load_mesh("serialized", mesh_header(4) + compress_bytes(bytes));
  expect_near(mesh.normals.at(2), Eigen::Vector3f(0, 0, -1));
  expect_near(mesh.uvs.at(1), Eigen::Vector2f(0.3F, 0.4F));
  EXPECT_EQ(mesh.triangles.at(0), (std::array<std::uint32_t, 3>{2, 1, 0}));
}

/// A triangle of version 5, with one record of these three floats and texture coordinates a vertex.
std::string packed_triangle(std::uint32_t flags, const Eigen::Vector3f& frame) {
  std::string bytes;
  append<std::uint32_t>(bytes, 0x1000 | flags);
  append<std::uint32_t>(bytes, 4);
  bytes += "name";
  append_all<std::uint64_t>(bytes, {3, 1, 2, 1});
  for (const auto& p :
       {Eigen::Vector3f(0, 0, 0), Eigen::Vector3f(1, 0, 0), Eigen::Vector3f(0, 1, 0)})
    append_all<float>(bytes, {p.x(), p.y(), p.z(), frame.x(), frame.y(), frame.z(), p.x(), p.y()});
  append_all<std::uint32_t>(bytes, {0, 1, 2, 0x80000000U});
  append_all<std::uint32_t>(bytes, {0, 0, 1, 0, 0, 0});  // distinct positions and normals
  append<std::uint32_t>(bytes, 2);
  for (const std::string name : {"face_weight", "vertex_color"}) {
    append(bytes, static_cast<std::uint32_t>(name.size()));
    bytes += name + '\0';
    append<std::uint32_t>(bytes, name == "vertex_color" ? 3 : 1);
    for (int i = 0; i < (name == "vertex_color" ? 9 : 1); ++i) append(bytes, 0.25F);
  }
  return mesh_header(5) + compress_bytes(bytes);
}

TEST(SerializedFile, ReadsRecordsOfMitsuba3) {
  constexpr std::uint32_t kNormals = 1, kFrames = 2, kTexCoords = 4, kFlat = 16;
  const TriangleMesh plain = load_mesh("serialized", packed_triangle(0, {0, 0, 0}));
  expect_near(plain.positions.at(1), Eigen::Vector3f(1, 0, 0));
  expect_near(plain.normals.at(0), Eigen::Vector3f(0, 0, 1));  // computed
  EXPECT_TRUE(plain.uvs.empty());
  EXPECT_EQ(plain.triangles.at(0), (std::array<std::uint32_t, 3>{0, 1, 2}));

  const TriangleMesh smooth =
      load_mesh("serialized", packed_triangle(kNormals | kTexCoords, {0, 0.6F, 0.8F}));
  expect_near(smooth.normals.at(2), Eigen::Vector3f(0, 0.6F, 0.8F));
  expect_near(smooth.uvs.at(2), Eigen::Vector2f(0, 1));

  // A turn by 90 degrees about x takes z to -y; it is stored as tan(90 / 4 degrees) x.
  const float turned = std::tan(static_cast<float>(kPi) / 8.0F);
  const TriangleMesh framed =
      load_mesh("serialized", packed_triangle(kNormals | kFrames | kTexCoords, {turned, 0, 0}));
  expect_near(framed.normals.at(0), Eigen::Vector3f(0, -1, 0));

  const std::string flat = packed_triangle(kNormals | kFlat, {0, 0.6F, 0.8F});
  EXPECT_TRUE(load_mesh("serialized", flat).normals.empty());
  const std::string shaded = R"(<boolean name="faceNormals" value="false"/>)";
  EXPECT_FALSE(load_mesh("serialized", flat, shaded).normals.empty());
}

TEST(SerializedFile, FindsMeshesByIndex) {
  for (const std::uint16_t version : {std::uint16_t{3}, std::uint16_t{4}}) {
    const std::vector<std::string> meshes{one_triangle(version, 1), one_triangle(version, 2),
                                          one_triangle(version, 3)};
    const std::string file =
        version == 4 ? join_meshes<std::uint64_t>(meshes) : join_meshes<std::uint32_t>(meshes);
    for (int i = 0; i < 3; ++i) {
      const TriangleMesh mesh = load_mesh("serialized", file, shape_index(i));
      EXPECT_EQ(mesh.positions.at(1).x(), static_cast<float>(i + 1)) << "version " << version;
    }
    expect_contains(mesh_error("serialized", file, shape_index(3)), "no mesh 3");
    expect_contains(mesh_error("serialized", file, shape_index(-1)), "negative");
  }
}

TEST(SerializedFile, MirroringKeepsTheOutside) {
  const TriangleMesh mesh =
      load_mesh("serialized", one_triangle(4, 1), transform(R"(<scale x="-1"/>)"));
  expect_near(mesh.normals.at(0), Eigen::Vector3f(0, 0, 1));
  expect_near(winding_normal(mesh, 0), Eigen::Vector3f(0, 0, 1));
}

TEST(SerializedFile, RefusesTruncatedFiles) {
  const std::string file = one_triangle(4, 1);
  for (const std::size_t size : {std::size_t{0}, std::size_t{3}, std::size_t{4}, std::size_t{20},
                                 file.size() - 6, file.size() - 1})
    expect_contains(mesh_error("serialized", file.substr(0, size)), "truncated");
}

TEST(SerializedFile, RefusesCorruptFiles) {
  const std::string file = one_triangle(4, 1);
  std::string changed = file;
  changed[0] = 'x';
  expect_contains(mesh_error("serialized", changed), "header");
  changed = file;
  changed[2] = 7;
  expect_contains(mesh_error("serialized", changed), "version 7");
  changed = file;
  changed[4] = '\x55';
  expect_contains(mesh_error("serialized", changed), "corrupt");
  changed = file;
  changed.back() = static_cast<char>(changed.back() ^ 1);  // of the checksum
  expect_contains(mesh_error("serialized", changed), "corrupt");

  std::string beyond = mesh_preamble(4, 0x1000, 3, 1);
  append_all<float>(beyond, {0, 0, 0, 1, 0, 0, 0, 1, 0});
  append_all<std::uint32_t>(beyond, {0, 1, 3});
  expect_contains(mesh_error("serialized", mesh_header(4) + compress_bytes(beyond)), "vertex 3");
}

TEST(SerializedFile, RefusesImpossibleCountsBeforeItAllocates) {
  const auto file = [](std::uint64_t vertices, std::uint64_t triangles) {
    std::string bytes = mesh_preamble(4, 0x1000, vertices, triangles);
    append_all<float>(bytes, {0, 0, 0, 1, 0, 0, 0, 1, 0});
    return mesh_header(4) + compress_bytes(bytes);
  };
  const std::uint64_t huge = std::uint64_t{1} << 62U;
  expect_contains(mesh_error("serialized", file(huge, 1)), "corrupt");
  expect_contains(mesh_error("serialized", file(3, huge)), "corrupt");
  expect_contains(mesh_error("serialized", file(0, 0)), "no triangles");
}

}  // namespace
}  // namespace driftlight
