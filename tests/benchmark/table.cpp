// Sparse tables of slices: the classic and the compact form of row displacement beside compressed sparse rows
// (CSR), on the patterns of baked archives, or on made ones like them.
//   glint_benchmark_table [--from ARCHIVE.glint]... [--rows N] [--large] [--json]
// Without --from: made patterns like a teapot's (12 %) and goblets' (50 %), 25,000 x 642; with --large, 1 M
// rows too.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <functional>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>
#include <numeric>
#include <string>
#include <vector>

#include "common/archive/archive.h"
#include "common/archive/slice_table.h"
#include "common/base/frame.h"
#include "common/base/rng.h"
#include "common/domain/direction_grid.h"

namespace glint {
namespace {

constexpr uint32_t kEntryBytes = 12;

/// Which cells of a table are taken, row by row.
struct Pattern {
  std::string name;
  uint32_t columns = 0;
  std::vector<uint64_t> row_start{0};
  std::vector<uint16_t> taken{};

  uint32_t rows() const { return static_cast<uint32_t>(row_start.size() - 1); }
  std::span<const uint16_t> Row(uint32_t r) const {
    return {taken.data() + row_start[r], taken.data() + row_start[r + 1]};
  }
  void EndRow() { row_start.push_back(taken.size()); }
};

/// Smooth in [0, 1] along the surface: rows are vertices in file order, so that neighbours are alike.
float Wave(uint64_t seed, float at) {
  const auto cell = static_cast<uint32_t>(at);
  const auto value = [&](uint32_t i) { return CounterRng(seed, i).Uniform(); };
  const float f = at - static_cast<float>(cell), s = f * f * (3 - 2 * f);
  return value(cell) * (1 - s) + value(cell + 1) * s;
}

/// A blocker covers a cap of mirror directions of its own size, which moves slowly from vertex to vertex;
/// some stretches of the surface see nothing.
/// @param share  of rows that see a blocker; @param cap  largest angular radius of one, in rad
Pattern MadePattern(const std::string& name, const DirectionGrid& grid, uint32_t rows, float share,
                    float cap) {
  Pattern p{.name = name, .columns = grid.size()};
  for (uint32_t r = 0; r < rows; ++r) {
    const float at = static_cast<float>(r) / 40;
    if (Wave(1, at / 4) > 1 - share) {
      const auto axis = [&](uint64_t seed) {
        return glm::normalize(glm::vec3(Wave(seed, at), Wave(seed + 1, at), Wave(seed + 2, at)) - 0.5f +
                              1e-4f);
      };
      const glm::vec3 axes[2] = {axis(2), axis(5)};
      const float cos_cap[2] = {std::cos(cap * (0.3f + 0.7f * Wave(8, at))), std::cos(cap * Wave(9, at))};
      CounterRng rng(10, r);
      for (uint32_t c = 0; c < grid.size(); ++c) {
        // The edge of the cap is uneven by what one vertex sees and the next does not.
        const float jitter = 0.06f * (rng.Uniform() - 0.5f);
        const auto inside = [&](int k) { return glm::dot(axes[k], grid.direction(c)) + jitter > cos_cap[k]; };
        if (inside(0) || inside(1)) p.taken.push_back(static_cast<uint16_t>(c));
      }
    }
    p.EndRow();
  }
  return p;
}

Pattern PatternOf(const std::string& name, const SliceTableView& table) {
  Pattern p{.name = name, .columns = table.columns()};
  for (uint32_t r = 0; r < table.rows(); ++r) {
    table.Row(r).ForEach([&](uint32_t c, const std::byte*) { p.taken.push_back(static_cast<uint16_t>(c)); });
    p.EndRow();
  }
  return p;
}

/// Entry of the cell: its own co-ordinates, so that a wrong look-up is seen.
void FillEntry(uint32_t row, uint32_t column, std::byte* out) {
  const uint32_t words[3] = {row, column, row ^ (column << 16)};
  std::memcpy(out, words, sizeof words);
}

/// Compressed sparse rows: first entry of each row (u64) and the columns (u16), searched by halving.
struct Csr {
  std::vector<uint64_t> start;
  std::vector<uint16_t> columns;
  std::vector<std::byte> entries;

