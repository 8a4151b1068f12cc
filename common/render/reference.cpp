// Path tracing with next-event estimation and the balance heuristic (Veach 1997), as plain as it can be: this
// is the truth that everything else is measured by.
#include "common/render/reference.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <utility>
#include <vector>

#include "common/base/log.h"
#include "common/base/parallel.h"
#include "common/domain/scatter_point.h"
#include "common/render/pixel_samples.h"

namespace glint {
namespace {

constexpr int kTile = 16;           // pixels a side; one tile is one piece of parallel work
constexpr int kPrimaryBatch = 64;   // camera rays traced together
constexpr int kPairsPerVertex = 3;  // environment sample; lobe choice; BRDF sample
constexpr int kMaxBounces = 1024;
constexpr int kMaxSamples = 1 << 20;

/// The environment, turned: directions in the world frame.
class TurnedEnvironment {
 public:
  TurnedEnvironment(const Environment& environment, float degrees)
      : environment_(environment), frame_(degrees) {}

  glm::vec3 Radiance(const glm::vec3& d) const { return environment_.Radiance(frame_.ToLookup(d)); }
  float Pdf(const glm::vec3& d) const { return environment_.Pdf(frame_.ToLookup(d)); }
  Environment::Sample SampleDirection(const glm::vec2& u, glm::vec3* radiance) const {
    Environment::Sample sample = environment_.SampleDirection(u.x, u.y);
    *radiance = environment_.Radiance(sample.direction);
    sample.direction = frame_.ToWorld(sample.direction);
    return sample;
  }

 private:
  const Environment& environment_;
  const LookupFrame frame_;
};

/// A path's vertex: everything that scattering there needs.
struct PathVertex {
  ScatterPoint point;
  Brdf brdf;
  const BrdfShape* shape = nullptr;  ///< set when lobes stand in for the BRDF

  const glm::vec3& wo() const { return point.wo_local; }
  glm::vec3 Evaluate(const glm::vec3& wi) const {
    return shape != nullptr ? EvaluateLobes(brdf, *shape, wo(), wi) : EvaluateCosine(brdf, wo(), wi);
  }
  float Pdf(const glm::vec3& wi) const {
    return shape != nullptr ? PdfLobes(brdf, *shape, wo(), wi) : PdfBrdf(brdf, wo(), wi);
  }
  BrdfSample Sample(float u_lobe, const glm::vec2& u) const {
    return shape != nullptr ? SampleLobes(brdf, *shape, wo(), u_lobe, u.x, u.y)
                            : SampleBrdf(brdf, wo(), u_lobe, u.x, u.y);
  }
};

float BalanceWeight(float pdf, float other) { return pdf / (pdf + other); }

class PathTracer {
 public:
  PathTracer(const Scene& scene, const RayScene& rays, const BakeDomain* domain,
             const Environment& environment, const View& view, const ReferenceOptions& options)
      : scene_(scene),
        rays_(rays),
        domain_(options.lobes ? domain : nullptr),
        environment_(environment, view.environment_rotation_deg),
        primary_(view),
        view_(view),
        options_(options) {}

  /// The two halves' means at pixel (x, y): radiance and coverage.
  std::array<glm::vec4, 2> Pixel(int x, int y, PixelSamples* samples) const {
    std::array<glm::vec4, 2> half;
    const uint32_t pixel =
        static_cast<uint32_t>(y) * static_cast<uint32_t>(view_.width) + static_cast<uint32_t>(x);
    for (uint32_t h = 0; h < 2; ++h) {
      samples->Start(options_.seed, pixel, h);
      half[h] = HalfPixel(x, y, *samples);
    }
    return half;
  }

  static int PairsPerPath(int bounces) { return 1 + kPairsPerVertex * (bounces + 1); }

 private:
  glm::vec4 HalfPixel(int x, int y, const PixelSamples& samples) const {
    const uint32_t count = static_cast<uint32_t>(options_.samples) / 2;
    glm::dvec4 sum(0);
    std::array<Ray, kPrimaryBatch> ray;
    std::array<Hit, kPrimaryBatch> hit;
    for (uint32_t start = 0; start < count; start += kPrimaryBatch) {
      const uint32_t batch = std::min<uint32_t>(kPrimaryBatch, count - start);
      for (uint32_t i = 0; i < batch; ++i) {
        const glm::vec2 jitter = samples.Point(0, start + i);
        ray[i] = Ray{};
        ray[i].origin = primary_.eye();
        ray[i].direction =
            primary_.Direction(static_cast<float>(x) + jitter.x, static_cast<float>(y) + jitter.y);
      }
      rays_.IntersectCoherent(ray.data(), hit.data(), static_cast<int>(batch));
      for (uint32_t i = 0; i < batch; ++i) sum += CameraPath(ray[i].direction, hit[i], samples, start + i);
    }
    return sum / static_cast<double>(count);
  }

