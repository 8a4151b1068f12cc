#include "coordinator/spatial/refine.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "common/base/parallel.h"
#include "common/scene/ray_scene.h"
#include "coordinator/spatial/predictions.h"
#include "coordinator/spatial/vertex_hierarchy.h"
#include "coordinator/spatial/visibility_masks.h"

namespace glint {
namespace {

/// Square of the error inside a face, of that in the middle of an edge whose ends' views it is an even chance
/// which it has: most of what changes does so gradually. Measured on a teapot and goblets: between 0.1 and
/// 0.4 vertices and error are on one curve, and the less is looked at the better.
constexpr double kOfEnds = 0.2;
/// Faces are large, and tested inside whatever their corners see, above this part of the surface.
constexpr double kLargeFace = 1.0 / 512;
constexpr int kMaxSplitRounds = FacetTree::kMaxDepth;

/// Of each node the first that is the same in all that counts.
std::vector<uint32_t> SameNodes(const std::vector<uint32_t>& welded, const FacetTree& facets) {
  std::vector<uint32_t> same = welded;
  same.insert(same.end(), facets.welded_middles().begin(), facets.welded_middles().end());
  return same;
}

class Refinement {
 public:
  Refinement(const BakeSettings& settings, int threads, const RayScene& rays, BakeDomain* domain)
      : settings_(settings),
        threads_(threads),
        domain_(*domain),
        hierarchy_(BuildHierarchy(domain_)),
        masks_(domain_, rays) {
    predictions_.Resize(domain_.vertex_count());
    double diagonal = 0;
    if (!domain_.positions.empty()) {
      glm::vec3 low = domain_.positions[0], high = low;
      for (const glm::vec3& p : domain_.positions) low = glm::min(low, p), high = glm::max(high, p);
      diagonal = glm::length(glm::dvec3(high) - glm::dvec3(low));
    }
    shortest_ = diagonal * settings.smallest_edge;
    used_.assign(domain_.vertex_count(), 0);
    for (const auto& t : domain_.triangles) {
      total_area_ += Area(t);
      for (const uint32_t v : t) used_[hierarchy_.welded[v]] = 1;
    }
  }

  Result<RefinementReport> Run() {
    BakeCoarsest();
    for (int level = 1; level <= hierarchy_.levels; ++level) RefineLevel(level);
    GLINT_RETURN_IF_ERROR(RefineFaces());
    const std::vector<uint32_t> same = SameNodes(hierarchy_.welded, domain_.nodes.facets);
    domain_.nodes = predictions_.Finish(domain_, same);
    report_.levels = static_cast<uint32_t>(hierarchy_.levels);
    report_.tested = masks_.known();
    report_.baked = domain_.nodes.rows.size();
    report_.middles = domain_.nodes.facets.middles().size();
    report_.degenerate = hierarchy_.degenerate;
    report_.non_manifold = hierarchy_.non_manifold;
    return report_;
  }

 private:
  /// A node that may be baked, what it would be predicted from, and the surface that it stands for.
  struct Candidate {
    uint32_t node;
    std::vector<Parent> parents;
    double area;
    double weighed = 0;  ///< square of the error, by how much of the surface it is about
  };

  /// Two nodes, the smaller one first.
  using Edge = std::pair<uint32_t, uint32_t>;

  double Area(const std::array<uint32_t, 3>& corner) const {
    const glm::dvec3 a(domain_.NodePosition(corner[0]));
    return 0.5 * glm::length(glm::cross(glm::dvec3(domain_.NodePosition(corner[1])) - a,
                                        glm::dvec3(domain_.NodePosition(corner[2])) - a));
  }
  double Tolerance2() const {
    return static_cast<double>(settings_.spatial_tolerance) * settings_.spatial_tolerance;
  }
  /// How much an error over this area matters: as much as its part of the surface, in units of what a bake
  /// vertex stands for on average.
  double Share(double area) const { return area * static_cast<double>(predictions_.baked()) / total_area_; }
  bool Full() const { return settings_.max_vertices > 0 && predictions_.baked() >= settings_.max_vertices; }

  void BakeCoarsest() {
    std::vector<uint32_t> nodes;
    for (uint32_t v = 0; v < domain_.vertex_count(); ++v)
      if (hierarchy_.welded[v] == v && hierarchy_.level[v] == 0 && used_[v]) nodes.push_back(v);
    masks_.Look(nodes, threads_);
    for (const uint32_t v : nodes) predictions_.Bake(v, masks_.Dark(v));
  }

