#include "coordinator/spatial/vertex_hierarchy.h"

#include <OpenMesh/Core/Mesh/TriMesh_ArrayKernelT.hh>
#include <algorithm>
#include <cmath>
#include <glm/ext/vector_double3.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <utility>

namespace glint {
namespace {

constexpr int kMaxLevels = 24;
constexpr size_t kLeastVertices = 48;
constexpr double kMaxFaceTurn = 0.5;      ///< cosine
constexpr float kMaxNormalTurn = 0.5f;    ///< cosine
constexpr double kStraightBorder = 0.87;  ///< cosine
constexpr double kLeastShape = 0.08;      ///< of a triangle: 1 if equilateral, 0 without area
constexpr unsigned kMostNeighbours = 12;
constexpr float kLeastWeight = 0.02f;  ///< parents with less have no say

struct Traits : OpenMesh::DefaultTraits {
  using Point = OpenMesh::Vec3d;
  VertexAttributes(OpenMesh::Attributes::Status);
  HalfedgeAttributes(OpenMesh::Attributes::Status | OpenMesh::Attributes::PrevHalfedge);
  EdgeAttributes(OpenMesh::Attributes::Status);
  FaceAttributes(OpenMesh::Attributes::Status);
};
using Mesh = OpenMesh::TriMesh_ArrayKernelT<Traits>;
using Vertex = Mesh::VertexHandle;
using Halfedge = Mesh::HalfedgeHandle;

glm::dvec3 ToGlm(const Mesh::Point& p) { return {p[0], p[1], p[2]}; }

/// Twice the area times the normal.
glm::dvec3 Cross(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  return glm::cross(b - a, c - a);
}

/// 1 for an equilateral triangle, 0 for one without area.
double Shape(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const double edges = glm::dot(b - a, b - a) + glm::dot(c - b, c - b) + glm::dot(a - c, a - c);
  return edges > 0 ? 2 * std::sqrt(3.0) * glm::length(Cross(a, b, c)) / edges : 0;
}

class Coarsening {
 public:
  explicit Coarsening(const BakeDomain& domain) : domain_(domain) {
    out_.welded = WeldVertices(domain);
    out_.level.assign(domain.vertex_count(), 0);
    out_.parents.resize(domain.vertex_count());
    out_.area.assign(domain.vertex_count(), 0);
  }

  VertexHierarchy Run() {
    Build();
    std::vector<std::vector<uint32_t>> taken;  // finest first
    while (static_cast<int>(taken.size()) < kMaxLevels && alive_ > kLeastVertices) {
      std::vector<uint32_t> pass = Pass();
      if (pass.empty()) break;
      alive_ -= pass.size();
      taken.push_back(std::move(pass));
    }
    out_.levels = static_cast<int>(taken.size());
    for (size_t i = 0; i < taken.size(); ++i)
      for (const uint32_t v : taken[i]) out_.level[v] = static_cast<uint8_t>(taken.size() - i);
    return std::move(out_);
  }

 private:
  /// A vertex that may go: along this half-edge.
  struct Collapse {
    double cost;
    uint32_t vertex;
    Halfedge halfedge;
  };

  void Build() {
    // What it has to say of faces that do not fit is counted here.
    omerr().disable();
    handle_.resize(domain_.vertex_count());
    for (uint32_t v = 0; v < domain_.vertex_count(); ++v) {
      if (out_.welded[v] != v) continue;
      const glm::vec3& p = domain_.positions[v];
      handle_[v] = mesh_.add_vertex({p.x, p.y, p.z});
      vertex_.push_back(v);
    }
    locked_.assign(vertex_.size(), 0);
    for (const auto& t : domain_.triangles) {
      const uint32_t a = out_.welded[t[0]], b = out_.welded[t[1]], c = out_.welded[t[2]];
      if (a == b || b == c || c == a) {
        ++out_.degenerate;
        continue;
      }
      if (mesh_.add_face(handle_[a], handle_[b], handle_[c]).is_valid()) continue;
      ++out_.non_manifold;
      for (const uint32_t v : {a, b, c}) locked_[handle_[v].idx()] = 1;
    }
    omerr().enable();
    alive_ = vertex_.size();
  }

