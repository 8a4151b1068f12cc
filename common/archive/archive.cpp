// The transfer archive: writing, and opening in place. The frame is in format.cpp, the sections' contents in
// sections.cpp, the tables in slice_table.cpp. Bytes: docs/archive-format.md.
#include "common/archive/archive.h"

#include <algorithm>
#include <utility>

#include "common/archive/format.h"
#include "common/archive/lobe_codec.h"
#include "common/archive/sections.h"
#include "common/base/files.h"
#include "common/base/hash.h"
#include "common/domain/bake_settings.h"
#include "common/domain/direction_grid.h"

namespace glint {
namespace {

using namespace archive_format;

uint32_t LargestLobeCount(const std::vector<BrdfShape>& shapes) {
  int lobes = 0;
  for (const BrdfShape& shape : shapes) lobes = std::max(lobes, shape.lobes);
  return static_cast<uint32_t>(lobes);
}

std::span<const std::byte> AsBytes(const std::string& text) { return std::as_bytes(std::span(text)); }

/// Whether a table belongs where the archive has it: one row a bake vertex, one column a direction (or side).
Status CheckTable(const SliceTableView& table, const Header& header, bool diffuse) {
  if (table.rows() != header.rows) return BadInput("its rows are not the bake vertices");
  if (table.columns() != (diffuse ? 2 : DirectionGrid::SizeOf(static_cast<int>(header.grid_level)))) {
    return BadInput("its columns are not the directions");
  }
  if (std::find(kEntryBytes.begin(), kEntryBytes.end(), table.entry_bytes()) == kEntryBytes.end()) {
    return BadInput("its entries have a wrong size");
  }
  return {};
}

// ---- Writing ----

Header MakeHeader(const ArchiveContent& content) {
  Header header;
  header.grid_level = static_cast<uint32_t>(content.grid_level);
  header.base_level = static_cast<uint32_t>(std::min(content.base_level, content.grid_level));
  header.layers = static_cast<uint32_t>(content.layer_bytes.size());
  header.slots = LargestLobeCount(content.domain->shapes);
  header.slice_lobes = header.direct_lobes = static_cast<uint32_t>(content.slice_lobes);
  header.vertices = content.domain->positions.size();
  header.triangles = content.domain->triangles.size();
  header.rows = content.domain->row_count();
  header.archive_key = content.archive_key;
  return header;
}

/// What the domain must be for its archive to open again; a failure is a bug of the caller.
Status CheckContent(const ArchiveContent& content) {
  const BakeDomain& d = *content.domain;
  const size_t vertices = d.positions.size();
  if (vertices > kMaxVertices || d.triangles.size() > kMaxTriangles) {
    return LimitExceeded("more vertices or triangles than an archive can hold (" +
                         std::to_string(kMaxVertices) + ", " + std::to_string(kMaxTriangles) +
                         "); simplify the scene");
  }
  if (d.normals.size() != vertices || d.specular.size() != vertices || d.diffuse.size() != vertices ||
      d.shape.size() != vertices || d.double_sided.size() != vertices ||
      d.triangle_double_sided.size() != d.triangles.size()) {
    return InternalError("archive: the domain's arrays have different lengths");
  }
  if (content.grid_level < 0 || content.grid_level > DirectionGrid::kMaxLevel) {
    return InternalError("archive: direction level " + std::to_string(content.grid_level) +
                         " is out of range");
  }
  if (content.base_level < 0) return InternalError("archive: the base level is negative");
  if (content.layer_bytes.size() > kMaxLayers) return LimitExceeded("archive: more than 256 layers");
  if (content.slice_lobes < 1 || content.slice_lobes > kMaxSliceLobes) {
    return InternalError("archive: " + std::to_string(content.slice_lobes) + " lobes a slice");
  }
  const Header header = MakeHeader(content);
  for (uint32_t layer = 0; layer < header.layers; ++layer) {
    if (content.layer_bytes[layer].size() != header.tables(layer)) {
      return InternalError("archive: layer " + std::to_string(layer) + " has " +
                           std::to_string(content.layer_bytes[layer].size()) + " tables, not " +
                           std::to_string(header.tables(layer)));
    }
  }
  return {};
}

/// Appends aligned sections to the file and remembers their records.
class SectionWriter {
 public:
  explicit SectionWriter(FilePublisher* file) : file_(file) {}

