#include "common/archive/archive.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <utility>

#include "common/archive/sections.h"
#include "common/base/files.h"
#include "tests/archive/archive_fixture.h"

namespace glint {
namespace {

using archive_fixture::Content;
using archive_fixture::Link;
using archive_fixture::MakeContent;
using archive_fixture::Reseal;

class ArchiveTest : public testing::Test {
 protected:
  ArchiveTest()
      : folder_(std::filesystem::temp_directory_path() /
                ("glint_archive_test_" + std::to_string(getpid()) + "_" +
                 testing::UnitTest::GetInstance()->current_test_info()->name())) {
    std::filesystem::create_directories(folder_);
  }
  ~ArchiveTest() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path Path(const std::string& name = "a.glint") const { return folder_ / name; }
  std::vector<std::byte> Write(Content* content) const {
    const Status status = WriteArchive(Path(), Link(content));
    EXPECT_TRUE(status.ok()) << status.message();
    auto bytes = ReadFile(Path(), 1 << 30);
    EXPECT_TRUE(bytes.ok());
    return std::move(bytes).value();
  }
  /// Status of VerifyArchive on these bytes.
  Status Verify(std::span<const std::byte> bytes) const {
    EXPECT_TRUE(PublishFile(Path("v.glint"), bytes).ok());
    return VerifyArchive(Path("v.glint"));
  }

