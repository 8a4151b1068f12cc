#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/scene/gltf_document.h"

namespace glint {

/// Elements of an accessor as floats, `components` a piece; normalized integers are already in [-1, 1] or [0,
/// 1].
struct FloatArray {
  int components = 0;
  std::vector<float> values;
  size_t count() const { return components ? values.size() / components : 0; }
};

/// Reads accessors[index] with every bound checked in 64 bits, sparse substitutions applied, all values
/// finite.
/// @param object what asks for it ("meshes[2].primitives[0].attributes.NORMAL"), for messages
/// @param max_count most elements to accept (kLimit beyond); an accessor without a buffer view, which is
/// zeros that take no bytes of the file, may have 2^20
/// @param wanted the elements to read, ascending; null: all
Result<FloatArray> ReadFloats(const GltfDocument& document, GltfBytes& bytes, int index,
                              const std::string& object, int min_components, int max_components,
                              uint64_t max_count, const std::vector<uint32_t>* wanted);

/// The same for unsigned scalars: triangle indices.
Result<std::vector<uint32_t>> ReadIndices(const GltfDocument& document, GltfBytes& bytes, int index,
                                          const std::string& object, uint64_t max_count);

/// accessors[index], or an error if there is none.
Result<const tinygltf::Accessor*> FindAccessor(const GltfDocument& document, int index,
                                               const std::string& object);

}  // namespace glint
