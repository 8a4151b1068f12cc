#include <iomanip>
#include <iostream>
#include <memory>

#include "common/base/log.h"
#include "common/render/metrics.h"
#include "tools/commands.h"

namespace glint {
namespace {

struct CompareWords {
  std::string test, reference, mask, difference;
  int block = 1;
  ToneMap tone;
  std::optional<double> max_rel_mse, max_flip;
};

void PrintText(const Comparison& c) {
  std::cout << std::setprecision(6) << "relMSE               " << c.rel_mse << '\n'
            << "mean relative error  " << c.mean_relative << '\n'
            << "PSNR                 " << c.psnr_db << " dB\n"
            << "FLIP                 " << c.flip << '\n'
            << "mean                 " << c.mean_test << " (reference " << c.mean_reference << ")\n"
            << "pixels               " << c.pixels << '\n';
}

nlohmann::ordered_json ToJson(const CompareWords& words, const Comparison& c) {
  return {{"test", words.test},       {"reference", words.reference},
          {"rel_mse", c.rel_mse},     {"mean_relative", c.mean_relative},
          {"psnr_db", c.psnr_db},     {"flip", c.flip},
          {"mean_test", c.mean_test}, {"mean_reference", c.mean_reference},
          {"pixels", c.pixels}};
}

Status CheckBounds(const CompareWords& words, const Comparison& c) {
  // Written so that a figure that is not a number fails.
  if (words.max_rel_mse && !(c.rel_mse <= *words.max_rel_mse)) {
    return Mismatch(words.test + ": relMSE " + std::to_string(c.rel_mse) + " is above the bound of " +
                    std::to_string(*words.max_rel_mse));
  }
  if (words.max_flip && !(c.flip <= *words.max_flip)) {
    return Mismatch(words.test + ": FLIP " + std::to_string(c.flip) + " is above the bound of " +
                    std::to_string(*words.max_flip));
  }
  return {};
}

Status RunCompare(const CompareWords& words, const CommonWords& common) {
  if (!words.difference.empty()) GLINT_RETURN_IF_ERROR(CheckOutput(words.difference, {".png"}));
  GLINT_ASSIGN_OR_RETURN(const Picture test, ReadPicture(words.test));
  GLINT_ASSIGN_OR_RETURN(const Picture reference, ReadPicture(words.reference));
  std::optional<Picture> mask;
  if (!words.mask.empty()) {
    GLINT_ASSIGN_OR_RETURN(mask, ReadPng(words.mask));
  }
  GLINT_ASSIGN_OR_RETURN(
      const Comparison comparison,
      Compare(test, reference, {.mask = mask ? &*mask : nullptr, .block = words.block, .tone = words.tone}));
  if (!words.difference.empty()) {
    GLINT_ASSIGN_OR_RETURN(Picture difference,
                           FalseColorDifference(test, reference, mask ? &*mask : nullptr));
    // Its colours are meant for the display as they are; writing a PNG encodes linear light.
    for (glm::vec4& pixel : difference.pixels) {
      for (int c = 0; c < 3; ++c) pixel[c] = SrgbToLinear(pixel[c]);
    }
    GLINT_RETURN_IF_ERROR(WritePicture(difference, words.difference, {.exposure = 1, .reinhard = false}));
    Log(LogLevel::kNote, "wrote " + words.difference);
  }
  if (common.json) {
    PrintJson(ToJson(words, comparison));
  } else {
    PrintText(comparison);
  }
  return CheckBounds(words, comparison);
}

}  // namespace

Command AddCompareCommand(CLI::App& glint, CommonWords& common) {
  CLI::App& app = *glint.add_subcommand("compare", "Measure how far a picture is from a reference");
  const auto words = std::make_shared<CompareWords>();
  app.add_option("test", words->test, "Picture to judge: .exr or .hdr")->required()->type_name("PICTURE");
  app.add_option("reference", words->reference, "Picture to trust: .exr or .hdr")
      ->required()
      ->type_name("REFERENCE");
  app.add_option("--mask", words->mask,
                 "Count pixels that are white here (default: the reference's alpha > 0)")
      ->type_name("MASK.png");
  app.add_option("--block", words->block,
                 "Average blocks of N x N pixels first, which hides noise (FLIP and the number of pixels are "
                 "of the full picture)")
      ->check(CLI::Range(1, 4096))
      ->type_name("N");
  app.add_option("--diff", words->difference, "False-colour picture of the relative difference")
      ->type_name("DIFF.png");
  AddToneWords(app, words->tone);
  app.add_option("--max-rel-mse", words->max_rel_mse, "Exit with 7 if relMSE is larger")
      ->check(NumberRange(0, 1e300))
      ->type_name("X");
  app.add_option("--max-flip", words->max_flip, "Exit with 7 if FLIP is larger")
      ->check(NumberRange(0, 1e300))
      ->type_name("X");
  AddCommonWords(app, common);
  app.footer(
      "relMSE is the mean of (t - r)^2 / (r^2 + eps^2), eps = a tenth of the reference's mean.\n"
      "\n"
      "Examples:\n"
      "  glint compare teapot.exr truth.exr\n"
      "  glint compare teapot.exr truth.exr --mask mask.png --block 4 --diff difference.png --json\n"
      "  glint compare teapot.exr truth.exr --max-rel-mse 0.01");
  return [words, &common] { return RunCompare(*words, common); };
}

}  // namespace glint
