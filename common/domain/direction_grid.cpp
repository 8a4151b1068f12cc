#include "common/domain/direction_grid.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <map>
#include <numeric>
#include <utility>

#include "common/base/octahedral.h"

namespace glint {
namespace {

/// Octahedral map of a unit direction to [0, 1]^2.
glm::vec2 Octahedral(const glm::vec3& d) { return OctahedralFromDirection(d) * 0.5f + 0.5f; }

uint32_t SpreadBits(uint32_t x) {
  x = (x | (x << 8)) & 0x00FF00FFu;
  x = (x | (x << 4)) & 0x0F0F0F0Fu;
  x = (x | (x << 2)) & 0x33333333u;
  return (x | (x << 1)) & 0x55555555u;
}

uint32_t OctahedralMorton(const glm::vec3& d) {
  const glm::vec2 p = glm::clamp(Octahedral(d) * 65535.0f, glm::vec2(0), glm::vec2(65535));
  return SpreadBits(static_cast<uint32_t>(p.x)) | (SpreadBits(static_cast<uint32_t>(p.y)) << 1);
}

struct Geodesic {
  std::vector<glm::dvec3> points;
  std::vector<std::array<uint32_t, 3>> faces;
};

Geodesic Icosahedron() {
  const double g = (1 + std::sqrt(5.0)) / 2;
  Geodesic mesh;
  mesh.points = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                 {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (glm::dvec3& p : mesh.points) p = glm::normalize(p);
  // Faces are the triples of mutually nearest points, oriented outwards.
  const double edge = glm::dot(mesh.points[0], mesh.points[1]) - 1e-9;
  for (uint32_t a = 0; a < 12; ++a)
    for (uint32_t b = a + 1; b < 12; ++b)
      for (uint32_t c = b + 1; c < 12; ++c) {
        const glm::dvec3 &pa = mesh.points[a], &pb = mesh.points[b], &pc = mesh.points[c];
        if (glm::dot(pa, pb) < edge || glm::dot(pb, pc) < edge || glm::dot(pa, pc) < edge) continue;
        if (glm::dot(pa, glm::cross(pb, pc)) > 0) {
          mesh.faces.push_back({a, b, c});
        } else {
          mesh.faces.push_back({a, c, b});
        }
      }
  return mesh;
}

/// Splits every face into four at the edges' midpoints, pushed out to the sphere.
Geodesic Subdivide(const Geodesic& coarse) {
  Geodesic fine;
  fine.points = coarse.points;
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> midpoints;
  auto midpoint = [&](uint32_t a, uint32_t b) {
    const auto [it, added] =
        midpoints.try_emplace(std::minmax(a, b), static_cast<uint32_t>(fine.points.size()));
    if (added) fine.points.push_back(glm::normalize(coarse.points[a] + coarse.points[b]));
    return it->second;
  };
  for (const auto& [a, b, c] : coarse.faces) {
    const uint32_t ab = midpoint(a, b), bc = midpoint(b, c), ca = midpoint(c, a);
    fine.faces.insert(fine.faces.end(), {{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}});
  }
  return fine;
}

}  // namespace

DirectionGrid::DirectionGrid(int level) : level_(std::clamp(level, 0, kMaxLevel)) {
  Geodesic mesh = Icosahedron();
  for (int i = 0; i < level_; ++i) mesh = Subdivide(mesh);

  std::vector<uint32_t> order(mesh.points.size());
  std::iota(order.begin(), order.end(), 0u);
  std::vector<uint32_t> code(order.size());
  for (uint32_t i = 0; i < code.size(); ++i) code[i] = OctahedralMorton(glm::vec3(mesh.points[i]));
  std::stable_sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return code[a] < code[b]; });
  std::vector<uint32_t> rank(order.size());
  directions_.resize(order.size());
  for (uint32_t i = 0; i < order.size(); ++i) {
    rank[order[i]] = i;
    directions_[i] = glm::vec3(mesh.points[order[i]]);
  }
  triangles_.reserve(mesh.faces.size());
  for (const auto& f : mesh.faces) triangles_.push_back({rank[f[0]], rank[f[1]], rank[f[2]]});
  BuildLocator();
}

void DirectionGrid::BuildLocator() {
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> face_of_edge;  // directed edge -> the face on its left
  for (uint32_t t = 0; t < triangles_.size(); ++t)
    for (int i = 0; i < 3; ++i) face_of_edge[{triangles_[t][i], triangles_[t][(i + 1) % 3]}] = t;
  cells_.resize(triangles_.size());
  for (uint32_t t = 0; t < triangles_.size(); ++t) {
    const auto& f = triangles_[t];
    // In double precision: the corners of a fine triangle are nearly parallel.
    const glm::dvec3 corner[3] = {glm::dvec3(directions_[f[0]]), glm::dvec3(directions_[f[1]]),
                                  glm::dvec3(directions_[f[2]])};
    Cell& cell = cells_[t];
    cell = {};
    cell.index = f;
    const double volume = glm::dot(corner[0], glm::cross(corner[1], corner[2]));
    for (int i = 0; i < 3; ++i) {
      const int j = (i + 1) % 3, k = (i + 2) % 3;
      const glm::vec3 edge(glm::cross(corner[j], corner[k]) / volume);
      const glm::vec3& d = directions_[f[i]];
      cell.neighbour[i] = face_of_edge.at({f[k], f[j]});
      cell.edge_x[i] = edge.x, cell.edge_y[i] = edge.y, cell.edge_z[i] = edge.z;
      cell.x[i] = d.x, cell.y[i] = d.y, cell.z[i] = d.z;
    }
  }
  // Start the walk near the answer: for a grid of octahedral squares, the triangle at the square's centre.
  squares_ = 8 << level_;
  std::vector<uint32_t> start(static_cast<size_t>(squares_) * squares_);
  uint32_t current = 0;
  std::array<float, 4> weights;
  for (int y = 0; y < squares_; ++y) {
    for (int x = 0; x < squares_; ++x) {
      const glm::vec2 p((x + 0.5f) / squares_ * 2 - 1, (y + 0.5f) / squares_ * 2 - 1);
      current = Walk(DirectionFromOctahedral(p), current, &weights);
      start[static_cast<size_t>(y) * squares_ + x] = current;
    }
  }
  start_ = std::move(start);
}

DirectionGrid::Location DirectionGrid::Locate(const glm::vec3& direction) const {
  const glm::vec2 p = Octahedral(direction) * static_cast<float>(squares_);
  const int x = std::clamp(static_cast<int>(p.x), 0, squares_ - 1),
            y = std::clamp(static_cast<int>(p.y), 0, squares_ - 1);
  uint32_t start = start_[static_cast<size_t>(y) * squares_ + x];
  return Locate(direction, &start);
}

int DirectionGrid::LevelOf(uint32_t directions) {
  for (int level = 0; level <= kMaxLevel; ++level)
    if (directions == 10u * (1u << (2 * level)) + 2) return level;
  return -1;
}

}  // namespace glint
