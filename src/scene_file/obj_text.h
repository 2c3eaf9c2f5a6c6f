// SPDX-License-Identifier: Apache-2.0
/// The text of Wavefront OBJ files.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace driftlight {

/// What some lines of a file say. Each statement tells how many values have come before it, so that
/// pieces of a file can be parsed side by side and taken in order.
struct ObjPiece {
  /// As written: from 1, or from the end if negative; 0 where there is none.
  struct Corner {
    int position = 0;
    int uv = 0;
    int normal = 0;
  };
  struct Counts {
    std::uint32_t positions = 0;
    std::uint32_t normals = 0;
    std::uint32_t uvs = 0;
  };
  enum class Kind : std::uint8_t { Polygon, Group, Material, Library };
  struct Statement {
    Kind kind;
    int line;  ///< of the piece, from 1
    Counts before;
    std::uint32_t first;  ///< of a polygon's corners, or the name
    std::uint32_t count;  ///< of a polygon's corners
  };
  struct Problem {
    int line;
    std::string message;
  };

  std::vector<Eigen::Vector3f> positions;
  std::vector<Eigen::Vector3f> normals;
  std::vector<Eigen::Vector2f> uvs;
  std::vector<Corner> corners;
  std::vector<std::string> names;
  std::vector<Statement> statements;
  int line_count = 0;
  /// What is wrong with the last line that was read.
  std::optional<Problem> problem;
};

/// Parses whole lines, which may end as on any system, up to the first that is wrong: no statement,
/// or one whose numbers cannot be read. Statements that do not matter to meshes may say what they
/// like.
ObjPiece parse_obj(const std::string& lines);

}  // namespace driftlight
