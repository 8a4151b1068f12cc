#include "tests/render/outside_references.h"

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <utility>

#include "common/base/frame.h"

namespace glint {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

constexpr int kBlock = 4;  // outside pixels a side

glm::vec3 Vector(const Json& json) { return {json.at(0), json.at(1), json.at(2)}; }

Camera ReadCamera(const Json& json) {
  Camera camera;
  camera.eye = Vector(json.at("position"));
  camera.forward = glm::normalize(Vector(json.at("look_at")) - camera.eye);
  camera.up = Vector(json.at("up"));
  camera.vertical_fov = json.at("vfov_deg").get<float>() * kPi / 180;
  return camera;
}

OutsidePicture ReadPictureEntry(const Json& json, const fs::path& folder) {
  OutsidePicture picture;
  picture.file = folder / json.at("file").get<std::string>();
  picture.bounces = json.at("bounces");
  picture.noise_block4_rel_mse = json.at("noise_block4_relMSE");
  picture.cycles_fresnel_bias = json.at("schlick_minus_cycles_fresnel_bias");
  const Json& cycles = json.at("cycles");
  if (cycles.is_object() && cycles.at("file").is_string()) {
    picture.cycles_file = folder / cycles.at("file").get<std::string>();
  }
  return picture;
}

std::vector<OutsideView> ReadViews(const Json& json, const fs::path& folder) {
  std::vector<OutsideView> views;
  for (const auto& [name, entry] : json.at("views").items()) {
    OutsideView view;
    view.name = name;
    view.scene = fs::weakly_canonical(folder / json.at("glb").get<std::string>());
    view.mask = folder / entry.at("mask").get<std::string>();
    view.width = json.at("resolution").at(0);
    view.height = json.at("resolution").at(1);
    for (const Json& image : json.at("images")) {
      const std::string camera = image.at("camera"), environment = image.at("env");
      if (camera + "_" + environment != name || !fs::exists(folder / image.at("file").get<std::string>()))
        continue;
      view.camera = ReadCamera(json.at("cameras").at(camera));
      view.environment = fs::weakly_canonical(
          folder / json.at("environments").at(environment).at("file").get<std::string>());
      view.pictures.push_back(ReadPictureEntry(image, folder));
    }
    if (!view.pictures.empty()) views.push_back(std::move(view));
  }
  return views;
}

/// Means over blocks of `block` pixels a side.
Picture BoxAverage(const Picture& picture, int block) {
  Picture out(picture.width / block, picture.height / block);
  for (int y = 0; y < out.height * block; ++y) {
    for (int x = 0; x < out.width * block; ++x) {
      out.at(x / block, y / block) += picture.at(x, y) / static_cast<float>(block * block);
    }
  }
  return out;
}

double Mean(const glm::dvec3& v) { return (v.x + v.y + v.z) / 3; }

/// Sums over the blocks that the mask has wholly; all three pictures are in blocks.
Agreement CompareBlocks(const Picture& test, const Picture& half_difference, const Picture& reference,
                        const Picture& mask) {
  Agreement agreement;
  double sum_test = 0, sum_reference = 0;
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    if (mask.pixels[i].x < 0.999f) continue;
    ++agreement.blocks;
    sum_test += Mean(glm::dvec3(test.pixels[i]));
    sum_reference += Mean(glm::dvec3(reference.pixels[i]));
  }
  if (agreement.blocks == 0) return agreement;
  double variance = 0;
  const double epsilon = 0.1 * sum_reference / static_cast<double>(agreement.blocks);
  for (size_t i = 0; i < mask.pixels.size(); ++i) {
    if (mask.pixels[i].x < 0.999f) continue;
    const glm::dvec3 t(test.pixels[i]), r(reference.pixels[i]), d(half_difference.pixels[i]);
    const glm::dvec3 scale = 1.0 / (r * r + epsilon * epsilon) / static_cast<double>(agreement.blocks);
    agreement.rel_mse += Mean((t - r) * (t - r) * scale);
    agreement.noise += Mean(d * d * scale);
    variance += Mean(d) * Mean(d);
  }
  agreement.bias = sum_test / sum_reference - 1;
  agreement.bias_error = std::sqrt(variance) / sum_reference;
  return agreement;
}

}  // namespace

std::optional<fs::path> FindSharedData() {
  fs::path folder = fs::path(GLINT_SOURCE_DIR) / ".." / "shared" / "data";
  if (const char* given = std::getenv("GLINT_SHARED_DATA"); given != nullptr && *given != 0) folder = given;
  std::error_code error;
  if (!fs::is_directory(folder / "ref", error)) return std::nullopt;
  return fs::weakly_canonical(folder, error);
}

Result<std::vector<OutsideView>> LoadOutsideViews(const fs::path& shared_data, const std::string& scene) {
  const fs::path folder = shared_data / "ref" / scene;
  try {
    std::ifstream file(folder / "scene.json");
    return ReadViews(Json::parse(file), folder);
  } catch (const std::exception& error) {
    return BadInput((folder / "scene.json").string() + ": " + error.what());
  }
}

Result<Agreement> CompareWithOutside(const ReferenceResult& test, const fs::path& outside,
                                     const fs::path& mask_file) {
  GLINT_ASSIGN_OR_RETURN(const Picture reference, ReadPicture(outside));
  GLINT_ASSIGN_OR_RETURN(const Picture mask, ReadPng(mask_file));
  const int width = test.picture.width, height = test.picture.height;
  const int factor = width > 0 ? reference.width / width : 0;
  if (factor < 1 || kBlock % factor != 0 || width * factor != reference.width ||
      height * factor != reference.height) {
    return BadInput(outside.string() + ": the picture must be 1, 1/2 or 1/4 of its size");
  }
  if (mask.width != reference.width || mask.height != reference.height) {
    return BadInput(mask_file.string() + ": size differs from the picture's");
  }
  const Agreement agreement = CompareBlocks(BoxAverage(test.picture, kBlock / factor),
                                            BoxAverage(test.half_difference, kBlock / factor),
                                            BoxAverage(reference, kBlock), BoxAverage(mask, kBlock));
  if (agreement.blocks == 0) return BadInput(mask_file.string() + ": no block is wholly inside the mask");
  return agreement;
}

}  // namespace glint
