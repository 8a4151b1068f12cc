#include "common/scene/gltf_material.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>
#include <utility>

#include "common/scene/gltf_image.h"

namespace glint {
namespace {

constexpr size_t kMaxMaterials = 65535;
constexpr double kMaxExponent = 1e6;

Wrap ToWrap(int mode) {
  if (mode == TINYGLTF_TEXTURE_WRAP_CLAMP_TO_EDGE) return Wrap::kClamp;
  if (mode == TINYGLTF_TEXTURE_WRAP_MIRRORED_REPEAT) return Wrap::kMirror;
  return Wrap::kRepeat;
}

class MaterialReader {
 public:
  MaterialReader(const GltfDocument& document, GltfBytes& bytes, const SceneLimits& limits, Scene& scene)
      : document_(document),
        bytes_(bytes),
        limits_(limits),
        scene_(scene),
        pixels_left_(limits.image_pixels) {}

  Status Read(std::vector<int>& uv_sets) {
    const auto& materials = document_.model.materials;
    if (materials.size() > kMaxMaterials) {
      return LimitExceeded("materials: " + std::to_string(materials.size()) + ", more than the limit of " +
                           std::to_string(kMaxMaterials) + "; merge some");
    }
    for (size_t i = 0; i < materials.size(); ++i) {
      object_ = "materials[" + std::to_string(i) + "]";
      int uv_set = 0;
      Material material;
      GLINT_RETURN_IF_ERROR(Convert(materials[i], material, uv_set));
      scene_.materials.push_back(std::move(material));
      uv_sets.push_back(uv_set);
    }
    return {};
  }

 private:
  Status Convert(const tinygltf::Material& from, Material& to, int& uv_set) {
    to.name = from.name;
    to.double_sided = from.doubleSided;
    const auto& pbr = from.pbrMetallicRoughness;
    for (int c = 0; c < 3; ++c) to.base_color[c] = Unit(pbr.baseColorFactor[c], "baseColorFactor");
    to.metallic = Unit(pbr.metallicFactor, "metallicFactor");
    to.roughness = Unit(pbr.roughnessFactor, "roughnessFactor");
    const std::string path = object_ + ".pbrMetallicRoughness.";
    GLINT_ASSIGN_OR_RETURN(to.base_color_texture,
                           UseTexture(pbr.baseColorTexture.index, path + "baseColorTexture"));
    GLINT_ASSIGN_OR_RETURN(to.metallic_roughness_texture,
                           UseTexture(pbr.metallicRoughnessTexture.index, path + "metallicRoughnessTexture"));
    const bool has_base = to.base_color_texture != kNone, has_mr = to.metallic_roughness_texture != kNone;
    uv_set = has_base ? pbr.baseColorTexture.texCoord : has_mr ? pbr.metallicRoughnessTexture.texCoord : 0;
    if (has_base && has_mr && pbr.metallicRoughnessTexture.texCoord != uv_set) {
      Note("metallicRoughnessTexture is read with the base colour's TEXCOORD_" + std::to_string(uv_set));
    }
    NoteIgnored(from);
    return ReadBrdf(from, to);
  }

  void NoteIgnored(const tinygltf::Material& from) {
    const auto& e = from.emissiveFactor;
    if (std::any_of(e.begin(), e.end(), [](double v) { return v > 0; })) Note("emission is ignored");
    if (from.normalTexture.index >= 0) Note("the normal texture is ignored");
    if (from.occlusionTexture.index >= 0) Note("the occlusion texture is ignored: light is computed");
    if (from.alphaMode != "OPAQUE") Note("transparency (alphaMode) is ignored: the surface is opaque");
  }

