#include "coordinator/slice_error.h"

#include <algorithm>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <utility>

#include "common/archive/blend.h"
#include "common/archive/lobe_codec.h"
#include "common/archive/nested.h"
#include "common/base/frame.h"
#include "common/base/rng.h"
#include "common/domain/scatter_point.h"

namespace glint {
namespace {

constexpr int kHalves = 2;  ///< independent truths
constexpr int kPathsPerFan = 64;
constexpr int kDraws = 16;                 ///< of a slice, for one that is seen from outside
constexpr int kStages = kErrorCauses + 1;  ///< the truth, and the answer after each cause
constexpr int kTruth = 0;
constexpr int StageOf(ErrorCause cause) { return static_cast<int>(cause) + 1; }
constexpr int kArchive = StageOf(ErrorCause::kRays);

/// Uniform in a triangle.
glm::vec2 SampleTriangle(float u, float v) {
  const float root = std::sqrt(u);
  return {root * (1 - v), root * v};
}

SkyLight Sum(const std::vector<SkyLight>& layers) {
  SkyLight sum{};
  for (const SkyLight& light : layers) sum = sum + light;
  return sum;
}

/// Mean over skies and channels of d0 d1 / ((archive^2 + truth^2) / 2 + epsilon^2).
class RelativeProduct {
 public:
  RelativeProduct(const SkyLight& truth0, const SkyLight& truth1, const SkyLight& archive, double epsilon) {
    for (int s = 0; s < kSkiesPerSlice; ++s) {
      const glm::dvec3 t = 0.5 * (glm::dvec3(truth0[s]) + glm::dvec3(truth1[s])), a(archive[s]);
      scale_[s] = 1.0 / (3.0 * kSkiesPerSlice * (0.5 * (t * t + a * a) + epsilon * epsilon));
    }
  }
  double operator()(const SkyLight& d0, const SkyLight& d1) const {
    double sum = 0;
    for (int s = 0; s < kSkiesPerSlice; ++s)
      sum += glm::dot(glm::dvec3(d0[s]) * glm::dvec3(d1[s]), scale_[s]);
    return sum;
  }

 private:
  std::array<glm::dvec3, kSkiesPerSlice> scale_;
};

/// Columns of the diffuse tables.
uint16_t SideColumn(const TestSlice& slice) { return slice.point.back ? 1 : 0; }

}  // namespace

/// [half][stage][layer]
struct SliceTester::Answers {
  std::array<std::array<std::vector<SkyLight>, kStages>, kHalves> light;

