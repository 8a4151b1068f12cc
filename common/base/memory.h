#pragma once

#include <unistd.h>

#include <cstdint>

namespace glint {

/// Bytes of this machine's memory.
inline uint64_t MachineMemory() {
  return static_cast<uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<uint64_t>(sysconf(_SC_PAGE_SIZE));
}

}  // namespace glint
