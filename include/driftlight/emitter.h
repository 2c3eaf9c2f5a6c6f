// SPDX-License-Identifier: Apache-2.0
/// Emitters: area lights, points, and environments at infinity.
#pragma once

#include <cstdint>
#include <variant>

#include "driftlight/frame.h"
#include "driftlight/texture.h"
#include "driftlight/warp.h"

namespace driftlight {

/// A shape that emits constant radiance from the side of its normal.
struct AreaEmitter {
  Rgbd radiance{1, 1, 1};
  std::uint32_t shape = 0;
};

/// Equal intensity (power per steradian) in all directions.
struct PointEmitter {
  Vec3d position{0, 0, 0};
  Rgbd intensity{1, 1, 1};
};

/// The same radiance from every direction.
struct ConstantEnvironment {
  Rgbd radiance{1, 1, 1};
};

/// Radiance in latitude-longitude coordinates: with d in map space, y up,
///   u = atan2(d.x, -d.z) / (2 pi),  v = acos(d.y) / pi   (times the size of the bitmap),
/// interpolated bilinearly; u wraps, v is clamped.
class EnvironmentMap {
 public:
  /// `to_world` rotates map space into world space. The bitmap must have positive energy.
  EnvironmentMap(Bitmap bitmap, const Eigen::Matrix3d& to_world, double scale);

  const Bitmap& bitmap() const { return bitmap_; }

  /// Radiance from the unit world direction d (pointing away from the scene).
  template <Scalar T>
  Rgb<T> eval(const Vec3<T>& d) const {
    using std::acos;
    using std::atan2;
    const T dx = dot(axis_x_, d);
    const T dy = dot(axis_y_, d);
    const T dz = dot(axis_z_, d);
    const T x = atan2(dx, -dz) * (0.5 * kInvPi * static_cast<double>(bitmap_.width));
    // Rounding may carry |dy| past 1; there the map is constant in v.
    const T theta =
        std::abs(value(dy)) < 1.0 ? T(acos(dy)) : constant<T>(value(dy) > 0 ? 0.0 : kPi);
    const T y = theta * (kInvPi * static_cast<double>(bitmap_.height));
    Rgb<T> c = lookup(bitmap_, x, y, Wrap::Repeat, Wrap::Clamp);
    for (int i = 0; i < 3; ++i) c[i] = c[i] * scale_;
    return c;
  }

  /// Derivatives of `eval` by the world coordinates of d: a row for each colour. Only their
  /// components normal to d have a meaning.
  Eigen::Matrix3d gradient(const Vec3d& d) const;

  /// Draws a direction about in proportion to luminance; u1, u2 in [0, 1).
  Vec3d sample(double u1, double u2) const;
  /// Density of `sample` per solid angle; positive wherever `eval` is.
  double pdf(const Vec3d& d) const;
  /// Integral of the luminance over the sphere (as tabulated for sampling).
  double total_luminance() const { return total_; }
  /// Angular size of a texel at the horizon, radians.
  double texel_angle() const { return kPi / static_cast<double>(bitmap_.height); }

 private:
  /// Patches of bilinear interpolation, between texel centres: width x (height + 1) of them.
  int row_of(double y) const;
  double patch_solid_angle(int row) const;

  Bitmap bitmap_;
  Vec3d axis_x_, axis_y_, axis_z_;  ///< map axes in world space
  double scale_ = 1;
  DiscreteDistribution rows_;
  std::vector<DiscreteDistribution> columns_;
  double total_ = 0;
};

using Emitter = std::variant<AreaEmitter, PointEmitter, ConstantEnvironment, EnvironmentMap>;

inline bool is_environment(const Emitter& emitter) {
  return std::holds_alternative<ConstantEnvironment>(emitter) ||
         std::holds_alternative<EnvironmentMap>(emitter);
}

}  // namespace driftlight
