#include "common/domain/facet_tree.h"

#include <algorithm>
#include <string>
#include <unordered_map>

#include "common/scene/scene.h"

namespace glint {
namespace {

constexpr uint8_t kAllEdges = 7;

uint64_t EdgeKey(uint32_t a, uint32_t b) {
  return static_cast<uint64_t>(std::min(a, b)) << 32 | std::max(a, b);
}

/// Parts that an element or facet with these halved edges falls into.
int PartCount(uint8_t cut) { return 1 + (cut & 1) + (cut >> 1 & 1) + (cut >> 2 & 1); }

/// The corner at which one (`one`) or two halved edges are looked at: opposite the one, or between the two.
int Pivot(uint8_t cut) {
  switch (cut) {
    case 1:
    case 6:
      return 0;
    case 2:
    case 5:
      return 1;
    default:
      return 2;
  }
}

/// Place of a node with these weights of a triangle's corners.
SurfacePlace PlaceOf(uint32_t triangle, const std::array<float, 3>& weight) {
  return {triangle, weight[1], weight[2]};
}

}  // namespace

/// Makes a tree: elements first, then the cuts.
class FacetTree::Builder {
 public:
  Builder(std::span<const std::array<uint32_t, 3>> triangles, std::span<const uint32_t> welded,
          FacetTree* tree)
      : vertices_(static_cast<uint32_t>(welded.size())), welded_(welded), tree_(*tree) {
    tree_.corners_.assign(triangles.begin(), triangles.end());
    tree_.child_.assign(triangles.size(), kLeaf);
    tree_.cut_.assign(triangles.size(), 0);
    owner_.resize(triangles.size());
    depth_.assign(triangles.size(), 0);
    for (uint32_t t = 0; t < triangles.size(); ++t) {
      owner_[t] = t;
      weights_.push_back({std::array<float, 3>{1, 0, 0}, {0, 1, 0}, {0, 0, 1}});
    }
  }

  Status Split(uint32_t element) {
    if (element >= tree_.corners_.size()) return BadInput("a split names no element");
    if (tree_.child_[element] != kLeaf) return BadInput("an element is split twice");
    if (depth_[element] >= kMaxDepth) return BadInput("an element is split too often");
    Divide(element, kAllEdges);
    return TooMany();
  }

  /// Cuts through what lies beside split elements.
  Status Conform() {
    const auto elements = static_cast<uint32_t>(tree_.corners_.size());
    for (uint32_t e = 0; e < elements; ++e) {
      if (tree_.child_[e] != kLeaf) continue;
      if (MustSplit(e)) return BadInput("neighbours are split more than once apart");
      uint8_t cut = 0;
      for (int i = 0; i < 3; ++i) {
        const auto [a, b] = Edge(e, i);
        if (Halved(a, b)) cut |= static_cast<uint8_t>(1 << i);
      }
      if (cut != 0) Divide(e, cut);
    }
    return TooMany();
  }

  /// Splits what lies beside elements that are split twice, and so on; appends what it split.
  Status Balance(std::vector<uint32_t>* splits) {
    for (bool changed = true; changed;) {
      changed = false;
      for (uint32_t e = 0; e < tree_.corners_.size(); ++e) {
        if (tree_.child_[e] != kLeaf || !MustSplit(e)) continue;
        GLINT_RETURN_IF_ERROR(Split(e));
        splits->push_back(e);
        changed = true;
      }
    }
    return {};
  }

 private:
  /// An edge's half is halved.
  bool MustSplit(uint32_t element) const {
    for (int i = 0; i < 3; ++i) {
      const auto [a, b] = Edge(element, i);
      const auto middle = halved_.find(EdgeKey(Weld(a), Weld(b)));
      if (middle != halved_.end() && (Halved(a, middle->second) || Halved(middle->second, b))) return true;
    }
    return false;
  }
  std::array<uint32_t, 2> Edge(uint32_t part, int opposite) const {
    const auto& c = tree_.corners_[part];
    return {c[(opposite + 1) % 3], c[(opposite + 2) % 3]};
  }
  uint32_t Weld(uint32_t node) const {
    return node < vertices_ ? welded_[node] : tree_.welded_middles_[node - vertices_];
  }
  bool Halved(uint32_t a, uint32_t b) const { return halved_.count(EdgeKey(Weld(a), Weld(b))) > 0; }
  Status TooMany() const {
    if (vertices_ + tree_.middles_.size() <= kMaxNodes) return {};
    return LimitExceeded("more than " + std::to_string(kMaxNodes) + " nodes; refine less");
  }

