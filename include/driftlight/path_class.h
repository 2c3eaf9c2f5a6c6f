// SPDX-License-Identifier: Apache-2.0
/// Names for what a path is made of, so that a check can say what it saw and where it failed.
#pragma once

#include <set>
#include <string>

#include "driftlight/path.h"
#include "driftlight/scene.h"

namespace driftlight {

/// "diffuse", "rough conductor ggx", ..
std::string kind_of(const Bsdf& bsdf);
/// "planar mesh", "mesh", "sphere", "disk", "cylinder"
std::string kind_of(const Shape& shape);
/// "area emitter", "point emitter", "constant environment", "environment map"
std::string kind_of(const Emitter& emitter);

/// The classes of a path, each for one feature: its length, its BSDFs (with the kind of scattering
/// and the stronger lobe of two), the surfaces that it meets, and the way in which it ends.
std::set<std::string> classes_of(const Scene& scene, const PathTopology& topology,
                                 const PathCoordinates& coordinates);

/// Length, lobes and kinds of shapes in the order of the path, and its end, in one name, such as
/// "length 4: diffuse on mesh > conductor on sphere x2 > connection to disk".
std::string path_class(const Scene& scene, const PathTopology& topology,
                       const PathCoordinates& coordinates);

}  // namespace driftlight
