// Glint's own scenes, made from formulas and B-splines so that no data file is needed. Lengths are in the
// order of one.
#include "common/scene/generate.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <numbers>
#include <span>

#include "common/scene/mesh_builder.h"

namespace glint {
namespace {

constexpr double kTau = 2 * std::numbers::pi;
constexpr glm::dvec3 kX{1, 0, 0}, kY{0, 1, 0}, kZ{0, 0, 1};

// Reflectance at normal incidence, linear Rec. 709.
constexpr glm::vec3 kSilver{0.95f, 0.93f, 0.88f}, kGold{1.00f, 0.77f, 0.34f}, kCopper{0.95f, 0.64f, 0.54f},
    kBrass{0.89f, 0.79f, 0.43f}, kSteel{0.77f, 0.78f, 0.78f};

Material Metal(const std::string& name, const glm::vec3& color, float roughness,
               const GenerateOptions& options) {
  Material material;
  material.name = name;
  material.base_color = color;
  material.metallic = 1;
  material.roughness = roughness;
  if (options.exponent > 0) {
    material.model = MaterialModel::kPhong;
    material.exponent = options.exponent;
    material.roughness =
        std::pow(2 / (options.exponent + 2), 0.25f);  // about as wide, for programs that know no Phong
    material.specular = 0.9f * color;
  }
  return material;
}

Material Diffuse(const std::string& name, const glm::vec3& color) {
  Material material;
  material.name = name;
  material.base_color = color;
  material.metallic = 0;
  material.roughness = 1;
  return material;
}

Camera LookAt(const glm::vec3& eye, const glm::vec3& target, float vertical_fov_degrees) {
  Camera camera;
  camera.name = "main";
  camera.eye = eye;
  camera.forward = glm::normalize(target - eye);
  camera.up = {0, 1, 0};
  camera.vertical_fov = vertical_fov_degrees * static_cast<float>(kTau / 360);
  return camera;
}

// Rows of a square patch with about this many vertices.
int PatchSide(double vertices) { return std::max(2, static_cast<int>(std::lround(std::sqrt(vertices)))); }

void AddFloor(MeshBuilder& builder, double half_side, double vertices, uint16_t material) {
  const int side = PatchSide(vertices);
  builder.AddPatch({-half_side, 0, half_side}, {2 * half_side, 0, 0}, {0, 0, -2 * half_side}, side, side,
                   material);
}

// Solid of revolution about a vertical axis. Control points are (radius, height) from the lower to the upper
// pole; both ends get a mirrored point each, so that the curve meets the axis at a right angle.
class Revolution {
 public:
  Revolution(const glm::dvec3& foot, std::span<const glm::dvec2> profile, double bend)
      : foot_(foot), control_(profile.begin(), profile.end()), bend_(bend) {
    control_.insert(control_.begin(), {-profile[1].x, profile[1].y});
    const glm::dvec2 before = profile[profile.size() - 2];
    control_.push_back({-before.x, before.y});
    const auto points = SampleSpline(control_, 512, 0);
    for (size_t i = 0; i + 1 < points.size(); ++i) {
      const double step = glm::distance(points[i], points[i + 1]);
      length_ += step;
      area_ += step * kTau * 0.5 * std::abs(points[i].x + points[i + 1].x);
    }
  }
  double area() const { return area_; }

  void Add(MeshBuilder& builder, double vertices, uint16_t material) const {
    const auto [rows, columns] = SizeTube(vertices, length_ * (1 + bend_ * kTau), area_ / length_);
    const auto points = SampleSpline(control_, rows + 2, bend_);
    std::vector<Ring> rings;
    for (size_t i = 0; i < points.size(); ++i) {
      const bool pole = i == 0 || i + 1 == points.size();
      rings.push_back({foot_ + kY * points[i].y, kZ, kX, pole ? 0.0 : std::abs(points[i].x)});
    }
    builder.AddTube(rings, columns, false, material);
  }

