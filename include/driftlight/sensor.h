// SPDX-License-Identifier: Apache-2.0
/// The sensor: a pinhole, a thin lens or an orthographic camera.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "driftlight/frame.h"
#include "driftlight/reconstruction_filter.h"
#include "driftlight/warp.h"

namespace driftlight {

/// A camera: its film, and the ray through each film point. Film coordinates (x, y) run over [0,
/// 1)^2 from the top left corner of the image.
///
/// Each ray has a unit vector v as its coordinate, which names the point v / (forward.v) of an
/// image plane at distance 1. With a = `scale` it is
///   Perspective   the ray from `origin` along v,
///   Orthographic  the ray along `forward` from origin + a (v / (forward.v) - forward),
/// so that the film, W(v), charts and constraints are the same for both: in the measure of v.
///
/// A perspective camera may have a thin lens, a disk of radius R about the origin across `forward`,
/// that is in focus at the depth F. A film point has one ray from each point l of it, all to the
/// point at depth F that the pinhole would see there. So from l the camera is a pinhole, and its v
/// the direction from l, whose image plane at distance 1 is shifted by (origin - l) / F: in the
/// measure of l and v
///   mean radiance over the film = integral W(v) L(l, v) d omega dA / (pi R^2),
/// W the same. Where members take a point of the lens, that of a camera without one is its origin.
struct Camera {
  enum class Projection : std::uint8_t { Perspective, Orthographic };

  Projection projection = Projection::Perspective;
  Vec3d origin{0, 0, 0};
  Vec3d right{1, 0, 0};    ///< unit; direction of growing film x
  Vec3d up{0, 1, 0};       ///< unit; direction of falling film y
  Vec3d forward{0, 0, 1};  ///< unit
  double half_width = 1;   ///< of the image plane; of a pinhole tan(fov_x / 2)
  double half_height = 1;
  double scale = 1;        ///< Orthographic: length in the world of a unit of the image plane
  double lens_radius = 0;  ///< 0: no lens
  double focus_depth = std::numeric_limits<double>::infinity();  ///< of the lens
  /// Of the image plane's window, along right and up: films that are cropped or shifted.
  Vec2d center{0, 0};
  int film_width = 256;  ///< pixels
  int film_height = 256;
  ReconstructionFilter filter;
  double near_clip = 0;  ///< depth along `forward` before which nothing is seen
  double far_clip = std::numeric_limits<double>::infinity();

  bool is_orthographic() const { return projection == Projection::Orthographic; }
  bool has_lens() const { return lens_radius > 0.0; }
  /// Density of a uniform point on the lens; 1 without one.
  double lens_density() const { return has_lens() ? kInvPi / (lens_radius * lens_radius) : 1.0; }
  /// Point on the lens, uniform for uniform u; u is not looked at without one.
  template <Scalar T>
  Vec3<T> lens_point(const Vec2<T>& u) const {
    if (!has_lens()) return constant<T>(origin);
    const Vec2<T> disk = square_to_disk(u.x(), u.y());
    return constant<T>(origin) + T(lens_radius * disk.x()) * constant<T>(right) +
           T(lens_radius * disk.y()) * constant<T>(up);
  }
  bool is_on_lens(const Vec3d& p) const { return (p - origin).norm() <= lens_radius; }
  /// Area A of the image plane.
  double area() const { return 4.0 * half_width * half_height; }
  double pixel_count() const {
    return static_cast<double>(film_width) * static_cast<double>(film_height);
  }
  /// Index of the pixel, row by row from the top, that the film point is in or nearest to.
  std::size_t pixel(const Vec2d& film) const {
    const int x = std::clamp(static_cast<int>(film.x() * film_width), 0, film_width - 1);
    const int y = std::clamp(static_cast<int>(film.y() * film_height), 0, film_height - 1);
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(film_width) +
           static_cast<std::size_t>(x);
  }

  /// The coordinate of the film point, from this point of the lens.
  template <Scalar T>
  Vec3<T> direction(const Vec2<T>& film, const Vec3<T>& lens) const {
    const Vec3<T> v = constant<T>(forward) +
                      T((2.0 * film.x() - 1.0) * half_width + center.x()) * constant<T>(right) +
                      T((1.0 - 2.0 * film.y()) * half_height + center.y()) * constant<T>(up);
    return unit<T>(has_lens() ? Vec3<T>(v - focus_shift(lens)) : v);
  }
  /// From the middle of the lens.
  Vec3d direction(const Vec2d& film) const { return direction<double>(film, origin); }