  Status Header(std::span<const std::byte> header) { return file_->Write(header); }

  Status Add(Kind kind, Codec codec, std::span<const std::byte> stored, uint64_t raw_bytes,
             uint32_t layer = 0, uint32_t slot = 0) {
    sections_.push_back(
        {kind, codec, layer, slot, file_->offset(), stored.size(), raw_bytes, Checksum64(stored)});
    GLINT_RETURN_IF_ERROR(file_->Write(stored));
    static constexpr std::array<std::byte, kAlignment> kZeros{};
    return file_->Write(std::span(kZeros).first(Align(file_->offset()) - file_->offset()));
  }

  Status AddCompressed(Kind kind, std::span<const std::byte> raw) {
    if (kind != Kind::kVertices && kind != Kind::kNodes && raw.size() > kMaxVariableBytes) {
      return LimitExceeded("archive: section " + Section{.kind = kind}.Name() + " is larger than 64 MiB");
    }
    GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> stored, Compress(raw));
    return Add(kind, Codec::kZstd, stored, raw.size());
  }

  Status Footer(std::span<const std::byte> header) {
    return file_->Write(EncodeFooter(sections_, header, file_->offset()));
  }

 private:
  FilePublisher* file_;
  std::vector<Section> sections_;
};

Status WriteTables(const ArchiveContent& content, const Header& header, SectionWriter* out) {
  for (uint32_t layer = 0; layer < header.layers; ++layer) {
    for (uint32_t slot = 0; slot < header.tables(layer); ++slot) {
      const std::span<const std::byte> bytes = content.layer_bytes[layer][slot];
      const auto table = SliceTableView::Parse(bytes);
      const Status status = table.ok() ? CheckTable(*table, header, header.is_diffuse(slot)) : table.status();
      if (!status.ok()) {
        return InternalError("archive: table " + std::to_string(layer) + "/" + std::to_string(slot) + ": " +
                             status.message());
      }
      GLINT_RETURN_IF_ERROR(out->Add(Kind::kTable, Codec::kRaw, bytes, bytes.size(), layer, slot));
    }
  }
  return {};
}

}  // namespace

Status WriteArchive(const std::filesystem::path& path, const ArchiveContent& content) {
  GLINT_RETURN_IF_ERROR(CheckContent(content));
  const Header header = MakeHeader(content);
  const auto header_bytes = EncodeHeader(header);
  const BakeDomain& domain = *content.domain;
  GLINT_ASSIGN_OR_RETURN(FilePublisher file, FilePublisher::Create(path));
  SectionWriter out(&file);
  GLINT_RETURN_IF_ERROR(out.Header(header_bytes));
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> geometry, EncodeGeometry(domain));
  const uint64_t geometry_bytes = domain.positions.size() * 24 + domain.triangles.size() * 12;
  GLINT_RETURN_IF_ERROR(out.Add(Kind::kGeometry, Codec::kDraco, geometry, geometry_bytes));
  GLINT_RETURN_IF_ERROR(out.AddCompressed(Kind::kShapes, EncodeShapes(domain.shapes)));
  GLINT_RETURN_IF_ERROR(out.AddCompressed(Kind::kVertices, EncodeVertices(domain)));
  GLINT_RETURN_IF_ERROR(out.AddCompressed(Kind::kNodes, EncodeNodes(domain.nodes)));
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> cameras, EncodeCameras(content.cameras));
  GLINT_RETURN_IF_ERROR(out.AddCompressed(Kind::kCameras, cameras));
  GLINT_RETURN_IF_ERROR(out.AddCompressed(Kind::kReport, AsBytes(content.report_json)));
  GLINT_RETURN_IF_ERROR(WriteTables(content, header, &out));
  GLINT_RETURN_IF_ERROR(out.Footer(header_bytes));
  return file.Commit();
}