  /// A level's vertices: they are baked, or predicted from those of the levels before.
  void RefineLevel(int level) {
    std::vector<Candidate> candidates;
    for (uint32_t v = 0; v < domain_.vertex_count(); ++v) {
      if (hierarchy_.welded[v] != v || hierarchy_.level[v] != level) continue;
      predictions_.Predict(v, hierarchy_.parents[v]);
      candidates.push_back({v, hierarchy_.parents[v], hierarchy_.area[v]});
    }
    Test(std::move(candidates));
  }

  /// Bakes candidates that are predicted badly, worst first.
  void Test(std::vector<Candidate> candidates) {
    if (candidates.empty() || Full()) return;
    std::vector<uint32_t> nodes;
    nodes.reserve(candidates.size());
    for (const Candidate& c : candidates) nodes.push_back(c.node);
    masks_.Look(nodes, threads_);
    ParallelFor(candidates.size(), threads_, 64, [&](size_t i, int) {
      Candidate& c = candidates[i];
      c.weighed = Share(c.area) * masks_.SquareError(c.node, predictions_.Combine(c.parents));
    });
    std::stable_sort(candidates.begin(), candidates.end(),
                     [](const Candidate& a, const Candidate& b) { return a.weighed > b.weighed; });
    for (const Candidate& c : candidates) {
      if (c.weighed <= Tolerance2() || Full()) break;
      if (!masks_.Dark(c.node)) predictions_.Bake(c.node, false);
    }
  }

  /// Halves edges of faces inside which predictions may fail, round by round.
  Status RefineFaces() {
    std::vector<uint32_t> splits, faces(domain_.triangles.size());
    std::iota(faces.begin(), faces.end(), 0);
    for (int round = 1; round <= kMaxSplitRounds && !Full(); ++round) {
      const std::vector<uint32_t> active = ActiveFaces(faces);
      if (active.empty()) break;
      const size_t before = splits.size();
      splits.insert(splits.end(), active.begin(), active.end());
      GLINT_ASSIGN_OR_RETURN(splits,
                             FacetTree::Balance(domain_.triangles, hierarchy_.welded, std::move(splits)));
      GLINT_RETURN_IF_ERROR(Split(splits));
      Test(NewMiddles());
      faces = UnsplitChildren(splits, before);
    }
    return {};
  }

  /// Faces to be split.
  std::vector<uint32_t> ActiveFaces(const std::vector<uint32_t>& faces) {
    std::vector<uint32_t> candidates, looked;
    std::vector<Edge> edges;
    for (const uint32_t face : faces) {
      const std::array<uint32_t, 3>& corner = Corners(face);
      if (!CanBeSplit(corner) || !MayCount(Area(corner))) continue;
      candidates.push_back(face);
      for (int i = 0; i < 3; ++i) edges.push_back(EdgeOf(corner, i)), looked.push_back(edges.back().first);
    }
    for (const Edge& edge : edges) looked.push_back(edge.second);
    masks_.Look(looked, threads_);
    std::sort(edges.begin(), edges.end());
    edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
    std::vector<double> error(edges.size());
    ParallelFor(edges.size(), threads_, 64, [&](size_t i, int) {
      error[i] = kOfEnds * masks_.SquareErrorBetween(edges[i].first, edges[i].second);
    });
    std::erase_if(candidates, [&](uint32_t face) {
      const double area = Area(Corners(face));
      if (area > kLargeFace * total_area_) return false;
      double worst = 0;
      for (int i = 0; i < 3; ++i) {
        const auto edge = std::lower_bound(edges.begin(), edges.end(), EdgeOf(Corners(face), i));
        worst = std::max(worst, error[edge - edges.begin()]);
      }
      return worst * Share(area) <= Tolerance2();
    });
    return candidates;
  }

  bool CanBeSplit(const std::array<uint32_t, 3>& corner) const {
    const auto& [a, b, c] = corner;
    return std::max({Distance(a, b), Distance(b, c), Distance(c, a)}) >= 2 * shortest_;
  }
  /// Whether it matters over such an area what is seen.
  bool MayCount(double area) const {
    return area > kLargeFace * total_area_ || kOfEnds * Share(area) > Tolerance2();
  }

  Edge EdgeOf(const std::array<uint32_t, 3>& corner, int i) const {
    return std::minmax({Same(corner[i]), Same(corner[(i + 1) % 3])});
  }

