// Radiance RGBE pictures (Ward, "Real Pixels", Graphics Gems II; the file format page of the Radiance
// manual). A mantissa byte m with exponent e means m 2^(e - 136), as most readers take it (no half step
// added).

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstring>
#include <string_view>

#include "common/render/image_codecs.h"

namespace glint::codec {
namespace {

using Rgbe = std::array<uint8_t, 4>;

constexpr int kMinRleWidth = 8, kMaxRleWidth = 0x7fff;
constexpr size_t kMaxHeaderLine = 4096;

struct Axis {
  bool vertical = false;  ///< Y
  bool flipped = false;   ///< runs against our order (+Y up is flipped, -X is flipped)
  int64_t count = 0;
};

struct HdrHeader {
  float scale = 1;  ///< radiance of a stored unit: 1 / product of EXPOSURE lines
  Axis major, minor;
};

/// Reads bytes with bounds.
class Cursor {
 public:
  explicit Cursor(std::span<const std::byte> bytes) : bytes_(bytes) {}
  size_t remaining() const { return bytes_.size() - position_; }
  bool Take(uint8_t& value) {
    if (remaining() == 0) return false;
    value = std::to_integer<uint8_t>(bytes_[position_++]);
    return true;
  }
  bool Take(Rgbe& value) {
    if (remaining() < 4) return false;
    std::memcpy(value.data(), bytes_.data() + position_, 4);
    position_ += 4;
    return true;
  }
  bool Peek(Rgbe& value) const {
    if (remaining() < 4) return false;
    std::memcpy(value.data(), bytes_.data() + position_, 4);
    return true;
  }
  void Skip(size_t n) { position_ += n; }
  /// Line without its end; false at the end of the file or when it is overlong.
  bool TakeLine(std::string_view& line) {
    const char* begin = reinterpret_cast<const char*>(bytes_.data()) + position_;
    const std::string_view rest(begin, std::min(remaining(), kMaxHeaderLine));
    const size_t end = rest.find('\n');
    if (end == std::string_view::npos) return false;
    line = rest.substr(0, end);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    position_ += end + 1;
    return true;
  }

