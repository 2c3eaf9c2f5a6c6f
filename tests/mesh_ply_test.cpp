// SPDX-License-Identifier: Apache-2.0
/// PLY files.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "driftlight/scene_file.h"
#include "support/scene_directory.h"

namespace driftlight {
namespace {

using test::expect_contains;
using test::expect_near;
using test::lit;
using test::SceneDirectory;

LoadedScene load_ply(const std::string& file, const std::string& content = "") {
  const SceneDirectory directory;
  directory.write("mesh.ply", file);
  return directory.load(lit(R"(<shape type="ply"><string name="filename" value="mesh.ply"/>)" +
                            content + "</shape>"));
}

TriangleMesh load_mesh(const std::string& file, const std::string& content = "") {
  const LoadedScene loaded = load_ply(file, content);
  return std::get<TriangleMesh>(loaded.scene.shapes()[0].geometry);
}

std::string error_of(const std::string& file) {
  return test::scene_error([&] { load_ply(file); });
}

std::string header(const std::string& format, const std::string& vertex_properties, int vertices,
                   const std::string& face_properties, int faces) {
  return "ply\nformat " + format + " 1.0\ncomment made by hand\nelement vertex " +
         std::to_string(vertices) + "\n" + vertex_properties + "element face " +
         std::to_string(faces) + "\n" + face_properties + "end_header\n";
}

const std::string kXyz = "property float x\nproperty float y\nproperty float z\n";
const std::string kIndices = "property list uchar int vertex_indices\n";
const std::string kSquare =
    header("ascii", kXyz, 4, kIndices, 1) + "0 0 0\n1 0 0\n1 1 0\n0 1 0\n4 0 1 2 3\n";

TEST(PlyFile, TriangulatesPolygons) {
  const TriangleMesh mesh = load_mesh(kSquare);
  ASSERT_EQ(mesh.triangles.size(), 2U);
  EXPECT_EQ(mesh.triangles[0], (std::array<std::uint32_t, 3>{0, 1, 2}));
  EXPECT_EQ(mesh.triangles[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
  EXPECT_EQ(mesh.positions.size(), 4U);
  EXPECT_TRUE(mesh.uvs.empty());
  expect_near(mesh.normals.at(2), Eigen::Vector3f(0, 0, 1));  // computed
}

TEST(PlyFile, AcceptsLineEndsOfOtherSystems) {
  std::string file;
  for (const char c : kSquare) file += c == '\n' ? std::string("\r\n") : std::string(1, c);
  EXPECT_EQ(load_mesh(file).triangles.size(), 2U);
}

TEST(PlyFile, ReadsNormalsAndTextureCoordinates) {
  const std::string more = "property float nx\nproperty float ny\nproperty float nz\n";
  for (const auto& [u, v] :
       {std::pair{"u", "v"}, std::pair{"s", "t"}, std::pair{"texture_u", "texture_v"}}) {
    const std::string uvs = std::string("property float ") + u + "\nproperty float " + v + "\n";
    const std::string file = header("ascii", kXyz + more + uvs, 3, kIndices, 1) +
                             "0 0 0 0 0 -1 0.1 0.2\n1 0 0 0 0 -1 0.3 0.4\n"
                             "0 1 0 0 0 -1 0.5 0.6\n3 0 1 2\n";
    const TriangleMesh mesh = load_mesh(file);
    expect_near(mesh.normals.at(0), Eigen::Vector3f(0, 0, -1));
    expect_near(mesh.uvs.at(1), Eigen::Vector2f(0.3F, 0.4F));
    const TriangleMesh flipped = load_mesh(file, R"(<boolean name="flipTexCoords" value="true"/>)");
    expect_near(flipped.uvs.at(1), Eigen::Vector2f(0.3F, 0.6F));
    EXPECT_TRUE(load_mesh(file, R"(<boolean name="faceNormals" value="true"/>)").normals.empty());
  }
}

TEST(PlyFile, NamesWhatItDoesNotUse) {
  const LoadedScene loaded =
      load_ply(header("ascii", kXyz + "property uchar red\nproperty list uchar float tags\n", 3,
                      kIndices + "property int group\n", 1) +
               "0 0 0 255 2 1 2\n1 0 0 7 0\n0 1 0 9 1 3\n3 0 1 2 5\n");
  ASSERT_EQ(loaded.notices.size(), 1U);
  expect_contains(loaded.notices[0], "vertex tags, face group");
}

TEST(PlyFile, SkipsOtherElements) {
  const std::string file =
      "ply\nformat ascii 1.0\nelement camera 2\nproperty float fov\n"
      "property list int float k\nelement vertex 3\n" +
      kXyz + "element face 1\n" + kIndices + "element empty 7\nend_header\n" +
      "45 2 1 2\n50 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";
  EXPECT_EQ(load_mesh(file).triangles.size(), 1U);
}

template <class T>
void append(std::string& bytes, T value, bool big) {
  std::array<char, sizeof(T)> raw{};
  std::memcpy(raw.data(), &value, sizeof(T));
  if (big) std::reverse(raw.begin(), raw.end());
  bytes.append(raw.data(), raw.size());
}

/// A square of a binary file, its numbers of several types.
std::string binary_square(bool big) {
  std::string bytes = header(big ? "binary_big_endian" : "binary_little_endian",
                             "property double x\nproperty float y\nproperty short z\n"
                             "property uchar red\n",
                             4, "property list uint ushort vertex_index\n", 1);
  const double xs[] = {0, 1, 1, 0};
  const float ys[] = {0, 0, 1, 1};
  for (int i = 0; i < 4; ++i) {
    append(bytes, xs[i], big);
    append(bytes, ys[i], big);
    append<std::int16_t>(bytes, -300, big);
    append<std::uint8_t>(bytes, 200, big);
  }
  append<std::uint32_t>(bytes, 4, big);
  for (std::uint16_t i = 0; i < 4; ++i) append(bytes, i, big);
  return bytes;
}

TEST(PlyFile, ReadsBothByteOrders) {
  for (const bool big : {false, true}) {
    const TriangleMesh mesh = load_mesh(binary_square(big));
    ASSERT_EQ(mesh.triangles.size(), 2U);
    expect_near(mesh.positions.at(2), Eigen::Vector3f(1, 1, -300));
    EXPECT_EQ(mesh.triangles[1], (std::array<std::uint32_t, 3>{0, 2, 3}));
  }
}

/// Rows of one size are read side by side; after a quadrangle they no longer are.
TEST(PlyFile, ReadsManyFacesInTheirOrder) {
  constexpr int kFaces = 20000;
  std::string vertices;
  for (int i = 0; i < kFaces + 3; ++i)
    for (const float x : {static_cast<float>(i), i % 2 == 0 ? 0.0F : 1.0F, 0.0F})
      append(vertices, x, false);
  const auto face = [](std::uint8_t corners, int first) {
    std::string bytes;
    append(bytes, corners, false);
    for (int i = 0; i < corners; ++i) append(bytes, first + i, false);
    return bytes;
  };
  std::string faces;
  for (int i = 0; i + 1 < kFaces; ++i) faces += face(3, i);
  const std::string start =
      header("binary_little_endian", kXyz, kFaces + 3, kIndices, kFaces) + vertices + faces;
  const TriangleMesh even = load_mesh(start + face(3, kFaces - 1));
  const TriangleMesh uneven = load_mesh(start + face(4, kFaces - 1));
  ASSERT_EQ(even.triangles.size(), static_cast<std::size_t>(kFaces));
  ASSERT_EQ(uneven.triangles.size(), even.triangles.size() + 1);
  for (std::uint32_t i = 0; i < kFaces; ++i) {
    ASSERT_EQ(even.positions[i].x(), static_cast<float>(i));
    ASSERT_EQ(even.triangles[i], (std::array<std::uint32_t, 3>{i, i + 1, i + 2}));
    ASSERT_EQ(uneven.triangles[i], even.triangles[i]);
  }
}

TEST(PlyFile, MirroringTurnsItInsideOutButInMitsuba3) {
  const SceneDirectory directory;
  directory.write("mesh.ply", kSquare);
  const auto normal = [&](const std::string& version, const std::string& name) {
    const LoadedScene loaded = directory.load(
        "<scene version=\"" + version + R"("><shape type="ply"><string name="filename" )" +
        R"(value="mesh.ply"/><transform name=")" + name +
        R"("><scale x="-1"/></transform></shape>)" + test::kSensor + test::kEmitter + "</scene>");
    return std::get<TriangleMesh>(loaded.scene.shapes()[0].geometry).normals.at(0);
  };
  expect_near(normal("0.6.0", "toWorld"), Eigen::Vector3f(0, 0, -1));
  expect_near(normal("3.0.0", "to_world"), Eigen::Vector3f(0, 0, 1));
}

TEST(PlyFile, RefusesTruncatedFiles) {
  for (const std::string& file : {kSquare, binary_square(false), binary_square(true)}) {
    const std::size_t body = file.find("end_header\n") + 11;
    for (std::size_t size = 0; size + 2 < file.size(); size += size < body ? 37 : 5)
      EXPECT_FALSE(error_of(file.substr(0, size)).empty()) << size;
    expect_contains(error_of(file.substr(0, body + 7)), "truncated");
  }
}

TEST(PlyFile, RefusesImpossibleCountsBeforeItAllocates) {
  const auto with_count = [](const std::string& count) {
    return error_of("ply\nformat ascii 1.0\nelement vertex " + count + "\n" + kXyz +
                    "element face 1\n" + kIndices + "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n");
  };
  expect_contains(with_count("9223372036854775807"), "9223372036854775807 elements 'vertex'");
  expect_contains(with_count("99223372036854775807"), "mesh.ply:3: ");
  const std::string list =
      header("ascii", kXyz, 3, kIndices, 1) + "0 0 0\n1 0 0\n0 1 0\n1000000000 0 1 2\n";
  expect_contains(error_of(list), "longer than the file");
}

TEST(PlyFile, RefusesBadFiles) {
  expect_contains(error_of("obj\n"), "'ply'");
  expect_contains(error_of("ply\nformat ascii 1.0\n"), "no end");
  expect_contains(error_of("ply\nend_header\n"), "no format");
  expect_contains(error_of("ply\nformat text 1.0\nend_header\n"), "binary_little_endian");
  expect_contains(error_of("ply\nformat ascii 1.0\nproperty float x\nend_header\n"),
                  "mesh.ply:3: ");
  expect_contains(
      error_of("ply\nformat ascii 1.0\nelement vertex 1\nproperty half x\nend_header\n"), "'half'");
  expect_contains(error_of(header("ascii", "property float x\n", 1, kIndices, 1) + "0\n3 0 0 0\n"),
                  "x, y or z");
  expect_contains(error_of(header("ascii", kXyz, 1, "property int a\n", 1) + "0 0 0\n1\n"),
                  "vertex_indices");
  const auto with_face = [](const std::string& face) {
    return header("ascii", kXyz, 3, kIndices, 1) + "0 0 0\n1 0 0\n0 1 0\n" + face + "\n";
  };
  expect_contains(error_of(with_face("3 0 1 3")),
                  "mesh.ply:14: a face refers to vertex 3, but there are only 3\n   14 | 3 0 1 3");
  expect_contains(error_of(with_face("3 0 1 -1")), "vertex -1");
  expect_contains(error_of(with_face("3 0 1 1.5")), "vertex 1.5");
  expect_contains(error_of(with_face("2 0 1 1")), "three corners");
  expect_contains(error_of(with_face("3 0 1 x")), "mesh.ply:14: 'x'");
  expect_contains(error_of(header("ascii", kXyz, 3, kIndices, 1) + "0 0 0\n1 1e99 0\n0 1 0\n"),
                  "mesh.ply:12: 1e+99 does not fit");
  expect_contains(error_of(with_face("3 0 1 nan")), "'nan'");
}

}  // namespace
}  // namespace driftlight
