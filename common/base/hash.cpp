#include "common/base/hash.h"

#include <openssl/evp.h>
#include <xxhash.h>

#include <new>

namespace glint {

namespace {

int HexValue(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  return -1;
}

}  // namespace

struct Hasher::Impl {
  EVP_MD_CTX* context = nullptr;

  Impl() : context(EVP_MD_CTX_new()) {
    // SHA-256 is part of every OpenSSL build and its update cannot fail; only memory for the context can be
    // missing.
    if (context == nullptr || EVP_DigestInit_ex(context, EVP_sha256(), nullptr) != 1) throw std::bad_alloc();
  }
  ~Impl() { EVP_MD_CTX_free(context); }
  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;
};

Hasher::Hasher() : impl_(std::make_unique<Impl>()) {}
Hasher::~Hasher() = default;

Hasher& Hasher::Raw(const void* data, size_t size) {
  if (size > 0) EVP_DigestUpdate(impl_->context, data, size);
  return *this;
}

Hasher& Hasher::Bytes(std::span<const std::byte> bytes) {
  Add(uint64_t{bytes.size()});
  return Raw(bytes.data(), bytes.size());
}

Hasher& Hasher::String(std::string_view s) { return Bytes(std::as_bytes(std::span(s))); }

Hasher& Hasher::Add(const Digest& digest) { return Raw(digest.bytes.data(), digest.bytes.size()); }

Digest Hasher::Finish() {
  Digest digest;
  EVP_DigestFinal_ex(impl_->context, digest.bytes.data(), nullptr);
  EVP_DigestInit_ex(impl_->context, EVP_sha256(), nullptr);
  return digest;
}

std::string Digest::Hex() const {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string hex;
  hex.reserve(2 * bytes.size());
  for (const uint8_t byte : bytes) {
    hex.push_back(kDigits[byte >> 4]);
    hex.push_back(kDigits[byte & 15]);
  }
  return hex;
}

std::optional<Digest> Digest::FromHex(std::string_view hex) {
  Digest digest;
  if (hex.size() != 2 * digest.bytes.size()) return std::nullopt;
  for (size_t i = 0; i < digest.bytes.size(); ++i) {
    const int high = HexValue(hex[2 * i]), low = HexValue(hex[2 * i + 1]);
    if (high < 0 || low < 0) return std::nullopt;
    digest.bytes[i] = static_cast<uint8_t>(16 * high + low);
  }
  return digest;
}

Digest Sha256(std::span<const std::byte> bytes) {
  Digest digest;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.bytes.data(), nullptr, EVP_sha256(), nullptr) != 1) {
    throw std::bad_alloc();
  }
  return digest;
}

uint64_t Checksum64(std::span<const std::byte> bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

}  // namespace glint