 private:
  std::span<const std::byte> bytes_;
  size_t position_ = 0;
};

std::string_view TakeWord(std::string_view& text) {
  const size_t begin = std::min(text.find_first_not_of(' '), text.size());
  text.remove_prefix(begin);
  const std::string_view word = text.substr(0, text.find(' '));
  text.remove_prefix(word.size());
  return word;
}

template <class T>
bool ParseWhole(std::string_view word, T& value) {
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  return error == std::errc() && end == word.data() + word.size();
}

bool ParseAxis(std::string_view& line, Axis& axis) {
  const std::string_view name = TakeWord(line), count = TakeWord(line);
  if (name.size() != 2 || (name[0] != '+' && name[0] != '-') || (name[1] != 'X' && name[1] != 'Y'))
    return false;
  axis.vertical = name[1] == 'Y';
  axis.flipped = (name[0] == '+') == axis.vertical;
  return ParseWhole(count, axis.count) && axis.count > 0;
}

Status ApplyVariable(std::string_view line, const std::string& name, HdrHeader& header) {
  constexpr std::string_view kFormat = "FORMAT=", kExposure = "EXPOSURE=";
  if (line.starts_with(kFormat) && line.substr(kFormat.size()) != "32-bit_rle_rgbe")
    return BadInput(name + ": pixel format '" + std::string(line.substr(kFormat.size())) +
                    "' is not 32-bit_rle_rgbe; convert the picture to RGBE");
  if (line.starts_with(kExposure)) {
    std::string_view text = line.substr(kExposure.size());
    float exposure = 0;
    if (!ParseWhole(TakeWord(text), exposure) || !(exposure > 1e-20f) || !(exposure < 1e20f))
      return BadInput(name + ": EXPOSURE must be a positive number; correct the header");
    header.scale /= exposure;
    if (!(header.scale > 1e-20f && header.scale < 1e20f))
      return BadInput(name + ": the EXPOSURE lines multiply to an unusable number; correct the header");
  }
  return {};
}

Result<HdrHeader> ParseHeader(Cursor& cursor, const std::string& name) {
  const Status cut = BadInput(name + ": the Radiance header does not end; the file is cut off or damaged");
  HdrHeader header;
  std::string_view line;
  if (!cursor.TakeLine(line)) return cut;  // "#?RADIANCE" or another program's name
  while (true) {
    if (!cursor.TakeLine(line)) return cut;
    if (line.empty()) break;
    GLINT_RETURN_IF_ERROR(ApplyVariable(line, name, header));
  }
  if (!cursor.TakeLine(line)) return cut;
  if (!ParseAxis(line, header.major) || !ParseAxis(line, header.minor) ||
      header.major.vertical == header.minor.vertical)
    return BadInput(name + ": the resolution line is not like '-Y 512 +X 1024'; write the file again");
  return header;
}

/// One run-length coded plane of a scan line: counts above 128 repeat the next byte, others copy.
bool ReadPlane(Cursor& cursor, std::vector<Rgbe>& line, int channel) {
  for (size_t x = 0; x < line.size();) {
    uint8_t count = 0, value = 0;
    if (!cursor.Take(count)) return false;
    const bool run = count > 128;
    const size_t n = run ? count - 128u : count;
    if (n == 0 || n > line.size() - x) return false;
    for (size_t i = 0; i < n; ++i) {
      if ((!run || i == 0) && !cursor.Take(value)) return false;
      line[x++][channel] = value;
    }
  }
  return true;
}

/// Plain pixels, in which (1, 1, 1, n) repeats the one before; consecutive repeats count in base 256.
bool ReadOldLine(Cursor& cursor, std::vector<Rgbe>& line) {
  int shift = 0;
  for (size_t x = 0; x < line.size();) {
    Rgbe pixel;
    if (!cursor.Take(pixel)) return false;
    if (pixel[0] != 1 || pixel[1] != 1 || pixel[2] != 1) {
      line[x++] = pixel;
      shift = 0;
      continue;
    }
    const size_t n = shift < 24 ? static_cast<size_t>(pixel[3]) << shift : line.size() + 1;
    if (x == 0 || n > line.size() - x) return false;
    std::fill_n(line.begin() + static_cast<std::ptrdiff_t>(x), n, line[x - 1]);
    x += n;
    shift += 8;
  }
  return true;
}

bool ReadLine(Cursor& cursor, std::vector<Rgbe>& line) {
  Rgbe start;
  if (!cursor.Peek(start)) return false;
  const int width = static_cast<int>(line.size());
  const bool planes = width >= kMinRleWidth && width <= kMaxRleWidth && start[0] == 2 && start[1] == 2 &&
                      (start[2] << 8 | start[3]) == width;
  if (!planes) return ReadOldLine(cursor, line);
  cursor.Skip(4);
  for (int c = 0; c < 4; ++c)
    if (!ReadPlane(cursor, line, c)) return false;
  return true;
}

glm::vec4 Decode(const Rgbe& pixel, float scale) {
  if (pixel[3] == 0) return {0, 0, 0, 1};
  const float unit = std::ldexp(scale, pixel[3] - 136);
  return {unit * pixel[0], unit * pixel[1], unit * pixel[2], 1};
}

Rgbe Quantize(const glm::vec4& pixel) {
  constexpr float kLargest = 0x1.fep126f;  // 255 * 2^119: the exponent byte stays within 255
  float value[3], largest = 0;
  for (int c = 0; c < 3; ++c) {
    value[c] = pixel[c] > 0 ? std::min(pixel[c], kLargest) : 0.0f;
    largest = std::max(largest, value[c]);
  }
  if (largest < 1e-32f) return {};
  int exponent = 0;
  std::frexp(largest, &exponent);
  if (std::ldexp(largest, 8 - exponent) > 255.5f) ++exponent;  // would round up to 256
  Rgbe out;
  for (int c = 0; c < 3; ++c)
    out[c] = static_cast<uint8_t>(std::min(255.0f, std::floor(std::ldexp(value[c], 8 - exponent) + 0.5f)));
  out[3] = static_cast<uint8_t>(exponent + 128);
  return out;
}

/// Runs of at least four equal bytes are worth their two bytes; everything between is copied.
void WritePlane(const std::vector<uint8_t>& plane, std::vector<std::byte>& out) {
  const auto run_at = [&](size_t x) {
    size_t n = 1;
    while (x + n < plane.size() && n < 127 && plane[x + n] == plane[x]) ++n;
    return n;
  };
  for (size_t x = 0; x < plane.size();) {
    if (const size_t run = run_at(x); run >= 4) {
      out.push_back(std::byte(128 + run));
      out.push_back(std::byte(plane[x]));
      x += run;
      continue;
    }
    size_t end = x + 1;
    while (end < plane.size() && end - x < 128 && run_at(end) < 4) ++end;
    out.push_back(std::byte(end - x));
    for (; x < end; ++x) out.push_back(std::byte(plane[x]));
  }
}

}  // namespace

Result<Picture> DecodeHdr(std::span<const std::byte> bytes, const std::string& name,
                          const PictureLimits& limits) {
  Cursor cursor(bytes);
  GLINT_ASSIGN_OR_RETURN(const HdrHeader header, ParseHeader(cursor, name));
  const Axis& horizontal = header.major.vertical ? header.minor : header.major;
  const Axis& vertical = header.major.vertical ? header.major : header.minor;
  GLINT_RETURN_IF_ERROR(CheckSize(horizontal.count, vertical.count, limits, name));
  const Status damaged = BadInput(name + ": the pixel data is cut off or damaged; write the file again");
  // Whatever the coding, a line takes four bytes or more: a short file cannot ask for much memory.
  if (cursor.remaining() / 4 < static_cast<uint64_t>(header.major.count)) return damaged;

  Picture picture(static_cast<int>(horizontal.count), static_cast<int>(vertical.count));
  std::vector<Rgbe> line(static_cast<size_t>(header.minor.count));
  for (int64_t i = 0; i < header.major.count; ++i) {
    if (!ReadLine(cursor, line)) return damaged;
    const int64_t a = header.major.flipped ? header.major.count - 1 - i : i;
    for (int64_t j = 0; j < header.minor.count; ++j) {
      const int64_t b = header.minor.flipped ? header.minor.count - 1 - j : j;
      const int x = static_cast<int>(header.major.vertical ? b : a);
      const int y = static_cast<int>(header.major.vertical ? a : b);
      picture.at(x, y) = Decode(line[static_cast<size_t>(j)], header.scale);
    }
  }
  return picture;
}

std::vector<std::byte> EncodeHdr(const Picture& picture) {
  const std::string header = "#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y " + std::to_string(picture.height) +
                             " +X " + std::to_string(picture.width) + "\n";
  std::vector<std::byte> out(header.size());
  std::memcpy(out.data(), header.data(), header.size());
  const bool planes = picture.width >= kMinRleWidth && picture.width <= kMaxRleWidth;
  std::vector<Rgbe> line(static_cast<size_t>(picture.width));
  std::vector<uint8_t> plane(line.size());
  for (int y = 0; y < picture.height; ++y) {
    for (int x = 0; x < picture.width; ++x) line[x] = Quantize(picture.at(x, y));
    if (!planes) {
      for (const Rgbe& pixel : line)
        for (const uint8_t value : pixel) out.push_back(std::byte(value));
      continue;
    }
    for (const int value : {2, 2, picture.width >> 8, picture.width & 255}) out.push_back(std::byte(value));
    for (int c = 0; c < 4; ++c) {
      for (size_t x = 0; x < line.size(); ++x) plane[x] = line[x][c];
      WritePlane(plane, out);
    }
  }
  return out;
}

}  // namespace glint::codec