// ---- Opening ----

struct Archive::Impl {
  MappedFile file;
  std::vector<std::byte> owned;
  std::span<const std::byte> bytes;

  Header header;
  BakeDomain domain;
  std::vector<Camera> cameras;
  std::vector<LayerViews> layers;
  std::string report_json;
  std::vector<SectionInfo> infos;

  Status Read(Checks checksums);
  Status CheckSectionList(const std::vector<Section>& sections) const;
  Status ReadSection(const Section& section);
  Status ReadCompressed(const Section& section);
  bool SizeIsPossible(const Section& section) const;
  Status ReadTable(const Section& section);
  std::span<const std::byte> Stored(const Section& s) const {
    return bytes.subspan(s.offset, s.stored_bytes);
  }
};

namespace {

/// The sections of every archive, in order; tables follow.
constexpr std::pair<Kind, Codec> kFixedSections[] = {
    {Kind::kGeometry, Codec::kDraco}, {Kind::kShapes, Codec::kZstd},  {Kind::kVertices, Codec::kZstd},
    {Kind::kNodes, Codec::kZstd},     {Kind::kCameras, Codec::kZstd}, {Kind::kReport, Codec::kZstd}};

Status SectionError(const Section& section, const Status& status) {
  return {status.kind(), "section " + section.Name() + ": " + status.message()};
}

}  // namespace

Status Archive::Impl::Read(Checks checksums) {
  GLINT_ASSIGN_OR_RETURN(header, DecodeHeader(bytes));
  GLINT_ASSIGN_OR_RETURN(const std::vector<Section> sections, DecodeFooter(bytes));
  GLINT_RETURN_IF_ERROR(CheckSectionList(sections));
  layers.resize(header.layers);
  for (LayerViews& layer : layers) layer.nested = header.base_level < header.grid_level;
  for (const Section& section : sections) {
    const bool checked = checksums == Checks::kEverything ||
                         (checksums == Checks::kAllButTables && section.kind != Kind::kTable);
    if (checked && Checksum64(Stored(section)) != section.checksum) {
      return SectionError(section,
                          BadInput("checksum differs: the file is damaged; copy it again, or bake it again"));
    }
    if (const Status status = ReadSection(section); !status.ok()) return SectionError(section, status);
    infos.push_back({section.Name(), section.offset, section.stored_bytes, section.raw_bytes});
  }
  if (LargestLobeCount(domain.shapes) != header.slots) {
    return BadInput("section shapes: the shapes' lobes are not the tables'; bake it again");
  }
  return {};
}

Status Archive::Impl::CheckSectionList(const std::vector<Section>& sections) const {
  std::vector<Section> expected;
  for (const auto& [kind, codec] : kFixedSections) expected.push_back({.kind = kind, .codec = codec});
  for (uint32_t layer = 0; layer < header.layers; ++layer)
    for (uint32_t slot = 0; slot < header.tables(layer); ++slot)
      expected.push_back({Kind::kTable, Codec::kRaw, layer, slot});
  if (sections.size() != expected.size()) {
    return BadInput("footer: wrong number of sections; bake it again");
  }
  for (size_t i = 0; i < sections.size(); ++i) {
    const Section &s = sections[i], &e = expected[i];
    if (s.kind != e.kind || s.codec != e.codec || s.layer != e.layer || s.slot != e.slot) {
      return BadInput("footer: section " + s.Name() + " is out of order; bake it again");
    }
  }
  return {};
}

Status Archive::Impl::ReadSection(const Section& section) {
  switch (section.codec) {
    case Codec::kDraco:
      if (section.raw_bytes != header.vertices * 24 + header.triangles * 12)
        return BadInput("wrong raw size");
      return DecodeGeometry(Stored(section), header.vertices, header.triangles, &domain);
    case Codec::kZstd:
      return ReadCompressed(section);
    case Codec::kRaw:
      return ReadTable(section);
  }
  return InternalError("unknown codec");
}

