#pragma once

// tinygltf under a namespace of our own, built here (tinygltf.cpp). Two reasons: Debian's libdraco exports a
// second, differently configured tinygltf under the same names, which would take the place of the library's;
// and only the parsing of documents is wanted: files, buffers and images are read by Glint within its bounds.
#define TINYGLTF_NO_STB_IMAGE
#define TINYGLTF_NO_STB_IMAGE_WRITE
#define TINYGLTF_NO_EXTERNAL_IMAGE
#define TINYGLTF_NO_FS
#define tinygltf glint_tinygltf
#include <tiny_gltf.h>
#undef tinygltf

namespace glint {
namespace tinygltf = ::glint_tinygltf;
}  // namespace glint
