#pragma once

#include <cstddef>
#include <memory>
#include <mutex>
#include <vector>

namespace glint {

/// Memory for many arrays that live until all of them go. It grows by slabs that double; those of 2 MiB and
/// more are asked to lie on large pages: reads here and there in hundreds of megabytes are bounded by the
/// translation of addresses. Thread-safe.
class Slabs {
 public:
  /// @return  that many bytes, aligned to 16, with undefined contents
  /// Throws std::bad_alloc as operator new does.
  std::byte* Allocate(size_t bytes);

 private:
  struct Free {
    void operator()(std::byte* slab) const;
  };

  std::mutex mutex_;
  std::vector<std::unique_ptr<std::byte, Free>> slabs_;
  std::byte* next_ = nullptr;
  size_t left_ = 0;   ///< bytes of the last slab
  size_t total_ = 0;  ///< bytes of all slabs
};

}  // namespace glint
