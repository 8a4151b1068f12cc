#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

namespace glint {

/// The line of a bake's queue at which a worker waits for tasks whose hits it holds (worker/line_chooser.h).
/// As long as this lives no other worker of the bake has the same, unless there are more workers than lines
/// or the file system has no locks: then some share one, and trace what the others have traced. The line's
/// file, homes/<line> in the bake's folder, says who has it.
class HomeLine {
 public:
  /// @param bake   the bake's folder
  /// @param lines  > 0
  /// @param seed   where to begin to look for a line that is free
  HomeLine(const std::filesystem::path& bake, uint32_t lines, uint32_t seed);
  ~HomeLine();
  HomeLine(const HomeLine&) = delete;
  HomeLine& operator=(const HomeLine&) = delete;

  uint32_t line() const { return line_; }

 private:
  uint32_t line_;
  int lock_ = -1;
};

/// "host:process" of the worker that has a line, or had it last; empty: nobody that could lock it.
std::string HomeName(const std::filesystem::path& bake, uint32_t line);

}  // namespace glint
