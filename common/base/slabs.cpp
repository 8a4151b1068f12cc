#include "common/base/slabs.h"

#include <sys/mman.h>

#include <algorithm>
#include <cstdlib>
#include <new>
#include <utility>

namespace glint {
namespace {

constexpr size_t kAlignment = 16;
constexpr size_t kLargePage = size_t{2} << 20;
constexpr size_t kSmallestSlab = size_t{64} << 10, kLargestSlab = size_t{16} << 20;

size_t RoundUp(size_t bytes, size_t to) { return (bytes + to - 1) / to * to; }

}  // namespace

void Slabs::Free::operator()(std::byte* slab) const { std::free(slab); }

std::byte* Slabs::Allocate(size_t bytes) {
  bytes = RoundUp(std::max<size_t>(bytes, 1), kAlignment);
  const std::lock_guard lock(mutex_);
  if (bytes > left_) {
    size_t size = std::max(bytes, std::clamp(total_, kSmallestSlab, kLargestSlab));
    const size_t alignment = size >= kLargePage ? kLargePage : kAlignment;
    size = RoundUp(size, alignment);
    auto* slab = static_cast<std::byte*>(std::aligned_alloc(alignment, size));
    if (!slab) throw std::bad_alloc();
    // A wish: without it everything works, slower.
    if (alignment == kLargePage) madvise(slab, size, MADV_HUGEPAGE);
    slabs_.emplace_back(slab);
    next_ = slab;
    left_ = size;
    total_ += size;
  }
  left_ -= bytes;
  return std::exchange(next_, next_ + bytes);
}

}  // namespace glint