  glm::dvec4 CameraPath(const glm::vec3& direction, const Hit& hit, const PixelSamples& samples,
                        uint32_t sample) const {
    if (hit.hit()) return glm::dvec4(Trace(hit, direction, samples, sample), 1);
    const bool shows_sky = view_.background == Background::kEnvironment && options_.first_bounce == 0;
    return glm::dvec4(shows_sky ? environment_.Radiance(direction) : glm::vec3(0), 0);
  }

  /// Radiance of one path that first meets the scene at `hit`, along `direction`.
  glm::vec3 Trace(Hit hit, glm::vec3 direction, const PixelSamples& samples, uint32_t sample) const {
    glm::vec3 radiance(0), beta(1);
    for (int bounce = 0;; ++bounce) {
      PathVertex vertex;
      if (!MakeVertex(hit, -direction, &vertex)) return radiance;
      const bool counts = bounce >= options_.first_bounce;
      const bool last = bounce == options_.bounces;
      const int pair = 1 + kPairsPerVertex * bounce;
      if (counts && options_.environment_sampling)
        radiance += beta * LightFromEnvironmentSample(vertex, samples.Point(pair, sample));

      const BrdfSample scattered =
          vertex.Sample(samples.Point(pair + 1, sample).x, samples.Point(pair + 2, sample));
      if (scattered.pdf <= 0 || scattered.weight == glm::vec3(0)) return radiance;
      const glm::vec3 wi = glm::normalize(vertex.point.frame.ToWorld(scattered.wi));
      if (glm::dot(wi, vertex.point.face) <= 0) return radiance;
      beta *= scattered.weight;
      const Ray ray = RayFrom(vertex, wi);
      if (last) {
        if (!rays_.Occluded(ray)) radiance += beta * LightFromBrdfSample(wi, scattered.pdf);
        return radiance;
      }
      hit = rays_.Intersect(ray);
      if (!hit.hit()) return counts ? radiance + beta * LightFromBrdfSample(wi, scattered.pdf) : radiance;
      direction = wi;
    }
  }

  /// Light that arrives along a sample of the environment, times f cos / pdf and its share of the balance
  /// heuristic.
  glm::vec3 LightFromEnvironmentSample(const PathVertex& vertex, const glm::vec2& u) const {
    glm::vec3 incoming;
    const Environment::Sample sample = environment_.SampleDirection(u, &incoming);
    if (!(sample.pdf > 0) || glm::dot(sample.direction, vertex.point.face) <= 0) return glm::vec3(0);
    const glm::vec3 wi = vertex.point.frame.ToLocal(sample.direction);
    const glm::vec3 f = vertex.Evaluate(wi);
    if (f == glm::vec3(0) || rays_.Occluded(RayFrom(vertex, sample.direction))) return glm::vec3(0);
    return f * incoming * (BalanceWeight(sample.pdf, vertex.Pdf(wi)) / sample.pdf);
  }

  /// Light along a BRDF sample that nothing blocks, times its share of the balance heuristic.
  glm::vec3 LightFromBrdfSample(const glm::vec3& wi, float pdf) const {
    const float share = options_.environment_sampling ? BalanceWeight(pdf, environment_.Pdf(wi)) : 1.0f;
    return environment_.Radiance(wi) * share;
  }

  Ray RayFrom(const PathVertex& vertex, const glm::vec3& wi) const {
    return vertex.point.Leaving(wi, rays_.epsilon());
  }

  /// False where nothing is reflected.
  bool MakeVertex(const Hit& hit, const glm::vec3& wo, PathVertex* vertex) const {
    const bool double_sided = scene_.materials[scene_.triangle_material[hit.triangle]].double_sided;
    if (!MakeScatterPoint(scene_.positions, scene_.normals, scene_.triangles[hit.triangle], double_sided, hit,
                          wo, &vertex->point))
      return false;
    if (domain_ == nullptr) {
      vertex->brdf = ToBrdf(EvaluateMaterial(scene_, hit.triangle, hit.u, hit.v));
    } else {
      const DomainBrdf found = BrdfAt(*domain_, hit);
      vertex->brdf = found.brdf;
      vertex->shape = found.shape;
    }
    return true;
  }