/// Vertices were decoded from bytes that were there, so that their number bounds what others may ask for.
bool Archive::Impl::SizeIsPossible(const Section& section) const {
  constexpr uint64_t kNodeBytes = 64;  // of a vertex: its count, row and weights, and those of its middles
  if (section.kind == Kind::kVertices)
    return section.raw_bytes == VertexSectionBytes(header.vertices, header.triangles);
  if (section.kind == Kind::kNodes)
    return section.raw_bytes <= kMaxVariableBytes + kNodeBytes * header.vertices;
  return section.raw_bytes <= kMaxVariableBytes;
}

Status Archive::Impl::ReadCompressed(const Section& section) {
  if (!SizeIsPossible(section)) return BadInput("its size is out of range");
  GLINT_ASSIGN_OR_RETURN(const std::vector<std::byte> raw, Decompress(Stored(section), section.raw_bytes));
  switch (section.kind) {
    case Kind::kShapes:
      return DecodeShapes(raw, &domain.shapes);
    case Kind::kVertices:
      return DecodeVertices(raw, &domain);
    case Kind::kNodes: {
      GLINT_ASSIGN_OR_RETURN(domain.nodes, DecodeNodes(raw, domain, header.rows));
      return {};
    }
    case Kind::kCameras:
      return DecodeCameras(raw, &cameras);
    case Kind::kReport:
      report_json.assign(reinterpret_cast<const char*>(raw.data()), raw.size());
      return {};
    default:
      return InternalError("not a compressed section");
  }
}

Status Archive::Impl::ReadTable(const Section& section) {
  if (section.raw_bytes != section.stored_bytes) return BadInput("wrong raw size");
  GLINT_ASSIGN_OR_RETURN(const SliceTableView table, SliceTableView::Parse(Stored(section)));
  const bool diffuse = header.is_diffuse(section.slot);
  GLINT_RETURN_IF_ERROR(CheckTable(table, header, diffuse));
  layers[section.layer].Add(section.slot / (header.slots + 1), diffuse, table);
  return {};
}

Archive::Archive() : impl_(std::make_unique<Impl>()) {}
Archive::Archive(Archive&&) noexcept = default;
Archive& Archive::operator=(Archive&&) noexcept = default;
Archive::~Archive() = default;

Result<Archive> Archive::Open(const std::filesystem::path& path, Checks checksums) {
  Archive archive;
  GLINT_ASSIGN_OR_RETURN(archive.impl_->file, MappedFile::Open(path));
  archive.impl_->bytes = archive.impl_->file.bytes();
  GLINT_RETURN_IF_ERROR(archive.impl_->Read(checksums).WithContext(path.string()));
  return archive;
}

Result<Archive> Archive::FromMemory(std::span<const std::byte> bytes, const std::string& name) {
  Archive archive;
  archive.impl_->owned.assign(bytes.begin(), bytes.end());
  archive.impl_->bytes = archive.impl_->owned;
  GLINT_RETURN_IF_ERROR(archive.impl_->Read(Checks::kEverything).WithContext(name));
  return archive;
}

const BakeDomain& Archive::domain() const { return impl_->domain; }
int Archive::grid_level() const { return static_cast<int>(impl_->header.grid_level); }
DirectionGrid Archive::MakeGrid() const {
  return DirectionGrid(grid_level(), static_cast<int>(impl_->header.base_level));
}
const std::vector<LayerViews>& Archive::layers() const { return impl_->layers; }
const std::vector<Camera>& Archive::cameras() const { return impl_->cameras; }
const std::string& Archive::report_json() const { return impl_->report_json; }
const Digest& Archive::archive_key() const { return impl_->header.archive_key; }
const std::vector<SectionInfo>& Archive::sections() const { return impl_->infos; }
uint64_t Archive::file_bytes() const { return impl_->bytes.size(); }

}  // namespace glint
