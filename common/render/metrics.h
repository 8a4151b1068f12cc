#pragma once

#include "common/render/image.h"

namespace glint {

struct Comparison {
  double rel_mse = 0;  ///< mean (t - r)^2 / (r^2 + eps^2), eps = 0.1 mean(r), over RGB of counted pixels
  double mean_relative = 0;  ///< mean |t - r| / (r + eps)
  double psnr_db = 0;        ///< after Reinhard and sRGB, peak 1
  double flip = 0;           ///< mean LDR-FLIP (Andersson et al. 2020), 67 pixels per degree
  double mean_test = 0, mean_reference = 0;
  uint64_t pixels = 0;  ///< counted
};

struct CompareOptions {
  const Picture* mask = nullptr;  ///< counts where > 0.5; null: where the reference's alpha > 0 (all if none)
  int block = 1;                  ///< box-average blocks of this side first (hides noise)
  ToneMap tone;
};

/// Pictures of one size, all of whose pixels are finite. kBadInput otherwise (naming the first pixel that is
/// not): no measure means anything then. kUsage for a tone that CheckTone refuses. FLIP filters the full
/// pictures and is averaged over the counted pixels, whatever `block` is, and `pixels` counts before
/// averaging.
Result<Comparison> Compare(const Picture& test, const Picture& reference, const CompareOptions& options = {});
/// Per-pixel LDR-FLIP error in [0, 1] of two tone-mapped pictures.
Result<std::vector<float>> FlipMap(const Picture& test, const Picture& reference, const ToneMap& tone = {});
/// False-colour picture of |t - r| / (r + eps), with a perceptual map; values already in display space
/// (sRGB). With a mask, pixels that it does not count are black with alpha 0, and do not count towards eps.
Result<Picture> FalseColorDifference(const Picture& test, const Picture& reference,
                                     const Picture* mask = nullptr);

}  // namespace glint
