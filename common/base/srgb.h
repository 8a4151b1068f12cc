#pragma once

#include <cmath>

namespace glint {

/// IEC 61966-2-1: linear light of an encoded value, both in [0, 1].
inline double SrgbDecode(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

}  // namespace glint
