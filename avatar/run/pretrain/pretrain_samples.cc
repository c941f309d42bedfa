#include "avatar/run/pretrain/pretrain_samples.h"

#include <ATen/ATen.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "avatar/body/mesh_raster.h"
#include "avatar/run/lift/lift_samples.h"
#include "avatar/run/lift/pose_variation.h"
#include "avatar/run/pack/body_shape.h"
#include "avatar/run/pack/pack_rows.h"
#include "avatar/run/pack/template_view.h"
#include "avatar/run/render/render.h"
#include "core/check.h"
#include "core/error.h"
#include "core/parallel.h"
#include "core/units.h"
#include "dataset/views/crop.h"

namespace mvstudio::avatar {
namespace {

using dataset::Coco19Pose;

constexpr int kAttempts = 100;
constexpr double kLeastGirth = 0.6, kMostGirth = 1.7;  // those that a fit may take (shape_fit.h)
constexpr int64_t kMinPersonPx = 16;

struct Drawn {
  int body_idx = 0;
  Coco19Pose pose;
  Eigen::Matrix3Xf vertices_in_world;
  geometry::RigCamera crop;
};

/// The clips that have poses of this share, and which poses.
struct PoseLists {
  std::vector<const MotionClip*> clips;
  std::vector<const std::vector<int>*> indices;
};

PoseLists ListsOf(const PretrainSources& sources, PoseShare share) {
  PoseLists lists;
  for (const MotionClip& clip : sources.clips) {
    const std::vector<int>& indices = share == PoseShare::kLearned ? clip.learned : clip.held_out;
    if (indices.empty()) continue;
    lists.clips.push_back(&clip), lists.indices.push_back(&indices);
  }
  return lists;
}

Coco19Pose RandomPose(const PoseLists& lists, const PretrainSampleOptions& o, Rng& rng) {
  const auto clip = static_cast<size_t>(rng.Index(static_cast<int64_t>(lists.clips.size())));
  const std::vector<int>& indices = *lists.indices[clip];
  const int index = indices[static_cast<size_t>(rng.Index(static_cast<int64_t>(indices.size())))];
  PoseVariation variation;
  DrawTurns(DegToRad(o.pose_jitter_deg), rng, &variation);
  DrawLengths(o.limb_spread, rng, &variation);
  const Coco19Pose pose = Varied(lists.clips[clip]->poses[static_cast<size_t>(index)], variation);
  return rng.Index(2) == 0 ? pose : Mirrored(pose);
}

Eigen::Vector3d MiddleOf(const Coco19Pose& pose) {
  Eigen::Vector3d low = pose.x_in_world.col(0), high = low;
  for (int j = 0; j < 19; ++j) {
    if (pose.valid[j]) low = low.cwiseMin(pose.x_in_world.col(j)), high = high.cwiseMax(pose.x_in_world.col(j));
  }
  return (low + high) / 2;
}

/// A level camera around the person, cropped as BuildTrainingSet does; nothing when the person is not before it.
std::optional<geometry::RigCamera> RandomCrop(const Coco19Pose& pose, const PretrainSampleOptions& o, Rng& rng) {
  const double azimuth = rng.Uniform(0, 2 * kPi);
  const double elevation = DegToRad(rng.Uniform(o.min_elevation_deg, o.max_elevation_deg));
  const double distance = rng.Uniform(o.min_distance_m, o.max_distance_m);
  const double half_extent_m = SizeOf(pose) / kSizePerHeight * rng.Uniform(o.min_extent, o.max_extent);
  const geometry::RigCamera camera = OrbitCamera(MiddleOf(pose), azimuth, elevation, distance, o.size_px);
  const auto extent = dataset::MeasurePerson(pose, camera);
  if (!extent || !(half_extent_m > 0)) return std::nullopt;
  return dataset::CropCamera(camera, extent->middle_in_cam, half_extent_m, o.fill, o.size_px);
}

std::optional<Drawn> Draw(const PretrainSources& sources, const PoseLists& lists, const PretrainSampleOptions& o, Rng& rng) {
  Drawn drawn;
  drawn.pose = RandomPose(lists, o, rng);
  drawn.body_idx = static_cast<int>(rng.Index(static_cast<int64_t>(sources.templates.size())));
  const body::BodyTemplate& body = sources.templates[static_cast<size_t>(drawn.body_idx)];
  const auto vertices = PosedVertices(RandomShape(body, o.girth_spread, rng), drawn.pose);
  const auto crop = RandomCrop(drawn.pose, o, rng);
  if (!vertices || !crop) return std::nullopt;
  drawn.vertices_in_world = *vertices, drawn.crop = *crop;
  return drawn;
}

int64_t PersonPx(const AvatarPack& pack, int64_t i) {
  const int64_t area = int64_t{pack.size_px} * pack.size_px;
  const uint8_t* mask = pack.masks.data_ptr<uint8_t>() + i * area;
  return area - std::count(mask, mask + area, 0);
}

/// Numbers of their own for each sample.
Rng RngOf(uint64_t seed, PoseShare share, int64_t set, int64_t i) {
  const uint64_t of_share = Rng(2 * seed + (share == PoseShare::kHeldOut ? 1 : 0)).Next();
  const uint64_t of_set = Rng(of_share + static_cast<uint64_t>(set)).Next();
  return Rng(Rng(of_set + static_cast<uint64_t>(i)).Next());
}

void Check(bool fine, const std::string& option, const std::string& range) {
  if (!fine) throw UsageError("option '" + option + "' must be " + range);
}

}  // namespace

void Validate(const PretrainSampleOptions& o) {
  Check(o.size_px >= 16 && o.size_px <= 4096, "size", "16 to 4096 px");
  Check(o.fill > 0.1 && o.fill <= 1, "fill", "0.1 to 1");
  Check(o.pose_jitter_deg >= 0 && o.pose_jitter_deg <= 90, "pose-jitter-deg", "0 to 90");
  Check(o.limb_spread >= 0 && o.limb_spread <= 0.3, "limb-spread", "0 to 0.3");
  Check(o.girth_spread >= 0 && o.girth_spread <= 0.5, "girth-spread", "0 to 0.5");
  Check(o.min_elevation_deg > -90 && o.min_elevation_deg <= o.max_elevation_deg, "min-elevation-deg",
        "above -90 and at most option 'max-elevation-deg'");
  Check(o.max_elevation_deg < 90, "max-elevation-deg", "below 90");
  Check(o.min_distance_m >= 1.2 && o.min_distance_m <= o.max_distance_m, "min-distance-m",
        "at least 1.2 and at most option 'max-distance-m'");
  Check(o.max_distance_m <= 1000, "max-distance-m", "at most 1000");
  Check(o.min_extent >= 0.2 && o.min_extent <= o.max_extent, "min-extent", "at least 0.2 and at most option 'max-extent'");
  Check(o.max_extent <= 5, "max-extent", "at most 5");
}

body::BodyTemplate RandomShape(const body::BodyTemplate& body, double girth_spread, Rng& rng) {
  const body::BlendShapes& shapes = body.shapes;
  if (shapes.sigma.size() > 0) {
    Eigen::VectorXd coefficients(shapes.sigma.size());
    for (Eigen::Index s = 0; s < coefficients.size(); ++s)
      coefficients[s] = std::clamp(shapes.sigma[s] * rng.Normal(), shapes.low[s], shapes.high[s]);
    return body::WithShape(body, coefficients);
  }
  BodyShape shape;
  const double whole = girth_spread * rng.Normal();
  for (double& girth : shape.girth)
    girth = std::clamp(std::exp((whole + girth_spread * rng.Normal()) / std::sqrt(2.0)), kLeastGirth, kMostGirth);
  return ScaleGirth(body, shape);
}

void FillSample(AvatarPack& pack, int64_t i, const body::BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                const Coco19Pose& pose, const geometry::RigCamera& crop) {
  const body::PartUvMap map = body::RasterizeBody(body, vertices_in_world, crop);
  FillLabels(pack, i, map);
  FillPose(pack, i, pose, crop);
  Image image(map.width, map.height, 3), mask(map.width, map.height, 1);
  for (size_t p = 0; p < map.part.size(); ++p) {
    if (map.part[p] == 0) continue;
    mask.pixels[p] = 255;
    image.pixels[3 * p] = static_cast<uint8_t>(10 * map.part[p]);
    image.pixels[3 * p + 1] = static_cast<uint8_t>(255 * map.u[p]);
    image.pixels[3 * p + 2] = static_cast<uint8_t>(255 * map.v[p]);
  }
  FillImage(pack, i, image, mask);
}

PretrainSamples DrawSamples(const PretrainSources& sources, const PretrainSampleOptions& options, PoseShare share, int64_t set,
                            int64_t count, const RunContext& run) {
  const PoseLists lists = ListsOf(sources, share);
  MVS_CHECK(!lists.clips.empty() && !sources.templates.empty() && count > 0, "no poses or no body to draw samples from");
  TrainingSetOptions rows;
  rows.size_px = options.size_px, rows.num_joints = sources.num_joints;
  PretrainSamples samples{EmptyPack({"random"}, count, rows), std::vector<int>(static_cast<size_t>(count))};
  ParallelFor(count, run.num_threads, [&](int64_t i) {
    Rng rng = RngOf(run.seed, share, set, i);
    bool seen = false;
    for (int attempt = 0; attempt < kAttempts && !seen; ++attempt) {
      const std::optional<Drawn> drawn = Draw(sources, lists, options, rng);
      if (!drawn) continue;
      const auto body_idx = static_cast<size_t>(drawn->body_idx);
      FillSample(samples.pack, i, sources.templates[body_idx], drawn->vertices_in_world, drawn->pose, drawn->crop);
      samples.body_idx[static_cast<size_t>(i)] = drawn->body_idx;
      seen = PersonPx(samples.pack, i) >= kMinPersonPx;
    }
    if (!seen) throw FormatError(lists.clips.front()->source, "", "no pose of the motions can be seen by a random camera");
    samples.pack.frame.data_ptr<int64_t>()[i] = i;
  });
  return samples;
}

}  // namespace mvstudio::avatar
