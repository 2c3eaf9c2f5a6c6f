// SPDX-License-Identifier: Apache-2.0
/// The sensor: a pinhole camera.
#pragma once

#include <limits>

#include "driftlight/frame.h"
#include "driftlight/reconstruction_filter.h"

namespace driftlight {

/// A pinhole with its image plane at distance 1. Film coordinates (x, y) run over [0, 1)^2 from the
/// top left corner of the image.
struct PerspectiveCamera {
  Vec3d origin{0, 0, 0};
  Vec3d right{1, 0, 0};    ///< unit; direction of growing film x
  Vec3d up{0, 1, 0};       ///< unit; direction of falling film y
  Vec3d forward{0, 0, 1};  ///< unit
  double half_width = 1;   ///< of the image plane: tan(fov_x / 2)
  double half_height = 1;
  Vec2d center{0, 0};  ///< of the image plane's window, along right and up: where films are cropped
  int film_width = 256;  ///< pixels
  int film_height = 256;
  ReconstructionFilter filter;
  double near_clip = 0;  ///< depth along `forward` before which nothing is seen
  double far_clip = std::numeric_limits<double>::infinity();

  /// Area A of the image plane.
  double area() const { return 4.0 * half_width * half_height; }
  double pixel_count() const {
    return static_cast<double>(film_width) * static_cast<double>(film_height);
  }

  /// Unit direction through the film point.
  template <Scalar T>
  Vec3<T> direction(const Vec2<T>& film) const {
    return unit<T>(constant<T>(forward) +
                   T((2.0 * film.x() - 1.0) * half_width + center.x()) * constant<T>(right) +
                   T((1.0 - 2.0 * film.y()) * half_height + center.y()) * constant<T>(up));
  }
  Vec3d direction(const Vec2d& film) const { return direction<double>(film); }

  /// Cosine between v and the optical axis.
  template <Scalar T>
  T cosine(const Vec3<T>& v) const {
    return dot(forward, v);
  }

  /// Where the ray with direction v crosses the image plane, in film coordinates. Needs cosine > 0.
  template <Scalar T>
  Vec2<T> film_position(const Vec3<T>& v) const {
    const T inverse = constant<T>(0.5) / cosine(v);
    return {(dot(right, v) * inverse - 0.5 * center.x()) * (1.0 / half_width) + 0.5,
            0.5 - (dot(up, v) * inverse - 0.5 * center.y()) * (1.0 / half_height)};
  }

  /// True if v goes through the film.
  bool sees(const Vec3d& v) const {
    if (!(cosine(v) > 0.0)) return false;
    const Vec2d film = film_position(v);
    return film.x() >= 0.0 && film.x() < 1.0 && film.y() >= 0.0 && film.y() < 1.0;
  }

  /// log W(v) with W = 1 / (A cos^3), so that the integral of W L over solid angle is the mean
  /// radiance over the film.
  template <Scalar T>
  T log_importance(const Vec3<T>& v) const {
    using std::log;
    return -3.0 * log(cosine(v)) - std::log(area());
  }
};

}  // namespace driftlight
