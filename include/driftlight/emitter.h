// SPDX-License-Identifier: Apache-2.0
/// Emitters: area lights, points, spots, parallel light, and environments at infinity.
#pragma once

#include <cstdint>
#include <memory>
#include <variant>

#include "driftlight/frame.h"
#include "driftlight/texture.h"
#include "driftlight/warp.h"

namespace driftlight {

/// A shape that emits from the side of its normal, the same radiance into all directions.
struct AreaEmitter {
  Rgbd radiance{1, 1, 1};  ///< of a texture the mean, or what is at most beyond a black bitmap
  std::uint32_t shape = 0;
  /// The radiance over that; null: the same all over.
  std::shared_ptr<const Texture> texture = nullptr;

  /// Radiance where the shape has these texture coordinates.
  Rgbd radiance_at(const Vec2d& uv) const {
    return texture != nullptr ? Rgbd(radiance * texture->eval(uv)) : radiance;
  }
};

/// Equal intensity (power per steradian) in all directions.
struct PointEmitter {
  Vec3d position{0, 0, 0};
  Rgbd intensity{1, 1, 1};

  /// Power / intensity, steradians.
  double solid_angle() const { return 4.0 * kPi; }
};

/// A point that emits into a cone. At the angle theta to the axis its intensity is that on the
/// axis, times
///   falloff = 1                                  theta <= beam width
///             (cutoff - theta) / (cutoff - beam)   up to the cutoff angle
///             0                                  beyond (Mitsuba's spot).
class SpotEmitter {
 public:
  /// Angles from the axis in radians, 0 <= beam_width <= cutoff and 0 < cutoff <= pi. The axis need
  /// not be normalised.
  SpotEmitter(const Vec3d& position, const Vec3d& axis, const Rgbd& intensity, double cutoff,
              double beam_width);

  const Vec3d& position() const { return position_; }
  const Vec3d& axis() const { return axis_; }
  const Rgbd& intensity() const { return intensity_; }
  double cutoff() const { return cutoff_; }
  double beam_width() const { return beam_width_; }

  /// Along the unit direction v, away from the emitter.
  template <Scalar T>
  T falloff(const Vec3<T>& v) const {
    using std::atan2;
    using std::sqrt;
    const double theta = angle(value(v));
    if (theta <= beam_width_) return constant<T>(1.0);
    if (theta >= cutoff_) return constant<T>(0.0);
    const T cosine = dot(axis_, v);
    const Vec3<T> off = v + scaled(constant<T>(axis_), T(-cosine));
    return (cutoff_ - T(atan2(sqrt(dot(off, off)), cosine))) * inverse_transition_;
  }
  /// Gradient of `falloff` by v, normal to v; 0 where it is constant. With theta the angle,
  ///   d theta / dv = (cos theta v - axis) / sin theta.
  Vec3d falloff_gradient(const Vec3d& v) const;

  /// Draws a direction in proportion to the falloff, whose density is falloff / solid_angle();
  /// u1, u2 in [0, 1).
  template <Scalar T>
  Vec3<T> sample(const T& u1, const T& u2) const {
    using std::cos;
    using std::sin;
    const T theta = angle_of_share(T(u1 * 0.5 * kInvPi * solid_angle_));
    const T phi = 2.0 * kPi * u2;
    const T sine = sin(theta);
    return to_world<T>({sine * cos(phi), sine * sin(phi), cos(theta)}, constant<T>(axis_));
  }
  /// The inverse of `sample`, for a direction in the cone.
  Vec2d inverse(const Vec3d& v) const;
  /// Integral of the falloff over the sphere: power / intensity, steradians.
  double solid_angle() const { return solid_angle_; }
  /// Standard deviation of a direction in the cone, along one axis: that of a disk of radius
  /// `cutoff`.
  double width() const { return 0.5 * cutoff_; }

