// SPDX-License-Identifier: Apache-2.0
#include "driftlight/emitter.h"

#include <algorithm>
#include <cmath>

#include "environment_precision.h"

namespace driftlight {

// ---- SpotEmitter ----------------------------------------------------------------------------

/// With b the beam width and c the cutoff angle the falloff has the integral
///   2 pi (1 - (sin c - sin b) / (c - b)) = 2 pi (1 - cos m sin h / h),
/// m = (c + b) / 2 and h = (c - b) / 2.
SpotEmitter::SpotEmitter(const Vec3d& position, const Vec3d& axis, const Rgbd& intensity,
                         double cutoff, double beam_width)
    : position_(position),
      axis_(axis.normalized()),
      intensity_(intensity),
      cutoff_(cutoff),
      beam_width_(beam_width),
      inverse_transition_(cutoff > beam_width ? 1.0 / (cutoff - beam_width) : 0.0) {
  const double half = 0.5 * (cutoff - beam_width);
  const double sinc = half > 0.0 ? std::sin(half) / half : 1.0;
  solid_angle_ = 2.0 * kPi * (1.0 - std::cos(0.5 * (cutoff + beam_width)) * sinc);
}

double SpotEmitter::angle(const Vec3d& v) const {
  const double cosine = axis_.dot(v);
  return std::atan2((v - cosine * axis_).norm(), cosine);
}

Vec3d SpotEmitter::falloff_gradient(const Vec3d& v) const {
  const double theta = angle(v);
  if (theta <= beam_width_ || theta >= cutoff_) return Vec3d::Zero();
  return inverse_transition_ / std::sin(theta) * (axis_ - std::cos(theta) * v);
}

/// The falloff integrates to 1 - cos b within the beam (over 2 pi), where directions are uniform,
/// and beyond it up to theta to
///   F(theta) = ((c - b) cos b + sin b - (c - theta) cos theta - sin theta) / (c - b),
///   F' = (c - theta) sin theta / (c - b),
/// which Newton steps invert, kept inside a bracket.
double SpotEmitter::integral(double theta) const {
  const double half_sine = std::sin(0.5 * std::min(theta, beam_width_));
  const double in_beam = 2.0 * half_sine * half_sine;
  if (theta <= beam_width_) return in_beam;
  const double start = (cutoff_ - beam_width_) * std::cos(beam_width_) + std::sin(beam_width_);
  const double sum = start - (cutoff_ - theta) * std::cos(theta) - std::sin(theta);
  return in_beam + sum * inverse_transition_;
}

double SpotEmitter::angle_of_share(double share) const {
  const double in_beam = integral(beam_width_);
  // Rounding must not carry a direction to the rim, where the density is 0.
  const double most = (1.0 - 1e-12) * cutoff_;
  double theta = 2.0 * std::asin(std::sqrt(0.5 * std::min(share, in_beam)));
  if (share > in_beam && inverse_transition_ > 0.0) {
    double low = beam_width_;
    double high = most;
    theta = 0.5 * (low + high);
    for (int i = 0; i < 60 && high - low > 1e-13 * cutoff_; ++i) {
      const double excess = integral(theta) - share;
      (excess > 0.0 ? high : low) = theta;
      const double step =
          excess / ((cutoff_ - theta) * std::sin(theta) * inverse_transition_ + 1e-300);
      const double next = theta - step;
      const bool inside = next > low && next < high;
      if (inside && std::abs(step) < 1e-13 * cutoff_) break;
      theta = inside ? next : 0.5 * (low + high);
    }
  }
  return std::min(theta, most);
}

Vec2d SpotEmitter::inverse(const Vec3d& v) const {
  const Vec3d local = to_local(v, axis_);
  const double share = integral(std::min(angle(v), cutoff_)) * 2.0 * kPi / solid_angle_;
  return {std::min(share, 1.0), disk_to_square(local.head<2>()).y()};
}

// ---- EnvironmentMap -------------------------------------------------------------------------

EnvironmentMap::EnvironmentMap(Bitmap bitmap, const Eigen::Matrix3d& to_world, double scale)
    : bitmap_(std::move(bitmap)),
      precision_(environment_precision(bitmap_)),
      axis_x_(to_world.col(0)),
      axis_y_(to_world.col(1)),
      axis_z_(to_world.col(2)),
      scale_(scale) {
  // Within a patch the interpolant is at most the largest corner and at least a quarter of it
  // somewhere: the mean of the corners keeps f / pdf bounded and the pdf positive where eval is.
  const auto width = static_cast<std::size_t>(bitmap_.width);
  for (int edge = 0; edge <= bitmap_.height + 1; ++edge) {
    const double y = std::clamp(edge - 0.5, 0.0, static_cast<double>(bitmap_.height));
    edges_.push_back(std::cos(kPi * y / bitmap_.height));
  }
  std::vector<double> row_weights;
  std::vector<double> weights(width);
  for (int row = 0; row <= bitmap_.height; ++row) {
    const int top = std::max(row - 1, 0);
    const int bottom = std::min(row, bitmap_.height - 1);
    for (int x = 0; x < bitmap_.width; ++x) {
      const int next = (x + 1) % bitmap_.width;
      const Rgbd sum = (bitmap_.at(x, top) + bitmap_.at(next, top) + bitmap_.at(x, bottom) +
                        bitmap_.at(next, bottom))
                           .cast<double>();
      weights[static_cast<std::size_t>(x)] = 0.25 * luminance(sum) * scale_;
    }
    columns_.emplace_back(weights);
    row_weights.push_back(columns_.back().total() * patch_solid_angle(row));
  }
  rows_ = DiscreteDistribution(row_weights);
  total_ = rows_.total();
}

/// With (X, Y, Z) the coordinates of d in map space, x = width / (2 pi) atan2(X, -Z) and
/// y = height / pi acos(Y):
///   dx = width / (2 pi) (X dZ - Z dX) / (X^2 + Z^2),   dy = -height / pi dY / sqrt(1 - Y^2).
Eigen::Matrix3d EnvironmentMap::gradient(const Vec3d& d) const {
  const double dx = axis_x_.dot(d);
  const double dy = axis_y_.dot(d);
  const double dz = axis_z_.dot(d);
  const double per_x = 0.5 * kInvPi * bitmap_.width;
  const double per_y = kInvPi * bitmap_.height;
  const double x = std::atan2(dx, -dz) * per_x;
  const double y = std::acos(std::clamp(dy, -1.0, 1.0)) * per_y;
  const Vec3d x_gradient = per_x / (dx * dx + dz * dz) * (dx * axis_z_ - dz * axis_x_);
  // At the poles the map is constant in v, as in `eval`.
  const double sine2 = 1.0 - dy * dy;
  const Vec3d y_gradient = (sine2 > 0.0 ? -per_y / std::sqrt(sine2) : 0.0) * axis_y_;
  const BilinearPatch patch(bitmap_, x, y, Wrap::Repeat, Wrap::Clamp);
  return scale_ * (patch.slope_x(y).matrix() * x_gradient.transpose() +
                   patch.slope_y(x).matrix() * y_gradient.transpose());
}

/// Patch row r spans the map's y in [r - 1/2, r + 1/2], cut at the poles.
double EnvironmentMap::patch_solid_angle(int row) const {
  const auto r = static_cast<std::size_t>(row);
  return (edges_[r] - edges_[r + 1]) * 2.0 * kPi / bitmap_.width;
}

int EnvironmentMap::row_of(double y) const {
  return std::clamp(static_cast<int>(std::floor(y + 0.5)), 0, bitmap_.height);
}

EnvironmentMap::Place EnvironmentMap::place_of(const Vec3d& d) const {
  const double dy = std::clamp(axis_y_.dot(d), -1.0, 1.0);
  const double x = std::atan2(axis_x_.dot(d), -axis_z_.dot(d)) * 0.5 * kInvPi * bitmap_.width - 0.5;
  Place place;
  place.row = row_of(std::acos(dy) * kInvPi * bitmap_.height);
  const double left = std::floor(x);
  place.column = static_cast<int>(left) % bitmap_.width;
  if (place.column < 0) place.column += bitmap_.width;
  const auto r = static_cast<std::size_t>(place.row);
  place.offset = {(edges_[r] - dy) / (edges_[r] - edges_[r + 1]), x - left};
  return place;
}

Vec2d EnvironmentMap::inverse(const Vec3d& d) const {
  const Place at = place_of(d);
  return {rows_.inverse(at.row, at.offset.x()),
          columns_[static_cast<std::size_t>(at.row)].inverse(at.column, at.offset.y())};
}

double EnvironmentMap::pdf(const Vec3d& d) const {
  const Place at = place_of(d);
  return rows_.probability(at.row) *
         columns_[static_cast<std::size_t>(at.row)].probability(at.column) /
         patch_solid_angle(at.row);
}

}  // namespace driftlight
