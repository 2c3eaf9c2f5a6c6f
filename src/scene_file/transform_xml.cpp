// SPDX-License-Identifier: Apache-2.0
#include "transform_xml.h"

#include <Eigen/LU>
#include <array>
#include <cmath>

#include "direction_across.h"
#include "driftlight/scalar.h"
#include "nearest_names.h"
#include "text.h"

namespace driftlight {
namespace {

Vec3d read_xyz(const Element& element, double fallback) {
  const std::array<double, 3> xyz = element.xyz(fallback);
  return {xyz[0], xyz[1], xyz[2]};
}

/// Mitsuba 3 also takes three numbers at once, as `value`.
void allow_xyz(const Element& element) {
  if (element.dialect() == Dialect::Mitsuba3)
    element.allow_attributes({"x", "y", "z", "value"});
  else
    element.allow_attributes({"x", "y", "z"});
}

Vec3d read_vector(const Element& element, const char* attribute) {
  const std::vector<double> v = element.numbers(attribute, 3);
  return {v[0], v[1], v[2]};
}

Eigen::Affine3d read_translate(const Element& element) {
  allow_xyz(element);
  return Eigen::Affine3d(Eigen::Translation3d(read_xyz(element, 0.0)));
}

Eigen::Affine3d read_rotate(const Element& element) {
  if (element.dialect() == Dialect::Mitsuba3)
    element.allow_attributes({"x", "y", "z", "value", "angle"});
  else
    element.allow_attributes({"x", "y", "z", "angle"});
  const Vec3d axis = read_xyz(element, 0.0);
  if (!(axis.norm() > 0.0)) element.fail("<rotate> needs an axis: x, y or z must not be 0");
  const double angle = element.number("angle") * kPi / 180.0;
  return Eigen::Affine3d(Eigen::AngleAxisd(angle, axis.normalized()));
}

Eigen::Affine3d read_scale(const Element& element) {
  element.allow_attributes({"x", "y", "z", "value"});
  const bool by_axis = element.find("x") || element.find("y") || element.find("z");
  if (by_axis == element.find("value").has_value())
    element.fail("<scale> needs either 'value' or some of 'x', 'y', 'z'");
  const bool three_at_once = element.dialect() == Dialect::Mitsuba3;
  const Vec3d factors =
      by_axis || three_at_once ? read_xyz(element, 1.0) : Vec3d::Constant(element.number("value"));
  return Eigen::Affine3d(Eigen::Scaling(factors));
}

/// A camera at `origin` that looks along its +z to `target`; +x is its left. Without an `up`, or
/// with one of zero, it is turned as Mitsuba turns it.
Eigen::Affine3d read_look_at(const Element& element) {
  element.allow_attributes({"origin", "target", "up"});
  const Vec3d origin = read_vector(element, "origin");
  const Vec3d forward = read_vector(element, "target") - origin;
  if (!(forward.norm() > 0.0)) element.fail("<lookat>: 'origin' and 'target' coincide");
  const bool has_up = !split_list(element.find("up").value_or("")).empty();
  Vec3d up = has_up ? read_vector(element, "up") : Vec3d(0, 0, 0);
  if (up.isZero(0.0)) up = direction_across(forward.normalized(), element.dialect());
  const Vec3d left = up.cross(forward);
  if (!(left.norm() > 1e-12 * forward.norm()))
    element.fail("<lookat>: 'up' must not be parallel to the direction from 'origin' to 'target'");
  Eigen::Affine3d result = Eigen::Affine3d::Identity();
  result.linear().col(0) = left.normalized();
  result.linear().col(1) = forward.cross(left).normalized();
  result.linear().col(2) = forward.normalized();
  result.translation() = origin;
  return result;
}

/// In Mitsuba 3 also one of 3 x 3.
Eigen::Affine3d read_matrix(const Element& element) {
  element.allow_attributes({"value"});
  if (element.dialect() == Dialect::Mitsuba3 && split_list(element.text("value")).size() == 9) {
    const std::vector<double> linear = element.numbers("value", 9);
    Eigen::Affine3d result = Eigen::Affine3d::Identity();
    result.linear() = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(linear.data());
    return result;
  }
  const std::vector<double> m = element.numbers("value", 16);
  const Eigen::Matrix4d matrix =
      Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(m.data());
  if (matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    element.fail("the last row of <matrix> must be 0, 0, 0, 1");
  return Eigen::Affine3d(matrix);
}

Eigen::Affine3d read_step(const Element& element) {
  const std::string tag = element.tag();
  if (tag == "translate") return read_translate(element);
  if (tag == "rotate") return read_rotate(element);
  if (tag == "scale") return read_scale(element);
  if (tag == "lookat" || tag == "lookAt") return read_look_at(element);
  if (tag == "matrix") return read_matrix(element);
  element.fail("unknown transform <" + tag + ">; " +
               hint(tag, {"translate", "rotate", "scale", "lookat", "matrix"}));
}

}  // namespace

Eigen::Affine3d read_transform(const Element& element) {
  element.allow_attributes({"name"});
  Eigen::Affine3d result = Eigen::Affine3d::Identity();
  for (const Element& step : element.children()) result = read_step(step) * result;
  if (!result.matrix().allFinite()) element.fail("the transform is not finite");
  if (result.linear().fullPivLu().rank() < 3) element.fail("the transform is not invertible");
  return result;
}

}  // namespace driftlight