  /// Takes away an independent set of vertices, as large as the rules allow; flattest first.
  std::vector<uint32_t> Pass() {
    std::vector<Collapse> candidates;
    for (const Vertex v : mesh_.vertices())
      if (const auto best = BestCollapse(v)) candidates.push_back(*best);
    std::sort(candidates.begin(), candidates.end(), [](const Collapse& a, const Collapse& b) {
      return std::pair(a.cost, a.vertex) < std::pair(b.cost, b.vertex);
    });
    std::vector<uint8_t> stays(vertex_.size(), 0);
    std::vector<uint32_t> taken;
    for (const Collapse& c : candidates) {
      const Vertex v = handle_[c.vertex];
      if (stays[v.idx()]) continue;
      // What a neighbour lost since may forbid what was best.
      std::optional<Collapse> now = c;
      for (const Vertex n : mesh_.vv_range(v)) {
        if (!stays[n.idx()]) continue;
        now = BestCollapse(v);
        break;
      }
      if (!now) continue;
      for (const Vertex n : mesh_.vv_range(v)) stays[n.idx()] = 1;
      Take(v, now->halfedge);
      taken.push_back(c.vertex);
    }
    return taken;
  }

  std::optional<Collapse> BestCollapse(Vertex v) {
    if (mesh_.status(v).deleted() || locked_[v.idx()] || mesh_.is_isolated(v)) return std::nullopt;
    const std::optional<double> turn = Turn(v);
    if (!turn) return std::nullopt;
    std::optional<Collapse> best;
    for (const Halfedge h : mesh_.voh_range(v)) {
      const std::optional<double> shape = WorstShape(v, h);
      if (!shape) continue;
      const double cost = *turn + 0.05 * (1 - *shape);
      if ((!best || cost < best->cost) && MayCollapse(v, h)) best = Collapse{cost, vertex_[v.idx()], h};
    }
    return best;
  }

  const glm::vec3& Normal(Vertex v) const { return domain_.normals[vertex_[v.idx()]]; }
  glm::dvec3 Position(Vertex v) const { return ToGlm(mesh_.point(v)); }

  /// Whether the mesh stays one. Asks for more of it than shapes do, so that they come first.
  bool MayCollapse(Vertex v, Halfedge h) {
    const Vertex to = mesh_.to_vertex_handle(h);
    return KeepsBorder(v, h) && mesh_.valence(v) + mesh_.valence(to) <= kMostNeighbours + 4 &&
           mesh_.is_collapse_ok(h);
  }

  /// Mean of 1 - cosine between a vertex's normal and its neighbours'; none if one is too far away.
  std::optional<double> Turn(Vertex v) const {
    double turn = 0;
    unsigned neighbours = 0;
    for (const Vertex n : mesh_.vv_range(v)) {
      const float cosine = glm::dot(Normal(v), Normal(n));
      if (cosine < kMaxNormalTurn) return std::nullopt;
      turn += 1 - cosine;
      ++neighbours;
    }
    return turn / neighbours;
  }

  /// Shape of the worst face around v once it is at the end of h; none if one turns too far, or is too thin.
  std::optional<double> WorstShape(Vertex v, Halfedge h) const {
    const Vertex to = mesh_.to_vertex_handle(h);
    double worst = 1;
    for (const auto face : mesh_.vf_range(v)) {
      if (face == mesh_.face_handle(h) || face == mesh_.face_handle(mesh_.opposite_halfedge_handle(h)))
        continue;
      std::array<glm::dvec3, 3> before, after;
      int i = 0;
      for (const Vertex corner : mesh_.fv_range(face)) {
        before[i] = Position(corner);
        after[i++] = Position(corner == v ? to : corner);
      }
      const glm::dvec3 n0 = Cross(before[0], before[1], before[2]), n1 = Cross(after[0], after[1], after[2]);
      if (glm::dot(n0, n1) <= kMaxFaceTurn * glm::length(n0) * glm::length(n1)) return std::nullopt;
      worst = std::min(worst, Shape(after[0], after[1], after[2]));
      if (worst < kLeastShape) return std::nullopt;
    }
    return worst;
  }

