// SPDX-License-Identifier: Apache-2.0
/// Derivatives derived by hand: the residuals of scattering (constraints.h), given the
/// differentials of the directions, of the normal and of the tangent in all local columns:
///   slopes  r = m - n, m = h / h.n, h = w_i + e w_o:
///           dr = (dh - m (n.dh)) / h.n - m (m.dn) - dn                                    (H19)
///           along the tangent and across it  r_u = (P.m - P.n) / L,  r_v = (n x P).m / L:
///           dr_u = (m.dP + P.dm - P.dn - n.dP - r_u dL) / L,  L dL = P.dP - P.n (P.dn + n.dP)
///           dr_v = (dn.(P x m) + dP.(m x n) + (n x P).dm - r_v dL) / L                    (H45)
///   diffuse r = w_o - c_o n:  dr = dw_o - c_o dn - n dc_o                                 (H20)
///   Phong   r = w_o - mirror: dr = dw_o - (2 c_i dn + 2 n dc_i - dw_i)                    (H21)
///   coating r of what is below, by w' = w / eta + (c' - c / eta) n with c' of (H39):
///           dw' = dw / eta + n (c / (eta^2 c') - 1 / eta) dc + (c' - c / eta) dn         (H40)
#pragma once

#include "driftlight/hand_path.h"

namespace driftlight::hand {

/// The differential of a vector, in all local columns.
struct Columns {
  LocalRow x, y, z;

