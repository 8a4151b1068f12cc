#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/base/status.h"
#include "coordinator/bake.h"

namespace glint {

/// A round of a bake with a target: what was baked, and what came of it.
struct TargetRound {
  BakeSettings settings;
  double error = 0;                          ///< ErrorSummary::rms of all layers
  std::array<double, kErrorCauses> cause{};  ///< the same summary's
  double seconds = 0;                        ///< wall time
  uint64_t bytes = 0;                        ///< of the archive
  std::string archive_key;                   ///< hexadecimal
  bool kept = false;                         ///< better than those before it, and within the bytes
};

/// What to bake next, or why nothing.
struct TargetStep {
  std::optional<BakeSettings> settings;
  bool reached = false;  ///< nothing is left to do
  std::string reason;    ///< without settings: what ended it, for people
};

/// Settings of the first round: every axis that is free as coarse as what it then causes is worth the round,
/// measured on teapots and goblets; coarsest without a tolerance or with a budget.
BakeSettings FirstSettings(const BakeSettings& settings, const BakeTarget& target);

/// Chooses the next round by the causes of the last kept one's error: of the axes whose cause stands out
/// those that the tolerance needs, if they are expected to reach it; else those that take out most error for
/// what they add in time and bytes, several if they are about equal; if that is more than the budget allows,
/// fewer or cheaper ones. A function of its arguments alone.
/// @param rounds        at least one, all earlier ones
/// @param seconds_left  of BakeTarget::max_seconds; ignored without that
TargetStep NextStep(std::span<const TargetRound> rounds, const BakeTarget& target, double seconds_left);

/// Files that a bake to `out_path` leaves or, with a target, has meanwhile; the archive and its report first.
std::vector<std::filesystem::path> ResultFiles(const std::filesystem::path& out_path);

/// Bakes `options` to an archive; RefineToTarget's way to run a round.
using RoundBake =
    std::function<Result<BakeReport>(const BakeOptions& options, const std::filesystem::path& out_path)>;

/// Bakes ever finer, from FirstSettings on, until options.target is met or its budget leaves no next
/// round. After each round that is better, it stands at `out_path`; so the best one is there whenever this
/// ends, by a signal and a kill as well, and the same call goes on after the last finished round
/// (OUT.rounds.json has them). The report says what was and what was not reached.
/// @param start_key  of all that the rounds depend on besides their settings
/// Errors: kUsage without an estimate to go by; kLimit if not even the coarsest bake is within the budget;
/// those of `bake`.
Result<BakeReport> RefineToTarget(const Digest& start_key, const std::filesystem::path& out_path,
                                  const BakeOptions& options, const RoundBake& bake);

}  // namespace glint