 private:
  glm::dvec3 foot_;
  std::vector<glm::dvec2> control_;
  double bend_;
  double length_ = 0, area_ = 0;
};

// A bent tube in the plane z = 0 around a B-spline; `radius(t)` along the curve. With a mouth it ends in a
// rounded lip and goes back inside by `mouth_depth`, where it is closed.
struct BentTube {
  std::vector<glm::dvec2> control;
  std::function<double(double)> radius;
  double mouth_depth = 0;

  double Length() const {
    const auto points = SampleSpline(control, 256, 0);
    double length = 0;
    for (size_t i = 0; i + 1 < points.size(); ++i) length += glm::distance(points[i], points[i + 1]);
    return length;
  }
  double Circumference() const { return kTau * 0.5 * (radius(0.15) + radius(0.85)); }
  double area() const { return (Length() + mouth_depth) * Circumference(); }

  void Add(MeshBuilder& builder, double vertices, uint16_t material) const {
    const double outer = Length();
    const auto [rows, columns] = SizeTube(vertices, outer + mouth_depth, Circumference());
    const int mouth_rows =
        mouth_depth > 0
            ? std::max(6, static_cast<int>(std::lround(rows * mouth_depth / (outer + mouth_depth))))
            : 0;
    std::vector<double> parameters;
    const auto points = SampleSpline(control, std::max(4, rows - mouth_rows), 0, &parameters);
    std::vector<Ring> rings;
    for (size_t i = 0; i < points.size(); ++i) {
      const glm::dvec2 tangent =
          glm::normalize(points[std::min(i + 1, points.size() - 1)] - points[i ? i - 1 : 0]);
      rings.push_back({{points[i], 0}, kZ, glm::cross({tangent, 0}, kZ), radius(parameters[i])});
    }
    if (mouth_depth > 0) AddMouth(rings, mouth_rows);
    builder.AddTube(rings, columns, false, material);
  }