  // Phong and Blinn-Phong by extras.glint_brdf; its members have the right types already.
  Status ReadBrdf(const tinygltf::Material& from, Material& to) {
    if (!from.extras.IsObject() || !from.extras.Has("glint_brdf")) return {};
    const tinygltf::Value& brdf = from.extras.Get("glint_brdf");
    const std::string path = object_ + ".extras.glint_brdf";
    const std::string model = brdf.Get("model").Get<std::string>();
    if (model != "phong" && model != "blinn-phong") {
      return BadInput(path + ".model: '" + Printable(model) +
                      "' is not known; use \"phong\" or \"blinn-phong\"");
    }
    to.model = model == "phong" ? MaterialModel::kPhong : MaterialModel::kBlinnPhong;
    const double exponent = brdf.Get("exponent").GetNumberAsDouble();
    if (!(exponent >= 0 && exponent <= kMaxExponent)) {
      return BadInput(path + ".exponent: must lie in [0, 1e6]");
    }
    to.exponent = static_cast<float>(exponent);
    for (const auto& [key, color] :
         {std::pair{"specular", &to.specular}, std::pair{"diffuse", &to.diffuse}}) {
      if (!brdf.Has(key)) continue;
      const tinygltf::Value& value = brdf.Get(key);
      for (int c = 0; c < 3; ++c) {
        const double v = value.Get(static_cast<size_t>(c)).GetNumberAsDouble();
        if (!(v >= 0 && v <= 1)) return BadInput(path + "." + key + ": must lie in [0, 1]");
        (*color)[c] = static_cast<float>(v);
      }
    }
    return {};
  }

  float Unit(double value, const std::string& member) {
    if (value < 0 || value > 1) Note(member + " is outside [0, 1] and was clamped");
    return static_cast<float>(std::clamp(value, 0.0, 1.0));
  }

  // Index into scene.textures of textures[index], read on first use; kNone for none.
  Result<uint32_t> UseTexture(int index, const std::string& path) {
    if (index < 0) return uint32_t{kNone};
    if (const auto it = textures_.find(index); it != textures_.end()) return uint32_t{it->second};
    const tinygltf::Model& model = document_.model;
    if (static_cast<size_t>(index) >= model.textures.size()) {
      return BadInput(path + ": textures[" + std::to_string(index) +
                      "] does not exist; export the file again");
    }
    const tinygltf::Texture& from = model.textures[index];
    const std::string object = "textures[" + std::to_string(index) + "]";
    Texture texture;
    if (from.sampler >= 0) {
      if (static_cast<size_t>(from.sampler) >= model.samplers.size()) {
        return BadInput(object + ".sampler: samplers[" + std::to_string(from.sampler) +
                        "] does not exist; export the file again");
      }
      texture.wrap_u = ToWrap(model.samplers[from.sampler].wrapS);
      texture.wrap_v = ToWrap(model.samplers[from.sampler].wrapT);
    }
    if (from.source < 0) {
      scene_.notes.push_back(object + ": has no PNG or JPEG image and is ignored");
    } else {
      GLINT_ASSIGN_OR_RETURN(texture.image, UseImage(from.source, object));
    }
    scene_.textures.push_back(texture);
    const auto used = static_cast<uint32_t>(scene_.textures.size() - 1);
    textures_[index] = used;
    return uint32_t{used};
  }

  Result<uint32_t> UseImage(int index, const std::string& user) {
    if (const auto it = images_.find(index); it != images_.end()) return uint32_t{it->second};
    const std::string object = "images[" + std::to_string(index) + "]";
    if (static_cast<size_t>(index) >= document_.images.size()) {
      return BadInput(user + ".source: " + object + " does not exist; export the file again");
    }
    const GltfDocument::ImageSource& source = document_.images[index];
    auto bytes = source.buffer_view >= 0 ? bytes_.View(source.buffer_view) : bytes_.Uri(source.uri, object);
    if (!bytes.ok()) return bytes.status().WithContext(object);
    GLINT_ASSIGN_OR_RETURN(Image image, DecodeImage(*bytes, source.name, limits_, pixels_left_, object));
    scene_.images.push_back(std::move(image));
    const auto used = static_cast<uint32_t>(scene_.images.size() - 1);
    images_[index] = used;
    return uint32_t{used};
  }

  /// Once, where several components of a colour give the same one.
  void Note(const std::string& what) {
    std::string note = object_ + ": " + what;
    if (scene_.notes.empty() || scene_.notes.back() != note) scene_.notes.push_back(std::move(note));
  }

  const GltfDocument& document_;
  GltfBytes& bytes_;
  const SceneLimits& limits_;
  Scene& scene_;
  uint64_t pixels_left_;
  std::map<int, uint32_t> textures_, images_;  // file's index -> scene's
  std::string object_;
};

}  // namespace

Status ReadMaterials(const GltfDocument& document, GltfBytes& bytes, const SceneLimits& limits, Scene& scene,
                     std::vector<int>& uv_sets) {
  return MaterialReader(document, bytes, limits, scene).Read(uv_sets);
}

}  // namespace glint