 private:
  double angle(const Vec3d& v) const;
  /// Integral of the falloff from the axis to theta, over 2 pi.
  double integral(double theta) const;
  /// Its inverse.
  double angle_of_share(double share) const;
  /// From its value, Newton steps: each doubles the order of the derivatives that are right.
  template <Scalar T>
  requires(ScalarTraits<T>::is_jet) T angle_of_share(const T& share)
  const {
    using std::asin;
    using std::cos;
    using std::sin;
    using std::sqrt;
    if (value(share) <= integral(beam_width_)) return 2.0 * asin(sqrt(0.5 * share));
    const double start = integral(beam_width_) +
                         ((cutoff_ - beam_width_) * std::cos(beam_width_) + std::sin(beam_width_)) *
                             inverse_transition_;
    T theta = constant<T>(angle_of_share(value(share)));
    for (int i = 0; i < 2; ++i) {
      const T rest = cutoff_ - theta;
      const T excess = start - (rest * cos(theta) + sin(theta)) * inverse_transition_ - share;
      theta = theta - excess / (rest * sin(theta) * inverse_transition_);
    }
    return theta;
  }

  Vec3d position_;
  Vec3d axis_;
  Rgbd intensity_;
  double cutoff_;
  double beam_width_;
  double inverse_transition_;
  double solid_angle_;
};

/// Parallel light from infinity. A surface that faces it receives `irradiance`.
struct DirectionalEmitter {
  Vec3d direction{0, 0, 1};  ///< in which the light travels; unit
  Rgbd irradiance{1, 1, 1};
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
    const Vec2<T> at = pixel(d);
    Rgb<T> c = lookup(bitmap_, at.x(), at.y(), Wrap::Repeat, Wrap::Clamp);
    for (int i = 0; i < 3; ++i) c[i] = c[i] * scale_;
    return c;
  }

  /// How closely the map binds a direction: 1 / s^2, s the standard deviation in radians, between a
  /// texel and 1, of the least blur that halves or doubles the luminance at d. Within a sun it is
  /// the sun's size, beside one a part of the distance.
  template <Scalar T>
  T precision(const Vec3<T>& d) const {
    const Vec2<T> at = pixel(d);
    return lookup(precision_, at.x(), at.y(), Wrap::Repeat, Wrap::Clamp)[0];
  }

  /// Derivatives of `eval` by the world coordinates of d: a row for each colour. Only their
  /// components normal to d have a meaning.
  Eigen::Matrix3d gradient(const Vec3d& d) const;

  /// Draws a direction about in proportion to luminance; u1, u2 in [0, 1). The patch is a discrete
  /// choice.
  template <Scalar T>
  Vec3<T> sample(T u1, T u2) const {
    using std::cos;
    using std::sin;
    const auto row = static_cast<std::size_t>(rows_.sample(u1));
    const int column = columns_[row].sample(u2);
    const T y = edges_[row] + u1 * (edges_[row + 1] - edges_[row]);
    const T sine = root_or_zero(T(1.0 - y * y));
    const T phi = 2.0 * kPi * (column + 0.5 + u2) / static_cast<double>(bitmap_.width);
    return unit<T>(constant<T>(axis_x_) * T(sine * sin(phi)) + constant<T>(axis_y_) * y -
                   constant<T>(axis_z_) * T(sine * cos(phi)));
  }
  /// The inverse of `sample`.
  Vec2d inverse(const Vec3d& d) const;
  /// Density of `sample` per solid angle; positive wherever `eval` is.
  double pdf(const Vec3d& d) const;
  /// Integral of the luminance over the sphere (as tabulated for sampling).
  double total_luminance() const { return total_; }
  /// Angular size of a texel at the horizon, radians.
  double texel_angle() const { return kPi / static_cast<double>(bitmap_.height); }

  /// Solid angle of what is brightest: Omega of a sun of even radiance S before a dark sky, for
  /// which int L^n = S^n Omega,
  ///   Omega = (int L^2)^3 / (int L^3)^2.
  double peak_solid_angle() const;
  /// Convolved over the sphere with (1 - (1 - cos gamma) / (5 sigma^2))_+^3, which for small sigma
  /// has the standard deviation sigma, radians, along each axis; in a bitmap just as fine as that
  /// needs. It is positive wherever this map is.
  EnvironmentMap blurred(double sigma) const;

