#pragma once

#include <chrono>

namespace glint {

/// Of a clock that only goes forward, from some instant on.
inline double SteadySeconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

/// Seconds since it was made.
class Stopwatch {
 public:
  double Seconds() const { return SteadySeconds() - begin_; }

 private:
  double begin_ = SteadySeconds();
};

}  // namespace glint