  static Columns zero() { return {LocalRow::Zero(), LocalRow::Zero(), LocalRow::Zero()}; }
  void set(int column, const Vec3d& v) {
    x[column] = v.x();
    y[column] = v.y();
    z[column] = v.z();
  }
};

inline LocalRow dot(const Vec3d& a, const Columns& b) {
  return a.x() * b.x + a.y() * b.y + a.z() * b.z;
}
inline Columns cross(const Vec3d& a, const Columns& b) {
  return {a.y() * b.z - a.z() * b.y, a.z() * b.x - a.x() * b.z, a.x() * b.y - a.y() * b.x};
}
inline Columns outer(const Vec3d& a, const LocalRow& row) {
  return {a.x() * row, a.y() * row, a.z() * row};
}
inline Columns operator*(double k, const Columns& a) { return {k * a.x, k * a.y, k * a.z}; }
inline Columns operator+(const Columns& a, const Columns& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Columns operator-(const Columns& a, const Columns& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

/// The rows of residuals, as they come.
class ResidualRows {
 public:
  /// Differentials of w_i, w_o, n, and P of (H44).
  struct Scattered {
    const Columns& dwi;
    const Columns& dwo;
    const Columns& dn;
    const Columns& dp;
  };

  explicit ResidualRows(Linearization& result) : result_(result) {}

  int count() const { return count_; }
  void add(const LocalRow& row) { result_.rows.row(count_++) = row; }
  /// `factor` is sqrt(w) / 3.
  void add(double factor, const Columns& dr) {
    add(factor * dr.x);
    add(factor * dr.y);
    add(factor * dr.z);
  }
  /// Those of the vertex's density.
  void scatter(const Vertex& x, const Scattered& d) { constrain(*x.bsdf, x, d, 1.0); }
  /// (H20) of any direction v, whose cosine with n this is.
  void tangential(const Vec3d& n, const Vec3d& v, double cosine, const Columns& dv,
                  const Columns& dn, double share) {
    const double factor = std::sqrt(share) / (3.0 * std::abs(cosine));
    const LocalRow d_cos = dot(n, dv) + dot(v, dn);
    add(factor, dv - cosine * dn - outer(n, d_cos));
  }

 private:
  /// (H19)
  void slopes(const Microfacets& m, double e, const Vertex& x, const Scattered& d, double share) {
    const double hn = x.cos_i + e * x.cos_o;
    const Vec3d h = (x.wi + e * x.wo) / hn;
    const Columns dh = d.dwi + e * d.dwo;
    const LocalRow along = dot(x.n_s, dh) / hn + dot(h, d.dn);
    const Columns change = (1.0 / hn) * dh - outer(h, along);
    if (!m.is_isotropic()) return slopes_by_axis(m, x, h, change, d, share);
    const double t = (h - x.n_s).squaredNorm() / (m.alpha_u * m.alpha_u);
    add(std::sqrt(share / m.slope_variance(m.alpha_u, t)) / 3.0, change - d.dn);
  }
  /// (H45), with m of (H19) and its differential.
  void slopes_by_axis(const Microfacets& microfacets, const Vertex& x, const Vec3d& m,
                      const Columns& dm, const Scattered& d, double share) {
    const Vec3d& p = x.tangent;
    const Vec3d across = x.n_s.cross(p);
    const double lift = x.n_s.dot(p);
    const double inverse = 1.0 / std::sqrt(p.squaredNorm() - lift * lift);
    const double r_u = (p.dot(m) - lift) * inverse;
    const double r_v = across.dot(m) * inverse;
    const LocalRow d_lift = dot(p, d.dn) + dot(x.n_s, d.dp);
    const LocalRow d_length = inverse * (dot(p, d.dp) - lift * d_lift);
    const LocalRow d_u = dot(m, d.dp) + dot(p, dm) - d_lift - r_u * d_length;
    const LocalRow d_v = dot(Vec3d(p.cross(m)), d.dn) + dot(Vec3d(m.cross(x.n_s)), d.dp) +
                         dot(across, dm) - r_v * d_length;
    const double u = r_u / microfacets.alpha_u;
    const double v = r_v / microfacets.alpha_v;
    const auto factor = [&](double alpha) {
      return inverse / 3.0 * std::sqrt(share / microfacets.slope_variance(alpha, u * u + v * v));
    };
    add(factor(microfacets.alpha_u) * d_u);
    add(factor(microfacets.alpha_v) * d_v);
  }
  /// (H20)
  void diffuse(const Vertex& x, const Scattered& d, double share) {
    tangential(x.n_s, x.wo, x.cos_o, d.dwo, d.dn, share);
  }

  // `share` is that of the BSDF in a blend.

  void constrain(const Bsdf& bsdf, const Vertex& x, const Scattered& d, double share) {
    std::visit([&](const auto& b) { constrain(b, x, d, share); }, bsdf);
  }
  void constrain(const Diffuse&, const Vertex& x, const Scattered& d, double share) {
    diffuse(x, d, share);
  }
  void constrain(const Conductor&, const Vertex&, const Scattered&, double) {}
  void constrain(const Dielectric&, const Vertex&, const Scattered&, double) {}
  void constrain(const RoughConductor& b, const Vertex& x, const Scattered& d, double share) {
    slopes(b.microfacets, 1.0, x, d, share);
  }
  void constrain(const RoughDielectric& b, const Vertex& x, const Scattered& d, double share) {
    const double eta = x.cos_i > 0.0 ? b.eta : 1.0 / b.eta;
    slopes(b.microfacets, x.scattering == Scattering::Reflection ? 1.0 : eta, x, d, share);
  }
  /// Two lobes; `add_glossy` takes the share of its one.
  template <class B, class AddGlossy>
  void add_lobes(const B& b, const Vertex& x, const Scattered& d, double share,
                 const AddGlossy& add_glossy) {
    const auto lobes = detail::lobes<double>(b, {x.n_s, x.uv, x.tangent}, x.wi, x.wo);
    if (!lobes.any()) return;
    const double glossy = lobes.glossy_share();
    if (glossy > 0.0) add_glossy(share * glossy);
    if (glossy < 1.0) diffuse(x, d, share * (1.0 - glossy));
  }
  /// (H21)
  void constrain(const Phong& b, const Vertex& x, const Scattered& d, double share) {
    add_lobes(b, x, d, share, [&](double part) {
      const LocalRow d_cos = dot(x.wi, d.dn) + dot(x.n_s, d.dwi);
      const Columns mirror = 2.0 * x.cos_i * d.dn + outer(x.n_s, 2.0 * d_cos) - d.dwi;
      add(std::sqrt(part * b.exponent) / 3.0, d.dwo - mirror);
    });
  }
  /// (H19)
  void constrain(const Ward& b, const Vertex& x, const Scattered& d, double share) {
    add_lobes(b, x, d, share, [&](double part) { slopes(b.microfacets(), 1.0, x, d, part); });
  }
  void constrain(const RoughPlastic& b, const Vertex& x, const Scattered& d, double share) {
    add_lobes(b, x, d, share, [&](double part) { slopes(b.microfacets, 1.0, x, d, part); });
  }

  void constrain(const ThinDielectric&, const Vertex&, const Scattered&, double) {}
  void constrain(const Plastic&, const Vertex& x, const Scattered& d, double share) {
    diffuse(x, d, share);
  }
  void constrain(const Mask& b, const Vertex& x, const Scattered& d, double share) {
    if (b.nested != nullptr) constrain(b.nested->bsdf, x, d, share);
  }
  /// (H40)
  static Columns inner(const Coating& b, const Vec3d& n, const Vec3d& w, double cosine,
                       const Columns& dw, const Columns& dn) {
    const double within = b.inner_cosine(cosine);
    const LocalRow d_cos = dot(w, dn) + dot(n, dw);
    const double slope = cosine / (b.eta * b.eta * within) - 1.0 / b.eta;
    return (1.0 / b.eta) * dw + outer(n, slope * d_cos) + (within - cosine / b.eta) * dn;
  }
  void constrain(const Coating& b, const Vertex& x, const Scattered& d, double share) {
    Vertex below = x;
    below.wi = b.inner(x.n_s, x.wi, x.cos_i);
    below.wo = b.inner(x.n_s, x.wo, x.cos_o);
    below.cos_i = b.inner_cosine(x.cos_i);
    below.cos_o = b.inner_cosine(x.cos_o);
    below.io = below.wi.dot(below.wo);
    constrain(b.nested->bsdf, below,
              {inner(b, x.n_s, x.wi, x.cos_i, d.dwi, d.dn),
               inner(b, x.n_s, x.wo, x.cos_o, d.dwo, d.dn), d.dn, d.dp},
              share);
  }
  void constrain(const Blend& b, const Vertex& x, const Scattered& d, double share) {
    const auto of = detail::blend_shares<double>(b, {x.n_s, x.uv, x.tangent}, x.wi, x.wo);
    if (of.first > 0.0) constrain(b.first->bsdf, x, d, share * of.first);
    if (of.second > 0.0) constrain(b.second->bsdf, x, d, share * of.second);
  }

  Linearization& result_;
  int count_ = 0;
};

}  // namespace driftlight::hand