  /// Vertices of a border go along it only, where it is straight.
  bool KeepsBorder(Vertex v, Halfedge h) const {
    if (!mesh_.is_boundary(v)) return true;
    if (!mesh_.is_boundary(mesh_.edge_handle(h))) return false;
    const Halfedge out = mesh_.halfedge_handle(v);  // the border's, by the kernel's rule
    const glm::dvec3 a = Position(mesh_.to_vertex_handle(out)) - Position(v);
    const glm::dvec3 b = Position(v) - Position(mesh_.from_vertex_handle(mesh_.prev_halfedge_handle(out)));
    return glm::dot(a, b) > kStraightBorder * glm::length(a) * glm::length(b);
  }

  void Take(Vertex v, Halfedge h) {
    const Vertex to = mesh_.to_vertex_handle(h);
    std::vector<std::array<Vertex, 3>> patch;
    double area = 0;
    for (const auto face : mesh_.vf_range(v)) {
      std::array<Vertex, 3> corner;
      int i = 0;
      bool kept = true;
      for (const Vertex c : mesh_.fv_range(face)) {
        kept = kept && c != to;
        corner[i++] = c;
      }
      area += glm::length(Cross(Position(corner[0]), Position(corner[1]), Position(corner[2]))) / 6;
      std::replace(corner.begin(), corner.end(), v, to);
      if (kept) patch.push_back(corner);
    }
    const uint32_t id = vertex_[v.idx()];
    out_.area[id] = static_cast<float>(area);
    out_.parents[id] = Predict(Position(v), to, patch);
    mesh_.collapse(h);
  }

  /// Weights of the corners of that triangle of the patch which is nearest.
  std::vector<Parent> Predict(const glm::dvec3& p, Vertex to,
                              const std::vector<std::array<Vertex, 3>>& patch) {
    double nearest = INFINITY;
    std::array<Vertex, 3> corner{to, to, to};
    glm::dvec3 weight(1, 0, 0);
    for (const auto& t : patch) {
      const glm::dvec3 a = Position(t[0]), b = Position(t[1]), c = Position(t[2]);
      const glm::dvec3 n = Cross(a, b, c);
      const double size = glm::dot(n, n);
      if (!(size > 0)) continue;
      glm::dvec3 w(glm::dot(Cross(p, b, c), n) / size, glm::dot(Cross(p, c, a), n) / size, 0);
      w.z = 1 - w.x - w.y;
      w = glm::max(w, glm::dvec3(0));
      w /= w.x + w.y + w.z;
      const glm::dvec3 off = w.x * a + w.y * b + w.z * c - p;
      if (glm::dot(off, off) >= nearest) continue;
      nearest = glm::dot(off, off);
      corner = t;
      weight = w;
    }
    std::vector<Parent> parents;
    double sum = 0;
    for (int i = 0; i < 3; ++i)
      if (weight[i] >= kLeastWeight) sum += weight[i];
    for (int i = 0; i < 3; ++i)
      if (weight[i] >= kLeastWeight)
        parents.push_back({vertex_[corner[i].idx()], static_cast<float>(weight[i] / sum)});
    return parents;
  }

  const BakeDomain& domain_;
  VertexHierarchy out_;
  Mesh mesh_;
  std::vector<Vertex> handle_;    ///< of each vertex that is the first of its kind
  std::vector<uint32_t> vertex_;  ///< of each handle
  std::vector<uint8_t> locked_;   ///< of each handle
  size_t alive_ = 0;
};

}  // namespace

VertexHierarchy BuildHierarchy(const BakeDomain& domain) { return Coarsening(domain).Run(); }

}  // namespace glint
