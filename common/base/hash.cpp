#include "common/base/hash.h"

#include <openssl/evp.h>
#include <xxhash.h>

#include <new>

namespace glint {

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

Digest Sha256(std::span<const std::byte> bytes) {
  Digest digest;
  if (EVP_Digest(bytes.data(), bytes.size(), digest.bytes.data(), nullptr, EVP_sha256(), nullptr) != 1) {
    throw std::bad_alloc();
  }
  return digest;
}

uint64_t Checksum64(std::span<const std::byte> bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

}  // namespace glint