  const std::byte* Find(uint32_t row, uint32_t column) const {
    const uint16_t* begin = columns.data() + start[row];
    const uint16_t* end = columns.data() + start[row + 1];
    const uint16_t* at = std::lower_bound(begin, end, column);
    return at != end && *at == column
               ? entries.data() + static_cast<uint64_t>(at - columns.data()) * kEntryBytes
               : nullptr;
  }
};

/// CPU seconds of this thread: other programs on the machine then disturb only through the caches.
double CpuSeconds() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double Seconds(const std::function<void()>& run) {
  const double begin = CpuSeconds();
  run();
  return CpuSeconds() - begin;
}

struct Cell {
  uint32_t row, column;
};

struct Outcome {
  std::string form;
  double build_s = 0, index_bytes = 0, fill = 0, random_ns = 0, present_ns = 0;
};

/// Nanoseconds a look-up, the least of five runs: other work on the machine only adds.
template <class Find>
double LookupNs(const std::vector<Cell>& cells, bool all_present, const Find& find) {
  double best = 1e9;
  for (int repeat = 0; repeat < 5; ++repeat) {
    uint64_t wrong = 0, found = 0;
    const double s = Seconds([&] {
      for (const Cell& cell : cells) {
        const std::byte* entry = find(cell);
        if (entry == nullptr) continue;
        ++found;
        uint32_t words[2];
        std::memcpy(words, entry, sizeof words);
        wrong += words[0] != cell.row || words[1] != cell.column;
      }
    });
    if (wrong > 0 || (all_present && found != cells.size())) {
      std::fprintf(stderr, "a look-up gave a wrong entry\n");
      std::abort();
    }
    best = std::min(best, s * 1e9 / static_cast<double>(cells.size()));
  }
  return best;
}

struct Queries {
  std::vector<Cell> random, present;
};

Queries MakeQueries(const Pattern& p) {
  constexpr uint32_t kCount = 2'000'000;
  Queries q;
  for (uint32_t i = 0; i < kCount; ++i) {
    CounterRng rng(77, i);
    q.random.push_back({rng.Bits() % p.rows(), rng.Bits() % p.columns});
    const uint64_t entry = ((uint64_t{rng.Bits()} << 32) | rng.Bits()) % p.taken.size();
    const auto row = static_cast<uint32_t>(std::upper_bound(p.row_start.begin(), p.row_start.end(), entry) -
                                           p.row_start.begin() - 1);
    q.present.push_back({row, p.taken[entry]});
  }
  return q;
}

Outcome MeasureTable(const Pattern& p, const SliceTableBuilder& builder, TableForm form, const Queries& q) {
  Outcome o{.form = form == TableForm::kCompact ? "compact" : "classic"};
  std::vector<std::byte> bytes;
  o.build_s = Seconds([&] { bytes = builder.Finish(form); });
  const auto view = SliceTableView::Parse(bytes);
  if (!view.ok()) {
    std::fprintf(stderr, "%s\n", view.status().message().c_str());
    std::abort();
  }
  o.index_bytes = static_cast<double>(view->index_bytes()) / static_cast<double>(p.taken.size());
  o.fill = view->fill();
  const SliceTableView table = *view;
  const auto find = [&](const Cell& c) { return table.Find(c.row, c.column); };
  o.random_ns = LookupNs(q.random, false, find);
  o.present_ns = LookupNs(q.present, true, find);
  return o;
}

Outcome MeasureCsr(const Pattern& p, const Queries& q) {
  Outcome o{.form = "csr", .fill = 1};
  Csr csr;
  o.build_s = Seconds([&] {
    csr.start = p.row_start;
    csr.columns = p.taken;
    csr.entries.resize(p.taken.size() * kEntryBytes);
    uint64_t at = 0;
    for (uint32_t r = 0; r < p.rows(); ++r) {
      for (const uint16_t c : p.Row(r)) FillEntry(r, c, csr.entries.data() + kEntryBytes * at++);
    }
  });
  o.index_bytes = static_cast<double>(csr.start.size() * 8 + csr.columns.size() * 2) /
                  static_cast<double>(p.taken.size());
  const auto find = [&](const Cell& c) { return csr.Find(c.row, c.column); };
  o.random_ns = LookupNs(q.random, false, find);
  o.present_ns = LookupNs(q.present, true, find);
  return o;
}

nlohmann::json Measure(const Pattern& p, bool print) {
  if (p.taken.empty()) return nullptr;
  const double cells = static_cast<double>(p.rows()) * p.columns;
  uint32_t empty = 0;
  for (uint32_t r = 0; r < p.rows(); ++r) empty += p.Row(r).empty();
  SliceTableBuilder builder(p.rows(), p.columns, kEntryBytes);
  const double append_s = Seconds([&] {
    std::vector<std::byte> entries;
    for (uint32_t r = 0; r < p.rows(); ++r) {
      entries.resize(p.Row(r).size() * kEntryBytes);
      std::byte* at = entries.data();
      for (const uint16_t c : p.Row(r)) FillEntry(r, c, at), at += kEntryBytes;
      builder.AppendRow(p.Row(r), entries);
    }
  });
  const Queries q = MakeQueries(p);
  const std::vector<Outcome> outcomes = {MeasureTable(p, builder, TableForm::kCompact, q),
                                         MeasureTable(p, builder, TableForm::kClassic, q), MeasureCsr(p, q)};
  nlohmann::json json = {{"pattern", p.name},
                         {"rows", p.rows()},
                         {"columns", p.columns},
                         {"entries", p.taken.size()},
                         {"density", p.taken.size() / cells},
                         {"empty_rows", empty / double(p.rows())},
                         {"append_seconds", append_s}};
  if (print) {
    std::printf("%s: %u x %u, %.1f %% taken, %.0f %% of rows empty\n", p.name.c_str(), p.rows(), p.columns,
                100 * p.taken.size() / cells, 100.0 * empty / p.rows());
    std::printf("  %-8s %9s %14s %7s %10s %10s\n", "form", "build s", "index B/entry", "fill %", "random ns",
                "present ns");
  }
  for (const Outcome& o : outcomes) {
    json["forms"].push_back({{"form", o.form},
                             {"build_seconds", o.build_s},
                             {"index_bytes_per_entry", o.index_bytes},
                             {"fill", o.fill},
                             {"random_ns", o.random_ns},
                             {"present_ns", o.present_ns}});
    if (print) {
      std::printf("  %-8s %9.3f %14.2f %7.1f %10.1f %10.1f\n", o.form.c_str(), o.build_s, o.index_bytes,
                  100 * o.fill, o.random_ns, o.present_ns);
    }
  }
  if (print) std::fflush(stdout);
  return json;
}

int Run(int argc, char** argv) {
  std::vector<std::string> archives;
  uint32_t rows = 25000;
  bool json = false, large = false;
  for (int i = 1; i < argc; ++i) {
    const std::string arg = argv[i];
    if (arg == "--from" && i + 1 < argc) {
      archives.emplace_back(argv[++i]);
    } else if (arg == "--rows" && i + 1 < argc) {
      rows = static_cast<uint32_t>(std::max(1, std::atoi(argv[++i])));
    } else if (arg == "--large") {
      large = true;
    } else if (arg == "--json") {
      json = true;
    } else {
      std::fprintf(stderr, "usage: %s [--from ARCHIVE.glint]... [--rows N] [--large] [--json]\n", argv[0]);
      return 2;
    }
  }
  nlohmann::json results = nlohmann::json::array();
  const auto measure = [&](const Pattern& p) {
    if (auto result = Measure(p, !json); !result.is_null()) results.push_back(std::move(result));
  };
  for (const std::string& path : archives) {
    const auto archive = Archive::Open(path);
    if (!archive.ok()) {
      std::fprintf(stderr, "%s\n", archive.status().message().c_str());
      return 3;
    }
    for (size_t layer = 0; layer < archive->layers().size(); ++layer) {
      const auto& specular = archive->layers()[layer].specular;
      for (size_t k = 0; k < specular.size(); ++k) {
        measure(PatternOf(path + " table " + std::to_string(layer) + "/" + std::to_string(k), specular[k]));
      }
    }
  }
  if (archives.empty()) {
    const DirectionGrid grid(3);
    measure(MadePattern("made, like a teapot", grid, rows, 0.42f, 0.95f));
    measure(MadePattern("made, like goblets", grid, rows, 0.85f, 1.6f));
    if (large) measure(MadePattern("made, 1 M rows", grid, 1'000'000, 0.42f, 0.85f));
  }
  if (json) std::printf("%s\n", results.dump(2).c_str());
  return 0;
}

}  // namespace
}  // namespace glint

int main(int argc, char** argv) { return glint::Run(argc, argv); }
