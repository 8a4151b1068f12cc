#include "common/scene/gltf_accessor.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <span>

namespace glint {
namespace {

int ComponentBytes(int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
    case TINYGLTF_COMPONENT_TYPE_FLOAT:
      return 4;
    default:
      return 0;
  }
}

int Components(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return 1;
    case TINYGLTF_TYPE_VEC2:
      return 2;
    case TINYGLTF_TYPE_VEC3:
      return 3;
    case TINYGLTF_TYPE_VEC4:
      return 4;
    default:
      return 0;
  }
}

template <class T>
T Load(const std::byte* at) {
  T value;
  std::memcpy(&value, at, sizeof value);
  return value;
}

float LoadFloat(const std::byte* at, int type, bool normalized) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_BYTE: {
      const float v = Load<int8_t>(at);
      return normalized ? std::max(v / 127.0f, -1.0f) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE: {
      const float v = Load<uint8_t>(at);
      return normalized ? v / 255.0f : v;
    }
    case TINYGLTF_COMPONENT_TYPE_SHORT: {
      const float v = Load<int16_t>(at);
      return normalized ? std::max(v / 32767.0f, -1.0f) : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT: {
      const float v = Load<uint16_t>(at);
      return normalized ? v / 65535.0f : v;
    }
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return static_cast<float>(Load<uint32_t>(at));
    default:
      return Load<float>(at);
  }
}

uint32_t LoadIndex(const std::byte* at, int type) {
  switch (type) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return Load<uint8_t>(at);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return Load<uint16_t>(at);
    default:
      return Load<uint32_t>(at);
  }
}

bool IsIndexType(int type) {
  return type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE || type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
         type == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
}

// Where elements lie: element i at data + i stride. All within the buffer view.
struct Layout {
  const std::byte* data = nullptr;
  uint64_t stride = 0;
};

// @param offset bytes from the start of the view
Result<Layout> CheckLayout(const GltfDocument& document, GltfBytes& bytes, int view_index, uint64_t offset,
                           uint64_t count, uint64_t element_bytes, uint64_t component_bytes,
                           const std::string& object) {
  auto view = bytes.View(view_index);
  if (!view.ok()) return view.status().WithContext(object);
  const tinygltf::BufferView& info = document.model.bufferViews[view_index];
  const uint64_t stride = info.byteStride ? info.byteStride : element_bytes;
  if (stride < element_bytes) {
    return BadInput(object + ": byteStride " + std::to_string(stride) + " is less than an element's " +
                    std::to_string(element_bytes) + " bytes; export the file again");
  }
  if (offset % component_bytes != 0 || (info.byteOffset + offset) % component_bytes != 0 ||
      stride % component_bytes != 0) {
    return BadInput(object + ": is not aligned to its components of " + std::to_string(component_bytes) +
                    " bytes; export the file again");
  }
  // count <= 2^53 and stride <= 252: no overflow.
  const uint64_t extent = stride * (count - 1) + element_bytes;
  if (offset > view->size() || extent > view->size() - offset) {
    return BadInput(object + ": needs bytes " + std::to_string(offset) + " to " +
                    std::to_string(offset + extent) + " of bufferViews[" + std::to_string(view_index) +
                    "], which has " + std::to_string(view->size()) + "; export the file again");
  }
  return Layout{view->data() + offset, stride};
}

/// Elements of an accessor that has no bytes in the file: an array in the making, of which a sparse accessor
/// replaces a part. A few bytes may not ask for much memory.
constexpr uint64_t kMaxElementsWithoutBytes = uint64_t{1} << 20;

struct Checked {
  const tinygltf::Accessor* accessor;
  int components, component_bytes;
  uint64_t element_bytes() const { return uint64_t(components) * component_bytes; }
};

Result<Checked> CheckAccessor(const GltfDocument& document, int index, const std::string& object,
                              uint64_t max_count) {
  GLINT_ASSIGN_OR_RETURN(const tinygltf::Accessor* accessor, FindAccessor(document, index, object));
  const Checked checked{accessor, Components(accessor->type), ComponentBytes(accessor->componentType)};
  if (checked.components == 0 || checked.component_bytes == 0) {
    return BadInput(object + ": accessors[" + std::to_string(index) +
                    "] has a type that cannot be used here; export the file again");
  }
  if (accessor->count == 0) return BadInput(object + ": has no elements; export the file again");
  if (accessor->count > max_count) {
    return LimitExceeded(object + ": " + std::to_string(accessor->count) +
                         " elements, more than the limit of " + std::to_string(max_count) +
                         "; simplify the scene");
  }
  if (accessor->bufferView < 0 && accessor->count > kMaxElementsWithoutBytes) {
    return LimitExceeded(object + ": " + std::to_string(accessor->count) +
                         " elements without a bufferView, more than the limit of " +
                         std::to_string(kMaxElementsWithoutBytes) + "; export the file again");
  }
  return checked;
}

// Positions (in the accessor) and places of the values that replace others.
struct Sparse {
  std::vector<uint32_t> targets;
  Layout values;
};

