#include "common/scene/ray_scene.h"

#include <embree3/rtcore.h>
#include <xmmintrin.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

namespace glint {
namespace {

constexpr int kPacket = 8;
using Triangles = std::span<const std::array<uint32_t, 3>>;

// Embree wants denormals flushed while it runs. The mode is restored afterwards: it must not leak into the
// caller's own arithmetic, which would then depend on which thread had traced before.
class FlushDenormals {
 public:
  FlushDenormals() : saved_(_mm_getcsr()) {
    if ((saved_ & kBits) != kBits) _mm_setcsr(saved_ | kBits);
  }
  ~FlushDenormals() {
    if ((saved_ & kBits) != kBits) _mm_setcsr(saved_);
  }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;

 private:
  static constexpr unsigned kBits = 0x8040;  // flush to zero, denormals are zero
  unsigned saved_;
};

RTCRay ToEmbree(const Ray& ray, float to_unit) {
  RTCRay r{};
  r.org_x = to_unit * ray.origin.x;
  r.org_y = to_unit * ray.origin.y;
  r.org_z = to_unit * ray.origin.z;
  r.tnear = to_unit * ray.t_near;
  r.dir_x = ray.direction.x;
  r.dir_y = ray.direction.y;
  r.dir_z = ray.direction.z;
  r.tfar = to_unit * ray.t_far;
  r.mask = ~0u;
  return r;
}

void FillLane(RTCRayHit8& packet, int lane, const Ray& ray, float to_unit) {
  packet.ray.org_x[lane] = to_unit * ray.origin.x;
  packet.ray.org_y[lane] = to_unit * ray.origin.y;
  packet.ray.org_z[lane] = to_unit * ray.origin.z;
  packet.ray.tnear[lane] = to_unit * ray.t_near;
  packet.ray.dir_x[lane] = ray.direction.x;
  packet.ray.dir_y[lane] = ray.direction.y;
  packet.ray.dir_z[lane] = ray.direction.z;
  packet.ray.time[lane] = 0;
  packet.ray.tfar[lane] = to_unit * ray.t_far;
  packet.ray.mask[lane] = ~0u;
  packet.ray.id[lane] = 0;
  packet.ray.flags[lane] = 0;
  packet.hit.geomID[lane] = RTC_INVALID_GEOMETRY_ID;
  packet.hit.primID[lane] = RTC_INVALID_GEOMETRY_ID;
  packet.hit.instID[0][lane] = RTC_INVALID_GEOMETRY_ID;
}

// Rounding may put u + v an ulp above one; the interface promises it does not.
Hit MakeHit(uint32_t triangle, float u, float v, float t) {
  u = std::clamp(u, 0.0f, 1.0f);
  return {triangle, u, std::clamp(v, 0.0f, 1.0f - u), t};
}

// Vertices into a buffer of Embree's own, which pads it as its vector loads need.
bool FillGeometry(RTCGeometry geometry, std::span<const glm::vec3> positions, Triangles triangles,
                  float to_unit) {
  if (triangles.empty()) return true;
  auto* vertices = static_cast<glm::vec3*>(rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, sizeof(glm::vec3), positions.size()));
  auto* indices = static_cast<std::array<uint32_t, 3>*>(
      rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                              sizeof(std::array<uint32_t, 3>), triangles.size()));
  if (!vertices || !indices) return false;
  std::transform(positions.begin(), positions.end(), vertices,
                 [&](const glm::vec3& p) { return to_unit * p; });
  std::copy(triangles.begin(), triangles.end(), indices);
  return true;
}

// Two parts. Positions are known to about 2^-24 of the largest coordinate, and interpolation, offset and the
// intersection each add a few such steps: 32 of them (2^-19). The intersection's own error and the slight
// non-planarity of interpolated points grow with the scene's extent: 1e-5 of the diagonal.
float SceneEpsilon(std::span<const glm::vec3> positions, Triangles triangles) {
  glm::vec3 lo(std::numeric_limits<float>::max()), hi(-std::numeric_limits<float>::max());
  for (const auto& triangle : triangles) {
    for (uint32_t i : triangle) {
      lo = glm::min(lo, positions[i]);
      hi = glm::max(hi, positions[i]);
    }
  }
  if (triangles.empty()) return 1e-5f;
  const glm::vec3 magnitude = glm::max(glm::abs(lo), glm::abs(hi));
  const float largest = std::max({magnitude.x, magnitude.y, magnitude.z});
  const float epsilon = 0x1p-19f * largest + 1e-5f * glm::length(hi - lo);
  return epsilon > 0 ? epsilon : 1e-5f;
}

// Embree gives no barycentric co-ordinates for triangles whose area is below about 1e-18: scenes are traced
// at a size of about one. The power of two makes that exact.
float ToUnitSize(float epsilon) {
  return std::ldexp(1.0f, std::clamp(-std::ilogb(1e5f * epsilon), -100, 100));
}

std::string InstructionSet(RTCDevice device) {
  if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) return "avx512";
  if (rtcGetDeviceProperty(device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED)) {
    const bool avx2 = __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
                      __builtin_cpu_supports("bmi") && __builtin_cpu_supports("bmi2");
    return avx2 ? "avx2" : "avx";
  }
  return __builtin_cpu_supports("sse4.2") ? "sse4.2" : "sse2";
}

}  // namespace

