#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "common/domain/bake_domain.h"
#include "common/scene/scene.h"

namespace glint::archive_format {

// Contents of the archive's sections, to bytes and back. Bytes: docs/archive-format.md. Decoders check every
// count, index and number that later code relies on (kBadInput); they believe neither sizes nor values.

/// Positions, normals and triangles by Draco, without loss and in their order. `stored` is Draco's stream.
Result<std::vector<std::byte>> EncodeGeometry(const BakeDomain& domain);
Status DecodeGeometry(std::span<const std::byte> stored, uint64_t vertices, uint64_t triangles,
                      BakeDomain* domain);

/// What vertices and triangles have besides geometry: reflectances, shape indices, sides. Needs the counts,
/// which it takes from positions and triangles; shapes must be decoded before.
std::vector<std::byte> EncodeVertices(const BakeDomain& domain);
Status DecodeVertices(std::span<const std::byte> raw, BakeDomain* domain);
uint64_t VertexSectionBytes(uint64_t vertices, uint64_t triangles);

std::vector<std::byte> EncodeShapes(const std::vector<BrdfShape>& shapes);
Status DecodeShapes(std::span<const std::byte> raw, std::vector<BrdfShape>* shapes);

/// JSON; numbers with the digits that give the same float back.
Result<std::vector<std::byte>> EncodeCameras(const std::vector<Camera>& cameras);
Status DecodeCameras(std::span<const std::byte> raw, std::vector<Camera>* cameras);

/// Zstandard, one frame, the same bytes for the same input.
Result<std::vector<std::byte>> Compress(std::span<const std::byte> raw);
/// Refuses frames that do not declare, or do not have, exactly `raw_bytes`.
Result<std::vector<std::byte>> Decompress(std::span<const std::byte> stored, uint64_t raw_bytes);

}  // namespace glint::archive_format
