// OpenEXR through the library's generic interfaces, from and to memory. Everything the library throws ends
// here.

#include <OpenEXR/Iex.h>
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfFrameBuffer.h>
#include <OpenEXR/ImfHeader.h>
#include <OpenEXR/ImfIO.h>
#include <OpenEXR/ImfInputFile.h>
#include <OpenEXR/ImfOutputFile.h>
#include <OpenEXR/ImfTileDescription.h>
#include <OpenEXR/ImfVersion.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <exception>
#include <mutex>

#include "common/render/image_codecs.h"

namespace glint::codec {
namespace {

/// What the library itself may accept, before our own, tighter check: the two limits are global to the
/// process.
void LimitLibraryOnce() {
  static std::once_flag once;
  std::call_once(once, [] {
    Imf::Header::setMaxImageSize(1 << 16, 1 << 16);
    Imf::Header::setMaxTileSize(1 << 12, 1 << 12);
  });
}

class MemoryInput : public Imf::IStream {
 public:
  MemoryInput(std::span<const std::byte> bytes, const std::string& name)
      : Imf::IStream(name.c_str()), bytes_(bytes) {}

  bool read(char c[], int n) override {
    if (n < 0 || position_ > bytes_.size() || static_cast<size_t>(n) > bytes_.size() - position_)
      throw Iex::InputExc("unexpected end of file");
    if (n > 0) std::memcpy(c, bytes_.data() + position_, n);
    position_ += n;
    return position_ < bytes_.size();
  }
  uint64_t tellg() override { return position_; }
  void seekg(uint64_t position) override { position_ = position; }

 private:
  std::span<const std::byte> bytes_;
  uint64_t position_ = 0;
};

class MemoryOutput : public Imf::OStream {
 public:
  explicit MemoryOutput(const std::string& name) : Imf::OStream(name.c_str()) {}

  void write(const char c[], int n) override {
    if (position_ + n > bytes_.size()) bytes_.resize(position_ + n);
    std::memcpy(bytes_.data() + position_, c, n);
    position_ += n;
  }
  uint64_t tellp() override { return position_; }
  void seekp(uint64_t position) override { position_ = position; }
  std::vector<std::byte> Take() { return std::move(bytes_); }