struct RayScene::Impl {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  ~Impl() {
    if (scene) rtcReleaseScene(scene);
    if (device) rtcReleaseDevice(device);
  }
};

RayScene::RayScene(std::span<const glm::vec3> positions, Triangles triangles, int build_threads)
    : impl_(std::make_unique<Impl>()),
      epsilon_(SceneEpsilon(positions, triangles)),
      to_unit_(ToUnitSize(epsilon_)) {
  const FlushDenormals guard;
  const std::string config = "threads=" + std::to_string(std::max(1, build_threads));
  impl_->device = rtcNewDevice(config.c_str());
  if (!impl_->device) {
    status_ =
        InternalError("Embree gives no device (error " + std::to_string(rtcGetDeviceError(nullptr)) + ")");
    return;
  }
  impl_->scene = rtcNewScene(impl_->device);
  // Robust, so that no ray slips through between triangles. Not compact: compact, robust and coherent
  // together hang in Embree 3.13.5's occluded packets.
  rtcSetSceneFlags(impl_->scene, RTC_SCENE_FLAG_ROBUST);
  rtcSetSceneBuildQuality(impl_->scene, RTC_BUILD_QUALITY_HIGH);
  RTCGeometry geometry = rtcNewGeometry(impl_->device, RTC_GEOMETRY_TYPE_TRIANGLE);
  const bool filled = FillGeometry(geometry, positions, triangles, to_unit_);
  rtcCommitGeometry(geometry);
  rtcAttachGeometryByID(impl_->scene, geometry, 0);
  rtcReleaseGeometry(geometry);
  if (filled) rtcCommitScene(impl_->scene);
  const RTCError error = rtcGetDeviceError(impl_->device);
  if (!filled || error != RTC_ERROR_NONE) {
    status_ = LimitExceeded("Embree cannot build the ray-tracing tree over " +
                            std::to_string(triangles.size()) + " triangles (error " + std::to_string(error) +
                            "); simplify the scene or use a machine with more memory");
    rtcReleaseScene(std::exchange(impl_->scene, nullptr));
    impl_->scene = rtcNewScene(impl_->device);  // empty: every ray misses
    rtcCommitScene(impl_->scene);
  }
}

RayScene::~RayScene() = default;
RayScene::RayScene(RayScene&&) noexcept = default;

Hit RayScene::Intersect(const Ray& ray) const {
  if (!impl_->scene) return {};
  const FlushDenormals guard;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  RTCRayHit query;
  query.ray = ToEmbree(ray, to_unit_);
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.primID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  rtcIntersect1(impl_->scene, &context, &query);
  const bool hit = query.hit.geomID != RTC_INVALID_GEOMETRY_ID;
  return hit ? MakeHit(query.hit.primID, query.hit.u, query.hit.v, query.ray.tfar / to_unit_) : Hit{};
}

bool RayScene::Occluded(const Ray& ray) const {
  if (!impl_->scene) return false;
  const FlushDenormals guard;
  RTCRay query = ToEmbree(ray, to_unit_);
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(impl_->scene, &context, &query);
  return query.tfar < 0;  // Embree's sign of a hit: tfar becomes minus infinity
}

void RayScene::Intersect(const Ray* rays, Hit* hits, int count) const {
  IntersectPackets(rays, hits, count, RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT);
}

void RayScene::IntersectCoherent(const Ray* rays, Hit* hits, int count) const {
  IntersectPackets(rays, hits, count, RTC_INTERSECT_CONTEXT_FLAG_COHERENT);
}

void RayScene::IntersectPackets(const Ray* rays, Hit* hits, int count, int flags) const {
  if (!impl_->scene) {
    std::fill_n(hits, std::max(count, 0), Hit{});
    return;
  }
  const FlushDenormals guard;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  context.flags = static_cast<RTCIntersectContextFlags>(flags);
  for (int first = 0; first < count; first += kPacket) {
    const int used = std::min(kPacket, count - first);
    alignas(32) int valid[kPacket];
    RTCRayHit8 packet;
    for (int lane = 0; lane < kPacket; ++lane) {
      valid[lane] = lane < used ? -1 : 0;
      FillLane(packet, lane, rays[first + std::min(lane, used - 1)], to_unit_);
    }
    rtcIntersect8(valid, impl_->scene, &context, &packet);
    for (int lane = 0; lane < used; ++lane) {
      const bool hit = packet.hit.geomID[lane] != RTC_INVALID_GEOMETRY_ID;
      hits[first + lane] = hit ? MakeHit(packet.hit.primID[lane], packet.hit.u[lane], packet.hit.v[lane],
                                         packet.ray.tfar[lane] / to_unit_)
                               : Hit{};
    }
  }
}

std::string RayScene::EngineId() {
  RTCDevice device = rtcNewDevice("threads=1");
  if (!device) return "embree " RTC_VERSION_STRING " unavailable";
  std::string id = "embree " RTC_VERSION_STRING " " + InstructionSet(device);
  rtcReleaseDevice(device);
  return id;
}

}  // namespace glint