 private:
  std::filesystem::path folder_;
};

template <class T>
bool SameBits(const std::vector<T>& a, const std::vector<T>& b) {
  return a.size() == b.size() && (a.empty() || std::memcmp(a.data(), b.data(), a.size() * sizeof(T)) == 0);
}

void ExpectSameShape(const BrdfShape& a, const BrdfShape& b) {
  EXPECT_EQ(a.model, b.model);
  EXPECT_EQ(a.shape, b.shape);
  EXPECT_EQ(a.lobes, b.lobes);
  EXPECT_EQ(std::memcmp(&a.error, &b.error, sizeof a.error), 0);
  ASSERT_EQ(a.slices.size(), b.slices.size());
  for (size_t i = 0; i < a.slices.size(); ++i) {
    EXPECT_EQ(a.slices[i].lobes, b.slices[i].lobes);
    // The whole array of lobes, so that a field that the format forgets is seen.
    EXPECT_EQ(std::memcmp(a.slices[i].lobe.data(), b.slices[i].lobe.data(), sizeof a.slices[i].lobe), 0);
  }
}

void ExpectSameDomain(const BakeDomain& a, const BakeDomain& b) {
  EXPECT_TRUE(SameBits(a.positions, b.positions));
  EXPECT_TRUE(SameBits(a.normals, b.normals));
  EXPECT_TRUE(SameBits(a.triangles, b.triangles));
  EXPECT_TRUE(SameBits(a.triangle_double_sided, b.triangle_double_sided));
  EXPECT_TRUE(SameBits(a.specular, b.specular));
  EXPECT_TRUE(SameBits(a.diffuse, b.diffuse));
  EXPECT_TRUE(SameBits(a.shape, b.shape));
  EXPECT_TRUE(SameBits(a.double_sided, b.double_sided));
  ASSERT_EQ(a.shapes.size(), b.shapes.size());
  for (size_t i = 0; i < a.shapes.size(); ++i) ExpectSameShape(a.shapes[i], b.shapes[i]);
}

void ExpectSameCells(std::span<const std::byte> want_bytes, const SliceTableView& got) {
  const auto want = SliceTableView::Parse(want_bytes);
  ASSERT_TRUE(want.ok());
  ASSERT_EQ(want->rows(), got.rows());
  ASSERT_EQ(want->columns(), got.columns());
  for (uint32_t row = 0; row < got.rows(); ++row) {
    for (uint32_t column = 0; column < got.columns(); ++column) {
      const std::byte* a = want->Find(row, column);
      const std::byte* b = got.Find(row, column);
      ASSERT_EQ(a == nullptr, b == nullptr);
      if (a != nullptr) {
        ASSERT_EQ(std::memcmp(a, b, got.entry_bytes()), 0);
      }
    }
  }
}

void ExpectHolds(const Archive& archive, const Content& c) {
  ExpectSameDomain(c.domain, archive.domain());
  EXPECT_EQ(archive.grid_level(), c.content.grid_level);
  EXPECT_EQ(archive.MakeGrid().base_level(), c.content.grid_level);
  EXPECT_EQ(archive.report_json(), c.content.report_json);
  EXPECT_EQ(archive.archive_key(), c.content.archive_key);
  ASSERT_EQ(archive.cameras().size(), c.content.cameras.size());
  for (size_t i = 0; i < archive.cameras().size(); ++i) {
    const Camera &a = archive.cameras()[i], &b = c.content.cameras[i];
    EXPECT_EQ(a.name, b.name);
    EXPECT_EQ(a.eye, b.eye);
    EXPECT_EQ(a.forward, b.forward);
    EXPECT_EQ(a.up, b.up);
    EXPECT_EQ(a.vertical_fov, b.vertical_fov);
  }
  ASSERT_EQ(archive.layers().size(), c.tables.size());
  for (size_t i = 0; i < c.tables.size(); ++i) {
    const LayerViews& layer = archive.layers()[i];
    const uint32_t slots = layer.diffuse_slot() + 1;
    ASSERT_EQ(layer.lobes(), static_cast<uint32_t>(c.content.slice_lobes));
    ASSERT_EQ(slots * layer.lobes(), c.tables[i].size());
    for (uint32_t k = 0; k < c.tables[i].size(); ++k) {
      ExpectSameCells(c.tables[i][k], layer.table(k / slots, k % slots));
    }
  }
}

TEST_F(ArchiveTest, HoldsWhatWasWritten) {
  for (const TableForm form : {TableForm::kCompact, TableForm::kClassic, TableForm::kSegmented}) {
    Content c = MakeContent(300, 500, 3, 3, form);
    const auto bytes = Write(&c);
    for (const auto checks :
         {Archive::Checks::kEverything, Archive::Checks::kAllButTables, Archive::Checks::kNothing}) {
      const auto archive = Archive::Open(Path(), checks);
      ASSERT_TRUE(archive.ok()) << archive.status().message();
      ExpectHolds(*archive, c);
      EXPECT_EQ(archive->file_bytes(), bytes.size());
    }
    const auto copy = Archive::FromMemory(bytes, "memory");
    ASSERT_TRUE(copy.ok()) << copy.status().message();
    ExpectHolds(*copy, c);
    const Status status = VerifyArchive(Path());
    EXPECT_TRUE(status.ok()) << status.message();
  }
}

TEST_F(ArchiveTest, GeometryOfEveryIndexWidthComesBackBitForBit) {
  // Draco stores indices in 8, 16, about 21 or 32 bits, by the number of points.
  for (const uint32_t vertices : {1u, 3u, 255u, 256u, 257u, 65535u, 65537u}) {
    Content c = MakeContent(vertices, 2 * vertices, 1, 0);
    c.domain.positions[0] = {-0.0f, 1e-42f, 1e15f};
    Write(&c);
    const auto archive = Archive::Open(Path());
    ASSERT_TRUE(archive.ok()) << archive.status().message();
    ExpectSameDomain(c.domain, archive->domain());
  }
}

TEST_F(ArchiveTest, EmptyDomain) {
  Content c = MakeContent(9, 7, 1, 1);
  c.domain = {};
  c.tables = {{SliceTableBuilder(0, 2, 12).Finish()}};
  c.content.slice_lobes = 1;
  c.content.cameras.clear();
  c.content.report_json.clear();
  Write(&c);
  const auto archive = Archive::Open(Path());
  ASSERT_TRUE(archive.ok()) << archive.status().message();
  ExpectHolds(*archive, c);
}

TEST_F(ArchiveTest, SameContentSameBytes) {
  Content c = MakeContent();
  const auto first = Write(&c);
  EXPECT_EQ(Write(&c), first);
}

TEST_F(ArchiveTest, SectionsTellWhereBytesAre) {
  Content c = MakeContent();
  const auto bytes = Write(&c);
  const auto archive = Archive::Open(Path());
  ASSERT_TRUE(archive.ok());
  ASSERT_EQ(archive->sections().size(), 6u + 2 * 2 * 3);
  uint64_t end = archive_format::kHeaderBytes;
  for (const SectionInfo& s : archive->sections()) {
    EXPECT_EQ(s.offset % 64, 0u);
    EXPECT_EQ(s.offset, archive_format::Align(end));
    end = s.offset + s.stored_bytes;
  }
  EXPECT_EQ(archive->sections()[0].name, "geometry");
  EXPECT_EQ(archive->sections()[0].raw_bytes, 9u * 24 + 7 * 12);
  EXPECT_EQ(archive->sections().back().name, "table 1/5");
  EXPECT_EQ(archive->sections().back().raw_bytes, c.tables[1][5].size());
}

TEST_F(ArchiveTest, EveryTruncationIsRefused) {
  Content c = MakeContent();
  const auto bytes = Write(&c);
  for (size_t n = 0; n < bytes.size(); ++n) {
    const auto archive = Archive::FromMemory(std::span(bytes).first(n), "cut");
    ASSERT_FALSE(archive.ok()) << n;
    ASSERT_EQ(archive.status().kind(), ErrorKind::kBadInput);
    ASSERT_EQ(archive.status().message().rfind("cut: ", 0), 0u) << archive.status().message();
  }
  auto longer = bytes;
  longer.resize(bytes.size() + 64);
  EXPECT_FALSE(Archive::FromMemory(longer, "longer").ok());
}

TEST_F(ArchiveTest, EveryFlippedByteIsSeen) {
  Content c = MakeContent();
  auto bytes = Write(&c);
  for (size_t i = 0; i < bytes.size(); ++i) {
    const auto flip = static_cast<std::byte>(1u << (i % 8));
    bytes[i] ^= flip;
    const auto archive = Archive::FromMemory(bytes, "flip");
    ASSERT_FALSE(archive.ok()) << i;
    ASSERT_EQ(archive.status().kind(), ErrorKind::kBadInput);
    bytes[i] ^= flip;
  }
  EXPECT_TRUE(Archive::FromMemory(bytes, "good").ok());
}

TEST_F(ArchiveTest, ErrorsNameTheSection) {
  Content c = MakeContent();
  auto bytes = Write(&c);
  const auto sections = Archive::FromMemory(bytes, "good")->sections();
  for (const SectionInfo& section : sections) {
    auto bad = bytes;
    bad[section.offset + section.stored_bytes / 2] ^= std::byte{4};
    const auto archive = Archive::FromMemory(bad, "bad");
    ASSERT_FALSE(archive.ok());
    EXPECT_NE(archive.status().message().find("section " + section.name + ":"), std::string::npos)
        << archive.status().message();
  }
}

TEST_F(ArchiveTest, OtherFilesAndVersionsAreNamed) {
  const std::string text =
      "glTF or anything else, long enough to hold a header and a tail of an archive, which it has "
      "neither of; so it must be refused with a message that helps whoever gave it to the program";
  const auto other = Archive::FromMemory(std::as_bytes(std::span(text)), "scene.glb");
  EXPECT_NE(other.status().message().find("not a Glint archive"), std::string::npos);
  Content c = MakeContent();
  auto bytes = Write(&c);
  bytes[8] = std::byte{1};
  Reseal(bytes);
  EXPECT_NE(Archive::FromMemory(bytes, "old").status().message().find("bake it again"), std::string::npos);
  bytes[8] = std::byte{9};
  Reseal(bytes);
  EXPECT_NE(Archive::FromMemory(bytes, "new").status().message().find("format version 9"), std::string::npos);
  EXPECT_FALSE(Archive::Open(Path("absent.glint")).ok());
}

/// Behind the checksums: hostile values in headers and sections are refused or harmless. Run under
/// AddressSanitizer for the full worth of it.
TEST_F(ArchiveTest, ResealedDamageIsRefusedOrHarmless) {
  for (const TableForm form : {TableForm::kCompact, TableForm::kClassic, TableForm::kSegmented}) {
    Content c = MakeContent(9, 7, 2, 2, form);
    const auto good = Write(&c);
    int refused = 0, accepted = 0;
    for (uint32_t i = 0; i < 6000; ++i) {
      CounterRng rng(23, i);
      auto bad = good;
      // Headers and records are a small part of the bytes: half of the flips go there.
      const size_t frame_at = bad.size() - 64 - 15 * 64;
      const size_t at = i % 4 == 0   ? rng.Bits() % 128
                        : i % 4 == 1 ? frame_at + rng.Bits() % (16 * 64)
                                     : rng.Bits() % bad.size();
      bad[at] = static_cast<std::byte>(rng.Bits() & 255);
      Reseal(bad);
      const auto archive = Archive::FromMemory(bad, "bad");
      ++(archive.ok() ? accepted : refused);
      if (!archive.ok()) continue;
      uint64_t entries = 0;
      for (const LayerViews& layer : archive->layers()) {
        for (uint32_t lobe = 0; lobe < layer.lobes(); ++lobe)
          for (uint32_t slot = 0; slot <= layer.diffuse_slot(); ++slot) {
            const SliceTableView& table = layer.table(lobe, slot);
            for (uint32_t row = 0; row < table.rows(); ++row)
              table.Row(row).ForEach([&](uint32_t, const std::byte* e) { entries += e[11] == std::byte{0}; });
          }
      }
      ASSERT_LE(entries, 3u * 9 * 26);
      for (const auto& t : archive->domain().triangles) {
        ASSERT_LT(std::max({t[0], t[1], t[2]}), archive->domain().vertex_count());
      }
      for (const uint16_t s : archive->domain().shape) ASSERT_LT(s, archive->domain().shapes.size());
    }
    EXPECT_GT(refused, 1000);
    EXPECT_GT(accepted, 1000);
  }
}

TEST(DecodeCamerasTest, RefusesCamerasThatCannotBeDrawn) {
  const auto kind = [](const std::string& eye, const std::string& fov) {
    const std::string text = R"([{"name":"c","eye":[)" + eye +
                             R"(,0,0],"forward":[0,0,-1],"up":[0,1,0],"vertical_fov":)" + fov + "}]";
    std::vector<Camera> cameras;
    return archive_format::DecodeCameras(std::as_bytes(std::span(text)), &cameras).kind();
  };
  EXPECT_EQ(kind("1", "0.7"), ErrorKind::kOk);
  for (const char* eye : {"1e19", "-1e19", "1e300"}) EXPECT_EQ(kind(eye, "0.7"), ErrorKind::kBadInput) << eye;
  for (const char* fov : {"0", "-1", "3.2", "1e300"}) EXPECT_EQ(kind("1", fov), ErrorKind::kBadInput) << fov;
}

TEST_F(ArchiveTest, ContentThatCannotBeDrawnIsRefused) {
  const auto kind = [&](auto change) {
    Content c = MakeContent();
    change(c.domain);
    return Archive::FromMemory(Write(&c), "bad").status().kind();
  };
  EXPECT_EQ(kind([](BakeDomain&) {}), ErrorKind::kOk);
  const std::pair<const char*, void (*)(BakeDomain&)> changes[] = {
      {"zero normal", [](BakeDomain& d) { d.normals[3] = glm::vec3(0); }},
      {"long normal", [](BakeDomain& d) { d.normals[3] *= 1.01f; }},
      {"far position", [](BakeDomain& d) { d.positions[2].y = -3e38f; }},
      {"bright colour", [](BakeDomain& d) { d.specular[1].z = 3e38f; }},
      {"bright matt colour", [](BakeDomain& d) { d.diffuse[1].x = 1e7f; }},
      {"lobe without direction",
       [](BakeDomain& d) { d.shapes[0].slices[5].lobe[1].mu_x = d.shapes[0].slices[5].lobe[1].mu_z = 0; }},
      // Lobes that a slice does not count are read nevertheless.
      {"uncounted lobe without direction", [](BakeDomain& d) { d.shapes[1].slices[5].lobe[3].mu_z = 0; }},
      {"lobe wholly below", [](BakeDomain& d) { d.shapes[1].slices[0].lobe[0].above = 0; }},
      {"lobe nearly wholly below", [](BakeDomain& d) { d.shapes[1].slices[0].lobe[0].above = 1e-44f; }},
      {"heavy lobe", [](BakeDomain& d) { d.shapes[0].slices[0].lobe[0].scale = 3e38f; }}};
  for (const auto& [what, change] : changes) EXPECT_EQ(kind(change), ErrorKind::kBadInput) << what;
}

TEST_F(ArchiveTest, WriterRefusesWhatWouldNotOpen) {
  Content c = MakeContent();
  c.domain.normals.pop_back();
  EXPECT_EQ(WriteArchive(Path(), Link(&c)).kind(), ErrorKind::kInternal);
  c = MakeContent();
  c.tables[1].pop_back();
  EXPECT_EQ(WriteArchive(Path(), Link(&c)).kind(), ErrorKind::kInternal);
  c = MakeContent();
  std::swap(c.tables[0].front(), c.tables[0].back());
  EXPECT_EQ(WriteArchive(Path(), Link(&c)).kind(), ErrorKind::kInternal);
  c = MakeContent();
  c.content.slice_lobes = 5;
  EXPECT_EQ(WriteArchive(Path(), Link(&c)).kind(), ErrorKind::kInternal);
  c = MakeContent();
  c.content.grid_level = 1;
  EXPECT_EQ(WriteArchive(Path(), Link(&c)).kind(), ErrorKind::kInternal);
  c = MakeContent();
  c.content.cameras[0].eye.x = NAN;
  EXPECT_EQ(WriteArchive(Path(), Link(&c)).kind(), ErrorKind::kInternal);
  c = MakeContent();
  c.content.cameras[0].eye.x = 1e19f;
  EXPECT_EQ(WriteArchive(Path(), Link(&c)).kind(), ErrorKind::kInternal);
  c = MakeContent();
  c.content.cameras[0].vertical_fov = 0;
  EXPECT_EQ(WriteArchive(Path(), Link(&c)).kind(), ErrorKind::kInternal);
  EXPECT_FALSE(std::filesystem::exists(Path()));
}

TEST_F(ArchiveTest, VerifyTellsDamageFromOtherFiles) {
  Content c = MakeContent();
  const auto good = Write(&c);
  for (size_t at = 0; at < good.size(); at += at < 256 ? 1 : 41) {
    auto bad = good;
    bad[at] ^= std::byte{16};
    ASSERT_EQ(Verify(bad).kind(), at < 8 ? ErrorKind::kBadInput : ErrorKind::kMismatch) << at;
  }
  for (const size_t size : {size_t{8}, size_t{100}, size_t{200}, good.size() - 1})
    EXPECT_EQ(Verify(std::span(good).first(size)).kind(), ErrorKind::kMismatch) << size;
  EXPECT_EQ(Verify(std::span(good).first(7)).kind(), ErrorKind::kBadInput);
  EXPECT_EQ(VerifyArchive(Path("absent.glint")).kind(), ErrorKind::kBadInput);
  auto newer = good;
  newer[8] = std::byte{9};
  Reseal(newer);
  EXPECT_EQ(Verify(newer).kind(), ErrorKind::kBadInput) << "whole, but another version's";
}

/// Offset in the file of the first entry of a table.
size_t FirstEntry(const std::vector<std::byte>& bytes, size_t layer, bool diffuse) {
  const auto archive = Archive::FromMemory(bytes, "good");
  const SliceTableView& table =
      diffuse ? archive->layers()[layer].diffuse : archive->layers()[layer].specular[0];
  const std::string name = "table " + std::to_string(layer) + "/" + (diffuse ? "2" : "0");
  for (const SectionInfo& s : archive->sections()) {
    if (s.name == name) {
      return s.offset + s.stored_bytes - archive_format::Align(table.entries() * table.entry_bytes());
    }
  }
  return 0;
}

TEST_F(ArchiveTest, VerifySeesWhatOpeningDoesNot) {
  Content c = MakeContent();
  const auto good = Write(&c);
  EXPECT_TRUE(Verify(good).ok());
  const auto with = [&](size_t at, uint16_t value) {
    auto bad = good;
    std::memcpy(bad.data() + at, &value, 2);
    Reseal(bad);
    EXPECT_TRUE(Archive::FromMemory(bad, "bad").ok());
    return Verify(bad);
  };
  EXPECT_EQ(with(FirstEntry(good, 0, false) + 2, 0).kind(), ErrorKind::kMismatch);      // reserved ratio
  EXPECT_EQ(with(FirstEntry(good, 1, false), 0x7C00).kind(), ErrorKind::kMismatch);     // infinite alpha
  EXPECT_EQ(with(FirstEntry(good, 1, true) + 6, 0x8000).kind(), ErrorKind::kMismatch);  // reserved direction
  EXPECT_TRUE(with(FirstEntry(good, 1, false) + 10, 0x1234).ok());                      // another kappa

  c = MakeContent();
  c.tables[1][0] = SliceTableBuilder(9, 12, 12).Finish();  // second lobes without first ones
  const Status gap = Verify(Write(&c));
  EXPECT_EQ(gap.kind(), ErrorKind::kMismatch);
  EXPECT_NE(gap.message().find("without the one before"), std::string::npos) << gap.message();

  c = MakeContent();
  std::byte most_of_it[kDirectEntryBytes];
  EncodeDirect({.fraction = 0.9f}, most_of_it);
  for (const size_t slot : {0, 3}) {  // first and second lobe
    SliceTableBuilder table(9, 12, kDirectEntryBytes);
    table.AppendRow(std::array<uint16_t, 1>{5}, most_of_it);
    c.tables[0][slot] = table.Finish();
  }
  const Status more = Verify(Write(&c));
  EXPECT_EQ(more.kind(), ErrorKind::kMismatch);
  EXPECT_NE(more.message().find("more than the whole"), std::string::npos) << more.message();

  c = MakeContent();
  c.domain.specular[3].y = -0.1f;
  EXPECT_EQ(Verify(Write(&c)).kind(), ErrorKind::kMismatch);
  c = MakeContent();
  c.domain.double_sided.assign(9, 0);
  EXPECT_EQ(Verify(Write(&c)).kind(), ErrorKind::kMismatch);
}

}  // namespace
}  // namespace glint