  /// The ray of the coordinate v from this point of the lens.
  template <Scalar T>
  Ray<T> ray(const Vec3<T>& v, const Vec3<T>& lens) const {
    if (!is_orthographic()) return {lens, v};
    const Vec3d corner = origin - scale * forward;
    return {along(constant<T>(corner), T(scale / cosine(v)), v), constant<T>(forward)};
  }

  /// The coordinate whose ray from this point of the lens comes to the point p, which must lie
  /// before the camera.
  template <Scalar T>
  Vec3<T> coordinate(const Vec3<T>& p, const Vec3<T>& lens) const {
    const Vec3<T> edge = p - lens;
    if (!is_orthographic()) return unit<T>(edge);
    // The part across, in units of the image plane, and forward by 1.
    return unit<T>(along(edge, T(scale - cosine(edge)), constant<T>(forward)));
  }

  /// Area across the rays at p by solid angle of the coordinate v of the ray there: squared
  /// distance from this point of the lens; a^2 / (forward.v)^3.
  template <Scalar T>
  T spread(const Vec3<T>& v, const Vec3<T>& p, const Vec3<T>& lens) const {
    if (!is_orthographic()) {
      const Vec3<T> edge = p - lens;
      return dot(edge, edge);
    }
    const T f = cosine(v);
    return scale * scale / (f * f * f);
  }

  /// Orthographic: the differential of the ray's origin for dv, and its transpose at x,
  ///   a (dv - v (forward.dv) / f) / f,   a (x - forward (v.x) / f) / f,   f = forward.v.
  Vec3d origin_differential(const Vec3d& v, const Vec3d& dv) const {
    const double f = cosine(v);
    return scale / f * (dv - cosine(dv) / f * v);
  }
  Vec3d origin_adjoint(const Vec3d& v, const Vec3d& x) const {
    const double f = cosine(v);
    return scale / f * (x - v.dot(x) / f * forward);
  }

  /// Depth of a point along `forward`.
  double depth(const Vec3d& p) const { return forward.dot(p - origin); }
  /// Where a ray of this camera crosses the near plane.
  Vec3d at_near_plane(const Ray<double>& ray) const {
    return ray.origin + near_clip / cosine(ray.direction) * ray.direction;
  }

  /// Cosine between v and the optical axis.
  template <Scalar T>
  T cosine(const Vec3<T>& v) const {
    return dot(forward, v);
  }

  /// Film coordinates of the ray of v from this point of the lens. Needs cosine > 0.
  template <Scalar T>
  Vec2<T> film_position(const Vec3<T>& v, const Vec3<T>& lens) const {
    const T inverse = constant<T>(0.5) / cosine(v);
    T x = dot(right, v) * inverse;
    T y = dot(up, v) * inverse;
    if (has_lens()) {
      const Vec3<T> shift = scaled(focus_shift(lens), constant<T>(0.5));
      x += dot(right, shift);
      y += dot(up, shift);
    }
    return {(x - 0.5 * center.x()) * (1.0 / half_width) + 0.5,
            0.5 - (y - 0.5 * center.y()) * (1.0 / half_height)};
  }

  /// True if the ray of v from this point of the lens goes through the film.
  bool sees(const Vec3d& v, const Vec3d& lens) const {
    if (!(cosine(v) > 0.0)) return false;
    const Vec2d film = film_position(v, lens);
    return film.x() >= 0.0 && film.x() < 1.0 && film.y() >= 0.0 && film.y() < 1.0;
  }

  /// log W(v) with W = 1 / (A cos^3), so that the integral of W L d omega is the mean
  /// radiance over the film, omega that of the coordinate (of each point of a lens).
  template <Scalar T>
  T log_importance(const Vec3<T>& v) const {
    using std::log;
    return -3.0 * log(cosine(v)) - std::log(area());
  }

 private:
  /// Of the image plane at distance 1, seen from a point of the lens: (l - origin) / F.
  template <Scalar T>
  Vec3<T> focus_shift(const Vec3<T>& lens) const {
    return scaled(Vec3<T>(lens - constant<T>(origin)), constant<T>(1.0 / focus_depth));
  }
};

}  // namespace driftlight
