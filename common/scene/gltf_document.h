#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/scene/load.h"
#include "common/scene/tinygltf.h"

namespace glint {

/// A glTF file taken apart: the document as tinygltf's structures (without buffers and images, whose bytes
/// are ours to bound), and where buffers and images are. Every member has the right type; indices are not yet
/// checked.
struct GltfDocument {
  struct BufferSource {
    bool has_uri = false;
    std::string uri;
    uint64_t byte_length = 0;
  };
  struct ImageSource {
    std::string name, uri;
    int buffer_view = -1;
  };
  tinygltf::Model model;
  std::vector<BufferSource> buffers;
  std::vector<ImageSource> images;
  std::span<const std::byte> binary;  ///< the GLB's second chunk, if any
};

/// Parses GLB or glTF JSON. `bytes` must outlive the document.
Result<GltfDocument> ParseGltf(std::span<const std::byte> bytes);

/// Bytes of buffers and of files beside the document, each read once, when first asked for.
class GltfBytes {
 public:
  /// @param folder where relative URIs start; empty: only embedded data is allowed
  GltfBytes(const GltfDocument& document, std::filesystem::path folder, uint64_t max_bytes)
      : document_(document), folder_(std::move(folder)), max_bytes_(max_bytes) {}

  /// Bytes of bufferViews[index]; the view lies within its buffer.
  Result<std::span<const std::byte>> View(int64_t index);
  /// Bytes behind a URI: base64 data, or a file beside the document. `object` is for messages.
  Result<std::span<const std::byte>> Uri(const std::string& uri, const std::string& object);

 private:
  Result<std::span<const std::byte>> Buffer(int64_t index);
  Result<std::vector<std::byte>> ReadBeside(const std::string& uri, const std::string& object) const;

  const GltfDocument& document_;
  std::filesystem::path folder_;
  uint64_t max_bytes_;
  std::map<std::string, std::vector<std::byte>> loaded_;  // by URI
};

/// A file name for a message: control characters replaced, shortened.
std::string Printable(const std::string& text);

}  // namespace glint
