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

DirectionGrid::DirectionGrid(int level, int base_level)
    : level_(std::clamp(level, 0, kMaxLevel)), base_level_(std::clamp(base_level, 0, level_)) {
  Geodesic mesh = Icosahedron();
  for (int i = 0; i < base_level_; ++i) mesh = Subdivide(mesh);
  levels_.push_back(mesh.faces);
  for (int i = base_level_; i < level_; ++i) {
    mesh = Subdivide(mesh);
    levels_.push_back(mesh.faces);
  }

  std::vector<uint32_t> order(mesh.points.size());
  std::iota(order.begin(), order.end(), 0u);
  std::vector<uint32_t> code(order.size());
  for (uint32_t i = 0; i < code.size(); ++i) code[i] = OctahedralMorton(glm::vec3(mesh.points[i]));
  const auto less = [&](uint32_t a, uint32_t b) { return code[a] < code[b]; };
  auto begin = order.begin();  // subdividing appends: levels already follow one another
  for (int i = base_level_; i <= level_; ++i) {
    const auto end = order.begin() + SizeOf(i);
    std::stable_sort(begin, end, less);
    begin = end;
  }
  std::vector<uint32_t> rank(order.size());
  directions_.resize(order.size());
  for (uint32_t i = 0; i < order.size(); ++i) {
    rank[order[i]] = i;
    directions_[i] = glm::vec3(mesh.points[order[i]]);
  }
  for (auto& faces : levels_)
    for (auto& f : faces) f = {rank[f[0]], rank[f[1]], rank[f[2]]};
  BuildMidpoints();
  BuildLocator();
}

void DirectionGrid::BuildMidpoints() {
  midpoints_.resize(size() - SizeOf(base_level_));
  std::vector<uint8_t> sides(midpoints_.size(), 0);
  for (int level = base_level_ + 1; level <= level_; ++level)
    for (uint32_t parent = 0; parent < triangles(level - 1).size(); ++parent)
      for (uint8_t edge = 0; edge < 3; ++edge) {
        const uint32_t direction = triangles(level)[4 * size_t{parent} + 3][edge];
        const uint32_t i = direction - SizeOf(base_level_);
        const auto& corner = triangles(level - 1)[parent];
        midpoints_[i].ends = {corner[edge], corner[(edge + 1) % 3]};
        midpoints_[i].triangle[sides[i]] = parent;
        midpoints_[i].edge[sides[i]++] = edge;
      }
}

void DirectionGrid::BuildLocator() {
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> face_of_edge;  // directed edge -> the face on its left
  const auto& triangles = levels_.back();
  for (uint32_t t = 0; t < triangles.size(); ++t)
    for (int i = 0; i < 3; ++i) face_of_edge[{triangles[t][i], triangles[t][(i + 1) % 3]}] = t;
  cells_.resize(triangles.size());
  for (uint32_t t = 0; t < triangles.size(); ++t) {
    const auto& f = triangles[t];
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
    if (directions == SizeOf(level)) return level;
  return -1;
}

}  // namespace glint
