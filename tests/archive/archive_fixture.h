#pragma once

#include <cmath>
#include <span>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/format.h"
#include "common/archive/lobe_codec.h"
#include "common/archive/slice_table.h"
#include "common/base/hash.h"
#include "common/base/rng.h"

namespace glint::archive_fixture {

/// A made surface and tables that are right in form; their values mean nothing.
struct Content {
  BakeDomain domain;
  std::vector<std::vector<std::vector<std::byte>>> tables;  ///< [layer][slot]
  ArchiveContent content;
};

inline glm::vec3 Random(CounterRng* rng, float low, float high) {
  glm::vec3 v;
  for (int c = 0; c < 3; ++c) v[c] = low + (high - low) * rng->Uniform();
  return v;
}

inline glm::vec3 RandomUnit(CounterRng* rng) {
  const float z = 2 * rng->Uniform() - 1, phi = 6.2831853f * rng->Uniform(), r = std::sqrt(1 - z * z);
  return {r * std::cos(phi), r * std::sin(phi), z};
}

inline BrdfShape MakeShape(CounterRng* rng, BrdfModel model, int lobes) {
  BrdfShape shape;
  shape.model = model;
  shape.shape = rng->Uniform();
  shape.lobes = lobes;
  shape.slices.resize(kElevationNodes);
  for (BrdfSlice& slice : shape.slices) {
    slice.lobes = lobes;
    for (int k = 0; k < lobes; ++k) {
      const float angle = 3 * rng->Uniform();
      slice.lobe[k].mu_x = -std::sin(angle);
      slice.lobe[k].mu_z = std::cos(angle);
      slice.lobe[k].kappa = 100 * rng->Uniform();
      slice.lobe[k].scale = rng->Uniform();
      slice.lobe[k].bias = rng->Uniform();
      slice.lobe[k].above = rng->Uniform();
    }
  }
  shape.error = {rng->Uniform(), rng->Uniform(), rng->Uniform(), rng->Uniform()};
  return shape;
}

inline BakeDomain MakeDomain(uint32_t vertices, uint32_t triangles, int lobes) {
  BakeDomain domain;
  CounterRng rng(17, vertices, triangles);
  domain.shapes.push_back(MakeShape(&rng, BrdfModel::kGgx, lobes));
  domain.shapes.push_back(MakeShape(&rng, BrdfModel::kPhong, 1));
  for (uint32_t v = 0; v < vertices; ++v) {
    domain.positions.push_back(Random(&rng, -1e3f, 1e3f));
    domain.normals.push_back(RandomUnit(&rng));
    domain.specular.push_back(Random(&rng, 0, 1));
    domain.diffuse.push_back(Random(&rng, 0, 1));
    domain.shape.push_back(static_cast<uint16_t>(v % 2));
    domain.double_sided.push_back(static_cast<uint8_t>(v % 3 == 0));
  }
  for (uint32_t t = 0; t < triangles; ++t) {
    // Degenerate and repeated ones too: their order and number must come back.
    domain.triangles.push_back({rng.Bits() % vertices, rng.Bits() % vertices, rng.Bits() % vertices});
    domain.triangle_double_sided.push_back(static_cast<uint8_t>(t % 3 == 1));
  }
  return domain;
}

inline std::vector<std::byte> MakeTable(const BakeDomain& domain, uint32_t columns, bool direct, bool diffuse,
                                        TableForm form, uint64_t seed, int lobe = 0) {
  SliceTableBuilder builder(domain.vertex_count(), columns, direct ? kDirectEntryBytes : kIndirectEntryBytes);
  for (uint32_t v = 0; v < domain.vertex_count(); ++v) {
    CounterRng rng(seed, v, static_cast<uint32_t>(lobe));
    std::vector<uint16_t> taken;
    std::vector<std::byte> entries;
    for (uint32_t c = 0; c < columns; ++c) {
      // Every third slice has a second lobe, and so on.
      const float stored = CounterRng(seed, v, c, 7).Uniform();
      if (stored > 0.3f * std::pow(1 / 3.0f, static_cast<float>(lobe))) continue;
      if (diffuse && c == 1 && !domain.double_sided[v]) continue;
      taken.push_back(static_cast<uint16_t>(c));
      entries.resize(entries.size() + 12);
      std::byte* out = entries.data() + entries.size() - 12;
      if (direct) {
        const float most = std::ldexp(1.0f, -lobe - 1);  // a slice's parts are no more than the whole
        EncodeDirect({most * rng.Uniform(), Random(&rng, -1, 1), 1 + rng.Uniform()}, out);
      } else {
        EncodeIndirect({Random(&rng, 0, 1), RandomUnit(&rng), 100 * rng.Uniform()}, out);
      }
    }
    builder.AppendRow(taken, entries);
  }
  return builder.Finish(form);
}

/// Everything that WriteArchive needs; grid level 0 (12 directions) keeps it small.
inline Content MakeContent(uint32_t vertices = 9, uint32_t triangles = 7, int lobes = 2, int layers = 2,
                           TableForm form = TableForm::kCompact, int slice_lobes = 2) {
  Content c;
  c.domain = MakeDomain(vertices, triangles, lobes);
  c.tables.resize(layers);
  for (int layer = 0; layer < layers; ++layer) {
    for (int lobe = 0; lobe < slice_lobes; ++lobe)
      for (int slot = 0; slot <= lobes; ++slot)
        c.tables[layer].push_back(MakeTable(c.domain, slot == lobes ? 2 : 12, layer == 0, slot == lobes, form,
                                            uint64_t{10} * layer + slot, lobe));
  }
  c.content.grid_level = 0;
  c.content.slice_lobes = slice_lobes;
  c.content.cameras = {{"main", {0.1f, 2, 3}, {0, 0, -1}, {0, 1, 0}, 0.7f},
                       {"\"caf\u00e9\"", {}, {1, 0, 0}, {0, 0, 1}, 1}};
  c.content.report_json = "{\"seconds\": 1.25,\n \"note\": \"kept as it is\"}";
  for (int i = 0; i < 32; ++i) c.content.archive_key.bytes[i] = static_cast<uint8_t>(i * 7);
  return c;
}

/// Points the content at what it holds; call it where the Content has its final address.
inline const ArchiveContent& Link(Content* c) {
  c->content.domain = &c->domain;
  c->content.layer_bytes.clear();
  for (const auto& layer : c->tables) c->content.layer_bytes.emplace_back(layer.begin(), layer.end());
  return c->content;
}

/// Makes every checksum right again after bytes were changed, as far as the frame can still be followed: so
/// that tests and fuzzing reach what stands behind the checksums.
inline void Reseal(std::span<std::byte> file) {
  using namespace archive_format;
  if (file.size() < kHeaderBytes + kTailBytes) return;
  const auto get = [&](uint64_t at) {
    uint64_t value;
    std::memcpy(&value, file.data() + at, 8);
    return value;
  };
  const auto put = [&](uint64_t at, uint64_t value) { std::memcpy(file.data() + at, &value, 8); };
  put(120, Checksum64(file.first(120)));
  const uint64_t tail = file.size() - kTailBytes, records = get(tail + 8);
  put(tail + 32, Checksum64(file.first(kHeaderBytes)));
  if (records <= tail) {
    for (uint64_t at = records; at + kRecordBytes <= tail; at += kRecordBytes) {
      const uint64_t offset = get(at + 16), stored = get(at + 24);
      if (offset <= file.size() && stored <= file.size() - offset)
        put(at + 40, Checksum64(file.subspan(offset, stored)));
    }
    put(tail + 40, Checksum64(file.subspan(records, tail - records)));
  }
  put(tail + 56, Checksum64(file.subspan(tail, 56)));
}

}  // namespace glint::archive_fixture
