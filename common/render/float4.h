#pragma once

#include <cstring>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

namespace glint {

/// Four floats in a vector register (a GCC and Clang extension): arithmetic is element by element.
using Float4 = float __attribute__((vector_size(16)));

inline Float4 LoadFloat4(const float* p) {
  Float4 v;
  std::memcpy(&v, p, sizeof v);
  return v;
}
inline Float4 LoadFloat4(const glm::vec4& p) { return LoadFloat4(&p.x); }
inline glm::vec3 ToVec3(Float4 v) { return {v[0], v[1], v[2]}; }

}  // namespace glint
