#include "coordinator/spatial/probe_rows.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>

#include "common/archive/lobe_codec.h"
#include "common/base/parallel.h"
#include "common/base/rng.h"
#include "common/round/task.h"
#include "coordinator/layer.h"
#include "coordinator/probe_tables.h"

namespace glint {
namespace {

constexpr double kEpsilon = 0.1;         ///< of the mean radiance, as in the estimate
constexpr double kLeastEpsilon = 1e-20;  ///< where everything is black

std::vector<SurfacePlace> PlacesOfVertices(const BakeDomain& domain) {
  std::vector<SurfacePlace> places(domain.vertex_count(), SurfacePlace{kNone, 0, 0});
  for (uint32_t t = 0; t < domain.triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) {
      SurfacePlace& place = places[domain.triangles[t][i]];
      if (place.triangle == kNone) place = {t, i == 1 ? 1.0f : 0.0f, i == 2 ? 1.0f : 0.0f};
    }
  return places;
}

std::vector<LobeSky> SkiesOf(uint64_t seed, uint32_t node) {
  CounterRng rng(seed, node, 0, 0x50726F62u);
  std::vector<LobeSky> skies;
  for (int s = 0; s < kSkiesPerSlice; ++s) skies.emplace_back(&rng);
  return skies;
}

}  // namespace

ProbeRows::ProbeRows(const Input& input)
    : input_(input),
      column_step_(std::max(1u, input.grid.size() / 2 / kDirections)),
      vertex_place_(PlacesOfVertices(*input.domain)) {
  for (int layer = 0; layer < kLayers; ++layer) rows_[layer].resize(LayoutOf(layer).count());
}

SlotLayout ProbeRows::LayoutOf(int layer) const {
  return {static_cast<uint32_t>(input_.domain->max_lobes()), input_.settings.StoredLobes(layer)};
}

Status ProbeRows::Compute(std::span<const uint32_t> nodes) {
  BakeDomain& domain = *input_.domain;
  domain.nodes.rows.assign(nodes.begin(), nodes.end());
  domain.nodes.first.assign(domain.vertex_count() + domain.nodes.facets.middles().size() + 1, 0);
  domain.nodes.weights.clear();
  for (int layer = 0; layer < kLayers; ++layer) {
    GLINT_ASSIGN_OR_RETURN(const Layer merged, RunLayer(layer));
    Append(layer, merged.views);
  }
  const size_t first = nodes_.size();
  row_of_.resize(domain.nodes.first.size() - 1, kNone);
  for (const uint32_t node : nodes) {
    row_of_[node] = static_cast<uint32_t>(nodes_.size());
    nodes_.push_back(node);
  }
  GLINT_RETURN_IF_ERROR(FinishTables());
  domain.nodes.rows = nodes_;
  for (size_t row = first; row < nodes_.size(); ++row) dark_.push_back(FindDark(static_cast<uint32_t>(row)));
  reader_ = std::make_unique<TransferReader>(domain, input_.grid);
  if (first == 0) FindEpsilon(nodes);
  return {};
}

Result<Layer> ProbeRows::RunLayer(int layer) {
  const BakeDomain& domain = *input_.domain;
  const Digest nodes = HashNodes(domain.nodes);
  std::vector<TaskSpec> tasks;
  for (uint32_t v = 0; v < domain.row_count(); v += input_.vertices_per_task) {
    const GatherBlock block{v, std::min(input_.vertices_per_task, domain.row_count() - v), 0,
                            input_.grid.size(), column_step_};
    tasks.push_back({TaskKey(input_.bake_key, nodes, layer, block, Digest{}), layer, block});
  }
  for (int attempt = 0;; ++attempt) {
    GLINT_RETURN_IF_ERROR(input_.executor->Run({tasks, nullptr}, [](size_t, bool) {}));
    Result<Layer> merged = MergeLayer(*input_.store, tasks, domain, input_.grid, LayoutOf(layer).slice_lobes,
                                      kDefaultTableForm, input_.threads);
    if (merged.ok() || merged.status().kind() != ErrorKind::kMismatch || attempt > 0) return merged;
  }
}

void ProbeRows::Append(int layer, const LayerViews& views) {
  const SlotLayout layout = LayoutOf(layer);
  for (uint32_t slot = 0; slot < layout.count(); ++slot) {
    const SliceTableView& table = views.table(slot / layout.stride(), slot % layout.stride());
    BlockRows& rows = rows_[layer][slot];
    for (uint32_t r = 0; r < table.rows(); ++r) {
      rows.BeginRow();
      table.Row(r).ForEach([&](uint32_t column, const std::byte* entry) {
        std::copy_n(entry, table.entry_bytes(),
                    rows.AddEntry(static_cast<uint16_t>(column), table.entry_bytes()));
      });
    }
  }
}

Status ProbeRows::FinishTables() {
  for (int layer = 0; layer < kLayers; ++layer) {
    const SlotLayout layout = LayoutOf(layer);
    tables_[layer].clear();
    views_[layer] = {};
    const uint32_t entry_bytes = layer == 0 ? kDirectEntryBytes : kIndirectEntryBytes;
    for (uint32_t slot = 0; slot < layout.count(); ++slot) {
      const bool diffuse = layout.is_diffuse(slot);
      tables_[layer].push_back(MakeTable(rows_[layer][slot], diffuse ? 2 : input_.grid.size(), entry_bytes,
                                         kDefaultTableForm));
      GLINT_ASSIGN_OR_RETURN(const SliceTableView view, SliceTableView::Parse(tables_[layer].back()));
      views_[layer].Add(slot / layout.stride(), diffuse, view);
    }
  }
  return {};
}

bool ProbeRows::FindDark(uint32_t row) const {
  for (const SliceTableView& table : views_[1].specular)
    if (!table.RowEmpty(row)) return false;
  if (!views_[1].diffuse.RowEmpty(row)) return false;
  const BakeVertex vertex = input_.domain->Node(nodes_[row]);
  auto blocked = [&](const SliceTableView& table, uint32_t column) {
    const std::byte* entry = table.Find(row, column);
    return entry != nullptr && DecodeDirect(entry).fraction <= 0;
  };
  if (views_[0].specular.empty()) return blocked(views_[0].diffuse, 0);
  for (uint32_t column = 0; column < input_.grid.size(); column += column_step_) {
    const float cosine = glm::dot(vertex.normal, input_.grid.direction(column));
    const bool seen = cosine > 0 || (cosine < 0 && vertex.double_sided);
    if (seen && !blocked(views_[0].specular[0], column)) return false;
  }
  return true;
}

SurfacePlace ProbeRows::PlaceOf(uint32_t node) const {
  const BakeDomain& domain = *input_.domain;
  return node < domain.vertex_count() ? vertex_place_[node]
                                      : domain.nodes.facets.middles()[node - domain.vertex_count()].place;
}

SkyLight ProbeRows::Light(const SurfacePlace& place, const glm::vec3& wo, std::span<const RowWeight> rows,
                          const std::vector<LobeSky>& skies, bool* defined) const {
  SkyLight light{};
  TransferPoint point;
  *defined = reader_->Prepare(place, wo, rows, &point);
  if (!*defined) return light;
  LayerLobes lobes;
  for (int layer = 0; layer < kLayers; ++layer) {
    reader_->Read(point, views_[layer], layer, &lobes);
    for (int i = 0; i < lobes.count; ++i) AddReflected(lobes.lobe[i], point.normal, skies, &light);
  }
  return light;
}

void ProbeRows::FindEpsilon(std::span<const uint32_t> nodes) {
  double sum = 0, count = 0;
  for (const uint32_t node : nodes) {
    const RowWeight own{row_of_[node], kWholeWeight};
    const std::vector<LobeSky> skies = SkiesOf(input_.settings.seed, node);
    for (uint32_t column = 0; column < input_.grid.size(); column += 8 * column_step_) {
      bool defined = false;
      const SkyLight light = Light(PlaceOf(node), input_.grid.direction(column), {&own, 1}, skies, &defined);
      if (!defined) continue;
      for (const glm::vec3& l : light) sum += (l.x + l.y + l.z) / 3;
      count += kSkiesPerSlice;
    }
  }
  epsilon_ = std::max(count > 0 ? kEpsilon * sum / count : 0, kLeastEpsilon);
}

double ProbeRows::SquareError(uint32_t node, std::span<const Parent> prediction) const {
  const RowWeight own{row_of_[node], kWholeWeight};
  std::vector<RowWeight> rows;
  for (const Parent& p : prediction)
    rows.push_back({row_of_[p.node], static_cast<uint16_t>(p.weight * static_cast<float>(kWholeWeight))});
  const BakeVertex vertex = input_.domain->Node(node);
  const SurfacePlace place = PlaceOf(node);
  const std::vector<LobeSky> skies = SkiesOf(input_.settings.seed, node);
  double sum = 0, weights = 0;
  for (uint32_t column = 0; column < input_.grid.size(); column += column_step_) {
    const glm::vec3& wo = input_.grid.direction(column);
    const float cosine = glm::dot(vertex.normal, wo);
    if (cosine <= 0 && !vertex.double_sided) continue;
    bool defined = false;
    const SkyLight computed = Light(place, wo, {&own, 1}, skies, &defined);
    if (!defined) continue;
    const SkyLight predicted = Light(place, wo, rows, skies, &defined);
    const double weight = std::abs(cosine);
    for (int s = 0; s < kSkiesPerSlice; ++s)
      for (int c = 0; c < 3; ++c) {
        const double p = predicted[s][c], t = computed[s][c];
        sum += weight * (p - t) * (p - t) / (0.5 * (p * p + t * t) + epsilon_ * epsilon_);
      }
    weights += 3.0 * kSkiesPerSlice * weight;
  }
  return weights > 0 ? sum / weights : 0;
}

}  // namespace glint