  const Scene& scene_;
  const RayScene& rays_;
  const BakeDomain* domain_;  // null: the true BRDF
  TurnedEnvironment environment_;
  PrimaryRays primary_;
  const View& view_;
  const ReferenceOptions& options_;
};

Status CheckOptions(const View& view, const BakeDomain* domain, const ReferenceOptions& options) {
  GLINT_RETURN_IF_ERROR(CheckView(view));
  if (options.samples < 2 || options.samples % 2 != 0 || options.samples > kMaxSamples) {
    return UsageError("samples " + std::to_string(options.samples) + ": must be even and from 2 to " +
                      std::to_string(kMaxSamples));
  }
  if (options.bounces < 0 || options.bounces > kMaxBounces) {
    return UsageError("bounces " + std::to_string(options.bounces) + ": must be 0 to " +
                      std::to_string(kMaxBounces));
  }
  if (options.first_bounce < 0 || options.first_bounce > options.bounces) {
    return UsageError("first bounce " + std::to_string(options.first_bounce) + ": must be 0 to bounces (" +
                      std::to_string(options.bounces) + ")");
  }
  if (options.lobes && domain == nullptr) return InternalError("tracing with lobes needs the bake domain");
  return {};
}

/// relMSE of the average from the halves' difference, over pixels of a box-averaged picture that are fully
/// covered.
double NoiseRelMse(const Picture& picture, const Picture& half_difference, int block) {
  const int width = picture.width / block, height = picture.height / block;
  std::vector<std::pair<glm::dvec3, glm::dvec3>> counted;  // mean, half difference
  double mean = 0;
  for (int by = 0; by < height; ++by) {
    for (int bx = 0; bx < width; ++bx) {
      glm::dvec4 value(0), difference(0);
      for (int i = 0; i < block * block; ++i) {
        const int x = bx * block + i % block, y = by * block + i / block;
        value += glm::dvec4(picture.at(x, y));
        difference += glm::dvec4(half_difference.at(x, y));
      }
      const double inverse = 1.0 / (block * block);
      if (value.w * inverse < 1 - 1e-4) continue;
      counted.emplace_back(glm::dvec3(value) * inverse, glm::dvec3(difference) * inverse);
      mean += (value.x + value.y + value.z) * inverse / 3;
    }
  }
  if (counted.empty()) return 0;
  const double epsilon = 0.1 * mean / static_cast<double>(counted.size());
  if (!(epsilon > 0)) return 0;
  double sum = 0;
  for (const auto& [value, difference] : counted) {
    for (int c = 0; c < 3; ++c) {
      sum += difference[c] * difference[c] / (value[c] * value[c] + epsilon * epsilon) / 3;
    }
  }
  return sum / static_cast<double>(counted.size());
}

}  // namespace

Result<ReferenceResult> RenderReference(const Scene& scene, const RayScene& rays, const BakeDomain* domain,
                                        const Environment& environment, const View& view,
                                        const ReferenceOptions& options) {
  GLINT_RETURN_IF_ERROR(CheckOptions(view, domain, options));
  const PathTracer tracer(scene, rays, domain, environment, view, options);
  ReferenceResult result;
  result.picture = Picture(view.width, view.height);
  result.half_difference = Picture(view.width, view.height);

  const int threads = ResolveThreadCount(options.threads);
  const int tiles_x = (view.width + kTile - 1) / kTile, tiles_y = (view.height + kTile - 1) / kTile;
  const auto half_samples = static_cast<uint32_t>(options.samples / 2);
  std::vector<PixelSamples> samples(static_cast<size_t>(threads),
                                    PixelSamples(PathTracer::PairsPerPath(options.bounces), half_samples));
  std::atomic<bool> stopped = false;
  ParallelFor(static_cast<size_t>(tiles_x) * tiles_y, threads, 1, [&](size_t tile, int thread) {
    if (StopRequested()) {
      stopped = true;
      return;
    }
    const int x0 = static_cast<int>(tile % tiles_x) * kTile, y0 = static_cast<int>(tile / tiles_x) * kTile;
    for (int y = y0; y < std::min(y0 + kTile, view.height); ++y) {
      for (int x = x0; x < std::min(x0 + kTile, view.width); ++x) {
        const auto half = tracer.Pixel(x, y, &samples[static_cast<size_t>(thread)]);
        result.picture.at(x, y) = 0.5f * (half[0] + half[1]);
        result.half_difference.at(x, y) = 0.5f * (half[0] - half[1]);
      }
    }
  });
  if (stopped) return Interrupted("the reference picture is not finished; run the same command again");
  result.noise_rel_mse = NoiseRelMse(result.picture, result.half_difference, 1);
  result.noise_block4_rel_mse = NoiseRelMse(result.picture, result.half_difference, 4);
  return result;
}

}  // namespace glint
