// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: of shading normals with relief (relief.h), n the one without.
///
///   n' = N / |N|:  dn' = (I - n' n'^T) dN / |N|
///   bumps    N = p_u x p_v + b p_u x n + a n x p_v,  a = h_u - n.p_u,  b = h_v - n.p_v:
///     dN = db p_u x n + b p_u x dn + da n x p_v + a dn x p_v,
///     da = h_uu du + h_uv dv - p_u.dn,  db = h_uv du + h_vv dv - p_v.dn                   (H35)
///   normals  N = m_0 s + m_1 t + m_2 n,  m = 2 c - 1,  t = n x s,  s = S / |S|,
///            S = p_u - (n.p_u) n:
///     dN = s dm_0 + t dm_1 + n dm_2 + m_0 ds + m_1 dt + m_2 dn,  dm = 2 (c_u du + c_v dv),
///     ds = (I - s s^T) dS / |S|,  dS = -(p_u.dn) n - (n.p_u) dn,  dt = dn x s + n x ds    (H36)
#pragma once

#include "driftlight/hand_rules.h"

namespace driftlight::hand {

/// (H35)
class Bumps {
 public:
  Bumps(const Relief& relief, const SurfaceTangents& tangents, const Vec3d& n, const Vec2d& uv)
      : p_(tangents), n_(n) {
    const auto height = [&](const Rgbd& color) { return relief.scale * luminance(color); };
    const Texture::Slopes slopes = relief.texture.slopes(uv);
    const Texture::Curvatures curvatures = relief.texture.curvatures(uv);
    a_ = height(slopes.u) - n.dot(p_.u);
    b_ = height(slopes.v) - n.dot(p_.v);
    h_uu_ = height(curvatures.uu);
    h_uv_ = height(curvatures.uv);
    h_vv_ = height(curvatures.vv);
  }

  /// N
  Vec3d normal() const { return p_.u.cross(p_.v) + b_ * p_.u.cross(n_) + a_ * n_.cross(p_.v); }
  /// dN
  Vec3d differential(const Vec3d& dn, double du, double dv) const {
    const double da = h_uu_ * du + h_uv_ * dv - p_.u.dot(dn);
    const double db = h_uv_ * du + h_vv_ * dv - p_.v.dot(dn);
    return db * p_.u.cross(n_) + b_ * p_.u.cross(dn) + da * n_.cross(p_.v) + a_ * dn.cross(p_.v);
  }

 private:
  SurfaceTangents p_;
  Vec3d n_;
  double a_, b_, h_uu_, h_uv_, h_vv_;
};

/// (H36)
class MappedNormal {
 public:
  MappedNormal(const Relief& relief, const SurfaceTangents& tangents, const Vec3d& n,
               const Vec2d& uv)
      : p_u_(tangents.u),
        n_(n),
        m_(2.0 * relief.texture.eval(uv) - 1.0),
        slopes_(relief.texture.slopes(uv)),
        across_(n.dot(p_u_)),
        length_((p_u_ - across_ * n).norm()),
        s_((p_u_ - across_ * n) / length_) {}

  /// N
  Vec3d normal() const { return m_[0] * s_ + m_[1] * n_.cross(s_) + m_[2] * n_; }
  /// dN
  Vec3d differential(const Vec3d& dn, double du, double dv) const {
    const Rgbd dm = 2.0 * (du * slopes_.u + dv * slopes_.v);
    const Vec3d change = -p_u_.dot(dn) * n_ - across_ * dn;
    const Vec3d ds = (change - s_.dot(change) * s_) / length_;
    const Vec3d dt = dn.cross(s_) + n_.cross(ds);
    return dm[0] * s_ + dm[1] * n_.cross(s_) + dm[2] * n_ + m_[0] * ds + m_[1] * dt + m_[2] * dn;
  }

 private:
  Vec3d p_u_, n_;
  Rgbd m_;
  Texture::Slopes slopes_;
  double across_;  ///< n.p_u
  double length_;  ///< |S|
  Vec3d s_;
};

/// Of a mesh with a relief at p; `n_s` tells which side the normal was turned to.
template <class Rules>
SurfaceDifferential relieved_surface(const Relief& relief, const TriangleMesh& mesh,
                                     std::uint32_t triangle, const Vec3d& p, const Vec2d& uv,
                                     const Vec3d& n_s) {
  const auto tangents = surface_tangents(mesh, triangle);
  if (!tangents) return Rules::surface(mesh, triangle, p, n_s, true);
  const Vec3d n = shading_normal(mesh, triangle, p);
  SurfaceDifferential result = Rules::surface(mesh, triangle, p, n, true);
  if (!result.interpolated) result.a1 = result.a2 = Vec3d::Zero();
  const auto change_along = [&](const auto& relieved, const Vec3d& edge, const Vec3d& dn) -> Vec3d {
    const Vec3d d = relieved.differential(dn, result.u.dot(edge), result.v.dot(edge));
    return (d - n_s.dot(d) * n_s) / relieved.normal().dot(n_s);  // +-|N|
  };
  const auto change = [&](const auto& relieved) {
    const std::array<Vec3d, 3> corner = corners(mesh, triangle);
    result.interpolated = true;
    result.a1 = change_along(relieved, corner[1] - corner[0], result.a1);
    result.a2 = change_along(relieved, corner[2] - corner[0], result.a2);
  };
  if (relief.kind == Relief::Kind::Bumps)
    change(Bumps(relief, *tangents, n, uv));
  else
    change(MappedNormal(relief, *tangents, n, uv));
  return result;
}

}  // namespace driftlight::hand
