// Seeds for fuzz_picture: small pictures in both formats, run-length encoded and plain.
//   make_picture_corpus FOLDER
#include <cstdio>
#include <filesystem>
#include <fstream>

#include "common/render/image.h"

namespace {

using namespace glint;

Picture MakePicture(int width, int height) {
  Picture picture(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      // Flat parts too, which are what run lengths are for.
      const float value = x < width / 2 ? 0.25f : 0.1f * static_cast<float>(x * y);
      picture.at(x, y) = {value, 2 * value, 1, y % 2 == 0 ? 1 : 0};
    }
  }
  return picture;
}

bool Write(const Picture& picture, const std::filesystem::path& path, bool full_float = false) {
  const Status status = WritePicture(picture, path, {}, full_float);
  if (!status.ok()) std::fprintf(stderr, "%s\n", status.message().c_str());
  return status.ok();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::fprintf(stderr, "usage: make_picture_corpus FOLDER\n");
    return 2;
  }
  const std::filesystem::path folder = argv[1];
  std::filesystem::create_directories(folder);
  std::ofstream(folder / "flat.hdr", std::ios::binary)
      << "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\nabcdefgh";
  return Write(MakePicture(24, 5), folder / "runs.hdr") && Write(MakePicture(4, 3), folder / "small.hdr") &&
                 Write(MakePicture(9, 7), folder / "half.exr") &&
                 Write(MakePicture(9, 7), folder / "float.exr", true)
             ? 0
             : 1;
}
