#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "common/archive/archive.h"
#include "tests/base/temp_folder.h"
#include "tests/coordinator/bake_fixture.h"

namespace glint::bake_fixture {

/// A sound archive just baked, and its report.
struct Baked {
  std::vector<std::byte> bytes;
  std::optional<Archive> archive;  ///< of the bytes, which stay where they are
  BakeReport report;
};

/// Empty, and the test has failed, if the bake has.
inline std::unique_ptr<Baked> BakeHere(const Scene& scene, const BakeOptions& options) {
  const TempFolder folder;
  const auto path = folder / "out.glint";
  auto baked = std::make_unique<Baked>();
  Result<BakeReport> report = BakeScene(scene, "scene", path, options);
  EXPECT_TRUE(report.ok()) << report.status().message();
  if (!report.ok()) return baked;
  const Status verified = VerifyArchive(path, 1);
  EXPECT_TRUE(verified.ok()) << verified.message();
  baked->report = std::move(report).value();
  baked->bytes = BytesOf(path);
  Result<Archive> archive = Archive::FromMemory(baked->bytes, "scene");
  EXPECT_TRUE(archive.ok()) << archive.status().message();
  if (archive.ok()) baked->archive = std::move(archive).value();
  return baked;
}

}  // namespace glint::bake_fixture
