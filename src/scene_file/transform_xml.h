// SPDX-License-Identifier: Apache-2.0
/// Transforms of scene files.
#pragma once

#include <Eigen/Geometry>

#include "xml_document.h"

namespace driftlight {

/// <transform>: its translate, rotate, scale, lookat and matrix steps, applied in the order in
/// which they are written. Throws SceneError if the result is not an invertible affine map.
Eigen::Affine3d read_transform(const Element& element);

}  // namespace driftlight