 private:
  /// Where the unit direction d falls on the bitmap.
  template <Scalar T>
  Vec2<T> pixel(const Vec3<T>& d) const {
    using std::acos;
    using std::atan2;
    const T dx = dot(axis_x_, d);
    const T dy = dot(axis_y_, d);
    const T dz = dot(axis_z_, d);
    // Rounding may carry |dy| past 1; there the map is constant in v.
    const T theta =
        std::abs(value(dy)) < 1.0 ? T(acos(dy)) : constant<T>(value(dy) > 0 ? 0.0 : kPi);
    return {atan2(dx, -dz) * (0.5 * kInvPi * static_cast<double>(bitmap_.width)),
            theta * (kInvPi * static_cast<double>(bitmap_.height))};
  }

  /// Patches of bilinear interpolation, between texel centres: width x (height + 1) of them. Where
  /// one is and where d lies in it, both offsets in [0, 1).
  struct Place {
    int row, column;
    Vec2d offset;
  };
  Place place_of(const Vec3d& d) const;
  int row_of(double y) const;
  double patch_solid_angle(int row) const;

  Bitmap bitmap_;
  Bitmap precision_;                ///< the same number in all three channels
  Vec3d axis_x_, axis_y_, axis_z_;  ///< map axes in world space
  double scale_ = 1;
  std::vector<double> edges_;  ///< cosines with the pole of the edges of the rows, from the top
  DiscreteDistribution rows_;
  std::vector<DiscreteDistribution> columns_;
  double total_ = 0;
};

/// Where a lamp is, and how far it extends.
struct LampExtent {
  Vec3d center{0, 0, 0};
  /// Rows: the principal axes of a uniform point on it, and its variances along them.
  Eigen::Matrix3d axes = Eigen::Matrix3d::Identity();
  Vec3d variance{0, 0, 0};
  Vec3d normal{0, 0, 0};  ///< of a flat lamp, on the side that emits; zero for others
  double spread = 0;      ///< largest (p - center)^T C^-1 (p - center) on it, C the covariance
  double reach = 0;       ///< largest distance from the center
};

/// An area emitter as an image of itself that is blurred by the angle sigma, for the softer levels
/// of tempered splitting (DESIGN 1.10). It has no surface: any ray may see it on its way. With u
/// the vector from the centre to the ray's origin, r = |u|, the ray x + t v carries
///   L g(u) (1 - q / 10)_+^3,   q = min over t >= 0 of y^T Sigma^-1 y,   y = u + t v,
///   Sigma = a C + sigma^2 r^2 I,   a = max(1, spread / 5),
/// a lobe of standard deviation sigma and more, as EnvironmentMap::blurred has it. Since q <= 5 on
/// the lamp itself, it is seen by all rays that meet the lamp. g keeps the power: the area of the
/// lamp across u is about 4 pi det(P C P)^(1/2), P the projection along u (sphere 3 pi, disk 4 pi,
/// rectangle 12 times that root), and that of the lobe 2.5 pi det(P Sigma P)^(1/2), so
///   g = 1.6 (S(C) / S(Sigma))^(1/2),   S(M) = u^T adj(M) u = r^2 det(P M P).
/// A ray is unobstructed if nothing stands in its way up to the distance r - reach: at all levels
/// alike, and so for each ray that meets the lamp. A flat lamp emits to its front.
class BlurredAreaEmitter {
 public:
  BlurredAreaEmitter(const AreaEmitter& sharp, const LampExtent& lamp, double sigma);

  const AreaEmitter& sharp() const { return sharp_; }

  /// False where the ray carries nothing, whatever stands in its way.
  bool shines(const Ray<double>& ray) const;
  /// How far an unobstructed ray goes.
  double clearance(const Vec3d& origin) const;
  /// log of g (1 - q / 10)^3, for a ray on which it shines.
  template <Scalar T>
  T log_share(const Ray<T>& ray) const {
    using std::log;
    const Vec3<T> u = principal(Vec3<T>(ray.origin - constant<T>(lamp_.center)));
    const Vec3<T> m = variances(dot(u, u));
    const Vec3<T> y = nearest(u, principal(ray.direction), m);
    const T q = sqr(y.x()) / m.x() + sqr(y.y()) / m.y() + sqr(y.z()) / m.z();
    return log(1.0 - q * (1.0 / kSupport)) * 3.0 +
           log(across(u, constant<T>(lamp_.variance)) / across(u, m)) * 0.5 + kLogPeak;
  }
  /// Its derivatives by the origin and by the direction. With D = Sigma^-1 and t the minimum,
  ///   dq / dx = 2 D y - 2 sigma^2 |D y|^2 u,   dq / dv = 2 t D y.
  struct Gradient {
    Vec3d by_origin;
    Vec3d by_direction;
  };
  Gradient log_share_gradient(const Ray<double>& ray) const;

