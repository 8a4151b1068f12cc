#pragma once

#include <filesystem>

#include "common/base/hash.h"
#include "common/base/status.h"
#include "common/round/manifest.h"

namespace glint {

// Files of a bake's folder beside its chunks and records (common/store/store.h):
//   rounds/<digest>.json   manifests, named by the SHA-256 of their bytes
//   plans/<key>.json       how a round was cut into tasks, by its input's key: a manifest by another name
//   inputs/<key>.glint     what a round's tasks read: an archive of the surface and the layer before
//   inputs/<key>.rows      checksums of that layer's rows (common/archive/row_sums.h)
//   failed/<key>.json      why a task was given up (common/round/quarantine.h)
//   homes/<line>           locked by the worker whose line of the queue it is (worker/home_line.h)

std::filesystem::path ManifestPath(const std::filesystem::path& bake, const Digest& manifest);
std::filesystem::path PlanPath(const std::filesystem::path& bake, const Digest& input_key);
std::filesystem::path InputPath(const std::filesystem::path& bake, const Digest& input_key);
std::filesystem::path InputRowsPath(const std::filesystem::path& bake, const Digest& input_key);
std::filesystem::path QuarantinePath(const std::filesystem::path& bake, const Digest& task_key);

/// Publishes the manifest and returns its name. Safe to repeat. kIo.
Result<Digest> WriteManifest(const std::filesystem::path& bake, const RoundManifest& manifest);
/// kBadInput naming the file and the field; kLimit.
Result<RoundManifest> ReadManifest(const std::filesystem::path& path);
/// The same by name; a file with other content than its name promises is kBadInput.
Result<RoundManifest> ReadManifest(const std::filesystem::path& bake, const Digest& manifest);

}  // namespace glint
