// SPDX-License-Identifier: Apache-2.0
/// Relief: small shape of a surface that shows in its shading normal alone (J. Blinn, Simulation of
/// wrinkled surfaces, SIGGRAPH 1978), by a texture over a mesh with texture coordinates.
#pragma once

#include "driftlight/geometry.h"
#include "driftlight/texture.h"

namespace driftlight {

struct Relief {
  enum class Kind : unsigned char {
    /// The luminance of the texture, times `scale`, is a height in units of the world.
    Bumps,
    /// The colour c of the texture is the normal 2 c - 1 in the frame (s, t, n): n the shading
    /// normal of the mesh, s along dp/du, t = n x s.
    Normals
  };

  Kind kind = Kind::Bumps;
  Texture texture;
  double scale = 1;  ///< of bumps, of either sign
};

namespace detail {

/// With p_u, p_v the tangents and h the height; the change of n along the surface is left out, as
/// usual:
///   N = (p_u + a n) x (p_v + b n) = p_u x p_v + b p_u x n + a n x p_v,
///   a = h_u - n.p_u,  b = h_v - n.p_v
template <Scalar T>
Vec3<T> bumped_normal(const Relief& relief, const SurfaceTangents& tangents, const Vec3<T>& n,
                      const Vec2<T>& uv) {
  const Texture::SlopesOf<T> slopes = relief.texture.slopes(uv);
  const T a = luminance(slopes.u) * relief.scale - dot(tangents.u, n);
  const T b = luminance(slopes.v) * relief.scale - dot(tangents.v, n);
  const Vec3<T> flat = constant<T>(Vec3d(tangents.u.cross(tangents.v)));
  const Vec3<T> along_v = along(flat, b, cross(constant<T>(tangents.u), n));
  return along(along_v, a, cross(n, constant<T>(tangents.v)));
}

/// N = m_0 s + m_1 n x s + m_2 n,  m = 2 c - 1,  s = S / |S|,  S = p_u - (n.p_u) n
template <Scalar T>
Vec3<T> mapped_normal(const Relief& relief, const SurfaceTangents& tangents, const Vec3<T>& n,
                      const Vec2<T>& uv) {
  const Rgb<T> color = relief.texture.eval(uv);
  const Vec3<T> s = normalized(along(constant<T>(tangents.u), T(-dot(tangents.u, n)), n));
  const Vec3<T> in_plane =
      along(scaled(s, T(2.0 * color[0] - 1.0)), T(2.0 * color[1] - 1.0), cross(n, s));
  return along(in_plane, T(2.0 * color[2] - 1.0), n);
}

}  // namespace detail

/// Unit shading normal with the relief, n the one without, on the side of n_g.
template <Scalar T>
Vec3<T> relieved_normal(const Relief& relief, const SurfaceTangents& tangents, const Vec3<T>& n_g,
                        const Vec3<T>& n, const Vec2<T>& uv) {
  const Vec3<T> normal = normalized(relief.kind == Relief::Kind::Bumps
                                        ? detail::bumped_normal(relief, tangents, n, uv)
                                        : detail::mapped_normal(relief, tangents, n, uv));
  return dot(value(n_g), value(normal)) < 0.0 ? Vec3<T>(-normal) : normal;
}

/// Gives the shading normal of the interaction, which has its uv, the relief; where texture
/// coordinates do not span the triangle it does nothing.
template <Scalar T>
void relieve(const Relief& relief, const TriangleMesh& mesh, std::uint32_t triangle,
             Interaction<T>& at) {
  if (const auto tangents = surface_tangents(mesh, triangle))
    at.n_s = relieved_normal(relief, *tangents, at.n_g, at.n_s, at.uv);
}

}  // namespace driftlight