 private:
  std::vector<std::byte> bytes_;
  uint64_t position_ = 0;
};

struct Window {
  int64_t x, y, width, height;
};

Window ToWindow(const Imath::Box2i& box) {
  return {box.min.x, box.min.y, int64_t{box.max.x} - box.min.x + 1, int64_t{box.max.y} - box.min.y + 1};
}

constexpr size_t kFirstHeader = 8;  ///< after the magic number and the version

/// Whether every attribute of the header at `at` is in the file whole: the library makes room for what an
/// attribute claims to hold before it looks. An attribute is a name, a type, and the size of its value.
bool AttributesAreWhole(std::span<const std::byte> bytes, size_t at) {
  const auto skip_text = [&] {
    while (at < bytes.size() && bytes[at] != std::byte{0}) ++at;
    return at++ < bytes.size();
  };
  while (at < bytes.size() && bytes[at] != std::byte{0}) {
    if (!skip_text() || !skip_text() || bytes.size() - at < 4) return false;
    uint32_t size = 0;
    std::memcpy(&size, bytes.data() + at, 4);
    at += 4;
    if (size > bytes.size() - at) return false;
    at += size;
  }
  return at < bytes.size();
}

/// The most that a byte of a chunk can become.
uint64_t LargestExpansion(Imf::Compression compression) {
  constexpr uint64_t kDeflate = 1032;  // 258 bytes of two bits
  switch (compression) {
    case Imf::NO_COMPRESSION:
      return 1;
    case Imf::RLE_COMPRESSION:
      return 64;  // 128 bytes of two
    case Imf::PIZ_COMPRESSION:
      return 512;  // 256 values of 16 bits of ten bits
    case Imf::PXR24_COMPRESSION:
      return 2 * kDeflate;  // and a quarter of a float is not stored
    case Imf::B44_COMPRESSION:
    case Imf::B44A_COMPRESSION:
      return 16;  // 32 bytes of three
    case Imf::DWAA_COMPRESSION:
    case Imf::DWAB_COMPRESSION:
      return 128 * kDeflate;  // 8 x 8 values of four bytes deflated, or runs deflated
    default:
      return kDeflate;
  }
}

int64_t LinesPerChunk(Imf::Compression compression) {
  switch (compression) {
    case Imf::NO_COMPRESSION:
    case Imf::RLE_COMPRESSION:
    case Imf::ZIPS_COMPRESSION:
      return 1;
    case Imf::ZIP_COMPRESSION:
    case Imf::PXR24_COMPRESSION:
      return 16;
    case Imf::DWAB_COMPRESSION:
      return 256;
    default:
      return 32;
  }
}

/// Whether a file of `size` bytes can hold the pixels that its header promises: eight bytes for the place of
/// each chunk, eight before its data, and data that expands no further than its compression can.
bool CanHold(const Imf::Header& header, const Window& data, uint64_t size) {
  uint64_t pixel_bytes = 0;
  for (auto c = header.channels().begin(); c != header.channels().end(); ++c)
    pixel_bytes += c.channel().type == Imf::HALF ? 2 : 4;
  int64_t chunk_width = data.width, chunk_height = LinesPerChunk(header.compression());
  if (header.hasTileDescription()) {
    chunk_width = std::max(1u, header.tileDescription().xSize);
    chunk_height = std::max(1u, header.tileDescription().ySize);
  }
  const auto count = [](int64_t pixels, int64_t chunk) {
    return static_cast<uint64_t>((pixels + chunk - 1) / chunk);
  };
  const uint64_t chunks = count(data.width, chunk_width) * count(data.height, chunk_height);
  const uint64_t raw = static_cast<uint64_t>(data.width) * static_cast<uint64_t>(data.height) * pixel_bytes;
  return size / 16 >= chunks && size - 16 * chunks >= raw / LargestExpansion(header.compression());
}

/// Sizes before memory, from the header alone: opening the file already makes room for its table of chunks.
Status CheckHeader(std::span<const std::byte> bytes, const std::string& name, const PictureLimits& limits) {
  int version = 0;
  if (bytes.size() < kFirstHeader || !AttributesAreWhole(bytes, kFirstHeader))
    return BadInput(name + ": the OpenEXR header does not end; the file is cut off or damaged");
  std::memcpy(&version, bytes.data() + 4, 4);
  MemoryInput input(bytes, name);
  input.seekg(kFirstHeader);
  Imf::Header header;
  header.readFrom(input, version);
  const Window data = ToWindow(header.dataWindow()), display = ToWindow(header.displayWindow());
  GLINT_RETURN_IF_ERROR(CheckSize(data.width, data.height, limits, name));
  GLINT_RETURN_IF_ERROR(CheckSize(display.width, display.height, limits, name));
  if (!CanHold(header, data, bytes.size()))
    return BadInput(name + ": " + std::to_string(bytes.size()) + " bytes cannot hold " +
                    std::to_string(data.width) + " x " + std::to_string(data.height) +
                    " pixels; the file is cut off or damaged");
  constexpr int64_t kMaxEmpty = 64, kAlwaysAllowed = int64_t{1} << 24;
  if (display.width * display.height > std::max(kAlwaysAllowed, kMaxEmpty * data.width * data.height))
    return LimitExceeded(name + ": a display window of " + std::to_string(display.width) + " x " +
                         std::to_string(display.height) +
                         " pixels is nearly empty; crop the picture to what it shows");
  return {};
}

/// File channel that fills each of R, G, B, A; empty: not in the file.
struct ChannelNames {
  const char* name[4];
};

Result<ChannelNames> ChooseChannels(const Imf::ChannelList& channels, const std::string& name) {
  const auto has = [&](const char* c) { return channels.findChannel(c) != nullptr; };
  ChannelNames chosen{{"", "", "", has("A") ? "A" : ""}};
  if (has("R") && has("G") && has("B")) {
    chosen.name[0] = "R", chosen.name[1] = "G", chosen.name[2] = "B";
  } else if (has("Y") && !has("RY") && !has("BY")) {
    chosen.name[0] = chosen.name[1] = chosen.name[2] = "Y";
  } else {
    return BadInput(name +
                    ": has neither channels R, G, B nor a lone Y; save the picture as plain RGB or RGBA");
  }
  for (const char* c : chosen.name)
    if (*c != 0 && (channels[c].xSampling != 1 || channels[c].ySampling != 1))
      return BadInput(name + ": channel " + c + " is subsampled; save the picture with full-size channels");
  return chosen;
}

/// Reads the data window, pixels in the order R, G, B, A.
Picture ReadDataWindow(Imf::InputFile& file, const ChannelNames& names) {
  const Imath::Box2i box = file.header().dataWindow();
  const Window window = ToWindow(box);
  Picture data(static_cast<int>(window.width), static_cast<int>(window.height));
  constexpr size_t kStride = sizeof(glm::vec4);
  const bool grey = names.name[0] == names.name[1];
  Imf::FrameBuffer buffer;
  for (int c = 0; c < 4; ++c) {
    if (*names.name[c] == 0 || (grey && (c == 1 || c == 2))) continue;
    buffer.insert(names.name[c], Imf::Slice::Make(Imf::FLOAT, &data.pixels[0][c], box, kStride,
                                                  kStride * static_cast<size_t>(window.width)));
  }
  file.setFrameBuffer(buffer);
  file.readPixels(box.min.y, box.max.y);
  for (glm::vec4& pixel : data.pixels) {
    if (grey) pixel.y = pixel.z = pixel.x;
    if (*names.name[3] == 0) pixel.w = 1;
  }
  return data;
}

Picture Place(Picture data, const Window& from, const Window& to) {
  if (from.x == to.x && from.y == to.y && from.width == to.width && from.height == to.height) return data;
  Picture picture(static_cast<int>(to.width), static_cast<int>(to.height));
  const int64_t x0 = std::max(from.x, to.x), x1 = std::min(from.x + from.width, to.x + to.width);
  const int64_t y0 = std::max(from.y, to.y), y1 = std::min(from.y + from.height, to.y + to.height);
  for (int64_t y = y0; y < y1; ++y)
    for (int64_t x = x0; x < x1; ++x)
      picture.at(static_cast<int>(x - to.x), static_cast<int>(y - to.y)) =
          data.at(static_cast<int>(x - from.x), static_cast<int>(y - from.y));
  return picture;
}

Result<Picture> Decode(std::span<const std::byte> bytes, const std::string& name,
                       const PictureLimits& limits) {
  GLINT_RETURN_IF_ERROR(CheckHeader(bytes, name, limits));
  MemoryInput input(bytes, name);
  Imf::InputFile file(input, 0);
  const Window data = ToWindow(file.header().dataWindow());
  const Window display = ToWindow(file.header().displayWindow());
  GLINT_ASSIGN_OR_RETURN(const ChannelNames names, ChooseChannels(file.header().channels(), name));
  return Place(ReadDataWindow(file, names), data, display);
}

template <class T>
std::vector<T> Interleaved(const Picture& picture) {
  std::vector<T> values(picture.pixels.size() * 4);
  for (size_t i = 0; i < picture.pixels.size(); ++i)
    for (int c = 0; c < 4; ++c) {
      float v = picture.pixels[i][c];
      if constexpr (sizeof(T) == 2) v = std::isfinite(v) ? std::clamp(v, -65504.0f, 65504.0f) : v;
      values[4 * i + c] = T(v);
    }
  return values;
}

template <class T>
std::vector<std::byte> Encode(const Picture& picture, const std::string& name, Imf::PixelType type) {
  const std::vector<T> values = Interleaved<T>(picture);
  Imf::Header header(picture.width, picture.height);
  header.compression() = Imf::ZIP_COMPRESSION;
  Imf::FrameBuffer buffer;
  for (int c = 0; c < 4; ++c) {
    const std::string channel(1, "RGBA"[c]);
    header.channels().insert(channel, Imf::Channel(type));
    // The library declares its buffers writable but only reads from them here.
    char* base = const_cast<char*>(reinterpret_cast<const char*>(values.data() + c));
    buffer.insert(channel, Imf::Slice(type, base, 4 * sizeof(T), 4 * sizeof(T) * picture.width));
  }
  MemoryOutput output(name);
  {
    Imf::OutputFile file(output, header, 0);
    file.setFrameBuffer(buffer);
    file.writePixels(picture.height);
  }
  return output.Take();
}

}  // namespace

Result<Picture> DecodeExr(std::span<const std::byte> bytes, const std::string& name,
                          const PictureLimits& limits) {
  LimitLibraryOnce();
  try {
    return Decode(bytes, name, limits);
  } catch (const std::bad_alloc&) {
    return LimitExceeded(name + ": not enough memory to read this OpenEXR file; scale the picture down");
  } catch (const std::exception& e) {
    return BadInput(name + ": cannot be read as OpenEXR (" + e.what() + "); write the file again");
  }
}

Result<std::vector<std::byte>> EncodeExr(const Picture& picture, const std::string& name, bool full_float) {
  LimitLibraryOnce();
  try {
    return full_float ? Encode<float>(picture, name, Imf::FLOAT)
                      : Encode<Imath::half>(picture, name, Imf::HALF);
  } catch (const std::exception& e) {
    return InternalError(name + ": OpenEXR could not encode the picture (" + e.what() + ")");
  }
}

}  // namespace glint::codec
