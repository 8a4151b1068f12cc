#include "common/base/hash.h"

#include <gtest/gtest.h>

#include <array>
#include <string>
#include <string_view>
#include <vector>

namespace glint {
namespace {

std::span<const std::byte> BytesOf(std::string_view s) { return std::as_bytes(std::span(s)); }

// FIPS 180-4's examples.
TEST(Sha256Test, KnownAnswers) {
  EXPECT_EQ(Sha256(BytesOf("abc")).Hex(), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  EXPECT_EQ(Sha256({}).Hex(), "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
  EXPECT_EQ(Sha256(BytesOf("abcdbcdecdefdefgefghfghighijhijkijkljklmklmnlmnomnopnopq")).Hex(),
            "248d6a61d20638b8e5c026930c3e6039a33ce45964ff2167f6ecedd419db06c1");
}

TEST(HasherTest, FeedsStringsWithTheirLength) {
  // 64-bit little-endian length, then the characters.
  EXPECT_EQ(Hasher().String("abc").Finish(), Sha256(BytesOf(std::string_view("\x03\0\0\0\0\0\0\0abc", 11))));
  EXPECT_NE(Hasher().String("ab").String("c").Finish(), Hasher().String("a").String("bc").Finish());
  EXPECT_NE(Hasher().String("").Finish(), Hasher().Finish());
}

TEST(HasherTest, FeedsNumbersWithTheirWidth) {
  EXPECT_EQ(Hasher().Add(uint32_t{0x04030201}).Finish(), Sha256(BytesOf("\x01\x02\x03\x04")));
  EXPECT_NE(Hasher().Add(uint32_t{1}).Finish(), Hasher().Add(uint64_t{1}).Finish());
  EXPECT_NE(Hasher().Add(0.0f).Finish(), Hasher().Add(-0.0f).Finish());
  const std::vector<uint16_t> values{1, 2, 3};
  EXPECT_EQ(Hasher().Array(std::span<const uint16_t>(values)).Finish(),
            Hasher().Bytes(std::as_bytes(std::span(values))).Finish());
}

TEST(HasherTest, StartsAfreshAfterFinish) {
  Hasher hasher;
  const Digest first = hasher.String("abc").Finish();
  EXPECT_EQ(hasher.String("abc").Finish(), first);
}

TEST(HasherTest, TakesLargeInputsInPieces) {
  const std::string large(1 << 20, 'x');
  Hasher whole, again;
  EXPECT_EQ(whole.String(large).Finish(), again.Bytes(BytesOf(large)).Finish());
}

// Values of the reference implementation, so that files stay readable with another version of the library.
TEST(Checksum64Test, IsXxh3WithSeedZero) {
  EXPECT_EQ(Checksum64({}), 0x2d06800538d394c2u);
  EXPECT_EQ(Checksum64(BytesOf("abc")), 0x78af5f94892f3950u);
}

TEST(Checksum64Test, NoticesEveryFlippedBit) {
  std::array<std::byte, 64> bytes{};
  const uint64_t before = Checksum64(bytes);
  for (size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    bytes[bit / 8] ^= std::byte(1 << (bit % 8));
    EXPECT_NE(Checksum64(bytes), before) << "bit " << bit;
    bytes[bit / 8] ^= std::byte(1 << (bit % 8));
  }
}

}  // namespace
}  // namespace glint
