// SPDX-License-Identifier: Apache-2.0
/// The text of Wavefront OBJ files.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace driftlight {

/// What some lines of a file say, so that pieces of a file can be parsed side by side and taken in
/// order.
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
  enum class Kind : std::uint8_t {
    Polygons,  ///< on lines that follow each other, with the same number of corners
    Group,
    Material,
    Library,
  };
  struct Statement {
    Kind kind;
    int line;                   ///< of the piece, from 1; of several the first
    Counts before;              ///< values that come before it
    std::uint32_t first;        ///< of the corners, or the name
    std::uint32_t corners = 0;  ///< of each polygon
    std::uint32_t count = 1;
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

  void clear();
};

/// Parses whole lines, which may end as on any system, up to the first that is wrong: no statement,
/// or one whose numbers cannot be read. Statements that do not matter to meshes may say what they
/// like. What the piece held before is gone, but its memory stays.
void parse_obj(const std::string& lines, ObjPiece& piece);

}  // namespace driftlight