  void Divide(uint32_t part, uint8_t cut) {
    const std::array<uint32_t, 3> c = tree_.corners_[part];
    const std::array<std::array<float, 3>, 3> w = weights_[part];
    std::array<uint32_t, 3> m{};
    std::array<std::array<float, 3>, 3> mw{};
    for (int i = 0; i < 3; ++i) {
      if ((cut >> i & 1) == 0) continue;
      for (int k = 0; k < 3; ++k) mw[i][k] = 0.5f * (w[(i + 1) % 3][k] + w[(i + 2) % 3][k]);
      m[i] = Middle(part, i, mw[i]);
    }
    tree_.child_[part] = static_cast<uint32_t>(tree_.corners_.size());
    tree_.cut_[part] = cut;
    auto add = [&](uint32_t n0, const std::array<float, 3>& w0, uint32_t n1, const std::array<float, 3>& w1,
                   uint32_t n2, const std::array<float, 3>& w2) {
      tree_.corners_.push_back({n0, n1, n2});
      tree_.child_.push_back(kLeaf);
      tree_.cut_.push_back(0);
      owner_.push_back(owner_[part]);
      depth_.push_back(static_cast<uint8_t>(depth_[part] + 1));
      weights_.push_back({w0, w1, w2});
    };
    const int i = Pivot(cut), j = (i + 1) % 3, k = (i + 2) % 3;
    switch (PartCount(cut)) {
      case 4:
        add(c[0], w[0], m[2], mw[2], m[1], mw[1]);
        add(m[2], mw[2], c[1], w[1], m[0], mw[0]);
        add(m[1], mw[1], m[0], mw[0], c[2], w[2]);
        add(m[0], mw[0], m[1], mw[1], m[2], mw[2]);
        break;
      case 3:  // the corner between the halved edges, and the rest through the corner after it
        add(c[i], w[i], m[k], mw[k], m[j], mw[j]);
        add(c[j], w[j], c[k], w[k], m[j], mw[j]);
        add(c[j], w[j], m[j], mw[j], m[k], mw[k]);
        break;
      default:
        add(c[i], w[i], c[j], w[j], m[i], mw[i]);
        add(c[i], w[i], m[i], mw[i], c[k], w[k]);
    }
  }

  /// Node in the middle of a part's edge.
  uint32_t Middle(uint32_t part, int opposite, const std::array<float, 3>& weight) {
    const auto [a, b] = Edge(part, opposite);
    const uint32_t next = vertices_ + static_cast<uint32_t>(tree_.middles_.size());
    const auto [same, added] = middle_of_.try_emplace(EdgeKey(a, b), next);
    const uint32_t first = halved_.try_emplace(EdgeKey(Weld(a), Weld(b)), next).first->second;
    if (added) {
      tree_.middles_.push_back({PlaceOf(owner_[part], weight), kNone, {std::min(a, b), std::max(a, b)}});
      tree_.welded_middles_.push_back(first);
    }
    Meet(first, owner_[part]);
    if (same->second != first) Meet(same->second, owner_[part]);
    return same->second;
  }
  /// A middle lies on this triangle as well. Of more than two the first counts.
  void Meet(uint32_t node, uint32_t triangle) {
    FacetTree::Middle& middle = tree_.middles_[node - vertices_];
    if (triangle != middle.place.triangle) middle.across = std::min(middle.across, triangle);
  }

  const uint32_t vertices_;
  const std::span<const uint32_t> welded_;
  FacetTree& tree_;
  std::vector<uint32_t> owner_;                               ///< triangle of each part
  std::vector<uint8_t> depth_;                                ///< of each part
  std::vector<std::array<std::array<float, 3>, 3>> weights_;  ///< of each part's corners, in the triangle
  std::unordered_map<uint64_t, uint32_t> middle_of_;          ///< by the edge's nodes
  std::unordered_map<uint64_t, uint32_t> halved_;             ///< by the welded ones: the first middle
};

Result<FacetTree> FacetTree::Make(std::span<const std::array<uint32_t, 3>> triangles,
                                  std::span<const uint32_t> welded, std::span<const uint32_t> splits) {
  FacetTree tree;
  if (splits.empty()) return tree;
  Builder builder(triangles, welded, &tree);
  for (const uint32_t element : splits) GLINT_RETURN_IF_ERROR(builder.Split(element));
  GLINT_RETURN_IF_ERROR(builder.Conform());
  return tree;
}

Result<std::vector<uint32_t>> FacetTree::Balance(std::span<const std::array<uint32_t, 3>> triangles,
                                                 std::span<const uint32_t> welded,
                                                 std::vector<uint32_t> splits) {
  FacetTree tree;
  Builder builder(triangles, welded, &tree);
  for (const uint32_t element : splits) GLINT_RETURN_IF_ERROR(builder.Split(element));
  GLINT_RETURN_IF_ERROR(builder.Balance(&splits));
  return splits;
}

uint32_t FacetTree::Descend(uint32_t part, std::array<float, 3>* weight) const {
  std::array<float, 3>& b = *weight;
  while (child_[part] != kLeaf) {
    const uint32_t first = child_[part];
    const uint8_t cut = cut_[part];
    const int i = Pivot(cut), j = (i + 1) % 3, k = (i + 2) % 3;
    const float bi = b[i], bj = b[j], bk = b[k];
    switch (PartCount(cut)) {
      case 4: {
        int corner = 3;
        for (int c = 0; c < 3; ++c)
          if (b[c] >= 0.5f) corner = c;
        for (int c = 0; c < 3; ++c)
          b[c] = corner == 3 ? 1 - 2 * b[c] : 2 * b[c] - (c == corner ? 1.0f : 0.0f);
        part = first + static_cast<uint32_t>(corner);
        break;
      }
      case 3:
        if (bi >= 0.5f) {
          b = {2 * bi - 1, 2 * bj, 2 * bk};
          part = first;
        } else if (bk >= bi) {
          b = {bj, bk - bi, 2 * bi};
          part = first + 1;
        } else {
          b = {bj - bi + bk, 2 * bk, 2 * (bi - bk)};
          part = first + 2;
        }
        break;
      default:
        if (bj >= bk) {
          b = {bi, bj - bk, 2 * bk};
          part = first;
        } else {
          b = {bi, 2 * bj, bk - bj};
          part = first + 1;
        }
    }
  }
  return part;
}

}  // namespace glint
