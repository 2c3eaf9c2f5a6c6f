// SPDX-License-Identifier: Apache-2.0
#include "vertex_colors.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "bsdf_textures.h"
#include "bsdfs_xml.h"
#include "driftlight/error.h"

namespace driftlight {
namespace {

const std::shared_ptr<const Bitmap>& stand_in() {
  static const auto bitmap =
      std::make_shared<const Bitmap>(Bitmap{1, 1, {Eigen::Array3f::Constant(1.0F)}});
  return bitmap;
}

/// Calls `visit` with each texture of the surface's BSDFs.
template <class S, class Visit>
void for_each_texture_of(S& surface, const Visit& visit) {
  for_each_texture(surface.front, visit);
  if (surface.back) for_each_texture(*surface.back, visit);
}

/// Corners lie so far within the patch, in texels, that rounding does not carry them out of it.
constexpr float kInset = 1.0F / 64.0F;

/// The four texels of a triangle whose corners, at (i, i), (1 - i, i) and (i, 1 - i) with i =
/// kInset, have these colours.
void paint(const std::array<Eigen::Array3f, 3>& corner, int x, int y, Bitmap& bitmap) {
  const Eigen::Array3f along_x = (corner[1] - corner[0]) / (1.0F - 2.0F * kInset);
  const Eigen::Array3f along_y = (corner[2] - corner[0]) / (1.0F - 2.0F * kInset);
  const Eigen::Array3f first = corner[0] - kInset * (along_x + along_y);
  const auto texel = [&](int i, int j) -> Eigen::Array3f& {
    return bitmap.texels[static_cast<std::size_t>(y + j) * static_cast<std::size_t>(bitmap.width) +
                         static_cast<std::size_t>(x + i)];
  };
  texel(0, 0) = first;
  texel(1, 0) = first + along_x;
  texel(0, 1) = first + along_y;
  texel(1, 1) = first + along_x + along_y;
}

/// Gives each triangle vertices of its own; no texture coordinates.
TriangleMesh taken_apart(const TriangleMesh& mesh) {
  TriangleMesh result;
  for (const auto& triangle : mesh.triangles) {
    const auto first = static_cast<std::uint32_t>(result.positions.size());
    result.triangles.push_back({first, first + 1, first + 2});
    for (const std::uint32_t vertex : triangle) {
      result.positions.push_back(mesh.positions[vertex]);
      if (!mesh.normals.empty()) result.normals.push_back(mesh.normals[vertex]);
    }
  }
  return result;
}

void check_paintable(const Surface& surface) {
  if (surface.relief != nullptr) throw InputError("vertex colours cannot be under a bump map");
  if (!is_isotropic(surface))
    throw InputError("vertex colours cannot be on a surface of anisotropic roughness");
  for_each_texture_of(surface, [](const Texture& texture) {
    if (!texture.is_constant() && !is_vertex_colors(texture))
      throw InputError("vertex colours cannot be beside another texture");
  });
}

}  // namespace

Texture vertex_color_texture() {
  Texture texture(Rgbd{1, 1, 1});
  texture.bitmap = stand_in();
  return texture;
}

bool is_vertex_colors(const Texture& texture) { return texture.bitmap == stand_in(); }

bool looks_at_vertex_colors(const Surface& surface) {
  bool result = false;
  for_each_texture_of(surface,
                      [&](const Texture& texture) { result |= is_vertex_colors(texture); });
  return result;
}

Surface painted(TriangleMesh& mesh, const std::vector<Eigen::Vector3f>& colors,
                const Surface& surface) {
  check_paintable(surface);
  const auto count = static_cast<int>(mesh.triangles.size());
  const int columns = static_cast<int>(std::ceil(std::sqrt(count)));
  const int rows = (count + columns - 1) / columns;
  Bitmap bitmap{2 * columns, 2 * rows, {}};
  bitmap.texels.resize(4 * static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows),
                       Eigen::Array3f::Zero());
  TriangleMesh apart = taken_apart(mesh);
  for (int i = 0; i < count; ++i) {
    const auto& triangle = mesh.triangles[static_cast<std::size_t>(i)];
    const int x = 2 * (i % columns);
    const int y = 2 * (i / columns);
    paint({colors[triangle[0]].array(), colors[triangle[1]].array(), colors[triangle[2]].array()},
          x, y, bitmap);
    // In texels, which are whole numbers and so many 64ths, and as such exact.
    const Eigen::Vector2f corner(static_cast<float>(x) + 0.5F + kInset,
                                 static_cast<float>(y) + 0.5F + kInset);
    apart.uvs.push_back(corner);
    apart.uvs.emplace_back(corner.x() + 1.0F - 2.0F * kInset, corner.y());
    apart.uvs.emplace_back(corner.x(), corner.y() + 1.0F - 2.0F * kInset);
  }
  mesh = std::move(apart);

  const auto shared = std::make_shared<const Bitmap>(std::move(bitmap));
  Surface result = surface;
  result.material.reset();
  for_each_texture_of(result, [&](Texture& texture) {
    if (!is_vertex_colors(texture)) return;
    texture.bitmap = shared;
    texture.uv_to_texture =
        Vec2d(1.0 / shared->width, 1.0 / shared->height).asDiagonal().toDenseMatrix();
    texture.wrap_u = texture.wrap_v = Wrap::Clamp;
  });
  return result;
}

}  // namespace driftlight
