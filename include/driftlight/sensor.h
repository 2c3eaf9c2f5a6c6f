// SPDX-License-Identifier: Apache-2.0
/// The sensor: a pinhole or an orthographic camera.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>

#include "driftlight/frame.h"
#include "driftlight/reconstruction_filter.h"

namespace driftlight {

/// A camera: its film, and the ray through each film point. Film coordinates (x, y) run over [0,
/// 1)^2 from the top left corner of the image.
///
/// Each ray has a unit vector v as its coordinate, which names the point v / (forward.v) of an
/// image plane at distance 1. With a = `scale` it is
///   Perspective   the ray from `origin` along v,
///   Orthographic  the ray along `forward` from origin + a (v / (forward.v) - forward),
/// so that the film, W(v), charts and constraints are the same for both: in the measure of v.
struct Camera {
  enum class Projection : std::uint8_t { Perspective, Orthographic };

  Projection projection = Projection::Perspective;
  Vec3d origin{0, 0, 0};
  Vec3d right{1, 0, 0};    ///< unit; direction of growing film x
  Vec3d up{0, 1, 0};       ///< unit; direction of falling film y
  Vec3d forward{0, 0, 1};  ///< unit
  double half_width = 1;   ///< of the image plane; of a pinhole tan(fov_x / 2)
  double half_height = 1;
  double scale = 1;  ///< Orthographic: length in the world of a unit of the image plane
  /// Of the image plane's window, along right and up: films that are cropped or shifted.
  Vec2d center{0, 0};
  int film_width = 256;  ///< pixels
  int film_height = 256;
  ReconstructionFilter filter;
  double near_clip = 0;  ///< depth along `forward` before which nothing is seen
  double far_clip = std::numeric_limits<double>::infinity();

  bool is_orthographic() const { return projection == Projection::Orthographic; }
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

  /// The coordinate of the film point.
  template <Scalar T>
  Vec3<T> direction(const Vec2<T>& film) const {
    return unit<T>(constant<T>(forward) +
                   T((2.0 * film.x() - 1.0) * half_width + center.x()) * constant<T>(right) +
                   T((1.0 - 2.0 * film.y()) * half_height + center.y()) * constant<T>(up));
  }
  Vec3d direction(const Vec2d& film) const { return direction<double>(film); }

  /// The ray of the coordinate v.
  template <Scalar T>
  Ray<T> ray(const Vec3<T>& v) const {
    if (!is_orthographic()) return {constant<T>(origin), v};
    const Vec3d corner = origin - scale * forward;
    return {along(constant<T>(corner), T(scale / cosine(v)), v), constant<T>(forward)};
  }

  /// The coordinate whose ray comes to the point p, which must lie before the camera.
  template <Scalar T>
  Vec3<T> coordinate(const Vec3<T>& p) const {
    const Vec3<T> edge = p - constant<T>(origin);
    if (!is_orthographic()) return unit<T>(edge);
    // The part across, in units of the image plane, and forward by 1.
    return unit<T>(along(edge, T(scale - cosine(edge)), constant<T>(forward)));
  }

  /// Area across the rays at p by solid angle of the coordinate v of the ray there: squared
  /// distance of a pinhole; a^2 / (forward.v)^3.
  template <Scalar T>
  T spread(const Vec3<T>& v, const Vec3<T>& p) const {
    if (!is_orthographic()) {
      const Vec3<T> edge = p - constant<T>(origin);
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

  /// Where the ray of v crosses the image plane, in film coordinates. Needs cosine > 0.
  template <Scalar T>
  Vec2<T> film_position(const Vec3<T>& v) const {
    const T inverse = constant<T>(0.5) / cosine(v);
    return {(dot(right, v) * inverse - 0.5 * center.x()) * (1.0 / half_width) + 0.5,
            0.5 - (dot(up, v) * inverse - 0.5 * center.y()) * (1.0 / half_height)};
  }

  /// True if the ray of v goes through the film.
  bool sees(const Vec3d& v) const {
    if (!(cosine(v) > 0.0)) return false;
    const Vec2d film = film_position(v);
    return film.x() >= 0.0 && film.x() < 1.0 && film.y() >= 0.0 && film.y() < 1.0;
  }

  /// log W(v) with W = 1 / (A cos^3), so that the integral of W L d omega is the mean
  /// radiance over the film, omega that of the coordinate.
  template <Scalar T>
  T log_importance(const Vec3<T>& v) const {
    using std::log;
    return -3.0 * log(cosine(v)) - std::log(area());
  }
};

}  // namespace driftlight
