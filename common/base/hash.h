#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>

namespace glint {

/// A SHA-256 digest: the name of a blob, or a task's key.
struct Digest {
  std::array<uint8_t, 32> bytes{};

  bool operator==(const Digest&) const = default;
  auto operator<=>(const Digest&) const = default;
  /// 64 lower-case hexadecimal characters.
  std::string Hex() const;
  /// The digest that Hex() gives this text for; none for any other text.
  static std::optional<Digest> FromHex(std::string_view hex);
};

/// Incremental SHA-256. Fields are fed with their length or fixed width, so that two different sequences of
/// fields never give the same bytes.
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;

  Hasher& Bytes(std::span<const std::byte> bytes);  ///< length, then the bytes
  Hasher& String(std::string_view s);               ///< length, then the characters
  Hasher& Add(const Digest& digest);
  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) Hasher& Add(T value) {
    return Raw(&value, sizeof value);
  }
  template <class T>
  requires std::is_trivially_copyable_v<T> Hasher& Array(std::span<const T> values) {
    return Bytes(std::as_bytes(values));
  }
  Digest Finish();

 private:
  Hasher& Raw(const void* data, size_t size);
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// SHA-256 of exactly these bytes (what `sha256sum` prints).
Digest Sha256(std::span<const std::byte> bytes);

/// Fast non-cryptographic 64-bit checksum (XXH3) for sections and chunks.
uint64_t Checksum64(std::span<const std::byte> bytes);

}  // namespace glint