Result<Sparse> CheckSparse(const GltfDocument& document, GltfBytes& bytes, const Checked& checked,
                           const std::string& object) {
  Sparse result;
  const auto& sparse = checked.accessor->sparse;
  if (!sparse.isSparse) return result;
  const std::string name = object + " (sparse)";
  if (sparse.count <= 0 || static_cast<uint64_t>(sparse.count) > checked.accessor->count ||
      !IsIndexType(sparse.indices.componentType)) {
    return BadInput(name + ": count or component type is wrong; export the file again");
  }
  const int index_bytes = ComponentBytes(sparse.indices.componentType);
  GLINT_ASSIGN_OR_RETURN(const Layout indices,
                         CheckLayout(document, bytes, sparse.indices.bufferView, sparse.indices.byteOffset,
                                     sparse.count, index_bytes, index_bytes, name + ".indices"));
  GLINT_ASSIGN_OR_RETURN(
      result.values,
      CheckLayout(document, bytes, sparse.values.bufferView, sparse.values.byteOffset, sparse.count,
                  checked.element_bytes(), checked.component_bytes, name + ".values"));
  for (int i = 0; i < sparse.count; ++i) {
    const uint32_t target = LoadIndex(indices.data + i * indices.stride, sparse.indices.componentType);
    if (target >= checked.accessor->count) {
      return BadInput(name + ": index " + std::to_string(target) + " is beyond the " +
                      std::to_string(checked.accessor->count) + " elements; export the file again");
    }
    result.targets.push_back(target);
  }
  return result;
}

// Reads the wanted elements by load(bytes of one component) into `values`; zeros where there is no buffer
// view.
// @param wanted ascending, each below the accessor's count; null: all
template <class T, class LoadComponent>
Status ReadElements(const GltfDocument& document, GltfBytes& bytes, const Checked& checked,
                    const std::string& object, const std::vector<uint32_t>* wanted, LoadComponent load,
                    std::vector<T>& values) {
  const tinygltf::Accessor& accessor = *checked.accessor;
  const auto copy = [&](const std::byte* from, uint64_t to) {
    for (int c = 0; c < checked.components; ++c) {
      values[to * checked.components + c] = load(from + c * checked.component_bytes);
    }
  };
  GLINT_ASSIGN_OR_RETURN(const Sparse sparse, CheckSparse(document, bytes, checked, object));
  Layout layout;
  if (accessor.bufferView >= 0) {
    GLINT_ASSIGN_OR_RETURN(
        layout, CheckLayout(document, bytes, accessor.bufferView, accessor.byteOffset, accessor.count,
                            checked.element_bytes(), checked.component_bytes, object));
  }
  const uint64_t count = wanted ? wanted->size() : accessor.count;
  values.assign(count * checked.components, T{0});
  if (layout.data) {
    for (uint64_t i = 0; i < count; ++i) copy(layout.data + (wanted ? (*wanted)[i] : i) * layout.stride, i);
  }
  for (size_t i = 0; i < sparse.targets.size(); ++i) {
    uint64_t to = sparse.targets[i];
    if (wanted) {
      const auto it = std::lower_bound(wanted->begin(), wanted->end(), sparse.targets[i]);
      if (it == wanted->end() || *it != sparse.targets[i]) continue;
      to = static_cast<uint64_t>(it - wanted->begin());
    }
    copy(sparse.values.data + i * sparse.values.stride, to);
  }
  return {};
}

}  // namespace

Result<const tinygltf::Accessor*> FindAccessor(const GltfDocument& document, int index,
                                               const std::string& object) {
  if (index < 0 || static_cast<size_t>(index) >= document.model.accessors.size()) {
    return BadInput(object + ": accessors[" + std::to_string(index) +
                    "] does not exist; export the file again");
  }
  return &document.model.accessors[index];
}

Result<FloatArray> ReadFloats(const GltfDocument& document, GltfBytes& bytes, int index,
                              const std::string& object, int min_components, int max_components,
                              uint64_t max_count, const std::vector<uint32_t>* wanted) {
  GLINT_ASSIGN_OR_RETURN(const Checked checked, CheckAccessor(document, index, object, max_count));
  if (checked.components < min_components || checked.components > max_components) {
    return BadInput(object + ": has " + std::to_string(checked.components) + " components, not " +
                    std::to_string(min_components) + "; export the file again");
  }
  FloatArray array{checked.components, {}};
  const int type = checked.accessor->componentType;
  const bool normalized = checked.accessor->normalized;
  GLINT_RETURN_IF_ERROR(ReadElements(
      document, bytes, checked, object, wanted,
      [&](const std::byte* at) { return LoadFloat(at, type, normalized); }, array.values));
  const auto bad =
      std::find_if(array.values.begin(), array.values.end(), [](float v) { return !std::isfinite(v); });
  if (bad != array.values.end()) {
    const auto element = static_cast<size_t>(bad - array.values.begin()) / checked.components;
    return BadInput(object + ": element " + std::to_string(wanted ? (*wanted)[element] : element) +
                    " is not a finite number; repair the mesh and export it again");
  }
  return array;
}

Result<std::vector<uint32_t>> ReadIndices(const GltfDocument& document, GltfBytes& bytes, int index,
                                          const std::string& object, uint64_t max_count) {
  GLINT_ASSIGN_OR_RETURN(const Checked checked, CheckAccessor(document, index, object, max_count));
  const int type = checked.accessor->componentType;
  if (checked.components != 1 || !IsIndexType(type)) {
    return BadInput(object + ": must be unsigned scalars; export the file again");
  }
  std::vector<uint32_t> values;
  GLINT_RETURN_IF_ERROR(ReadElements(
      document, bytes, checked, object, nullptr, [&](const std::byte* at) { return LoadIndex(at, type); },
      values));
  return values;
}

}  // namespace glint
