#include "common/scene/mesh_builder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>

#include "common/scene/normals.h"

namespace glint {
namespace {

constexpr double kTau = 2 * std::numbers::pi;

glm::dvec2 EvaluateSpline(std::span<const glm::dvec2> control, double t) {
  const int spans = static_cast<int>(control.size()) - 3;
  const double x = t * spans;
  const int i = std::clamp(static_cast<int>(std::floor(x)), 0, spans - 1);
  const double f = x - i, g = 1 - f;
  return (g * g * g * control[i] + (3 * f * f * f - 6 * f * f + 4) * control[i + 1] +
          (3 * g * g * g - 6 * g * g + 4) * control[i + 2] + f * f * f * control[i + 3]) /
         6.0;
}

}  // namespace

std::vector<glm::dvec2> SampleSpline(std::span<const glm::dvec2> control, int count, double bend,
                                     std::vector<double>* parameters) {
  constexpr int kFine = 8192;
  std::vector<glm::dvec2> fine(kFine + 1);
  for (int i = 0; i <= kFine; ++i) fine[i] = EvaluateSpline(control, double(i) / kFine);
  double total_length = 0;
  for (int i = 0; i < kFine; ++i) total_length += glm::distance(fine[i], fine[i + 1]);

  std::vector<double> measure(kFine + 1, 0.0);
  for (int i = 0; i < kFine; ++i) {
    double step = glm::distance(fine[i], fine[i + 1]);
    if (i > 0) {
      const glm::dvec2 d0 = fine[i] - fine[i - 1], d1 = fine[i + 1] - fine[i];
      step += bend * total_length * std::abs(std::atan2(d0.x * d1.y - d0.y * d1.x, glm::dot(d0, d1)));
    }
    measure[i + 1] = measure[i] + step;
  }

  std::vector<glm::dvec2> points(count);
  if (parameters) parameters->resize(count);
  for (int k = 0, i = 0; k < count; ++k) {
    const double wanted = measure[kFine] * k / (count - 1);
    while (i + 1 < kFine && measure[i + 1] < wanted) ++i;
    const double width = measure[i + 1] - measure[i];
    const double t = k == count - 1 ? 1.0 : (i + (width > 0 ? (wanted - measure[i]) / width : 0)) / kFine;
    points[k] = EvaluateSpline(control, t);
    if (parameters) (*parameters)[k] = t;
  }
  return points;
}

TubeSize SizeTube(double vertices, double length, double circumference) {
  const int columns =
      std::max(8, static_cast<int>(std::lround(std::sqrt(vertices * circumference / length))));
  return {std::max(4, static_cast<int>(std::lround(vertices / columns))), columns};
}

uint16_t MeshBuilder::AddMaterial(const Material& material) {
  scene_.materials.push_back(material);
  return static_cast<uint16_t>(scene_.materials.size() - 1);
}

uint32_t MeshBuilder::AddVertex(const glm::dvec3& position, uint16_t material) {
  scene_.positions.emplace_back(position);
  scene_.vertex_material.push_back(material);
  return vertex_count() - 1;
}

void MeshBuilder::AddTriangle(uint32_t a, uint32_t b, uint32_t c, uint16_t material) {
  if (a == b || b == c || c == a) return;  // at a pole, where a ring is one vertex
  scene_.triangles.push_back({a, b, c});
  scene_.triangle_material.push_back(material);
}

void MeshBuilder::AddTube(std::span<const Ring> rings, int columns, bool closed, uint16_t material) {
  std::vector<std::vector<uint32_t>> index(rings.size(), std::vector<uint32_t>(columns));
  for (size_t row = 0; row < rings.size(); ++row) {
    const Ring& ring = rings[row];
    for (int column = 0; column < columns; ++column) {
      if (ring.radius == 0 && column > 0) {
        index[row][column] = index[row][0];
        continue;
      }
      const double phi = kTau * column / columns;
      index[row][column] =
          AddVertex(ring.center + ring.radius * (std::cos(phi) * ring.a + std::sin(phi) * ring.b), material);
    }
  }
  for (size_t row = 0; row + (closed ? 0 : 1) < rings.size(); ++row) {
    const auto& lower = index[row];
    const auto& upper = index[(row + 1) % rings.size()];
    for (int column = 0; column < columns; ++column) {
      const int next = (column + 1) % columns;
      AddTriangle(lower[column], lower[next], upper[next], material);
      AddTriangle(lower[column], upper[next], upper[column], material);
    }
  }
}

void MeshBuilder::AddPatch(const glm::dvec3& corner, const glm::dvec3& e_u, const glm::dvec3& e_v, int rows,
                           int columns, uint16_t material) {
  const uint32_t first = vertex_count();
  for (int row = 0; row < rows; ++row) {
    for (int column = 0; column < columns; ++column) {
      AddVertex(corner + e_u * (double(column) / (columns - 1)) + e_v * (double(row) / (rows - 1)), material);
    }
  }
  for (int row = 0; row + 1 < rows; ++row) {
    for (int column = 0; column + 1 < columns; ++column) {
      const uint32_t a = first + row * columns + column, b = a + columns;
      AddTriangle(a, a + 1, b + 1, material);
      AddTriangle(a, b + 1, b, material);
    }
  }
}

void MeshBuilder::AddStarShape(int n, const std::function<glm::dvec3(const glm::dvec3&)>& place,
                               uint16_t material) {
  std::map<std::array<int, 3>, uint32_t> welded;  // by lattice point on the cube [0, n]^3
  const auto vertex = [&](const std::array<int, 3>& lattice) {
    const auto [it, added] = welded.try_emplace(lattice, 0);
    if (added) {
      glm::dvec3 d;
      for (int k = 0; k < 3; ++k) d[k] = std::tan((2.0 * lattice[k] / n - 1) * std::numbers::pi / 4);
      it->second = AddVertex(place(glm::normalize(d)), material);
    }
    return it->second;
  };
  for (int axis = 0; axis < 3; ++axis) {
    for (int side = 0; side <= 1; ++side) {
      // Lattice axes (s, t) of this face, ordered so that s x t points outwards.
      const int s = side ? (axis + 1) % 3 : (axis + 2) % 3, t = side ? (axis + 2) % 3 : (axis + 1) % 3;
      const auto at = [&](int i, int j) {
        std::array<int, 3> lattice{};
        lattice[axis] = side * n;
        lattice[s] = i;
        lattice[t] = j;
        return vertex(lattice);
      };
      for (int j = 0; j < n; ++j) {
        for (int i = 0; i < n; ++i) {
          AddTriangle(at(i, j), at(i + 1, j), at(i + 1, j + 1), material);
          AddTriangle(at(i, j), at(i + 1, j + 1), at(i, j + 1), material);
        }
      }
    }
  }
}

Scene MeshBuilder::Finish(const Camera& camera) {
  scene_.normals = AngleWeightedNormals(scene_.positions, scene_.triangles);
  scene_.uvs.assign(scene_.positions.size(), glm::vec2(0));
  scene_.colors.assign(scene_.positions.size(), glm::vec4(1));
  scene_.cameras = {camera};
  scene_.content = HashScene(scene_);
  return std::move(scene_);
}

}  // namespace glint
