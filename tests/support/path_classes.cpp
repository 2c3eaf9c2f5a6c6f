// SPDX-License-Identifier: Apache-2.0
#include "support/path_classes.h"

#include "driftlight/path_class.h"

namespace driftlight::test {

std::set<std::string> classes_of(const Scene& scene, const PathSampler::Sample& path) {
  return driftlight::classes_of(scene, path.topology, path.coordinates);
}

const std::vector<std::string>& required_classes() {
  static const std::vector<std::string> classes{
      "diffuse",
      "conductor",
      "rough conductor beckmann",
      "rough conductor ggx",
      "rough conductor anisotropic beckmann",
      "rough conductor anisotropic ggx",
      "rough conductor anisotropic phong",
      "dielectric reflection outside",
      "dielectric reflection inside",
      "dielectric transmission outside",
      "dielectric transmission inside",
      "rough dielectric beckmann reflection outside",
      "rough dielectric beckmann reflection inside",
      "rough dielectric beckmann transmission outside",
      "rough dielectric beckmann transmission inside",
      "rough dielectric ggx reflection outside",
      "rough dielectric ggx reflection inside",
      "rough dielectric ggx transmission outside",
      "rough dielectric ggx transmission inside",
      "rough dielectric anisotropic beckmann reflection outside",
      "rough dielectric anisotropic beckmann reflection inside",
      "rough dielectric anisotropic beckmann transmission outside",
      "rough dielectric anisotropic beckmann transmission inside",
      "phong glossy lobe",
      "phong diffuse lobe",
      "anisotropic ward glossy lobe",
      "anisotropic ward diffuse lobe",
      "plastic coat",
      "plastic base",
      "rough plastic beckmann coat",
      "rough plastic beckmann base",
      "rough plastic ggx coat",
      "rough plastic ggx base",
      "thin dielectric reflection outside",
      "thin dielectric transmission outside",
      "thin dielectric transmission inside",
      "coated diffuse base",
      "coated rough conductor anisotropic beckmann base",
      "coated conductor coat",
      "masked diffuse",
      "masked diffuse passed",
      "masked rough plastic ggx",
      "masked plastic",
      "masked plastic passed",
      "masked thin dielectric passed",
      "null passed",
      "on mesh",
      "on sphere",
      "on disk",
      "on interpolated normals",
      "on texture",
      "on back",
      "emitter seen directly",
      "hit planar mesh",
      "hit disk",
      "hit sphere",
      "hit mesh",
      "environment map",
      "constant environment",
      "connection to planar mesh",
      "connection to disk",
      "connection to sphere",
      "connection to point after diffuse",
      "connection to point after plastic base",
      "connection to point after phong diffuse lobe",
      "connection to point after rough conductor beckmann",
      "connection to spot after diffuse",
      "connection to spot after phong diffuse lobe",
      "connection to spot after rough conductor ggx",
      "connection to directional after diffuse",
      "connection to directional after phong diffuse lobe",
      "connection to directional after rough conductor ggx"};
  return classes;
}

void ClassCounter::add(const std::set<std::string>& classes) {
  for (const std::string& c : classes) ++counts_[c];
}

std::vector<std::string> ClassCounter::missing(int minimum) const {
  std::vector<std::string> result;
  for (const std::string& c : required_classes()) {
    const auto found = counts_.find(c);
    const int count = found == counts_.end() ? 0 : found->second;
    if (count < minimum) result.push_back(c + ": " + std::to_string(count));
  }
  return result;
}

}  // namespace driftlight::test