  /// y along the principal axes, where the ray is nearest, and its variances: how closely the lamp
  /// binds the ray. Variances are those of the ray's value.
  template <Scalar T>
  struct Approach {
    Vec3<T> y;
    Vec3<Stripped<T>> variance;
  };
  template <Scalar T>
  Approach<T> approach(const Ray<T>& ray) const {
    const Vec3<T> u = principal(Vec3<T>(ray.origin - constant<T>(lamp_.center)));
    const Vec3<T> m = variances(dot(u, u));
    return {nearest(u, principal(ray.direction), m), {strip(m.x()), strip(m.y()), strip(m.z())}};
  }
  /// Differentials of that y, along the world's axes: dy = du + t dv + v dt with dt = t_u.du +
  /// t_v.dv.
  struct ApproachDifferential {
    double t;
    Vec3d t_u;
    Vec3d t_v;
  };
  ApproachDifferential approach_differential(const Ray<double>& ray) const;
  const Eigen::Matrix3d& axes() const { return lamp_.axes; }

 private:
  static constexpr double kSupport = 10;
  static constexpr double kLogPeak = 0.47000362924573563;  // log 1.6

  template <Scalar T>
  Vec3<T> principal(const Vec3<T>& v) const {
    return {dot(axis(0), v), dot(axis(1), v), dot(axis(2), v)};
  }
  Vec3d axis(int i) const { return lamp_.axes.row(i); }
  template <Scalar T>
  Vec3<T> variances(const T& r2) const {
    const T blur = r2 * sigma2_;
    return {blur + core_.x(), blur + core_.y(), blur + core_.z()};
  }
  /// y = u + t v
  template <Scalar T>
  static Vec3<T> nearest(const Vec3<T>& u, const Vec3<T>& v, const Vec3<T>& m) {
    const T along = u.x() * v.x() / m.x() + u.y() * v.y() / m.y() + u.z() * v.z() / m.z();
    if (value(along) >= 0.0) return u;
    const T square = sqr(v.x()) / m.x() + sqr(v.y()) / m.y() + sqr(v.z()) / m.z();
    return u + scaled(v, T(-along / square));
  }
  /// S, of a diagonal matrix
  template <Scalar T>
  static T across(const Vec3<T>& u, const Vec3<T>& m) {
    return sqr(u.x()) * m.y() * m.z() + sqr(u.y()) * m.z() * m.x() + sqr(u.z()) * m.x() * m.y();
  }

  AreaEmitter sharp_;
  LampExtent lamp_;
  double sigma2_;
  Vec3d core_;  ///< a C
};

using Emitter = std::variant<AreaEmitter, PointEmitter, ConstantEnvironment, EnvironmentMap,
                             SpotEmitter, DirectionalEmitter, BlurredAreaEmitter>;

/// The area emitter that it is, sharp or blurred; null for others.
inline const AreaEmitter* area_of(const Emitter& emitter) {
  const auto* blurred = std::get_if<BlurredAreaEmitter>(&emitter);
  return blurred != nullptr ? &blurred->sharp() : std::get_if<AreaEmitter>(&emitter);
}

inline bool is_environment(const Emitter& emitter) {
  return std::holds_alternative<ConstantEnvironment>(emitter) ||
         std::holds_alternative<EnvironmentMap>(emitter);
}

/// A point or spot emitter.
inline bool is_point(const Emitter& emitter) {
  return std::holds_alternative<PointEmitter>(emitter) ||
         std::holds_alternative<SpotEmitter>(emitter);
}
/// Where it is.
inline const Vec3d& position_of(const Emitter& emitter) {
  const auto* spot = std::get_if<SpotEmitter>(&emitter);
  return spot != nullptr ? spot->position() : std::get<PointEmitter>(emitter).position;
}

}  // namespace driftlight
