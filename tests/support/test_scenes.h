// SPDX-License-Identifier: Apache-2.0
/// Small scenes that between them contain every BSDF, emitter, shape and way for a path to end.
#pragma once

#include <string>
#include <vector>

#include "driftlight/path_sampler.h"
#include "driftlight/scene.h"

namespace driftlight::test {

struct TestScene {
  std::string name;
  Scene scene;
  int max_depth;
};

/// All of them, built on first use.
///   room       diffuse, two-sided and Phong walls with textures under planar, disk, spherical and
///              non-planar area emitters, the first three textured; rough metals
///   glass      smooth and rough interfaces, mirrors, a point emitter
///   sun        glossy things under an environment map with a small bright sun, behind a window
///   overcast   the same kinds under a constant environment, seen through a rough window
///   stage      diffuse and glossy things under a spot and parallel light, behind smooth glass
///   coated     smooth and rough plastic, layers, panes, masks and what only lets pass
///   plan       diffuse, glossy and smooth things and blends of them under area emitters, a spot
///              and parallel light, as an orthographic camera sees them; bump and normal maps
///   lens       diffuse, glossy and smooth things under area emitters, a spot, parallel light and a
///              constant environment, as a lens sees them that is in focus among them
const std::vector<TestScene>& test_scenes();

/// With films of 32 x 24 pixels; path tracing finds all light of the first without the point
/// emitter, and of the others without glass and emitters that cannot be hit.
Scene coated(bool with_point);
Scene plan(bool with_caustics);
Scene lens(bool with_caustics);

/// Paths that carry light, drawn from a scene by its PathSampler.
std::vector<PathSampler::Sample> light_paths(const TestScene& scene, int count, std::uint64_t seed);

/// A rectangle of two triangles from `corner` along `u` and `v`, normal along u x v. With `uvs` it
/// has texture coordinates; `bend` tilts its vertex normals outward by that slope, 0 leaves them
/// out.
TriangleMesh quad(const Vec3d& corner, const Vec3d& u, const Vec3d& v, bool uvs = false,
                  double bend = 0);

/// A sphere of triangles with interpolated normals. `rings` from pole to pole.
TriangleMesh round_mesh(const Vec3d& center, double radius, int rings, bool normals = true);

/// A box of 12 triangles with outward normals and shared vertices.
TriangleMesh box(const Vec3d& low, const Vec3d& high);

/// A camera at `origin` that looks at `target`, y up, with this tangent of half its field of view.
Camera look_at(const Vec3d& origin, const Vec3d& target, double half_width);

/// A smooth coloured pattern in [low, high].
std::shared_ptr<const Bitmap> pattern_bitmap(int width, int height, double low, double high);

/// Sky with a sun of a few texels.
Bitmap sun_bitmap(int width, int height, float sun);

/// The closed unit-radiance furnace: inside a diffuse sphere of this albedo that emits L = 1.
Scene furnace(double albedo);

}  // namespace driftlight::test