  Status Split(const std::vector<uint32_t>& splits) {
    GLINT_ASSIGN_OR_RETURN(domain_.nodes.facets,
                           FacetTree::Make(domain_.triangles, hierarchy_.welded, splits));
    domain_.nodes.splits = splits;
    const size_t nodes = domain_.vertex_count() + domain_.nodes.facets.middles().size();
    first_new_ = static_cast<uint32_t>(predictions_.nodes());
    predictions_.Resize(nodes);
    masks_.Turn();
    return {};
  }

  /// The last round's nodes, predicted from the ends of the edges that they halve.
  std::vector<Candidate> NewMiddles() {
    constexpr double kAreaOfEdge = 0.43;  ///< half of the two equilateral triangles over it
    std::vector<Candidate> candidates;
    for (uint32_t node = first_new_; node < predictions_.nodes(); ++node) {
      if (Same(node) != node) continue;
      const auto& ends = domain_.nodes.facets.middles()[node - domain_.vertex_count()].ends;
      const std::vector<Parent> parents = {{Same(ends[0]), 0.5f}, {Same(ends[1]), 0.5f}};
      const double edge = Distance(ends[0], ends[1]);
      predictions_.Predict(node, parents);
      candidates.push_back({node, parents, kAreaOfEdge * edge * edge});
    }
    return candidates;
  }

  /// Children of the splits from `first` on that are not split themselves.
  std::vector<uint32_t> UnsplitChildren(const std::vector<uint32_t>& splits, size_t first) const {
    std::vector<uint32_t> children, sorted = splits;
    std::sort(sorted.begin(), sorted.end());
    for (size_t s = first; s < splits.size(); ++s)
      for (size_t i = 0; i < 4; ++i) {
        const auto child = static_cast<uint32_t>(domain_.triangles.size() + 4 * s + i);
        if (!std::binary_search(sorted.begin(), sorted.end(), child)) children.push_back(child);
      }
    return children;
  }

  const std::array<uint32_t, 3>& Corners(uint32_t element) const {
    const FacetTree& facets = domain_.nodes.facets;
    return facets.unsplit() ? domain_.triangles[element] : facets.corners(element);
  }
  uint32_t Same(uint32_t node) const {
    return node < domain_.vertex_count()
               ? hierarchy_.welded[node]
               : domain_.nodes.facets.welded_middles()[node - domain_.vertex_count()];
  }
  double Distance(uint32_t a, uint32_t b) const {
    return glm::length(glm::dvec3(domain_.NodePosition(a)) - glm::dvec3(domain_.NodePosition(b)));
  }

  const BakeSettings& settings_;
  const int threads_;
  BakeDomain& domain_;
  const VertexHierarchy hierarchy_;
  VisibilityMasks masks_;
  Predictions predictions_;
  std::vector<uint8_t> used_;  ///< of each vertex: some triangle has it
  double total_area_ = 0, shortest_ = 0;
  uint32_t first_new_ = 0;  ///< node, of the last split's
  RefinementReport report_;
};

}  // namespace

Result<RefinementReport> RefineVertices(const BakeSettings& settings, int threads, BakeDomain* domain) {
  const RayScene rays(domain->positions, domain->triangles, 1);
  GLINT_RETURN_IF_ERROR(rays.status());
  return Refinement(settings, threads, rays, domain).Run();
}

Status SubdivideEvenly(int times, BakeDomain* domain) {
  const std::vector<uint32_t> welded = WeldVertices(*domain);
  std::vector<uint32_t> splits;
  uint64_t begin = 0, end = domain->triangles.size();
  for (int i = 0; i < times; ++i) {
    for (uint64_t e = begin; e < end; ++e) {
      if (splits.size() > FacetTree::kMaxNodes) return LimitExceeded("too many faces; subdivide less often");
      splits.push_back(static_cast<uint32_t>(e));
    }
    begin = end;
    end = domain->triangles.size() + 4 * splits.size();
  }
  GLINT_ASSIGN_OR_RETURN(domain->nodes, SplitNodes(*domain, std::move(splits)));
  const std::vector<uint32_t> same = SameNodes(welded, domain->nodes.facets);
  std::vector<uint8_t> used(same.size(), 0);
  for (const auto& t : domain->triangles)
    for (const uint32_t v : t) used[same[v]] = 1;
  Predictions predictions;
  predictions.Resize(same.size());
  for (uint32_t node = 0; node < same.size(); ++node)
    if (same[node] == node && (node >= domain->vertex_count() || used[node])) predictions.Bake(node, false);
  domain->nodes = predictions.Finish(*domain, same);
  return {};
}

}  // namespace glint
