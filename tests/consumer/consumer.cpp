// SPDX-License-Identifier: Apache-2.0
/// Loads a scene, renders a few mutations and looks at the image: exit code 0 if it is lit.
#include <driftlight/image.h>
#include <driftlight/render.h>
#include <driftlight/scene_file.h>

#include <cmath>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iostream>

namespace {

/// A furnace: a white sphere in white light, radiance 1 wherever one looks, but for the light that
/// is lost with long paths.
constexpr const char* kScene = R"(<scene version="0.6.0">
  <sensor type="perspective">
    <float name="fov" value="60"/>
    <transform name="toWorld"><lookat origin="0,0,-4" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="16"/><integer name="height" value="16"/>
      <rfilter type="box"/>
    </film>
  </sensor>
  <emitter type="constant"/>
  <shape type="sphere"><bsdf type="diffuse"><spectrum name="reflectance" value="1"/></bsdf></shape>
</scene>
)";

double render(const std::filesystem::path& file) {
  std::ofstream(file) << kScene;
  const driftlight::LoadedScene loaded = driftlight::load_scene(file);
  const driftlight::LangevinResult result = driftlight::render_langevin(
      loaded.scene, driftlight::LangevinOptions(), driftlight::RenderOptions(), 64.0);
  driftlight::write_image(file.parent_path() / "consumer.exr", result.image);
  double sum = 0;
  for (const float x : result.image.rgb) sum += static_cast<double>(x);
  return sum / static_cast<double>(result.image.rgb.size());
}

}  // namespace

int main() {
  try {
    const double mean = render(std::filesystem::current_path() / "consumer_scene.xml");
    std::cout << "mean radiance " << mean << '\n';
    return std::abs(mean - 1.0) < 0.05 ? 0 : 1;
  } catch (const std::exception& error) {
    std::cerr << error.what() << '\n';
    return 1;
  }
}
