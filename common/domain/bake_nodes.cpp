#include "common/domain/bake_nodes.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <string>
#include <unordered_map>
#include <utility>

#include "common/domain/bake_domain.h"

namespace glint {
namespace {

/// All that two vertices must share for their slices to be the same.
std::string SlicesKey(const BakeDomain& domain, uint32_t v) {
  const glm::vec3 &p = domain.positions[v], &n = domain.normals[v], &d = domain.diffuse[v];
  const float numbers[6] = {p.x, p.y, p.z, n.x, n.y, n.z};
  const uint16_t kinds[3] = {domain.shape[v], domain.double_sided[v], d.x + d.y + d.z > 0};
  std::string key(sizeof numbers + sizeof kinds, '\0');
  std::memcpy(key.data(), numbers, sizeof numbers);
  std::memcpy(key.data() + sizeof numbers, kinds, sizeof kinds);
  return key;
}

/// Little-endian numbers, one after another.
class NumberWriter {
 public:
  template <class T>
  void Add(T value) {
    const auto* bytes = reinterpret_cast<const std::byte*>(&value);
    out_.insert(out_.end(), bytes, bytes + sizeof value);
  }
  std::vector<std::byte> Take() { return std::move(out_); }

 private:
  std::vector<std::byte> out_;
};

/// Reads them back; what is past the end is 0, and remembered.
class NumberReader {
 public:
  explicit NumberReader(std::span<const std::byte> bytes) : rest_(bytes) {}
  template <class T>
  T Next() {
    T value{};
    if (rest_.size() < sizeof value) {
      failed_ = true;
      return value;
    }
    std::memcpy(&value, rest_.data(), sizeof value);
    rest_ = rest_.subspan(sizeof value);
    return value;
  }
  /// Whether that many numbers of a size are there still.
  bool Has(uint64_t count, size_t size) const { return count <= rest_.size() / size; }
  bool Complete() const { return !failed_ && rest_.empty(); }

 private:
  std::span<const std::byte> rest_;
  bool failed_ = false;
};

Status DecodeRows(NumberReader* in, uint64_t rows, uint32_t node_count, BakeNodes* nodes) {
  if (!in->Has(rows, sizeof(uint32_t))) return BadInput("its rows are not there");
  uint64_t node = 0;
  for (uint64_t r = 0; r < rows; ++r) {
    const auto step = in->Next<uint32_t>();
    node += step;
    if ((r > 0 && step == 0) || node >= node_count) return BadInput("a row's node is out of range");
    nodes->rows.push_back(static_cast<uint32_t>(node));
  }
  return {};
}

Status DecodeWeights(NumberReader* in, uint64_t rows, uint32_t node_count, BakeNodes* nodes) {
  if (!in->Has(node_count, 1)) return BadInput("its nodes are not there");
  nodes->first.assign(1, 0);
  for (uint32_t n = 0; n < node_count; ++n) {
    const auto count = in->Next<uint8_t>();
    if (count > kMaxNodeRows) return BadInput("a node has too many rows");
    nodes->first.push_back(nodes->first.back() + count);
  }
  const uint64_t weights = nodes->first.back();
  if (!in->Has(weights, sizeof(uint32_t) + sizeof(uint16_t))) return BadInput("its weights are not there");
  nodes->weights.resize(weights);
  for (RowWeight& w : nodes->weights) {
    w.row = in->Next<uint32_t>();
    if (w.row >= rows) return BadInput("a node's row is out of range");
  }
  for (RowWeight& w : nodes->weights) w.weight = in->Next<uint16_t>();
  for (uint32_t n = 0; n < node_count; ++n) {
    uint32_t sum = 0;
    for (const RowWeight& w : nodes->RowsOf(n)) sum += w.weight;
    if (!nodes->RowsOf(n).empty() && sum != kWholeWeight) return BadInput("a node's weights do not add up");
  }
  return {};
}

}  // namespace

std::vector<uint32_t> WeldVertices(const BakeDomain& domain) {
  std::vector<uint32_t> welded(domain.vertex_count());
  std::unordered_map<std::string, uint32_t> first;
  for (uint32_t v = 0; v < domain.vertex_count(); ++v)
    welded[v] = first.try_emplace(SlicesKey(domain, v), v).first->second;
  return welded;
}

Result<BakeNodes> SplitNodes(const BakeDomain& domain, std::vector<uint32_t> splits) {
  BakeNodes nodes;
  if (!splits.empty()) {
    GLINT_ASSIGN_OR_RETURN(nodes.facets, FacetTree::Make(domain.triangles, WeldVertices(domain), splits));
  }
  nodes.splits = std::move(splits);
  nodes.first.assign(domain.vertex_count() + nodes.facets.middles().size() + 1, 0);
  return nodes;
}

std::vector<std::byte> EncodeNodes(const BakeNodes& nodes) {
  NumberWriter out;
  if (nodes.every_vertex()) return out.Take();
  out.Add(static_cast<uint32_t>(nodes.splits.size()));
  for (const uint32_t element : nodes.splits) out.Add(element);
  uint32_t before = 0;
  for (const uint32_t node : nodes.rows) out.Add(node - std::exchange(before, node));
  for (size_t n = 0; n + 1 < nodes.first.size(); ++n)
    out.Add(static_cast<uint8_t>(nodes.first[n + 1] - nodes.first[n]));
  for (const RowWeight& w : nodes.weights) out.Add(w.row);
  for (const RowWeight& w : nodes.weights) out.Add(w.weight);
  return out.Take();
}

Result<BakeNodes> DecodeNodes(std::span<const std::byte> raw, const BakeDomain& domain, uint64_t rows) {
  if (raw.empty()) {
    if (rows != domain.vertex_count()) return BadInput("every vertex is baked, but the rows are not as many");
    return BakeNodes{};
  }
  NumberReader in(raw);
  const auto count = in.Next<uint32_t>();
  if (!in.Has(count, sizeof(uint32_t))) return BadInput("its splits are not there");
  std::vector<uint32_t> splits(count);
  for (uint32_t& element : splits) element = in.Next<uint32_t>();
  GLINT_ASSIGN_OR_RETURN(BakeNodes nodes, SplitNodes(domain, std::move(splits)));
  const auto node_count = static_cast<uint32_t>(nodes.first.size() - 1);
  GLINT_RETURN_IF_ERROR(DecodeRows(&in, rows, node_count, &nodes));
  GLINT_RETURN_IF_ERROR(DecodeWeights(&in, rows, node_count, &nodes));
  if (!in.Complete()) return BadInput("it has a wrong size");
  return nodes;
}

}  // namespace glint
