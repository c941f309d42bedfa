#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "avatar/body/body_template.h"
#include "avatar/data/pack.h"
#include "avatar/run/pretrain/motion_clips.h"
#include "core/fields.h"
#include "core/progress.h"
#include "core/random.h"
#include "geometry/rig/rig.h"

/// Synthetic training images without colours: bodies of random shape in random poses before random cameras, with their parts
/// and chart coordinates.
namespace mvstudio::avatar {

struct PretrainSampleOptions {
  int size_px = 128;
  double fill = 0.97;
  double pose_jitter_deg = 10;
  double limb_spread = 0.05;
  double girth_spread = 0.12;
  double min_elevation_deg = -20, max_elevation_deg = 50;
  double min_distance_m = 2, max_distance_m = 6;
  double min_extent = 0.53, max_extent = 0.72;
};

template <class Visitor>
void VisitFields(Visitor&& visit, PretrainSampleOptions& o) {
  visit("size", o.size_px, "edge of the square crops, px");
  visit("fill", o.fill, "as in `avatar train`: share of the crop that the largest poses fill");
  visit("pose-jitter-deg", o.pose_jitter_deg,
        "degrees; standard deviation of random rotations of trunk and limbs, for poses that the motions do not contain; 0: "
        "none");
  visit("limb-spread", o.limb_spread,
        "standard deviation of the logarithms of body size and of each limb's length, the same left and right");
  visit(
      "girth-spread", o.girth_spread,
      "standard deviation of the logarithms of the girths of trunk, head, arms and legs, of templates without shapes of their "
      "own; those vary by their own standard deviations");
  visit("min-elevation-deg", o.min_elevation_deg, "degrees; lowest random camera, negative looks up");
  visit("max-elevation-deg", o.max_elevation_deg, "degrees; highest random camera");
  visit("min-distance-m", o.min_distance_m, "metres; nearest random camera, from the middle of the person");
  visit("max-distance-m", o.max_distance_m, "metres; farthest random camera");
  visit("min-extent", o.min_extent,
        "smallest half extent of a crop in body heights; `avatar train` takes that of a person's largest poses, 0.53 of people "
        "who stand and 0.7 of those who jump with their arms up");
  visit("max-extent", o.max_extent, "largest half extent of a crop in body heights");
}

/// Throws UsageError naming the option.
void Validate(const PretrainSampleOptions& options);

/// What samples are drawn from.
struct PretrainSources {
  std::vector<MotionClip> clips;
  std::vector<body::BodyTemplate> templates;
  int num_joints = 19;  ///< the list of joints that the network's inputs need
};

enum class PoseShare { kLearned, kHeldOut };

struct PretrainSamples {
  AvatarPack pack;            ///< images show part, u and v as red, green and blue
  std::vector<int> body_idx;  ///< of each image: index into the templates
};

/// `count` samples of set number `set`. Every clip with such poses is drawn equally often; half of the poses are mirrored. A
/// function of (seed, share, set) and the sources, whatever the number of threads. Throws FormatError when no pose can be seen.
PretrainSamples DrawSamples(const PretrainSources& sources, const PretrainSampleOptions& options, PoseShare share, int64_t set,
                            int64_t count, const RunContext& run);

/// Fills row i with the posed body as BuildTrainingSet labels it: part, u, v, the mask that they cover, joints and intrinsics.
void FillSample(AvatarPack& pack, int64_t i, const body::BodyTemplate& body, const Eigen::Matrix3Xf& vertices_in_world,
                const dataset::Coco19Pose& pose, const geometry::RigCamera& crop);

/// The template in another shape: along its blend shapes, where it has any, else with other girths.
body::BodyTemplate RandomShape(const body::BodyTemplate& body, double girth_spread, Rng& rng);

}  // namespace mvstudio::avatar
