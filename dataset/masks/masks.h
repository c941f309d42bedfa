#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <vector>

#include "core/image.h"
#include "core/status.h"
#include "dataset/pose/pose3d.h"
#include "geometry/rig/rig.h"

/// Foreground masks of people. Each pixel near the projected body (or anywhere, without joints) gets two costs. One is the
/// misfit of its colour to the people (a colour mixture learned under the skeleton). The other is the misfit to the
/// background: the pixel's own history where it was seen without the person, else a colour mixture of the surroundings.
/// Shadows and exposure changes are allowed for.
///
/// A graph cut with contrast-sensitive edges decides, first on a reduced crop, then at full resolution in a narrow band
/// along the outline. Rother et al., "GrabCut", SIGGRAPH 2004; Sun et al., "Background Cut", ECCV 2006. Bone lines are
/// always foreground (Neural Texture papers call them skeleton pixels).
///
/// Last, the pixels of the outline are decided by the fraction that the person covers. Their colour is a mixture, in
/// linear light, of the background behind them and the person beside them (Chuang et al., "A Bayesian Approach to Digital
/// Matting", CVPR 2001). From one half on they are foreground.
namespace mvstudio::dataset {

struct MaskOptions {
  int background_frames = 24;
  double reach_m = 0.22;
  int coarse_side_px = 320;
  double smoothness = 6.0;
  double prior = 3.0;
  double shadow_strength = 0.5;
  double noise_levels = 2.0;
  double hole_cm2 = 8.0;
  double body_scale = 1.0;
  double outline_px = 2.0;
  int outline_rounds = 2;
  double outline_smoothness = 0.4;
  double net_weight = 1.0;
  double temporal = 1.0;
};

template <class Visitor>
void VisitFields(Visitor&& visit, MaskOptions& o) {
  visit("mask-background-frames", o.background_frames, "frames sampled over the take to learn a camera's background");
  visit("mask-reach", o.reach_m,
        "metres beyond the body's usual surface that may still be the person; larger for wide clothes");
  visit("mask-coarse-side", o.coarse_side_px, "px; longer side of the reduced crop for the first graph cut; larger is slower");
  visit("mask-smoothness", o.smoothness, "weight of the outline's length; larger gives smoother masks and loses thin parts");
  visit("mask-prior", o.prior, "weight of the distance to the skeleton against colour, nats");
  visit("mask-shadow", o.shadow_strength, "darkest shadow that still counts as background, as a share of its brightness");
  visit("mask-noise", o.noise_levels, "grey levels; least standard deviation assumed for the background");
  visit("mask-hole", o.hole_cm2, "cm^2 at the body; smaller holes in a mask are filled");
  visit("mask-body-scale", o.body_scale, "multiplies the usual thickness of the limbs; below 1 for children");
  visit("mask-outline", o.outline_px, "px; half width of the band along the outline that is decided by coverage; 0: none");
  visit("mask-outline-rounds", o.outline_rounds, "times that this is done; each may move the outline by the band's half width");
  visit("mask-outline-smoothness", o.outline_smoothness, "as mask-smoothness, for the pixels of that band");
  visit("mask-net", o.net_weight, "weight of a segmentation net's probability against colour");
  visit("mask-temporal", o.temporal,
        "nats; weight of the previous frame where the image did not change; 0: every frame by itself");
}

/// A limb in the image: pixels within the (linearly changing) radius of the segment.
struct BodyCapsule {
  Eigen::Vector2d a_px, b_px;
  double radius_a_px = 0, radius_b_px = 0;
  double px_per_m = 0;
};

/// People of one frame, projected into one camera.
struct ProjectedBody {
  std::vector<BodyCapsule> limbs;                                  ///< usual thickness; soft constraint
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> bones;  ///< lines that are always foreground
  std::vector<Eigen::Vector2d> joints_px;                          ///< valid joints that project into the image
  bool empty() const { return limbs.empty(); }
};

ProjectedBody ProjectBody(const std::map<int, Coco19Pose>& people, const geometry::RigCamera& camera,
                          const MaskOptions& options = {});

/// 255 where the body may be: within `margin_m` of the limbs' surface.
Image BodyRegion(const ProjectedBody& body, int width, int height, double margin_m);

/// Appearance of each pixel of a camera without people.
struct BackgroundModel {
  Image colour;                // (H, W, 3) median over the frames where the pixel is free
  std::vector<float> sigma;    // (H, W) standard deviation of a channel, grey levels
  std::vector<uint8_t> known;  // (H, W) 1 where enough frames showed the background
  double KnownFraction() const;
};

/// `people[i]` is 255 where frame i may show a person. All of one size.
BackgroundModel LearnBackground(const std::vector<Image>& frames, const std::vector<Image>& people,
                                const MaskOptions& options = {});
BackgroundModel BackgroundFromPlate(const Image& plate, const MaskOptions& options = {});

/// Mixture of Gaussians in RGB.
struct ColourMixture {
  struct Component {
    double log_weight = 0;
    Eigen::Vector3d mean = Eigen::Vector3d::Zero();
    Eigen::Matrix3d whitening = Eigen::Matrix3d::Identity();  // |whitening (c - mean)|^2 is the squared Mahalanobis distance
    double log_norm = 0;
  };
  std::vector<Component> components;
  /// -log density per level^3, with a uniform component so that it stays finite.
  double Cost(const Eigen::Vector3d& rgb) const;
};

/// k-means from fixed starting points, then one Gaussian per cluster. Colours are (3, N) in 0..255. Deterministic.
ColourMixture FitColours(const Eigen::Matrix3Xf& rgb, int num_components);

/// What was learned about one camera before its frames are segmented.
struct CameraMaskModel {
  BackgroundModel background;
  ColourMixture person;
  ColourMixture surroundings;  ///< for pixels whose own background was never seen
};

/// Learns from sampled frames and their projected people, in two rounds; in the second, the first round's masks replace
/// the skeleton's surroundings. With a plate the background is the plate. Throws ContractViolation when sizes differ.
CameraMaskModel LearnCamera(const std::vector<Image>& frames, const std::vector<ProjectedBody>& bodies, const Image* plate,
                            const MaskOptions& options = {});

/// Same without joints: from frames and approximate masks of the people in them. `maybe[i]` is 255 where frame i may show
/// a person, `surely[i]` where it does.
CameraMaskModel LearnCameraFromMasks(const std::vector<Image>& frames, const std::vector<Image>& surely,
                                     const std::vector<Image>& maybe, const Image* plate, const MaskOptions& options = {});

/// Motion in the sampled frames: each pixel's background is its most frequent colour, or the plate's.
struct MotionModel {
  Status status = Status::kOk;  ///< kDegenerate: nothing moves, so people and background cannot be separated
  std::vector<Image> moving;    // (H, W, 1) 255 where a frame differs from the background, a frame each
  double moving_fraction = 0;   ///< of all pixels of all frames
};
MotionModel FindMotion(const std::vector<Image>& frames, const Image* plate, const MaskOptions& options = {});

/// Additional information on one frame; every part may be missing. Images are of the frame's size.
struct MaskHints {
  const ProjectedBody* body = nullptr;   ///< without one, people may be anywhere
  const Image* probability = nullptr;    // (H, W, 1) a net's belief in a person, 0..255
  const Image* possible = nullptr;       // (H, W, 1) 0 where the other cameras' masks leave no room for a person
  const Image* previous_rgb = nullptr;   ///< the frame before …
  const Image* previous_mask = nullptr;  ///< … and its mask
};

struct BodyMask {
  Image mask;                // (H, W, 1) 0 or 255
  Image soft;                // (H, W, 1) share of the pixel that the person covers, 0..255; 128 and more is foreground
  double area_fraction = 0;  ///< of the image
  int joints = 0;            ///< valid joints in the image
  int joints_on_mask = 0;    ///< of them, on the mask
  int joints_supported = 0;  ///< of them, where colour alone indicates a person
};

/// An empty mask when `hints` has a body that does not project into the image, or when nothing indicates a person.
BodyMask SegmentPeople(const Image& rgb, const MaskHints& hints, const CameraMaskModel& model, const MaskOptions& options = {});

/// From joints alone. An empty mask when no person projects into the image.
BodyMask SegmentBody(const Image& rgb, const ProjectedBody& body, const CameraMaskModel& model,
                     const MaskOptions& options = {});

}  // namespace mvstudio::dataset
