#include "common/render/image.h"

#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfTiledOutputFile.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <limits>

#include "common/base/files.h"
#include "common/base/rng.h"
#include "tests/render/render_test_support.h"

namespace glint {
namespace {

using test::TemporaryPath;

Picture RandomPicture(int width, int height) {
  Picture picture(width, height);
  CounterRng rng(5, 1);
  for (glm::vec4& p : picture.pixels) {
    const float scale = std::exp2(20 * rng.Uniform() - 10);
    p = {scale * rng.Uniform(), scale * rng.Uniform(), scale * rng.Uniform(), rng.Uniform()};
  }
  for (int x = 0; x < width / 2; ++x) picture.at(x, 0) = glm::vec4(1, 2, 3, 1);  // a run
  return picture;
}

std::vector<std::byte> Bytes(const std::string& text) {
  std::vector<std::byte> bytes(text.size());
  std::memcpy(bytes.data(), text.data(), text.size());
  return bytes;
}

Result<Picture> ReadHdrText(const std::string& text) {
  return ReadPictureFromMemory(Bytes(text), "test.hdr");
}

/// Grey values of a one-channel look at the picture, row by row.
std::vector<float> Reds(const Picture& picture) {
  std::vector<float> reds;
  for (const glm::vec4& p : picture.pixels) reds.push_back(p.x);
  return reds;
}

TEST(ImageTest, FloatExrIsExact) {
  const Picture picture = RandomPicture(37, 19);
  const TemporaryPath path("exact.exr");
  ASSERT_TRUE(WritePicture(picture, path.get(), {}, true).ok());
  const auto read = ReadPicture(path.get());
  ASSERT_TRUE(read.ok()) << read.status().message();
  ASSERT_EQ(read->width, 37);
  ASSERT_EQ(read->height, 19);
  EXPECT_EQ(read->pixels, picture.pixels);
}

TEST(ImageTest, HalfExrRoundsAndClamps) {
  Picture picture = RandomPicture(16, 8);
  picture.at(3, 4).x = 1e9f;
  const TemporaryPath path("half.exr");
  ASSERT_TRUE(WritePicture(picture, path.get()).ok());
  const auto read = ReadPicture(path.get());
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_EQ(read->at(3, 4).x, 65504.0f);
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    EXPECT_NEAR(read->pixels[i].y, picture.pixels[i].y, picture.pixels[i].y / 2048 + 6e-8f);
}

TEST(ImageTest, BytesDependOnThePictureAlone) {
  const Picture picture = RandomPicture(40, 40);
  for (const char* name : {"same.exr", "same.hdr", "same.png"}) {
    const TemporaryPath a(std::string("a") + name), b(std::string("b") + name);
    ASSERT_TRUE(WritePicture(picture, a.get()).ok());
    ASSERT_TRUE(WritePicture(picture, b.get()).ok());
    EXPECT_EQ(ReadFile(a.get(), 1 << 20).value(), ReadFile(b.get(), 1 << 20).value()) << name;
  }
}

TEST(ImageTest, ExrDataWindowIsPlacedInTheDisplayWindow) {
  const TemporaryPath path("window.exr");
  Imf::Header header(Imath::Box2i({0, 0}, {7, 5}), Imath::Box2i({-2, 1}, {3, 2}));
  header.channels().insert("Y", Imf::Channel(Imf::HALF));
  std::vector<Imath::half> values(12);
  for (int i = 0; i < 12; ++i) values[i] = static_cast<float>(i + 1);
  {
    Imf::OutputFile file(path.get().c_str(), header);
    Imf::FrameBuffer buffer;
    buffer.insert("Y", Imf::Slice::Make(Imf::HALF, values.data(), header.dataWindow()));
    file.setFrameBuffer(buffer);
    file.writePixels(2);
  }
  const auto read = ReadPicture(path.get());
  ASSERT_TRUE(read.ok()) << read.status().message();
  ASSERT_EQ(read->width, 8);
  ASSERT_EQ(read->height, 6);
  EXPECT_EQ(read->at(0, 1), glm::vec4(3, 3, 3, 1));  // the third column of the data window's first row
  EXPECT_EQ(read->at(3, 2), glm::vec4(12, 12, 12, 1));
  EXPECT_EQ(read->at(4, 2), glm::vec4(0));
  EXPECT_EQ(read->at(0, 0), glm::vec4(0));
}

TEST(ImageTest, TiledUintExrIsRead) {
  const TemporaryPath path("tiled.exr");
  constexpr int kWidth = 40, kHeight = 24;
  Imf::Header header(kWidth, kHeight);
  for (const char* c : {"R", "G", "B"}) header.channels().insert(c, Imf::Channel(Imf::UINT));
  header.setTileDescription(Imf::TileDescription(16, 16, Imf::ONE_LEVEL));
  std::vector<uint32_t> values(size_t{kWidth} * kHeight);
  for (size_t i = 0; i < values.size(); ++i) values[i] = static_cast<uint32_t>(i);
  {
    Imf::TiledOutputFile file(path.get().c_str(), header);
    Imf::FrameBuffer buffer;
    for (const char* c : {"R", "G", "B"})
      buffer.insert(c, Imf::Slice::Make(Imf::UINT, values.data(), header.dataWindow()));
    file.setFrameBuffer(buffer);
    file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
  }
  const auto read = ReadPicture(path.get());
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_EQ(read->at(39, 23), glm::vec4(glm::vec3(static_cast<float>(values.back())), 1));
}

TEST(ImageTest, HdrRoundTripKeepsEightBits) {
  for (const int width : {5, 200}) {  // plain pixels, and planes
    const Picture picture = RandomPicture(width, 9);
    const TemporaryPath path("round.hdr");
    ASSERT_TRUE(WritePicture(picture, path.get()).ok());
    const auto read = ReadPicture(path.get());
    ASSERT_TRUE(read.ok()) << read.status().message();
    for (size_t i = 0; i < picture.pixels.size(); ++i) {
      const glm::vec4 &p = picture.pixels[i], &q = read->pixels[i];
      const float largest = std::max({p.x, p.y, p.z});
      for (int c = 0; c < 3; ++c) EXPECT_NEAR(q[c], p[c], largest / 255);
      EXPECT_EQ(q.w, 1);
    }
  }
}

TEST(ImageTest, HdrOrientationsShowTheSamePicture) {
  // Stored values 2..7 (1, 1, 1 would mean a run); mantissas with exponent 136 decode to themselves.
  const auto pixels = [](const std::string& values) {
    std::string out;
    for (const char v : values)
      out += std::string(3, static_cast<char>(v - '0' + 1)) + static_cast<char>(136);
    return out;
  };
  const std::vector<float> expected{2, 3, 4, 5, 6, 7};
  const std::pair<const char*, const char*> kCases[] = {
      {"-Y 2 +X 3", "123456"}, {"+Y 2 +X 3", "456123"}, {"-Y 2 -X 3", "321654"}, {"+Y 2 -X 3", "654321"},
      {"+X 3 -Y 2", "142536"}, {"-X 3 -Y 2", "362514"}, {"+X 3 +Y 2", "415263"}, {"-X 3 +Y 2", "635241"}};
  for (const auto& [resolution, values] : kCases) {
    const auto read = ReadHdrText(std::string("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n") + resolution + "\n" +
                                  pixels(values));
    ASSERT_TRUE(read.ok()) << resolution << ": " << read.status().message();
    EXPECT_EQ(read->width, 3);
    EXPECT_EQ(Reds(*read), expected) << resolution;
  }
}

TEST(ImageTest, HdrOldRunsAndExposure) {
  const std::string pixel = {4, 4, 4, static_cast<char>(136)};
  const std::string run = {1, 1, 1, 3};
  const auto read = ReadHdrText("#?RGBE\nEXPOSURE=2\nEXPOSURE=4\n\n-Y 1 +X 4\n" + pixel + run);
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_EQ(Reds(*read), (std::vector<float>{0.5f, 0.5f, 0.5f, 0.5f}));
}

TEST(ImageTest, DamagedHdrIsRefused) {
  const std::string head = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n";
  const std::string scanline = {2, 2, 0, 8};
  for (const std::string& text :
       {head + "-Y 4 +X 4\n", head + "-Y 4 +Y 4\n", head + "-Y -4 +X 4\n", head + "-Y 4\n",
        std::string("#?RADIANCE\n"), std::string("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 1 +X 1\nabcd"),
        head + "-Y 1 +X 8\n" + scanline + std::string(1, char(137)) + "a" +
            std::string(40, 'b'),                                                  // run too long
        head + "-Y 1 +X 8\n" + scanline + std::string(40, '\0'),                   // empty count
        head + "-Y 1 +X 4\n" + std::string("\1\1\1\2", 4) + std::string(12, 'x'),  // run of nothing
        head + "-Y 1000000 +X 20\nabcd"}) {
    const auto read = ReadHdrText(text);
    ASSERT_FALSE(read.ok());
    EXPECT_NE(read.status().message().find("test.hdr"), std::string::npos);
  }
}

TEST(ImageTest, TruncatedFilesAreRefused) {
  const Picture picture = RandomPicture(24, 12);
  for (const char* name : {"cut.exr", "cut.hdr"}) {
    const TemporaryPath path(name);
    ASSERT_TRUE(WritePicture(picture, path.get()).ok());
    const std::vector<std::byte> bytes = ReadFile(path.get(), 1 << 20).value();
    for (size_t n = 0; n < bytes.size(); n += 17) {
      const auto read = ReadPictureFromMemory(std::span(bytes).first(n), name);
      EXPECT_FALSE(read.ok()) << name << " cut to " << n;
    }
  }
}

TEST(ImageTest, LimitsComeBeforeMemory) {
  PictureLimits limits;
  limits.side = 20;
  const TemporaryPath path("big.exr");
  ASSERT_TRUE(WritePicture(RandomPicture(24, 12), path.get()).ok());
  EXPECT_EQ(ReadPicture(path.get(), limits).status().kind(), ErrorKind::kLimit);
  limits = {};
  limits.pixels = 287;
  EXPECT_EQ(ReadPicture(path.get(), limits).status().kind(), ErrorKind::kLimit);
  limits = {};
  limits.file_bytes = 100;
  EXPECT_EQ(ReadPicture(path.get(), limits).status().kind(), ErrorKind::kLimit);
  const auto huge = ReadHdrText("#?RADIANCE\n\n-Y 2000000000 +X 2000000000\n");
  EXPECT_EQ(huge.status().kind(), ErrorKind::kLimit);
}

/// Puts other windows into the header of an EXR file.
void PatchWindow(std::vector<std::byte>& bytes, const std::string& attribute, int width, int height) {
  const std::string key = attribute + std::string("\0box2i\0", 7);
  const auto at = std::search(bytes.begin(), bytes.end(), key.begin(), key.end(),
                              [](std::byte b, char c) { return b == static_cast<std::byte>(c); });
  ASSERT_NE(at, bytes.end());
  const int32_t box[4] = {0, 0, width - 1, height - 1};
  std::memcpy(&*at + key.size() + 4, box, sizeof box);
}

TEST(ImageTest, ASmallExrCannotAskForMuchMemory) {
  for (const Imf::Compression compression :
       {Imf::NO_COMPRESSION, Imf::RLE_COMPRESSION, Imf::ZIPS_COMPRESSION, Imf::ZIP_COMPRESSION,
        Imf::PIZ_COMPRESSION, Imf::PXR24_COMPRESSION, Imf::B44_COMPRESSION, Imf::B44A_COMPRESSION,
        Imf::DWAA_COMPRESSION, Imf::DWAB_COMPRESSION}) {
    for (const bool tiled : {false, true}) {
      const TemporaryPath path("plain.exr");
      constexpr int kWidth = 1024, kHeight = 600;
      Imf::Header header(kWidth, kHeight);
      header.compression() = compression;
      std::vector<Imath::half> values(size_t{kWidth} * kHeight, Imath::half(0.5f));
      Imf::FrameBuffer buffer;
      for (const char* c : {"R", "G", "B", "A"}) {
        header.channels().insert(c, Imf::Channel(Imf::HALF));
        buffer.insert(c, Imf::Slice::Make(Imf::HALF, values.data(), header.dataWindow()));
      }
      if (tiled) {
        header.setTileDescription(Imf::TileDescription(256, 256, Imf::ONE_LEVEL));
        Imf::TiledOutputFile file(path.get().c_str(), header);
        file.setFrameBuffer(buffer);
        file.writeTiles(0, file.numXTiles() - 1, 0, file.numYTiles() - 1);
      } else {
        Imf::OutputFile file(path.get().c_str(), header);
        file.setFrameBuffer(buffer);
        file.writePixels(kHeight);
      }
      // What compresses best must still be read ...
      std::vector<std::byte> bytes = ReadFile(path.get(), 1 << 25).value();
      const auto read = ReadPictureFromMemory(bytes, "plain.exr");
      ASSERT_TRUE(read.ok()) << read.status().message();
      EXPECT_NEAR(read->at(700, 500).y, 0.5f, 0.01f);
      // ... and a header that promises far more must not.
      for (const char* window : {"dataWindow", "displayWindow"}) PatchWindow(bytes, window, 16384, 16384);
      bytes.resize(std::min<size_t>(bytes.size(), 3000));
      const auto refused = ReadPictureFromMemory(bytes, "plain.exr");
      EXPECT_EQ(refused.status().kind(), ErrorKind::kBadInput) << compression;
      EXPECT_NE(refused.status().message().find("cannot hold 16384 x 16384 pixels"), std::string::npos)
          << refused.status().message();
    }
  }
}

TEST(ImageTest, ExrHeadersAreNotTakenAtTheirWord) {
  const TemporaryPath path("header.exr");
  ASSERT_TRUE(WritePicture(RandomPicture(24, 12), path.get()).ok());
  const std::vector<std::byte> good = ReadFile(path.get(), 1 << 20).value();
  std::vector<std::byte> bytes = good;
  PatchWindow(bytes, "displayWindow", 16384, 8192);
  EXPECT_EQ(ReadPictureFromMemory(bytes, "e").status().kind(), ErrorKind::kLimit);
  // An attribute of two gigabytes in front of the others.
  const std::string text("note\0string\0\xff\xff\xff\x7f", 16);
  bytes = good;
  const auto* attribute = reinterpret_cast<const std::byte*>(text.data());
  bytes.insert(bytes.begin() + 8, attribute, attribute + text.size());
  EXPECT_EQ(ReadPictureFromMemory(bytes, "e").status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(ReadPictureFromMemory(std::span(good).first(6), "e").status().kind(), ErrorKind::kBadInput);
}

TEST(ImageTest, PngIsToneMappedSrgb) {
  Picture picture(3, 1);
  picture.at(0, 0) = glm::vec4(1, 1, 1, 1);
  picture.at(1, 0) = glm::vec4(0, 0, 0, 0);
  picture.at(2, 0) = glm::vec4(std::numeric_limits<float>::quiet_NaN(), -1, 1e30f, 0.5f);
  const TemporaryPath path("tone.png");
  ASSERT_TRUE(WritePicture(picture, path.get()).ok());
  const auto read = ReadPng(path.get());
  ASSERT_TRUE(read.ok()) << read.status().message();
  EXPECT_NEAR(read->at(0, 0).x, 188 / 255.0f, 1e-6f);  // Reinhard: 1/2; sRGB: 0.735
  EXPECT_EQ(read->at(1, 0), glm::vec4(0));
  EXPECT_EQ(read->at(2, 0).x, 0);
  EXPECT_EQ(read->at(2, 0).z, 1);
  EXPECT_NEAR(read->at(2, 0).w, 0.5f, 0.003f);
}

TEST(ImageTest, ExposuresThatAreNoneAreRefused) {
  const TemporaryPath path("tone.png");
  for (const float exposure : {0.0f, -1.0f, std::nanf(""), std::numeric_limits<float>::infinity()}) {
    EXPECT_EQ(WritePicture(RandomPicture(4, 2), path.get(), {.exposure = exposure}).kind(),
              ErrorKind::kUsage);
    EXPECT_FALSE(std::filesystem::exists(path.get()));
  }
}

TEST(ImageTest, UnknownFormatsAreNamed) {
  EXPECT_EQ(WritePicture(Picture(1, 1), "picture.bmp").kind(), ErrorKind::kUsage);
  EXPECT_EQ(WritePicture(Picture(), "picture.exr").kind(), ErrorKind::kBadInput);
  const auto read = ReadPictureFromMemory(Bytes("GIF89a"), "a.gif");
  EXPECT_EQ(read.status().kind(), ErrorKind::kBadInput);
  EXPECT_EQ(ReadPicture("/nonexistent/a.exr").status().kind(), ErrorKind::kBadInput);
}

TEST(ImageTest, SharedPicturesAreRead) {
  if (const auto path = test::SharedData("env/venice_sunset_1k.hdr")) {
    const auto picture = ReadPicture(*path);
    ASSERT_TRUE(picture.ok()) << picture.status().message();
    EXPECT_EQ(picture->width, 1024);
    EXPECT_EQ(picture->height, 512);
  }
  if (const auto path = test::SharedData("ref/goblets/mask_A_venice_sunset_1k.png")) {
    const auto mask = ReadPng(*path);
    ASSERT_TRUE(mask.ok()) << mask.status().message();
    for (const glm::vec4& p : mask->pixels) EXPECT_TRUE(p.x == 0 || p.x == 1);
  }
  if (const auto path = test::SharedData("ref/goblets/A_venice_sunset_1k_b0.exr")) {
    const auto picture = ReadPicture(*path);
    ASSERT_TRUE(picture.ok()) << picture.status().message();
    EXPECT_EQ(picture->width, 384);
  }
}

}  // namespace
}  // namespace glint