 private:
  // Half a circle of a lip, then straight back, narrowing to a pole.
  void AddMouth(std::vector<Ring>& rings, int count) const {
    const Ring rim = rings.back();
    const glm::dvec3 along = glm::cross(rim.a, rim.b);
    const double lip = 0.12 * rim.radius;
    const int lip_rows = 5;
    for (int i = 1; i <= lip_rows; ++i) {
      const double angle = std::numbers::pi * i / lip_rows;
      rings.push_back({rim.center + along * (lip * std::sin(angle)), rim.a, rim.b,
                       rim.radius - lip * (1 - std::cos(angle))});
    }
    const double inner = rings.back().radius;
    for (int i = 1; i <= count; ++i) {
      const double s = double(i) / count;
      const double width = i == count ? 0 : inner * std::sqrt(1 - std::pow(s, 4));
      rings.push_back({rim.center - along * (mouth_depth * s), rim.a, rim.b, width});
    }
  }
};

Scene MakeTeapot(const GenerateOptions& options) {
  const glm::dvec2 profile[] = {
      {0, 0.02},    {0.22, 0.02}, {0.34, 0.0},  {0.40, 0.02}, {0.42, 0.06}, {0.52, 0.16}, {0.61, 0.32},
      {0.60, 0.48}, {0.52, 0.61}, {0.42, 0.69}, {0.41, 0.73}, {0.42, 0.76}, {0.38, 0.76}, {0.36, 0.77},
      {0.26, 0.83}, {0.13, 0.87}, {0.05, 0.89}, {0.04, 0.93}, {0.10, 0.97}, {0.10, 1.02}, {0, 1.05}};
  const Revolution body({0, 0, 0}, profile, 0.02);
  // The ends of handle and spout lie a little inside the body.
  const BentTube handle{{{-0.30, 0.60},
                         {-0.47, 0.61},
                         {-0.70, 0.66},
                         {-0.94, 0.66},
                         {-1.04, 0.50},
                         {-0.94, 0.32},
                         {-0.74, 0.22},
                         {-0.54, 0.19},
                         {-0.40, 0.18}},
                        [](double) { return 0.052; }};
  const BentTube spout{{{0.30, 0.22},
                        {0.46, 0.25},
                        {0.66, 0.28},
                        {0.80, 0.38},
                        {0.87, 0.54},
                        {0.94, 0.68},
                        {1.06, 0.77},
                        {1.18, 0.83}},
                       [](double t) { return 0.055 + 0.105 * std::pow(1 - t, 1.6); },
                       0.16};
  MeshBuilder builder;
  const uint16_t silver = builder.AddMaterial(Metal("silver", kSilver, 0.15f, options));
  const double density = options.vertices / (body.area() + handle.area() + spout.area());
  handle.Add(builder, handle.area() * density, silver);
  spout.Add(builder, spout.area() * density, silver);
  body.Add(builder, double(options.vertices) - builder.vertex_count(), silver);
  return builder.Finish(LookAt({1.6f, 1.65f, 3.2f}, {0.06f, 0.46f, 0}, 34));
}

// A goblet: foot, stem, bowl with a wall, hollow; one closed surface. Scaled in radius and height.
std::vector<glm::dvec2> GobletProfile(double width, double height) {
  std::vector<glm::dvec2> profile = {
      {0, 0.03},     {0.14, 0.02},  {0.25, 0.0},   {0.285, 0.0},  {0.295, 0.022}, {0.26, 0.04}, {0.13, 0.06},
      {0.055, 0.11}, {0.045, 0.22}, {0.075, 0.29}, {0.045, 0.35}, {0.06, 0.42},   {0.18, 0.47}, {0.30, 0.58},
      {0.345, 0.75}, {0.33, 0.92},  {0.312, 1.0},  {0.30, 1.015}, {0.287, 1.0},   {0.30, 0.92}, {0.315, 0.75},
      {0.27, 0.60},  {0.16, 0.505}, {0.06, 0.475}, {0, 0.47}};
  for (glm::dvec2& point : profile) point *= glm::dvec2(width, height);
  return profile;
}

Scene MakeGoblets(const GenerateOptions& options) {
  constexpr double kLift = 0.002;  // feet stand just above the plane
  const std::array<Revolution, 3> goblets = {
      Revolution({-0.52, kLift, 0.10}, GobletProfile(1.0, 1.05), 0.02),
      Revolution({0.30, kLift, 0.42}, GobletProfile(1.1, 0.80), 0.02),
      Revolution({0.34, kLift, -0.46}, GobletProfile(1.15, 1.15), 0.02)};
  MeshBuilder builder;
  const uint16_t metals[] = {builder.AddMaterial(Metal("silver", kSilver, 0.10f, options)),
                             builder.AddMaterial(Metal("gold", kGold, 0.20f, options)),
                             builder.AddMaterial(Metal("copper", kCopper, 0.35f, options))};
  const uint16_t steel = builder.AddMaterial(Metal("steel plane", kSteel, 0.25f, options));
  AddFloor(builder, 1.6, 0.36 * options.vertices, steel);
  double area = 0;
  for (const Revolution& goblet : goblets) area += goblet.area();
  const double density = (double(options.vertices) - builder.vertex_count()) / area;
  for (int i = 0; i < 3; ++i) goblets[i].Add(builder, goblets[i].area() * density, metals[i]);
  return builder.Finish(LookAt({1.7f, 2.05f, 2.7f}, {0, 0.45f, 0}, 33));
}

// A (2, 3) torus knot standing above the plane. Frames are those of the torus it winds around, so that the
// tube closes on itself without a twist.
Scene MakeKnot(const GenerateOptions& options) {
  constexpr double kMajor = 0.56, kMinor = 0.25, kTube = 0.125, kHeight = 0.46;
  const auto point = [](double t) {
    const double around = 2 * t, across = 3 * t, r = kMajor + kMinor * std::cos(across);
    return glm::dvec3(r * std::cos(around), kHeight + kMinor * std::sin(across), r * std::sin(around));
  };
  double length = 0;
  for (int i = 0; i < 4096; ++i)
    length += glm::distance(point(kTau * i / 4096), point(kTau * (i + 1) / 4096));

  MeshBuilder builder;
  const uint16_t brass = builder.AddMaterial(Metal("brass", kBrass, 0.20f, options));
  const uint16_t steel = builder.AddMaterial(Metal("steel plane", kSteel, 0.25f, options));
  AddFloor(builder, 1.5, 0.36 * options.vertices, steel);
  const auto [rows, columns] =
      SizeTube(double(options.vertices) - builder.vertex_count(), length, kTau * kTube);
  std::vector<Ring> rings;
  for (int i = 0; i < rows; ++i) {
    const double t = kTau * i / rows;
    const glm::dvec3 center = point(t);
    const glm::dvec3 tangent = glm::normalize(point(t + 1e-4) - point(t - 1e-4));
    const glm::dvec3 core(kMajor * std::cos(2 * t), kHeight, kMajor * std::sin(2 * t));
    const glm::dvec3 outward = center - core;
    const glm::dvec3 a = glm::normalize(outward - tangent * glm::dot(outward, tangent));
    rings.push_back({center, a, glm::cross(tangent, a), kTube});
  }
  builder.AddTube(rings, columns, true, brass);
  return builder.Finish(LookAt({1.5f, 2.1f, 2.5f}, {0, 0.36f, 0}, 35));
}

// Cube faces a side for about this many vertices.
int StarSide(double vertices) {
  return std::max(2, static_cast<int>(std::lround(std::sqrt((vertices - 2) / 6))));
}

// A pebble with bumps and dents: radius 1 plus Gaussian bumps of the angle around fixed directions.
Scene MakeBlob(const GenerateOptions& options) {
  struct Bump {
    glm::dvec3 direction;
    double height, sharpness;
  };
  const Bump bumps[] = {
      {{0.35, 0.85, 0.25}, 0.55, 9},    {{-0.45, 0.80, 0.20}, 0.60, 9},   {{0.95, -0.10, 0.25}, 0.40, 5},
      {{-0.90, -0.25, 0.40}, 0.42, 6},  {{0.05, -0.15, 1.00}, 0.45, 7},   {{-0.05, 0.75, 0.65}, -0.45, 9},
      {{0.55, 0.25, 0.80}, -0.36, 11},  {{-0.60, 0.15, 0.75}, -0.36, 11}, {{0.10, 0.15, -1.00}, 0.30, 4},
      {{0.70, 0.60, -0.35}, -0.28, 12}, {{-0.65, 0.50, -0.55}, -0.30, 10}};
  const auto place = [&](const glm::dvec3& d) {
    double r = 1;
    for (const Bump& b : bumps)
      r += b.height * std::exp(b.sharpness * (glm::dot(d, glm::normalize(b.direction)) - 1));
    return glm::dvec3(0, 0.475, 0) + 0.48 * r * d * glm::dvec3(1, 0.95, 1);
  };
  MeshBuilder builder;
  const uint16_t gold = builder.AddMaterial(Metal("gold", kGold, 0.30f, options));
  const uint16_t white = builder.AddMaterial(Diffuse("diffuse plane", {0.6f, 0.6f, 0.6f}));
  AddFloor(builder, 1.4, 0.34 * options.vertices, white);
  builder.AddStarShape(StarSide(double(options.vertices) - builder.vertex_count()), place, gold);
  return builder.Finish(LookAt({0.75f, 1.5f, 2.9f}, {0, 0.45f, 0}, 33));
}

Scene MakeSphere(const GenerateOptions& options) {
  MeshBuilder builder;
  const uint16_t silver = builder.AddMaterial(Metal("silver", kSilver, 0.20f, options));
  builder.AddStarShape(
      StarSide(options.vertices), [](const glm::dvec3& d) { return d; }, silver);
  return builder.Finish(LookAt({0, 0.8f, 3.9f}, {0, 0, 0}, 35));
}

// Two squares of side 2 at distance 1, fronts facing each other.
Scene MakePlanes(const GenerateOptions& options) {
  MeshBuilder builder;
  const uint16_t silver = builder.AddMaterial(Metal("silver", kSilver, 0.25f, options));
  const uint16_t copper = builder.AddMaterial(Metal("copper", kCopper, 0.25f, options));
  const int side = PatchSide(options.vertices / 2.0);
  builder.AddPatch({-1, 0, 1}, {2, 0, 0}, {0, 0, -2}, side, side, silver);
  builder.AddPatch({-1, 1, -1}, {2, 0, 0}, {0, 0, 2}, side, side, copper);
  return builder.Finish(LookAt({1.2f, 0.5f, 3.4f}, {0, 0.48f, 0}, 38));
}

// A closed cube of side 2, fronts inwards, Lambertian with albedo 1: in it nothing is lost and nothing comes
// in.
Scene MakeFurnace(const GenerateOptions& options) {
  Material white;
  white.name = "white";
  white.model = MaterialModel::kPhong;
  white.exponent = 1;
  white.diffuse = glm::vec3(1);
  MeshBuilder builder;
  const uint16_t material = builder.AddMaterial(white);
  const int side = PatchSide(options.vertices / 6.0);
  const glm::dvec3 axes[] = {kX, kY, kZ};
  for (int k = 0; k < 3; ++k) {
    const glm::dvec3 n = axes[k], s = axes[(k + 1) % 3], t = axes[(k + 2) % 3];
    builder.AddPatch(-n - s - t, 2.0 * s, 2.0 * t, side, side, material);  // front towards s x t = n
    builder.AddPatch(n - s - t, 2.0 * t, 2.0 * s, side, side, material);   // front towards -n
  }
  return builder.Finish(LookAt({0.6f, 0.4f, 0.9f}, {-0.3f, -0.2f, -0.6f}, 60));
}

struct Entry {
  GeneratedScene scene;
  Scene (*make)(const GenerateOptions&);
};

const std::vector<Entry>& Entries() {
  static const std::vector<Entry> entries = {
      {{"teapot", "teapot-like: silver body with lid, handle and spout, alone"}, MakeTeapot},
      {{"goblets", "three hollow goblets (silver, gold, copper) on a glossy plane"}, MakeGoblets},
      {{"knot", "brass torus knot above a glossy plane"}, MakeKnot},
      {{"blob", "gold bumpy closed shape on a diffuse plane"}, MakeBlob},
      {{"sphere", "silver sphere alone: no indirect light"}, MakeSphere},
      {{"planes", "two facing glossy squares of side 2 at distance 1"}, MakePlanes},
      {{"furnace", "closed diffuse box of albedo 1 seen from inside"}, MakeFurnace}};
  return entries;
}

}  // namespace

const std::vector<GeneratedScene>& GeneratedScenes() {
  static const std::vector<GeneratedScene> scenes = [] {
    std::vector<GeneratedScene> list;
    for (const Entry& entry : Entries()) list.push_back(entry.scene);
    return list;
  }();
  return scenes;
}

Result<Scene> GenerateScene(const std::string& name, const GenerateOptions& options) {
  constexpr uint32_t kFewest = 500, kMost = 50'000'000;
  if (options.vertices < kFewest || options.vertices > kMost) {
    return UsageError("generated scene '" + name + "': " + std::to_string(options.vertices) +
                      " vertices; choose between " + std::to_string(kFewest) + " and " +
                      std::to_string(kMost));
  }
  if (!std::isfinite(options.exponent) || options.exponent < 0) {
    return UsageError("generated scene '" + name + "': the exponent must be 0 (none) or positive");
  }
  std::string known;
  for (const Entry& entry : Entries()) {
    if (entry.scene.name == name) return entry.make(options);
    known += (known.empty() ? "" : ", ") + entry.scene.name;
  }
  return UsageError("no generated scene is called '" + name + "'; choose one of: " + known);
}

}  // namespace glint