  explicit Answers(int layers) {
    for (auto& half : light)
      for (auto& stage : half) stage.assign(layers, SkyLight{});
  }
};

namespace {

std::vector<FanLight> LightFromPaths(const PathFan& fan, int layers) {
  std::vector<FanLight> light(layers);
  for (int layer = 1; layer < layers; ++layer) light[layer] = IndirectLightOf(fan, layer);
  return light;
}

/// A fan's light as it is: no lobe stands in for it. Paths under the face bring none.
void AddPaths(const PathFan& fan, const glm::vec3& weight, const TestSlice& slice,
              std::vector<SkyLight>* out) {
  const float share = 1.0f / static_cast<float>(std::max<size_t>(fan.paths.size(), 1));
  for (const FanPath& path : fan.paths) {
    if (!path.leaves || path.layer < 0) continue;
    const glm::vec3 beta = weight * path.beta * share;
    for (int s = 0; s < kSkiesPerSlice; ++s)
      (*out)[path.layer][s] += beta * slice.skies[s].Radiance(path.escape);
  }
}

/// The same read out as lobes.
/// @param lobe  the unoccluded one as the archive reads it
void AddReadOut(const PathFan& fan, std::span<FanLight> light, const TransferLobe& lobe,
                const ReadOut& read_out, const TestSlice& slice, std::vector<SkyLight>* out) {
  std::vector<DirectLobe> visible = ReadOutDirect(fan, read_out);
  if (visible.empty()) visible.emplace_back();
  for (const DirectLobe& direct : visible)
    if (direct.fraction > 0)
      AddReflected({lobe.alpha * direct.fraction, UnitOr(lobe.mu + direct.shift, lobe.mu),
                    std::min(lobe.kappa * direct.kappa_ratio, kMaxKappa), lobe.cosine},
                   slice.point.normal, slice.skies, &(*out)[0]);
  for (size_t layer = 1; layer < out->size(); ++layer)
    for (const IndirectLobe& read : ReadOutIndirect(fan.lobe, read_out, &light[layer]))
      AddReflected({lobe.alpha * read.alpha, read.mu, read.kappa, false}, slice.point.normal, slice.skies,
                   &(*out)[layer]);
}

/// Point of a sequence that all fans of one half share: what they have in common, noise too, cancels in their
/// differences.
FanSeed SeedOf(uint64_t seed, const TestSlice& slice, int half, uint32_t fan) {
  CounterRng rng(seed, slice.index, static_cast<uint32_t>(half), 0x48616C66u);
  const float x = rng.Uniform(), y = rng.Uniform();
  return {seed, slice.index, fan | static_cast<uint32_t>(half) << 16, {x, y}};
}

}  // namespace

SliceTester::SliceTester(const BakeDomain& domain, const RayScene& rays, const DirectionGrid& grid,
                         std::span<const LayerViews> layers, uint64_t seed, const ReadOut& read_out)
    : domain_(domain),
      rays_(rays),
      grid_(grid),
      layers_(layers),
      seed_(seed),
      read_out_(read_out),
      every_layer_(layers.size(), 1),
      reader_(domain, grid),
      tracer_(domain, rays, static_cast<int>(layers.size()) - 1) {
  double sum = 0;
  for (size_t i = 0; i < domain.triangles.size(); ++i) {
    const auto& t = domain.triangles[i];
    const glm::dvec3 a(domain.positions[t[0]]), b(domain.positions[t[1]]), c(domain.positions[t[2]]);
    sum += glm::length(glm::cross(b - a, c - a)) * (domain.triangle_double_sided[i] ? 2 : 1);
    area_up_to_.push_back(sum);
  }
}

bool SliceTester::Draw(uint32_t index, TestSlice* slice) const {
  if (area_up_to_.empty() || !(area_up_to_.back() > 0)) return false;
  CounterRng rng(seed_, index, 0, 0x536C6963u);
  slice->index = index;
  slice->skies.clear();
  for (int s = 0; s < kSkiesPerSlice; ++s) slice->skies.emplace_back(&rng);
  bool drawn = false;
  for (int i = 0; i < kDraws && !(drawn && SeenFromOutside(slice->point)); ++i)
    drawn = DrawPoint(&rng, &slice->point);
  return drawn;
}

bool SliceTester::DrawPoint(CounterRng* rng, TransferPoint* point) const {
  const double area = area_up_to_.back() * (rng->Uniform() + 0x1p-24 * rng->Uniform());
  const auto found = std::upper_bound(area_up_to_.begin(), area_up_to_.end() - 1, area);
  const auto triangle = static_cast<uint32_t>(found - area_up_to_.begin());
  const float side = rng->Uniform();
  const bool back = domain_.triangle_double_sided[triangle] != 0 && side < 0.5f;
  const glm::vec3 face = domain_.FaceNormal(triangle) * (back ? -1.0f : 1.0f);
  const float a = rng->Uniform(), b = rng->Uniform(), u = rng->Uniform(), v = rng->Uniform();
  const glm::vec2 place = SampleTriangle(a, b);
  return reader_.Prepare(triangle, place.x, place.y, SampleCosine(face, {u, v}), point);
}

bool SliceTester::SeenFromOutside(const TransferPoint& point) const {
  Ray ray;
  ray.origin = PointOf(point).side.origin;
  ray.direction = point.wo;
  return !rays_.Occluded(ray);
}

SkyLight SliceTester::Predict(const TestSlice& slice) const {
  Answers answers(layers());
  AskArchive(slice, 0, &answers);
  return Sum(answers.light[0][kArchive]);
}

SliceError SliceTester::Test(const TestSlice& slice, double epsilon, bool causes) const {
  Answers answers(layers());
  for (int half = 0; half < kHalves; ++half) {
    AskOwn(slice, half, causes, &answers);
    if (causes) AskDirections(slice, half, &answers);
    if (causes) AskVertices(slice, half, &answers);
    AskArchive(slice, half, &answers);
  }
  return Compare(answers, epsilon, causes);
}

SliceError SliceTester::Compare(const Answers& answers, double epsilon, bool causes) const {
  const auto &first = answers.light[0], &second = answers.light[1];
  std::array<SkyLight, kStages> all[kHalves];
  for (int half = 0; half < kHalves; ++half)
    for (int stage = 0; stage < kStages; ++stage) all[half][stage] = Sum(answers.light[half][stage]);
  const RelativeProduct relative(all[0][kTruth], all[1][kTruth], all[0][kArchive], epsilon);
  auto square = [&](int from, int to) {
    return relative(all[0][to] - all[0][from], all[1][to] - all[1][from]);
  };
  auto layer_square = [&](int from, int to, int j) {
    return relative(first[to][j] - first[from][j], second[to][j] - second[from][j]);
  };

  SliceError error;
  error.all = square(kTruth, kArchive);
  for (int j = 0; j < layers(); ++j) error.layer.push_back(layer_square(kTruth, kArchive, j));
  if (!causes) return error;
  error.layer_causes.resize(layers());
  for (int c = 0; c < kErrorCauses; ++c) {
    error.all_causes[c] = square(c, c + 1);
    for (int j = 0; j < layers(); ++j) error.layer_causes[j][c] = layer_square(c, c + 1, j);
  }
  return error;
}

SlicePoint SliceTester::PointOf(const TransferPoint& point) const {
  Hit hit;
  hit.triangle = point.triangle, hit.u = point.u, hit.v = point.v;
  const auto& t = domain_.triangles[point.triangle];
  glm::vec3 position(0);
  for (int i = 0; i < 3; ++i) position += point.vertex_weight[i] * domain_.positions[t[i]];
  const glm::vec3 face = domain_.FaceNormal(point.triangle) * (point.back ? -1.0f : 1.0f);
  const auto shape = static_cast<uint32_t>(BrdfAt(domain_, hit).shape - domain_.shapes.data());
  return {{position + face * rays_.epsilon(), point.normal, face}, shape, kNone};
}

/// At the very point and direction: the truth, its read-out, and that stored.
void SliceTester::AskOwn(const TestSlice& slice, int half, bool causes, Answers* answers) const {
  const TransferPoint& point = slice.point;
  const SlicePoint own = PointOf(slice.point);
  auto& light = answers->light[half];
  ProbeTables tables(layers(), domain_.max_lobes(), 1, read_out_);
  tables.BeginRow();
  PathFan fan;
  auto ask = [&](int slot, uint16_t column, const glm::vec3& weight, const TransferLobe& lobe) {
    tracer_.Trace(own, point.wo, slot, kPathsPerFan,
                  SeedOf(seed_, slice, half, static_cast<uint32_t>(slot + 1)), &fan);
    AddPaths(fan, weight, slice, &light[kTruth]);
    if (!causes) return;
    std::vector<FanLight> indirect = LightFromPaths(fan, layers());
    AddReadOut(fan, indirect, lobe, {0, read_out_.slice_lobes, read_out_.lobe_tolerance}, slice,
               &light[StageOf(ErrorCause::kLobes)]);
    tables.Add(slot, column, fan, indirect, every_layer_);
  };
  const BrdfSlice fitted = tracer_.sampler(own.shape).Fitted(point.cos_o);
  for (int k = 0; k < fitted.lobes; ++k) {
    const glm::vec3 weight = fitted.lobe[k].Weight(point.specular);
    ask(k, 0, weight, {weight, point.lobe_mu[k], point.slice.lobe[k].kappa, false});
  }
  if (point.diffuse_albedo != glm::vec3(0))
    ask(PathFanTracer::kDiffuse, SideColumn(slice), point.diffuse_albedo,
        {point.diffuse_albedo, point.normal, kCosineKappa, true});
  if (!causes) return;
  TransferPoint read = point;
  read.rows = 1;
  read.row = {0};
  read.row_weight = {1};
  read.column = {0, 0, 0};
  read.corner_weight = {1};
  Read(tables, read, slice, &light[StageOf(ErrorCause::kBits)]);
}

/// A point's slices of the directions around a slice's, and its diffuse one.
struct SliceTester::Row {
  SlicePoint point;
  bool diffuse = false;
  DirectionGrid::Location around;  ///< no slice is needed, nor there, where a weight is 0
  uint32_t row = 0;                ///< in nested tables: whose directions stand in for those
  uint32_t id = 0;                 ///< 1: the very point's; 2 + i: of its i-th bake vertex
};

/// One slot of one of a row's slices.
struct SliceTester::RowSlice {
  int slot;
  uint16_t column;  ///< of the tables
  glm::vec3 wo;
  std::vector<uint8_t> layers;  ///< those that need it
  uint32_t id;                  ///< of its paths
};

/// What the archive's tables would hold of a row, so that the slice is read from it as from them: by slot,
/// then column.
std::vector<SliceTester::RowSlice> SliceTester::SlicesOf(const Row& row) const {
  std::vector<RowSlice> slices;
  const int lobes = tracer_.sampler(row.point.shape).lobes();
  if (!grid_.nested()) {
    for (int k = 0; k < lobes; ++k)
      for (uint16_t j = 0; j < 3; ++j)
        if (row.around.weight[j] > 0)
          slices.push_back({k, j, grid_.direction(row.around.index[j]), every_layer_,
                            static_cast<uint32_t>(j) << 4 | static_cast<uint32_t>(k)});
    return slices;
  }
  std::map<std::pair<int, uint16_t>, std::vector<uint8_t>> needed;
  const auto above = [&](uint32_t d) { return glm::dot(row.point.side.normal, grid_.direction(d)) > 0; };
  for (int layer = 0; layer < layers(); ++layer)
    for (int k = 0; k < lobes; ++k) {
      const SliceTableView::RowView stored = layers_[layer].specular[k].Row(row.row);
      VisitStandIns(
          grid_, grid_.level(), row.around.triangle, row.around.weight, above,
          [&](uint32_t d) { return stored.empty() ? nullptr : stored.Find(d); },
          [&](uint32_t d, float, const std::byte*) {
            std::vector<uint8_t>& by = needed[{k, static_cast<uint16_t>(d)}];
            by.resize(every_layer_.size(), 0);
            by[layer] = 1;
          });
    }
  for (auto& [place, by] : needed) {
    const uint32_t id = static_cast<uint32_t>(slices.size()) & 0xFFu;
    slices.push_back({place.first, place.second, grid_.direction(place.second), std::move(by), id});
  }
  return slices;
}

ProbeTables SliceTester::TablesAround() const {
  if (grid_.nested()) return {layers(), domain_.max_lobes(), grid_, read_out_};
  return {layers(), domain_.max_lobes(), 3, read_out_};
}

/// At the very point, for the grid's directions around; in nested tables, for those that the heaviest
/// bake vertex has.
void SliceTester::AskDirections(const TestSlice& slice, int half, Answers* answers) const {
  const std::span share(slice.point.row_weight.data(), slice.point.Rows().size());
  const auto nearest = std::max_element(share.begin(), share.end()) - share.begin();
  Row row{PointOf(slice.point), slice.point.diffuse_albedo != glm::vec3(0), grid_.Locate(slice.point.wo),
          slice.point.row[nearest], 1};
  float total = 0;
  for (int j = 0; j < 3; ++j) {
    const glm::vec3& wo = grid_.direction(row.around.index[j]);
    if (glm::dot(row.point.side.normal, wo) <= 0) row.around.weight[j] = 0;
    total += row.around.weight[j];
  }
  TransferPoint read = slice.point;
  read.rows = 1;
  read.row = {0};
  read.row_weight = {1};
  read.column = {0, 1, 2};
  read.grid_triangle = row.around.triangle;
  read.row_normal[0] = row.point.side.normal;
  read.whole = {};
  read.corner_weight = {};
  for (int j = 0; j < 3 && total > 0; ++j) read.corner_weight[j] = row.around.weight[j] / total;
  ProbeTables tables = TablesAround();
  GatherRow(slice, row, half, &tables, nullptr);
  Read(tables, read, slice, &answers->light[half][StageOf(ErrorCause::kAngular)]);
}

/// At the bake vertices around, for the grid's directions around: from paths, and from the archive's layers
/// below.
void SliceTester::AskVertices(const TestSlice& slice, int half, Answers* answers) const {
  ProbeTables paths = TablesAround(), below = paths;
  const TransferPoint& point = slice.point;
  TransferPoint read = point;
  for (uint32_t i = 0; i < static_cast<uint32_t>(point.rows); ++i) {
    const uint32_t r = point.row[i];
    read.row[i] = i;
    const float* weight = &point.corner_weight[3 * i];
    const Row row{tracer_.AtVertex(r, point.back),
                  domain_.Row(r).diffuse != glm::vec3(0),
                  {point.column, {weight[0], weight[1], weight[2]}, point.grid_triangle},
                  r,
                  2 + i};
    GatherRow(slice, row, half, &paths, &below);
  }
  read.column = {0, 1, 2};
  Read(paths, read, slice, &answers->light[half][StageOf(ErrorCause::kSpatial)]);
  Read(below, read, slice, &answers->light[half][StageOf(ErrorCause::kBelow)]);
}

void SliceTester::AskArchive(const TestSlice& slice, int half, Answers* answers) const {
  LayerLobes lobes;
  for (int layer = 0; layer < layers(); ++layer) {
    reader_.Read(slice.point, layers_[layer], layer, &lobes);
    for (int i = 0; i < lobes.count; ++i)
      AddReflected(lobes.lobe[i], slice.point.normal, slice.skies, &answers->light[half][kArchive][layer]);
  }
}

/// @param below  gets the slices with what is gathered from the archive; may be null
void SliceTester::GatherRow(const TestSlice& slice, const Row& row, int half, ProbeTables* paths,
                            ProbeTables* below) const {
  PathFan fan;
  auto add = [&](const RowSlice& part) {
    tracer_.Trace(row.point, part.wo, part.slot, kPathsPerFan,
                  SeedOf(seed_, slice, half, row.id << 8 | part.id), &fan);
    std::vector<FanLight> light = LightFromPaths(fan, layers());
    paths->Add(part.slot, part.column, fan, light, part.layers);
    if (below != nullptr) below->Add(part.slot, part.column, fan, light = LightFromBelow(fan), part.layers);
  };
  paths->BeginRow();
  if (below != nullptr) below->BeginRow();
  for (const RowSlice& part : SlicesOf(row)) add(part);
  if (row.diffuse)
    add({PathFanTracer::kDiffuse, SideColumn(slice), row.point.side.normal, every_layer_, 0xF0u});
}

void SliceTester::Read(const ProbeTables& tables, const TransferPoint& point, const TestSlice& slice,
                       std::vector<SkyLight>* light) const {
  LayerLobes lobes;
  for (int layer = 0; layer < layers(); ++layer) {
    const ProbeTables::LayerTables finished = tables.Finish(layer, layers_[layer]);
    reader_.Read(point, finished.views, layer, &lobes);
    for (int i = 0; i < lobes.count; ++i)
      AddReflected(lobes.lobe[i], slice.point.normal, slice.skies, &(*light)[layer]);
  }
}

/// What gathering finds where a fan's rays meet surfaces: each layer's light as the archive has it.
std::vector<FanLight> SliceTester::LightFromBelow(const PathFan& fan) const {
  std::vector<FanLight> light(layers());
  TransferPoint point;
  LayerLobes lobes;
  for (const FanPath& path : fan.paths) {
    for (FanLight& l : light) l.leaving += path.leaves;
    if (!path.leaves || !path.hit.hit()) continue;
    if (!reader_.Prepare(path.hit.triangle, path.hit.u, path.hit.v, -path.direction, &point)) continue;
    for (int layer = 1; layer < layers(); ++layer) {
      reader_.Read(point, layers_[layer - 1], layer - 1, &lobes);
      glm::vec3 alpha(0), moment(0);
      for (int i = 0; i < lobes.count; ++i) {
        const TransferLobe& lobe = lobes.lobe[i];
        alpha += lobe.alpha;
        moment += Luminance(lobe.alpha) * (1 - DeltaFromKappa(lobe.kappa)) * lobe.mu;
      }
      light[layer].samples.Add(alpha, moment);
    }
  }
  return light;
}

}  // namespace glint
