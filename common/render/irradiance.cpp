#include "common/render/irradiance.h"

#include <array>
#include <cmath>
#include <numbers>

#include "common/base/frame.h"

namespace glint {
namespace {

/// Texels along either side of a leaf, and of a bright block.
constexpr int kLeaf = 8, kBrightBlock = 4;
constexpr size_t kMaxBright = 8;
constexpr float kBrightShare = 0.001f;
/// Coarse maps are resampled first, so that leaves are small: at least this many texels.
constexpr int kMinWidth = 1024, kMinHeight = 512;
constexpr int kMaxDepth = 64;

}  // namespace

/// Radiance x solid angle / pi of every texel of the map, or of a finer copy of a coarse one.
struct IrradianceTree::Texels {
  int width, height;
  std::vector<glm::vec3> light;

  explicit Texels(const Environment& environment)
      : width(std::max(environment.width(), kMinWidth)), height(std::max(environment.height(), kMinHeight)) {
    const bool same = width == environment.width() && height == environment.height();
    light.reserve(static_cast<size_t>(width) * height);
    for (int y = 0; y < height; ++y) {
      const double top = (0.5 - static_cast<double>(y) / height) * std::numbers::pi;
      const double bottom = (0.5 - static_cast<double>(y + 1) / height) * std::numbers::pi;
      const float share = static_cast<float>((std::sin(top) - std::sin(bottom)) * 2 / width);
      for (int x = 0; x < width; ++x)
        light.push_back(share * (same ? environment.texels()[light.size()]
                                      : environment.Radiance(Direction(x + 0.5f, y + 0.5f))));
    }
  }

  glm::vec3 Direction(float x, float y) const {
    return Environment::Direction(x / static_cast<float>(width), y / static_cast<float>(height));
  }
  glm::vec3& at(int x, int y) { return light[static_cast<size_t>(y) * width + x]; }

  IrradianceMoment Moment(int x0, int x1, int y0, int y1) const {
    IrradianceMoment moment;
    for (int y = y0; y < y1; ++y)
      for (int x = x0; x < x1; ++x) {
        const glm::vec3 d = Direction(static_cast<float>(x) + 0.5f, static_cast<float>(y) + 0.5f);
        for (int c = 0; c < 3; ++c) moment.channel[c] += light[static_cast<size_t>(y) * width + x][c] * d;
      }
    return moment;
  }
};

IrradianceTree::IrradianceTree(const Environment& environment) {
  Texels texels(environment);
  SetBrightApart(texels);
  Build(texels, 0, texels.width, 0, texels.height);
}

void IrradianceTree::SetBrightApart(Texels& texels) {
  struct Block {
    double light;
    int x, y;
  };
  double total = 0;
  std::vector<Block> blocks;
  const auto for_each = [&](const Block& block, const auto& body) {
    for (int y = block.y; y < std::min(block.y + kBrightBlock, texels.height); ++y)
      for (int x = block.x; x < std::min(block.x + kBrightBlock, texels.width); ++x) body(texels.at(x, y));
  };
  for (int y = 0; y < texels.height; y += kBrightBlock)
    for (int x = 0; x < texels.width; x += kBrightBlock) {
      Block block{0, x, y};
      for_each(block, [&](const glm::vec3& light) { block.light += Luminance(light); });
      total += block.light;
      blocks.push_back(block);
    }
  std::erase_if(blocks, [&](const Block& block) { return !(block.light > kBrightShare * total); });
  std::stable_sort(blocks.begin(), blocks.end(),
                   [](const Block& a, const Block& b) { return a.light > b.light; });
  if (blocks.size() > kMaxBright) blocks.resize(kMaxBright);
  for (const Block& block : blocks) {
    bright_.push_back(texels.Moment(block.x, std::min(block.x + kBrightBlock, texels.width), block.y,
                                    std::min(block.y + kBrightBlock, texels.height)));
    for_each(block, [](glm::vec3& light) { light = glm::vec3(0); });
  }
}

int IrradianceTree::Build(const Texels& texels, int x0, int x1, int y0, int y1) {
  const int index = static_cast<int>(nodes_.size());
  nodes_.emplace_back();
  // The cone: around the middle of the block, as wide as its corners and edges' middles; blocks of more than
  // a quarter turn are always opened.
  Node node;
  const float middle_x = 0.5f * static_cast<float>(x0 + x1), middle_y = 0.5f * static_cast<float>(y0 + y1);
  node.center = texels.Direction(middle_x, middle_y);
  if (4 * (x1 - x0) <= texels.width) {
    float cosine = 1;
    for (const float x : {static_cast<float>(x0), middle_x, static_cast<float>(x1)})
      for (const float y : {static_cast<float>(y0), middle_y, static_cast<float>(y1)})
        cosine = std::min(cosine, glm::dot(node.center, texels.Direction(x, y)));
    // The widest point of a short edge may lie between the three that were looked at: a tenth of margin.
    if (cosine > 0) node.sine = 1.1f * std::sqrt(std::max(0.0f, 1 - cosine * cosine)) + 1e-4f;
  }
  if (x1 - x0 <= kLeaf && y1 - y0 <= kLeaf) {
    node.moment = texels.Moment(x0, x1, y0, y1);
    nodes_[index] = node;
    return index;
  }
  const bool wide = x1 - x0 >= y1 - y0;
  const int cut = wide ? (x0 + x1) / 2 : (y0 + y1) / 2;
  const int first = wide ? Build(texels, x0, cut, y0, y1) : Build(texels, x0, x1, y0, cut);
  node.second = wide ? Build(texels, cut, x1, y0, y1) : Build(texels, x0, x1, cut, y1);
  for (int c = 0; c < 3; ++c)
    node.moment.channel[c] = nodes_[first].moment.channel[c] + nodes_[node.second].moment.channel[c];
  nodes_[index] = node;
  return index;
}

glm::vec3 IrradianceTree::DimAverage(const glm::vec3& n) const {
  glm::vec3 sum(0);
  std::array<int, kMaxDepth> open;
  int count = 0;
  open[count++] = 0;
  while (count > 0) {
    const int index = open[--count];
    const Node& node = nodes_[index];
    const float height = glm::dot(n, node.center);
    if (height <= -node.sine) continue;
    if (height < node.sine && node.second != 0) {
      open[count++] = node.second;
      open[count++] = index + 1;
      continue;
    }
    sum += node.moment.Average(n);
  }
  return sum;
}

}  // namespace glint
